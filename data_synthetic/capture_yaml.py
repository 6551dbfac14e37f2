"""What capture.yaml and truth.yaml of a synthetic capture say, as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.physics.brewster import brewster_angle

from .arrangement import View, ball, region
from .spec import CaptureSpec


def manifest(spec: CaptureSpec, entries: list[dict[str, Any]]) -> dict[str, Any]:
    """What a photographer would know; ``entries`` are the frames."""
    data: dict[str, Any] = {
        "schema": "reflectance_fit/capture/1",
        "sample": {"name": f"{spec.material} (synthetic)"},
        "exterior_ior": AIR_INDEX,
        "camera": _camera(spec),
        "polarizer": {"diattenuation": spec.stated_diattenuation},
    }
    if any(setting.retarder_deg is not None for setting in spec.settings):
        data["retarder"] = {"retardance_deg": {c.name: plain(c.retardance_deg) for c in spec.channels}}
    light: dict[str, Any] = {"stokes": [1, 0, 0, 0]}
    if spec.light.linear_deg is not None:
        light = {"linear_deg": plain(spec.light.linear_deg)}
    elif spec.light.circular is not None:
        light = {"circular": spec.light.circular}
    if spec.shape == "sphere":
        data["light"] = light | {"shape": "surround", "uniform": spec.surroundings == "even"}
        centre, radius = ball(spec)
        # Nearby, a ball is no circle: it has to be found.
        known = {"center_px": list(centre), "radius_px": radius}
        data["geometry"] = {"kind": "sphere", "sphere": known if spec.optics.focal_px is None else "detect"}
    elif spec.shape == "board":
        data["light"] = light | {"shape": "small"}
        data["geometry"] = {"kind": "charuco", "charuco": _charuco(spec)}
    else:
        data["light"] = light | {"shape": "small"}
        data["geometry"] = {"kind": "stated", "s_axis_deg": plain(spec.s_axis_deg)}
    data["nuisances"] = {name: {"sigma": plain(sigma)} for name, sigma in spec.nuisances.items()}
    if (box := region(spec)) is not None:
        data["region"] = list(box)
    return data | {"frames": entries}


def _camera(spec: CaptureSpec) -> dict[str, Any]:
    sensor = spec.sensor
    data: dict[str, Any] = {"sensor": sensor.kind}
    if sensor.layout_deg is not None:
        data["dofp_layout_deg"] = [[plain(axis) for axis in row] for row in sensor.layout_deg]
    data["channels"] = {
        c.name: {"wavelength_nm": plain(c.wavelength_nm), "fwhm_nm": plain(c.fwhm_nm)} for c in spec.channels
    }
    if spec.optics.focal_px is not None and not spec.geometry_views:
        data["focal_length_px"] = spec.optics.focal_px
    if spec.files == "tiff":
        # The file has nothing but pixels, and one black level is all that can be said.
        data |= {"encoding": "linear", "black_dn": float(np.mean(sensor.black)), "white_dn": sensor.white}
        if spec.noise_profile:
            data["noise"] = {"gain_e_per_dn": sensor.gain_e_per_dn, "read_noise_e": sensor.read_noise_e}
    return data


def _charuco(spec: CaptureSpec) -> dict[str, Any]:
    board = spec.board
    return {
        "squares": list(board.squares),
        "square_mm": plain(board.square_mm),
        "marker_mm": plain(board.marker_mm),
        "dictionary": board.dictionary,
        "sample_offset_mm": plain(board.sample_offset_mm),
    }


def truth(spec: CaptureSpec, arranged: Sequence[View], frames: int) -> dict[str, Any]:
    """What went in."""
    channels = []
    for channel in spec.channels:
        eta, k = spec.index_of(channel)
        angle = float(np.degrees(brewster_angle(eta / AIR_INDEX, k / AIR_INDEX)))
        channels.append(
            {
                "channel": channel.name,
                "wavelength_nm": plain(channel.wavelength_nm),
                "eta": round(eta, 12),
                "k": round(k, 12),
                "brewster_deg": round(angle, 10),
            }
        )
    data: dict[str, Any] = {
        "schema": "reflectance_fit/truth/1",
        "material": spec.material,
        "channels": channels,
        "nuisances": spec.faults.as_dict(),
    }
    known = [view.truth for view in arranged if view.truth is not None]
    if known:
        data["views"] = [{name: round(angle, 8) for name, angle in view.items()} for view in known]
    return data | {"frames": frames, "seed": spec.seed}


def plain(number: float) -> float:
    """Whole numbers without a point."""
    return int(number) if float(number).is_integer() else float(number)


def seconds(exposure_s: Fraction) -> int | str:
    """Exactly, as the manifest reads it: 2, or 1/60."""
    return exposure_s.numerator if exposure_s.denominator == 1 else str(exposure_s)
