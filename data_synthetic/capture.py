"""Writes a synthetic capture: RAW frames, capture.yaml and truth.yaml.

Each file says what a photographer would know; only truth.yaml tells the rest.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.files import check_writable, write_together
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.physics.brewster import brewster_angle

from .dng import DngMetadata, write_dng
from .scenes import FlatScene, SphereScene, analyzer_weights
from .sensor import FixedPattern, FloatArray, Sensor, auto_exposure, expose, fixed_pattern
from .spec import STATED_DIATTENUATION, CaptureSpec, Setting

Progress = Callable[[str, int, int], None]

_STRAY = 0.0005
# The sample reaches beyond the region that is measured by this share of the frame, on each side.
_SAMPLE, _REGION = 0.20, 0.25
_RADIUS = 0.42  # of the frame's height


@dataclass(frozen=True, slots=True, eq=False)
class _Shot:
    """A frame to take: what capture.yaml says of it, and what there is to see (None: the cap is on)."""

    entry: dict[str, Any]
    radiance: Callable[[], FloatArray] | None
    exposure_s: Fraction | None = None


def write_capture(folder: Path, spec: CaptureSpec, *, progress: Progress | None = None) -> Path:
    """Write raw/*.dng, truth.yaml and capture.yaml, all or none; returns the path of the last.

    The same spec gives the same bytes.  An earlier synthetic capture in
    ``folder`` is replaced; any other is refused.  ``progress`` is told
    (what, done, of how many).
    """
    earlier = _replaceable(folder)
    check_writable(folder)

    def fill(stage: Path) -> None:
        pixels = fixed_pattern(spec.sensor, np.random.default_rng([spec.seed, 0]))
        entries: list[dict[str, Any]] = []
        with ThreadPoolExecutor(os.cpu_count()) as pool:

            def take(what: str, shots: list[_Shot], done: int, total: int) -> None:
                numbers = range(len(entries), len(entries) + len(shots))
                for entry in pool.map(lambda n, shot: _take(stage, spec, pixels, n, shot), numbers, shots):
                    entries.append(entry)
                    done += 1
                    if progress is not None:
                        progress(what, done, total)

            views = list(_views(spec))
            total = len(views) * len(spec.settings) + spec.flats
            for view, (stated, scene) in enumerate(views):
                take("frames", _shots(spec, stated, scene), view * len(spec.settings), total)
            # The target is unpolarized: half of its light passes the analyzer, whatever its angle.
            white = np.full((1, 1), 0.5, dtype=np.float32)
            take("frames", [_Shot({"role": "flat"}, lambda: white)] * spec.flats, total - spec.flats, total)
            exposures = sorted({Fraction(entry["exposure_s"]) for entry in entries})
            darks = [_Shot({"role": "dark"}, None, t) for t in exposures for _ in range(spec.darks)]
            take("darks", darks, 0, len(darks))
        for entry in entries:
            entry["exposure_s"] = float(entry["exposure_s"])
        _write_yaml(stage / "truth.yaml", _truth(spec, len(entries)))
        _write_yaml(stage / "capture.yaml", _manifest(spec, entries))

    write_together(folder, fill, last="capture.yaml", superseded=earlier)
    return folder / "capture.yaml"


def _replaceable(folder: Path) -> list[Path]:
    """Frames of an earlier synthetic capture; an error where someone's own photographs could be."""
    if (folder / "truth.yaml").exists():
        return list(folder.glob("raw/*.dng"))
    if (folder / "capture.yaml").exists() or (folder / "raw").exists():
        message = "holds a capture that is not synthetic (it has no truth.yaml); choose another folder"
        raise ReflectanceFitError(Problem(str(folder), None, message))
    return []


def _views(spec: CaptureSpec) -> Iterator[tuple[dict[str, Any], FlatScene | SphereScene]]:
    """What capture.yaml says of each arrangement of sample and light, and how it looks in truth."""
    light = spec.faults.source(spec.light.stokes())
    if spec.shape == "sphere":
        yield {}, SphereScene(*_ball(spec.sensor), light)
    else:
        for stated in spec.angles_deg:
            theta = min(abs(stated + spec.faults.angle_offset_deg), 90.0)
            outline = _rectangle(spec.sensor, _SAMPLE)
            yield {"theta_deg": _plain(stated)}, FlatScene(outline, theta, light, spec.s_axis_deg, _STRAY)


def _shots(spec: CaptureSpec, stated: dict[str, Any], scene: FlatScene | SphereScene) -> list[_Shot]:
    """The frames of one view, one a setting."""
    stokes = _stokes_image(spec, scene)
    if spec.faults.diffuse:
        # The share is of the whole signal, its own part included, and the analyzer passes half of it.
        largest = np.max([_behind(spec, stokes, setting) for setting in spec.settings], axis=0)
        stokes[..., 0] += 2.0 * spec.faults.diffuse / (1.0 - spec.faults.diffuse) * largest
    shots = []
    for setting in spec.settings:
        entry = {"role": "sample"} | stated | {"analyzer_deg": _plain(setting.analyzer_deg)}
        if setting.retarder_deg is not None:
            entry["retarder_deg"] = _plain(setting.retarder_deg)
        shots.append(_Shot(entry, partial(_behind, spec, stokes, setting)))
    return shots


def _take(stage: Path, spec: CaptureSpec, pixels: FixedPattern, number: int, shot: _Shot) -> dict[str, Any]:
    """Expose one frame, write it, and complete its entry; the exposure is left exact."""
    sensor = spec.sensor
    radiance = np.zeros((1, 1), dtype=np.float32) if shot.radiance is None else shot.radiance()
    exposure_s = shot.exposure_s
    if exposure_s is None:
        x0, y0, x1, y1 = (
            (0, 0, sensor.width, sensor.height) if shot.entry["role"] == "flat" else _region(spec)
        )
        exposure_s = auto_exposure(radiance, sensor, pixels, (slice(y0, y1), slice(x0, x1)))
    # Numbered streams: the files do not depend on which thread was first.
    generator = np.random.default_rng([spec.seed, 1 + number]) if spec.noise else None
    metadata = DngMetadata(
        pattern=sensor.pattern,
        bits=sensor.bits,
        black=(*sensor.black[0], *sensor.black[1]),
        white=sensor.white,
        exposure_s=exposure_s,
        iso=sensor.iso,
        noise_profile=(sensor.noise_profile,) * 3,
    )
    name = f"raw/{number:03d}.dng"
    write_dng(stage / name, expose(radiance, exposure_s, sensor, pixels, generator), metadata)
    with (stage / name).open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return {"file": name, "sha256": digest} | shot.entry | {"exposure_s": exposure_s}


def _stokes_image(spec: CaptureSpec, scene: FlatScene | SphereScene) -> FloatArray:
    """The scene where the pixels are, each in its own colour, shape (height, width, 4)."""
    image = np.empty((spec.sensor.height, spec.sensor.width, 4), dtype=np.float32)
    x, y = np.arange(spec.sensor.width), np.arange(spec.sensor.height)[:, None]
    indices = {channel.name: spec.index_of(channel) for channel in spec.channels}
    for rows, columns, colour in spec.sensor.cell():
        image[rows, columns] = scene.stokes(x[columns], y[rows], *indices[colour])
    return image


def _behind(spec: CaptureSpec, stokes: FloatArray, setting: Setting) -> FloatArray:
    """Radiance behind the optics, shape (height, width)."""
    weights = {
        channel.name: analyzer_weights(
            setting.analyzer_deg + spec.faults.analyzer_offset_deg,
            spec.faults.diattenuation,
            retarder_deg=setting.retarder_deg,
            retardance_deg=channel.retardance_deg,
        ).astype(np.float32)
        for channel in spec.channels
    }
    radiance = np.empty(stokes.shape[:2], dtype=np.float32)
    for rows, columns, colour in spec.sensor.cell():
        radiance[rows, columns] = stokes[rows, columns] @ weights[colour]
    # Rounding may leave a crossed frame a little below nothing.
    return np.maximum(radiance, 0.0)


def _rectangle(sensor: Sensor, share: float) -> tuple[int, int, int, int]:
    """x0, y0, x1, y1: the frame less a share on each side, in whole colour cells."""
    dx, dy = 2 * round(share * sensor.width / 2), 2 * round(share * sensor.height / 2)
    return dx, dy, sensor.width - dx, sensor.height - dy


def _ball(sensor: Sensor) -> tuple[tuple[float, float], float]:
    """Centre and radius in pixels; not in the middle, and not on a pixel."""
    return (sensor.width / 2 + 7.3, sensor.height / 2 - 4.6), round(_RADIUS * sensor.height, 1)


def _region(spec: CaptureSpec) -> tuple[int, int, int, int]:
    """The pixels to measure: inside a flat sample, or around a ball."""
    if spec.shape == "flat":
        return _rectangle(spec.sensor, _REGION)
    (x, y), radius = _ball(spec.sensor)
    return int(x - radius), int(y - radius), int(x + radius) + 2, int(y + radius) + 2


def _manifest(spec: CaptureSpec, entries: list[dict[str, Any]]) -> dict[str, Any]:
    channels = {
        c.name: {"wavelength_nm": _plain(c.wavelength_nm), "fwhm_nm": _plain(c.fwhm_nm)}
        for c in spec.channels
    }
    data: dict[str, Any] = {
        "schema": "reflectance_fit/capture/1",
        "sample": {"name": f"{spec.material} (synthetic)"},
        "exterior_ior": AIR_INDEX,
        "camera": {"sensor": "bayer", "channels": channels},
        "polarizer": {"diattenuation": STATED_DIATTENUATION},
    }
    if any(setting.retarder_deg is not None for setting in spec.settings):
        data["retarder"] = {"retardance_deg": {c.name: _plain(c.retardance_deg) for c in spec.channels}}
    light: dict[str, Any] = {"stokes": [1, 0, 0, 0]}
    if spec.light.linear_deg is not None:
        light = {"linear_deg": _plain(spec.light.linear_deg)}
    elif spec.light.circular is not None:
        light = {"circular": spec.light.circular}
    if spec.shape == "flat":
        data["light"] = light | {"shape": "small"}
        data["geometry"] = {"kind": "stated", "s_axis_deg": _plain(spec.s_axis_deg)}
    else:
        data["light"] = light | {"shape": "surround", "uniform": True}
        centre, radius = _ball(spec.sensor)
        data["geometry"] = {"kind": "sphere", "sphere": {"center_px": list(centre), "radius_px": radius}}
    return data | {"region": list(_region(spec)), "frames": entries}


def _truth(spec: CaptureSpec, frames: int) -> dict[str, Any]:
    channels = []
    for channel in spec.channels:
        eta, k = spec.index_of(channel)
        angle = float(np.degrees(brewster_angle(eta / AIR_INDEX, k / AIR_INDEX)))
        channels.append(
            {
                "channel": channel.name,
                "wavelength_nm": _plain(channel.wavelength_nm),
                "eta": round(eta, 6),
                "k": round(k, 6),
                "brewster_deg": round(angle, 4),
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


def _plain(number: float) -> float:
    """Whole numbers without a point."""
    return int(number) if float(number).is_integer() else float(number)


def _write_yaml(path: Path, data: dict[str, Any]) -> None:
    """A line a frame."""
    text = yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=1000, allow_unicode=True)
    path.write_text(text, encoding="utf-8")
