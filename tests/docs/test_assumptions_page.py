"""docs/assumptions.md says what a violated assumption does to a report: here each is violated, and the page held to it.

``python tests/docs/test_assumptions_page.py`` prints the page's table.  The readings come from formulas of this
file's own (a film by Airy's sum, a plate by the geometric series), not from the fitting code.
"""

import re
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from reflectance_fit import fit
from reflectance_fit.materials.library import get
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.physics.fresnel import reflectances

PAGE = Path(__file__).parents[2] / "docs" / "assumptions.md"
WAVELENGTH_NM = 632.8
SCAN_DEG = np.arange(20.0, 84.0, 4.0)
ELLIPSOMETER_DEG = np.array([60.0, 65.0, 70.0, 75.0])


@dataclass(frozen=True)
class Case:
    sample: str
    wrong: str
    warnings: tuple[str, ...] = ()
    offset_deg: float = 0.0
    stray: float = 0.0
    gamma: float = 1.0
    plate: bool = False
    film: str | None = None
    film_nm: float = 0.0
    nuisances: str | None = "{}"


CASES = (
    Case("N-BK7", "nothing"),
    Case("N-BK7", "angle scale off by 1 degree", ("WRONG_MODEL", "LITERATURE_DISAGREES"), offset_deg=1.0),
    Case(
        "N-BK7",
        "the same, `angle_offset_deg` allowed",
        (),
        offset_deg=1.0,
        nuisances="{angle_offset_deg: {sigma: 1}}",
    ),
    Case("N-BK7", "the same, nothing said of nuisances", (), offset_deg=1.0, nuisances=None),
    Case(
        "N-BK7",
        "stray light, 1 % of the largest signal",
        ("WRONG_MODEL", "LITERATURE_DISAGREES"),
        stray=0.01,
    ),
    Case("N-BK7", "the same, `diffuse` allowed", (), stray=0.01, nuisances="{diffuse: {sigma: 0.01}}"),
    Case("N-BK7", "the same again, nothing said of nuisances", ("DARK_OFFSET",), stray=0.01, nuisances=None),
    Case("N-BK7", "detector responds as signal^1.05", ("WRONG_MODEL", "LITERATURE_DISAGREES"), gamma=1.05),
    Case("N-BK7", "plate, its back face reflects too", ("WRONG_MODEL", "LITERATURE_DISAGREES"), plate=True),
    Case("N-BK7", "2 nm of water on it", ("LITERATURE_DISAGREES",), film="water", film_nm=2.0),
    Case("Si", "2 nm of oxide on it", ("FILM_SUSPECTED",), film="fused silica", film_nm=2.0),
    Case("Al", "3 nm of oxide on it", ("ANGLE_RANGE", "FILM_SUSPECTED"), film="sapphire", film_nm=3.0),
)


def absolute(material):
    eta, k = get(material).absolute_index(WAVELENGTH_NM)
    return complex(float(eta), float(k))


def scan(case, generator):
    """s and p signals with 0.3 % noise; header and table."""
    index = absolute(case.sample) / AIR_INDEX
    powers = reflectances(np.cos(np.radians(SCAN_DEG + case.offset_deg)), index.real, 0.0)
    columns = {"theta_deg": SCAN_DEG}
    for name, power in (("signal_s", powers.s), ("signal_p", powers.p)):
        if case.plate:
            # R + T^2 R (1 + R^2 + ...): what comes back from both faces, added as powers.
            power = 2.0 * power / (1.0 + power)
        signal = (power / power.max()) ** case.gamma + case.stray
        columns[name] = signal + 0.003 * generator.standard_normal(len(signal))
        columns[f"{name}_sigma"] = np.full_like(signal, 0.003)
    return columns


def ellipsometry(case, generator):
    """Psi and Delta of a substrate under one film, with 0.03 and 0.08 degrees of noise."""
    outside, film, inside = (AIR_INDEX, absolute(case.film), absolute(case.sample))
    tangential = outside * np.sin(np.radians(ELLIPSOMETER_DEG))
    normal = [np.sqrt(n**2 - tangential**2 + 0j) for n in (outside, film, inside)]
    admittances = {"s": normal, "p": [n**2 / q for n, q in zip((outside, film, inside), normal, strict=True)]}
    phase = np.exp(4j * np.pi / WAVELENGTH_NM * case.film_nm * normal[1])
    r = {}
    for name, (a, b, c) in admittances.items():
        # r_p of admittances n^2/q is Verdet's as it stands; r_s of admittances q likewise.
        sign = 1.0 if name == "s" else -1.0
        top, bottom = sign * (a - b) / (a + b), sign * (b - c) / (b + c)
        r[name] = (top + bottom * phase) / (1 + top * bottom * phase)
    rho = r["p"] / r["s"]
    return {
        "theta_deg": ELLIPSOMETER_DEG,
        "psi_deg": np.degrees(np.arctan(abs(rho))) + 0.03 * generator.standard_normal(4),
        "psi_deg_sigma": np.full(4, 0.03),
        "delta_deg": np.degrees(-np.angle(rho)) % 360 + 0.08 * generator.standard_normal(4),
        "delta_deg_sigma": np.full(4, 0.08),
    }


def outcome(case, folder, seed=0):
    generator = np.random.default_rng(seed)
    columns = ellipsometry(case, generator) if case.film else scan(case, generator)
    np.savetxt(
        folder / "t.csv",
        np.column_stack(list(columns.values())),
        header=",".join(columns),
        comments="",
        delimiter=",",
    )
    (folder / "measurement.yaml").write_text(
        "schema: reflectance_fit/measurement/1\n"
        f"sample: {{name: {case.sample}}}\n"
        f"wavelength_nm: {WAVELENGTH_NM}\n"
        f"tables: [{{file: t.csv, columns: {{{', '.join(f'{c}: {c}' for c in columns)}}}}}]\n"
        + (f"nuisances: {case.nuisances}\n" if case.nuisances else ""),
        encoding="utf-8",
    )
    return fit(folder / "measurement.yaml", timings=False).report


def row(case, report):
    """One line of the page's table."""
    truth, channel, quality = absolute(case.sample), report.channels[0], report.fits[0].fit
    k = f"< {channel.k.ci95[1]:.2f}" if channel.k.median is None else f"{channel.k.median:.3f}"
    cells = (
        case.sample,
        case.wrong,
        f"{truth.real:.3f}, {0.0 if truth.imag < 1e-6 else truth.imag:.3f}",
        f"{channel.eta.median:.3f} +- {channel.eta.sd:.3f}",
        k,
        f"{quality.reduced_chi2:.1f}",
        ", ".join(f"`{warning.code}`" for warning in report.warnings) or "none",
    )
    return f"| {' | '.join(cells)} |"


def numbers(line):
    return [float(x) for x in re.findall(r"\d+\.\d+", line)]


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.sample}: {case.wrong}")
def test_the_report_of_a_violated_assumption_is_as_the_page_says(case, tmp_path):
    report = outcome(case, tmp_path)
    assert tuple(warning.code for warning in report.warnings) == case.warnings
    line = row(case, report)
    start = "|".join(line.split("|")[:3]) + "|"
    (shown,) = [text for text in PAGE.read_text(encoding="utf-8").splitlines() if text.startswith(start)]
    assert re.sub(r"\d+\.\d+", "#", shown) == re.sub(r"\d+\.\d+", "#", line)
    # Monte Carlo noise of other processors, no more.
    assert numbers(shown) == pytest.approx(numbers(line), rel=0.03, abs=0.002)


def test_a_film_of_no_thickness_is_none():
    """The film formula of this file, against the library's interface."""
    from reflectance_fit.physics.ellipsometry import psi_delta

    case = Case("Al", "", film="sapphire", film_nm=0.0)

    class Silent:
        @staticmethod
        def standard_normal(n):
            return np.zeros(n)

    columns = ellipsometry(case, Silent)
    index = absolute("Al") / AIR_INDEX
    psi, delta = psi_delta(np.cos(np.radians(ELLIPSOMETER_DEG)), index.real, index.imag)
    assert columns["psi_deg"] == pytest.approx(np.degrees(psi), abs=1e-9)
    assert columns["delta_deg"] == pytest.approx(np.degrees(delta), abs=1e-9)


if __name__ == "__main__":
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    for each in CASES:
        with tempfile.TemporaryDirectory() as name:
            print(row(each, outcome(each, Path(name), seed)), flush=True)
