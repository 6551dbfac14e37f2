"""Writes a synthetic capture: RAW frames, capture.yaml and truth.yaml.

Each file says what a photographer would know; only truth.yaml tells the rest.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.files import check_writable, write_together

from .arrangement import View, geometry_scenes, region, views
from .capture_yaml import manifest, plain, seconds, truth
from .dng import DngMetadata, write_dng
from .picture import Scene, stokes_image
from .rig import Setting
from .room import RoomScene
from .scenes import analyzer_weights
from .sensor import FixedPattern, FloatArray, auto_exposure, expose, fixed_pattern, stops_from
from .spec import CaptureSpec
from .tiff import write_tiff

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True, eq=False)
class _Shot:
    """A frame to take.

    What capture.yaml says of it, the radiance at the sensor, and how long: a
    time, or so many stops longer than what the camera finds.
    """

    entry: dict[str, Any]
    radiance: FloatArray
    exposure_s: Fraction | None = None
    stops: int = 0


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

        arranged = list(views(spec))
        samples = (shot for view in arranged for shot in _samples(spec, view))
        # The target is unpolarized: half of its light passes the analyzer, whatever its angle.
        white = np.full((1, 1), 0.5, dtype=np.float32)
        flats = [_Shot({"role": "flat"}, white, stops=n) for n in spec.flat_stops for _ in range(spec.flats)]
        boards = (
            _Shot({"role": "geometry"}, _behind(spec, _light(spec, scene), spec.settings[0]))
            for scene in geometry_scenes(spec)
        )
        total = len(arranged) * len(spec.settings) * len(spec.bracket) + len(flats) + spec.geometry_views
        take("taking frames", chain(samples, flats, boards), total)
        cap = np.zeros((1, 1), dtype=np.float32)
        darks = [_Shot({"role": "dark"}, cap, t) for t in sorted(exposures) for _ in range(spec.darks)]
        take("taking darks", darks, len(darks))
        _write_yaml(stage / "truth.yaml", truth(spec, arranged, len(entries)))
        _write_yaml(stage / "capture.yaml", manifest(spec, entries))

    write_together(folder, fill, last="capture.yaml", superseded=earlier)
    return folder / "capture.yaml"


def _replaceable(folder: Path) -> list[Path]:
    """Frames of an earlier synthetic capture; an error where someone's own photographs could be."""
    if (folder / "truth.yaml").exists():
        return [*folder.glob("raw/*.dng"), *folder.glob("raw/*.tif")]
    if (folder / "capture.yaml").exists() or (folder / "raw").exists():
        message = "holds a capture that is not synthetic (it has no truth.yaml); choose another folder"
        raise ReflectanceFitError(Problem(str(folder), None, message))
    return []


def _samples(spec: CaptureSpec, view: View) -> Iterator[_Shot]:
    """The frames of one view: a setting after the other, each in all exposures."""
    shifts = [spec.optics.shift_px(setting.analyzer_deg or 0.0) for setting in spec.settings]
    light = {shift: _light(spec, view.scene, shift) for shift in set(shifts)}
    seen = [
        _behind(spec, light[shift], setting) for shift, setting in zip(shifts, spec.settings, strict=True)
    ]
    if spec.faults.diffuse:
        # The share is of the whole signal, its own part included, and the analyzer passes half of it.
        largest = np.max(seen, axis=0)
        seen = [radiance + spec.faults.diffuse / (1.0 - spec.faults.diffuse) * largest for radiance in seen]
    for setting, radiance in zip(spec.settings, seen, strict=True):
        # A copy, or YAML would write the region of the first frame alone and point to it.
        entry = {"role": "sample"} | deepcopy(view.stated)
        for name in ("analyzer_deg", "retarder_deg"):
            if (angle := getattr(setting, name)) is not None:
                entry[name] = plain(angle)
        for stops in spec.bracket:
            yield _Shot(entry, radiance, stops=stops)


def _take(
    stage: Path, spec: CaptureSpec, pixels: FixedPattern, number: int, shot: _Shot
) -> tuple[dict[str, Any], Fraction]:
    """Expose one frame and write it; returns its complete entry and the exposure time."""
    sensor = spec.sensor
    exposure_s = shot.exposure_s
    if exposure_s is None:
        measured = region(spec) if shot.entry["role"] == "sample" else None
        # A board must not clip beside the sample that it measures.
        x0, y0, x1, y1 = measured or (0, 0, sensor.width, sensor.height)
        exposure_s = auto_exposure(shot.radiance, sensor, pixels, (slice(y0, y1), slice(x0, x1)))
        exposure_s = stops_from(exposure_s, shot.stops)
    # A stream a frame: one frame more or less leaves the others as they are.
    generator = np.random.default_rng([spec.seed, 1 + number]) if spec.noise else None
    frame = expose(shot.radiance, exposure_s, sensor, pixels, generator)
    if spec.files == "tiff":
        name = f"raw/{number:03d}.tif"
        write_tiff(stage / name, frame)
    else:
        name = f"raw/{number:03d}.dng"
        write_dng(stage / name, frame, _metadata(spec, exposure_s))
    with (stage / name).open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return {"file": name, "sha256": digest} | shot.entry | {"exposure_s": seconds(exposure_s)}, exposure_s


def _metadata(spec: CaptureSpec, exposure_s: Fraction) -> DngMetadata:
    """What the camera knows of a frame; pixels with polarizers are a matter of the manifest."""
    sensor = spec.sensor
    pattern = "MONO" if sensor.layout_deg is not None else sensor.pattern
    planes = 1 if pattern == "MONO" else 3
    return DngMetadata(
        pattern=pattern,
        bits=sensor.bits,
        black=(*sensor.black[0], *sensor.black[1]),
        white=sensor.white,
        exposure_s=exposure_s,
        iso=sensor.iso,
        noise_profile=(sensor.noise_profile,) * planes if spec.noise_profile else None,
    )


def _light(
    spec: CaptureSpec, scene: Scene | RoomScene, shift_px: tuple[float, float] = (0.0, 0.0)
) -> FloatArray:
    """Stokes vectors at the pixels, each in its own colour, shape (height, width, 4)."""
    channels = {site.colour: spec.channel_of(site.colour) for site in spec.sensor.cell()}
    indices = {colour: spec.index_of(channel) for colour, channel in channels.items()}
    if isinstance(scene, RoomScene):
        wavelengths_nm = {colour: channel.wavelength_nm for colour, channel in channels.items()}
        return scene.image(spec.sensor, indices, wavelengths_nm, spec.optics, spec.seed)
    return stokes_image(scene, spec.sensor, indices, spec.optics, shift_px)


def _behind(spec: CaptureSpec, stokes: FloatArray, setting: Setting) -> FloatArray:
    """Radiance behind the optics, shape (height, width)."""
    radiance = np.empty(stokes.shape[:2], dtype=np.float32)
    for rows, columns, colour, axis_deg in spec.sensor.cell():
        analyzer_deg = axis_deg if setting.analyzer_deg is None else setting.analyzer_deg
        assert analyzer_deg is not None
        weights = analyzer_weights(
            analyzer_deg + spec.faults.analyzer_offset_deg,
            spec.faults.diattenuation,
            retarder_deg=setting.retarder_deg,
            retardance_deg=spec.channel_of(colour).retardance_deg,
        )
        radiance[rows, columns] = stokes[rows, columns] @ weights.astype(np.float32)
    # Rounding may leave a crossed frame a little below nothing.
    return np.maximum(radiance, 0.0)


def _write_yaml(path: Path, data: dict[str, Any]) -> None:
    """A line a frame."""
    text = yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=1000, allow_unicode=True)
    path.write_text(text, encoding="utf-8")
