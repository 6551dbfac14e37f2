"""Writes a synthetic capture: RAW frames, capture.yaml and truth.yaml.

Each file says what a photographer would know; only truth.yaml tells the rest.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.files import check_writable, write_together

from .capture_yaml import manifest, plain, truth
from .dng import DngMetadata, write_dng
from .scenes import FlatScene, SphereScene, analyzer_weights
from .sensor import FixedPattern, FloatArray, auto_exposure, expose, fixed_pattern
from .spec import CaptureSpec, Setting

Progress = Callable[[str, int, int], None]

_STRAY = 0.0005


@dataclass(frozen=True, slots=True, eq=False)
class _Shot:
    """A frame to take: what capture.yaml says of it, the radiance at the sensor, and how long (None: by itself)."""

    entry: dict[str, Any]
    radiance: FloatArray
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
        exposures: set[Fraction] = set()

        def take(what: str, shots: Iterable[_Shot], total: int) -> None:
            for done, shot in enumerate(shots, 1):
                entry, exposure_s = _take(stage, spec, pixels, len(entries), shot)
                entries.append(entry)
                exposures.add(exposure_s)
                if progress is not None:
                    progress(what, done, total)

        views = list(_views(spec))
        samples = (shot for stated, scene in views for shot in _samples(spec, stated, scene))
        # The target is unpolarized: half of its light passes the analyzer, whatever its angle.
        flats = [_Shot({"role": "flat"}, np.full((1, 1), 0.5, dtype=np.float32))] * spec.flats
        take("taking frames", chain(samples, flats), len(views) * len(spec.settings) + spec.flats)
        cap = np.zeros((1, 1), dtype=np.float32)
        darks = [_Shot({"role": "dark"}, cap, t) for t in sorted(exposures) for _ in range(spec.darks)]
        take("taking darks", darks, len(darks))
        _write_yaml(stage / "truth.yaml", truth(spec, len(entries)))
        _write_yaml(stage / "capture.yaml", manifest(spec, entries))

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
        yield {}, SphereScene(*spec.ball, light)
    else:
        for stated in spec.angles_deg:
            theta = min(abs(stated + spec.faults.angle_offset_deg), 90.0)
            yield {"theta_deg": plain(stated)}, FlatScene(spec.outline, theta, light, spec.s_axis_deg, _STRAY)


def _samples(spec: CaptureSpec, stated: dict[str, Any], scene: FlatScene | SphereScene) -> Iterator[_Shot]:
    """The frames of one view, one a setting."""
    stokes = _stokes_image(spec, scene)
    if spec.faults.diffuse:
        # The share is of the whole signal, its own part included, and the analyzer passes half of it.
        largest = np.max([_behind(spec, stokes, setting) for setting in spec.settings], axis=0)
        stokes[..., 0] += 2.0 * spec.faults.diffuse / (1.0 - spec.faults.diffuse) * largest
    for setting in spec.settings:
        entry = {"role": "sample"} | stated | {"analyzer_deg": plain(setting.analyzer_deg)}
        if setting.retarder_deg is not None:
            entry["retarder_deg"] = plain(setting.retarder_deg)
        yield _Shot(entry, _behind(spec, stokes, setting))


def _take(
    stage: Path, spec: CaptureSpec, pixels: FixedPattern, number: int, shot: _Shot
) -> tuple[dict[str, Any], Fraction]:
    """Expose one frame and write it; returns its complete entry and the exposure time."""
    sensor = spec.sensor
    exposure_s = shot.exposure_s
    if exposure_s is None:
        x0, y0, x1, y1 = (
            spec.region if shot.entry["role"] == "sample" else (0, 0, sensor.width, sensor.height)
        )
        exposure_s = auto_exposure(shot.radiance, sensor, pixels, (slice(y0, y1), slice(x0, x1)))
    # A stream a frame: one frame more or less leaves the others as they are.
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
    write_dng(stage / name, expose(shot.radiance, exposure_s, sensor, pixels, generator), metadata)
    with (stage / name).open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return {"file": name, "sha256": digest} | shot.entry | {"exposure_s": float(exposure_s)}, exposure_s


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


def _write_yaml(path: Path, data: dict[str, Any]) -> None:
    """A line a frame."""
    text = yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=1000, allow_unicode=True)
    path.write_text(text, encoding="utf-8")
