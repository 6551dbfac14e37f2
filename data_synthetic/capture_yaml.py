"""What capture.yaml and truth.yaml of a synthetic capture say, as plain data."""

from __future__ import annotations

from typing import Any

import numpy as np

from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.physics.brewster import brewster_angle

from .spec import STATED_DIATTENUATION, CaptureSpec


def manifest(spec: CaptureSpec, entries: list[dict[str, Any]]) -> dict[str, Any]:
    """What a photographer would know; ``entries`` are the frames."""
    channels = {
        c.name: {"wavelength_nm": plain(c.wavelength_nm), "fwhm_nm": plain(c.fwhm_nm)} for c in spec.channels
    }
    data: dict[str, Any] = {
        "schema": "reflectance_fit/capture/1",
        "sample": {"name": f"{spec.material} (synthetic)"},
        "exterior_ior": AIR_INDEX,
        "camera": {"sensor": "bayer", "channels": channels},
        "polarizer": {"diattenuation": STATED_DIATTENUATION},
    }
    if any(setting.retarder_deg is not None for setting in spec.settings):
        data["retarder"] = {"retardance_deg": {c.name: plain(c.retardance_deg) for c in spec.channels}}
    light: dict[str, Any] = {"stokes": [1, 0, 0, 0]}
    if spec.light.linear_deg is not None:
        light = {"linear_deg": plain(spec.light.linear_deg)}
    elif spec.light.circular is not None:
        light = {"circular": spec.light.circular}
    if spec.shape == "flat":
        data["light"] = light | {"shape": "small"}
        data["geometry"] = {"kind": "stated", "s_axis_deg": plain(spec.s_axis_deg)}
    else:
        data["light"] = light | {"shape": "surround", "uniform": True}
        centre, radius = spec.ball
        data["geometry"] = {"kind": "sphere", "sphere": {"center_px": list(centre), "radius_px": radius}}
    data["nuisances"] = {name: {"sigma": plain(sigma)} for name, sigma in spec.nuisances.items()}
    return data | {"region": list(spec.region), "frames": entries}


def truth(spec: CaptureSpec, frames: int) -> dict[str, Any]:
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
    return {
        "schema": "reflectance_fit/truth/1",
        "material": spec.material,
        "channels": channels,
        "nuisances": spec.faults.as_dict(),
        "frames": frames,
        "seed": spec.seed,
    }


def plain(number: float) -> float:
    """Whole numbers without a point."""
    return int(number) if float(number).is_integer() else float(number)
