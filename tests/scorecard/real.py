"""Measurements of other laboratories, as they left them, beside what they or an independent analysis found."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from card import Figure, Table

from reflectance_fit import fit
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.inference.ladder import Method
from reflectance_fit.report.schema import Channel, Report

VARIABLE = "REFLECTANCE_FIT_DATA"
DATA = Path(os.environ.get(VARIABLE) or Path(__file__).parents[2] / ".." / "shared" / "data").resolve()
PRISM = "measured_angle/bologna_glass_prism"
TRACE = "measured_angle/prahl_gaertner/bk7_30_45_0.csv"
ARMS = "measured_angle/pasco_acrylic/adirao-projects"
VASE = "ellipsometry/trujillo_vase"

# scipy least squares of the same files, made apart from this program: eta and k at 450, 550, 633 nm.
TANTALUM = {
    "Ta_060810.dat": {450: (2.105, 2.717), 550: (2.398, 3.175), 633: (2.699, 3.478)},
    "Ta_w1_10102006.dat": {450: (2.175, 2.762), 550: (2.467, 3.220), 633: (2.772, 3.510)},
}
THIN = 10  # of the acrylic's readings, several a degree
EVERY = 10  # of a spectrum's wavelengths
FILM_NM = (400, 450, 500, 550, 600, 633, 700, 800)
ACRYLIC, BK7 = 1.488, 1.5151
PRINTED = 0.01  # by which tantalum may differ: both sides fit psi and Delta, with unlike weights


def about(*, full: bool) -> str:
    return (
        "Third-party measurements, fitted as a user would, seed 0; nothing is adjusted to the published values. "
        f"Tantalum: psi and Delta at 65, 70 and 75 degrees, every {EVERY}th wavelength. Importance sampling (emcee where it fails); of the acrylic Laplace, every {THIN}th reading of up to 1,700. "
        "Acrylic: arm readings without any sigma, of which the zero is unknown and the beam was followed by hand; "
        "the only good answers are a wide interval, a warning, or a refusal."
    )


def figures(*, full: bool) -> Iterator[Figure | Table]:
    if not DATA.is_dir():
        yield Figure.not_run("real data", "published values", f"no third-party data; {VARIABLE} names them")
        return
    yield from _prism()
    yield from _trace()
    yield from _acrylic()
    yield from _tantalum()
    yield from _oxide()


def _fit(manifest: str, files: dict[str, str], posterior: Method = "importance") -> Report:
    """The report on a manifest over copies of ``files``: name to path below the data, or to a text."""
    with tempfile.TemporaryDirectory() as folder:
        for name, source in files.items():
            if "\n" in source:
                (Path(folder) / name).write_text(source, encoding="utf-8")
            else:
                shutil.copyfile(DATA / source, Path(folder) / name)
        path = Path(folder) / "measurement.yaml"
        path.write_text("schema: reflectance_fit/measurement/1\n" + manifest, encoding="utf-8")
        return fit(path, posterior=posterior, timings=False).report


def _codes(report: Report) -> set[str]:
    return {warning.code for warning in report.warnings}


def _eta(channel: Channel) -> str:
    eta = channel.eta
    return "not identified" if eta.median is None else f"{eta.median:.4f} +- {eta.sd:.4f}"


def _prism() -> Iterator[Figure]:
    """Independent joint fit honouring both sigmas: 1.486(7), reduced chi2 0.56; zero free: 1.446(16), -1.2(4)."""
    tables = "".join(
        f"  - {{file: {x}.csv, delimiter: space, columns: "
        f"{{theta_deg: 0, signal_{x}: 1, theta_deg_sigma: 2, signal_{x}_sigma: 3}}}}\n"
        for x in "ps"
    )
    files = {"p.csv": f"{PRISM}/pi/run3-adjusted.csv", "s.csv": f"{PRISM}/sigma/run1-adjusted.csv"}
    for what, nuisances, eta, sd in (
        ("angles as stated", "{}", 1.486, 0.007),
        ("angle zero free, prior 1 deg", "{angle_offset_deg: {sigma: 1.0}}", 1.446, 0.016),
    ):
        report = _fit(
            f"sample: {{name: K9}}\nwavelength_nm: 650\ntables:\n{tables}nuisances: {nuisances}\n", files
        )
        (channel,) = report.channels
        quality = report.fits[0].fit
        zero = quality.nuisances.get("angle_offset_deg")
        found = channel.eta.median or np.nan
        yield Figure.judged(
            f"glass prism, {what}: eta",
            f"{_eta(channel)}, reduced chi2 {quality.reduced_chi2:.2f}"
            + (f", zero {zero.median:.2f} +- {zero.sd:.2f} deg" if zero else ""),
            f"{eta} +- {sd} of an independent fit, within its sd",
            abs(found - eta) <= sd,
        )
        yield Figure.judged(
            f"glass prism, {what}: K9 is 1.514",
            "said" if "LITERATURE_DISAGREES" in _codes(report) else "not said",
            "LITERATURE_DISAGREES",
            "LITERATURE_DISAGREES" in _codes(report),
        )


def _trace() -> Iterator[Figure]:
    """A rotating analyzer behind BK7 at 30 degrees, polarizer at 45 degrees; its zero is p, its sense the other one's.

    In the frame of docs/conventions.md the analyzer is 90 degrees on, and the light at -45.
    """
    lines = (DATA / TRACE).read_text(encoding="utf-8").splitlines()[2:]
    rows = [line.split(",") for line in lines if line]
    text = "analyzer_deg,signal\n" + "".join(f"{float(a) + 90},{value}\n" for a, value in rows)
    for what, nuisances in (
        ("analyzer's zero as stated", "{dark_offset: {}}"),
        ("analyzer's zero free, prior 1 deg", "{dark_offset: {}, analyzer_offset_deg: {sigma: 1}}"),
    ):
        report = _fit(
            "sample: {name: BK7}\nwavelength_nm: 632.8\nlight: {linear_deg: -45}\ntables:\n"
            "  - {file: t.csv, columns: {analyzer_deg: analyzer_deg, signal: signal}, constants: {theta_deg: 30}}\n"
            f"nuisances: {nuisances}\n",
            {"t.csv": text},
        )
        (channel,) = report.channels
        low, high = channel.eta.ci95 or (np.nan, np.nan)
        yield Figure.judged(
            f"rotating analyzer, BK7, {what}: eta",
            f"{_eta(channel)}, 95 % {low:.3f} to {high:.3f}; {', '.join(sorted(_codes(report)))}",
            f"{BK7} in the 95 % interval",
            low <= BK7 <= high,
        )


def _acrylic() -> Iterator[Figure]:
    """Arm readings: 2 x incidence and an unknown zero; the detector saturates near 4.2 V."""
    for name, axis in (("H_brewexp9", "p"), ("N_brewexp1", "s"), ("V_brewexp1", "s")):
        head, *readings = (DATA / ARMS / f"{name}.txt").read_text(encoding="utf-8").splitlines()[1:]
        text = "\n".join([head, *readings[::THIN]]) + "\n"
        # Read as it stands, the arm is straight on at 180 degrees: grazing, which no surface reflects.
        for zero_deg in (180, 174) if name.startswith("H") else (174,):
            manifest = (
                "sample: {name: acrylic}\nwavelength_nm: 650\ntables:\n  - file: t.txt\n    saturation: 4.19\n"
                f"    columns: {{theta_deg: Sensor Position (Degrees), signal_{axis}: Light Intensity (Volts)}}\n"
                f"    theta_from: {{scale: -0.5, zero_deg: {zero_deg}}}\n"
                "nuisances: {angle_offset_deg: {sigma: 3}}\n"
            )
            try:
                report = _fit(manifest, {"t.txt": text}, "laplace")
            except ReflectanceFitError as error:
                yield Figure.judged(
                    f"arm scan of acrylic, {name}, zero {zero_deg}",
                    f"refused: {str(error).splitlines()[0].partition('t.txt')[2][:90]}",
                    "no confident wrong number",
                    good=True,
                )
                continue
            (channel,) = report.channels
            low, high = channel.eta.ci95 or (-np.inf, np.inf)
            warned = "WRONG_MODEL" in _codes(report)
            yield Figure.judged(
                f"arm scan of acrylic, {name}, zero {zero_deg}",
                f"{_eta(channel)}; {', '.join(sorted(_codes(report)))}",
                "no confident wrong number",
                warned or channel.eta.median is None or low <= ACRYLIC <= high,
            )


def _tantalum() -> Iterator[Figure | Table]:
    rows: list[tuple[str, ...]] = []
    for name, known in TANTALUM.items():
        head = "sample: {name: film}\ntables:\n"
        three = "  - {file: t.dat, format: woollam_vase, wavelengths_nm: [450, 550, 633]}\n"
        report = _fit(head + three, {"t.dat": f"{VASE}/{name}"})
        off = max(
            max(abs((c.eta.median or np.nan) - eta), abs((c.k.median or np.nan) - k))
            for c, (eta, k) in zip(report.channels, known.values(), strict=True)
        )
        yield Figure.judged(
            f"{name}: eta and k at 450, 550, 633 nm, largest difference",
            f"{off:.4f}",
            f"{PRINTED} from an independent fit",
            off <= PRINTED,
        )
        every = ", ".join(f"{w:g}" for w in _wavelengths(DATA / VASE / name)[::EVERY])
        report = _fit(
            head + f"  - {{file: t.dat, format: woollam_vase, wavelengths_nm: [{every}]}}\n",
            {"t.dat": f"{VASE}/{name}"},
        )
        reduced = [f.fit.reduced_chi2 or np.nan for f in report.fits]
        wrong = sum(w.code == "WRONG_MODEL" for w in report.warnings)
        sds = [c.eta.sd for c in report.channels if c.eta.sd]
        yield Figure.judged(
            f"{name}: every {EVERY}th wavelength, eta and k identified",
            f"{sum(c.eta.status == c.k.status == 'identified' for c in report.channels)} of {len(report.channels)}",
            "all",
            all(c.eta.status == c.k.status == "identified" for c in report.channels),
        )
        yield Figure.reported(
            f"{name}: reduced chi2 of one interface, median (5 to 95 %); flagged WRONG_MODEL; median sd of eta",
            f"{np.median(reduced):.2f} ({np.quantile(reduced, 0.05):.2f} to {np.quantile(reduced, 0.95):.2f}); "
            f"{wrong} of {len(report.channels)}; {np.median(sds):.4f}",
        )
        rows += [
            (
                name,
                f"{c.wavelength_nm:g}",
                _eta(c),
                f"{c.k.median:.4f} +- {c.k.sd:.4f}" if c.k.median is not None else c.k.status,
                f"{report.fits[c.fit].fit.reduced_chi2:.2f}",
            )
            for c in report.channels[::5]
        ]
    yield Table("Tantalum, some of the wavelengths", ("file", "nm", "eta", "k", "reduced chi2"), tuple(rows))


def _wavelengths(path: Path) -> list[float]:
    """Those of a Woollam export, in order."""
    found = set()
    for line in path.read_text(encoding="latin-1").splitlines():
        fields = line.split()
        if len(fields) >= 5 and fields[0].replace(".", "").isdigit():
            found.add(float(fields[0]))
    return sorted(found)


def _oxide() -> Iterator[Figure]:
    """309 nm of SiO2 on Si by absolute R_p and R_s: one interface must be rejected at every wavelength."""
    name = "bare_sio2_sample1_fl_{}_pol_20080421.dat"
    tables = "".join(f"  - {{file: {x}.dat, format: woollam_vase}}\n" for x in "ps")
    report = _fit(
        f"sample: {{name: wafer}}\nwavelengths_nm: {list(FILM_NM)}\ntables:\n{tables}",
        {f"{x}.dat": f"{VASE}/pR_sR/{name.format(x)}" for x in "ps"},
    )
    wrong = {w.channel for w in report.warnings if w.code == "WRONG_MODEL"}
    least = min(f.fit.reduced_chi2 or 0.0 for f in report.fits)
    yield Figure.judged(
        "pR_sR, 309 nm of oxide on silicon: wavelengths where one interface is WRONG_MODEL",
        f"{len(wrong)} of {len(report.channels)}, smallest reduced chi2 {least:.3g}",
        "all",
        len(wrong) == len(report.channels),
    )
