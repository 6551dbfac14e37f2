"""The command ``plan``: what is worth photographing, in words, as a plot and as a manifest to fill in."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike

from reflectance_fit.data_synthetic.spec import NoiseLevel
from reflectance_fit.files import check_writable, write_together
from reflectance_fit.inference.design import GRID_DEG, Design
from reflectance_fit.inference.foresight import Foresight
from reflectance_fit.planning import WAVELENGTH_NM, Option, Plan, best_option, option, plan, recommended
from reflectance_fit.plot.plan import Curve
from reflectance_fit.report.numbers import short
from reflectance_fit.report.write import write_text

_FWHM_NM = 90
# The picture spreads the angles around each that it shows: one angle alone cannot tell two unknowns.
_SPREAD_DEG = 10.0
_POINTS = 8

_HEADER = """\
# The photographs of a plan. Fill in what stands in capitals, and the region of the sample; add darks and a flat.
# theta_deg is from the normal, analyzer_deg from s (the picture's horizontal, as s_axis_deg is 0).
"""


def plan_to_folder(
    folder: Path | None,
    *,
    eta: float | None = None,
    k: float = 0.0,
    material: str | None = None,
    wavelength_nm: float = WAVELENGTH_NM,
    noise: NoiseLevel | float = "typical",
    frames: int = 12,
) -> Plan:
    """``planning.plan``; with ``folder`` also plan.yaml, capture-template.yaml and the plot there."""
    if folder is not None:
        check_writable(folder)
    found = plan(eta=eta, k=k, material=material, wavelength_nm=wavelength_nm, noise=noise, frames=frames)
    if folder is not None:
        write_together(folder, lambda stage: _write(found, stage), last="plan.yaml")
    return found


def _write(found: Plan, stage: Path) -> None:
    from reflectance_fit.plot.plan import draw_plan
    from reflectance_fit.plot.style import save

    write_text(_yaml(_as_data(found)), stage / "plan.yaml")
    write_text(_HEADER + _yaml(_template(found)), stage / "capture-template.yaml")
    angles = [_against_angle(found, o) for o in found.best]
    frames = [_against_frames(found, o) for o in found.best]
    title = f"{found.title}: what {found.frames} photographs can tell"
    save(draw_plan(title, angles, frames, limit=_shows_limit(found)), stage, "plan")


def _yaml(data: dict[str, Any]) -> str:
    # Blocks of plain values on one line, as a person writes a frame.
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)


def _as_data(found: Plan) -> dict[str, Any]:
    """What plan.yaml says."""
    subject = found.subject
    best = recommended(found)
    return {
        "schema": "reflectance_fit/plan/1",
        "material": found.title,
        "assumed": {"eta": short(subject.eta), "k": short(subject.k)},
        "exterior_ior": subject.exterior_ior,
        "noise": found.noise,
        "nuisances": _nuisances(found, polarized=False),
        "recommended": best.design.kind.equipment,
        "best": [_option_data(o) for o in found.best],
        "usual": [_option_data(o) for o in found.usual],
    }


def _option_data(o: Option) -> dict[str, Any]:
    kind = o.design.kind
    return {
        "needs": kind.equipment,
        "name": kind.name,
        "light": {"linear_deg": _plain(kind.linear_deg)}
        if kind.linear_deg is not None
        else {"stokes": [1, 0, 0, 0]},
        "angles_deg": [_plain(angle) for angle in o.design.angles_deg],
        "settings": [_setting(analyzer, retarder) for analyzer, retarder in kind.settings],
        "frames": o.design.frames,
        "expected": _expected(o.expected),
        "cannot_tell": list(o.expected.cannot),
    }


def _expected(f: Foresight) -> dict[str, Any]:
    k: dict[str, Any] = {"status": f.k_status, "sd": _rounded(f.k_sd)}
    if f.k_limit is not None:
        k["ci95"] = [0.0, short(f.k_limit, 3)]
    return {
        "eta": {"status": f.eta_status, "sd": _rounded(f.eta_sd)},
        "k": k,
        "brewster_deg": {"value": short(f.brewster_deg, 6), "sd": _rounded(f.brewster_sd_deg)},
        "correlation": _rounded(f.correlation),
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else short(value, 3)


def _plain(number: float) -> float:
    return int(number) if number == int(number) else number


def _setting(analyzer_deg: float, retarder_deg: float | None) -> dict[str, float]:
    found = {"analyzer_deg": _plain(analyzer_deg)}
    return found if retarder_deg is None else found | {"retarder_deg": _plain(retarder_deg)}


def _template(found: Plan) -> dict[str, Any]:
    """A capture.yaml of the recommended design; an angle that stands twice is set up twice, with a gain each."""
    design = recommended(found).design
    kind = design.kind
    frames: list[dict[str, Any]] = []
    for i, angle in enumerate(design.angles_deg):
        again = design.angles_deg[:i].count(angle)
        for analyzer, retarder in kind.settings:
            frame: dict[str, Any] = {"file": f"raw/{len(frames):03d}.dng", "theta_deg": _plain(angle)}
            frame |= _setting(analyzer, retarder)
            frames.append(frame | ({"gain_group": f"{angle:g} deg again, {again}"} if again else {}))
    data: dict[str, Any] = {
        "schema": "reflectance_fit/capture/1",
        "sample": {"name": "NAME OF THE SAMPLE"},
        "camera": {
            "sensor": "bayer",
            "channels": {"G": {"wavelength_nm": _plain(found.wavelength_nm), "fwhm_nm": _FWHM_NM}},
        },
    }
    if any(retarder is not None for _, retarder in kind.settings):
        data["retarder"] = {"retardance_deg": {"G": 90}}
    if kind.linear_deg is not None:
        data["light"] = {"linear_deg": _plain(kind.linear_deg)}
    data["geometry"] = {"kind": "stated", "s_axis_deg": 0}
    data["nuisances"] = _nuisances(found, polarized=kind.linear_deg is not None)
    return data | {"frames": frames}


def _nuisances(found: Plan, *, polarized: bool) -> dict[str, dict[str, float]]:
    """As manifests state them: no sigma where it depends on the signals, or is flat.

    Light that is polarized altogether has no unpolarized part to become so.
    """
    return {
        name: {} if name == "dark_offset" or math.isinf(sigma) else {"sigma": sigma}
        for name, sigma in found.subject.nuisances.items()
        if not (polarized and name.startswith("source"))
    }


def _shows_limit(found: Plan) -> bool:
    """Whether k is shown as its upper limit."""
    return all(o.expected.k_sd is None for o in found.best)


def _curve(found: Plan, chosen: Option, x: ArrayLike, options: list[Option], mark: ArrayLike) -> Curve:
    def k(o: Option) -> float:
        value = o.expected.k_limit if _shows_limit(found) else o.expected.k_sd
        return np.nan if value is None else value

    def eta(o: Option) -> float:
        return np.nan if o.expected.eta_sd is None else o.expected.eta_sd

    return Curve(
        label=chosen.design.kind.equipment,
        x=np.asarray(x, dtype=float),
        eta=np.array([eta(o) for o in options]),
        k=np.array([k(o) for o in options]),
        mark=np.asarray(mark, dtype=float),
        mark_eta=eta(chosen),
        mark_k=k(chosen),
    )


def _against_angle(found: Plan, chosen: Option) -> Curve:
    """The chosen kind with as many angles, spread around each of the grid's."""
    kind, stations = chosen.design.kind, len(chosen.design.angles_deg)
    offsets = np.linspace(-_SPREAD_DEG, _SPREAD_DEG, stations) if stations > 1 else np.zeros(1)
    inside = GRID_DEG[(GRID_DEG[0] <= GRID_DEG - _SPREAD_DEG) & (GRID_DEG[-1] >= GRID_DEG + _SPREAD_DEG)]
    options = [option(Design(kind, tuple(map(float, middle + offsets))), found.subject) for middle in inside]
    return _curve(found, chosen, inside, options, chosen.design.angles_deg)


def _against_frames(found: Plan, chosen: Option) -> Curve:
    """The chosen kind at the best angles, from one angle to twice as many as chosen."""
    kind = chosen.design.kind
    stations = np.unique(np.linspace(1, 2 * len(chosen.design.angles_deg), _POINTS).round().astype(int))
    options = [best_option(kind, int(n) * kind.frames, found.subject) for n in stations]
    return _curve(found, chosen, stations * kind.frames, options, [chosen.design.frames])
