"""capture.yaml to ``Capture``: checked, files found, defaults applied.  No photograph is opened here."""

from __future__ import annotations

import math
from pathlib import Path

from reflectance_fit.capture.board import Board
from reflectance_fit.capture.checks import contradictions
from reflectance_fit.capture.frames import (
    WHITE,
    BoardSought,
    Capture,
    Channel,
    Exposure,
    Frame,
    Geometry,
    Noise,
    Sphere,
    SphereSought,
    Stated,
)
from reflectance_fit.capture.manifest import Ball, Camera, FrameEntry, Manifest, Registration, read_manifest
from reflectance_fit.capture.reading import Reading
from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.inputs import existing, sha256_of
from reflectance_fit.strict_yaml import Document


def read_capture(path: str | Path) -> Capture:
    """Read the manifest at ``path`` and find the files it names.

    Raises ReflectanceFitError: first for keys that are wrong by themselves,
    then for all that contradicts itself and all files that cannot be used.
    """
    path = Path(path)
    manifest, document = read_manifest(path)
    problems = contradictions(manifest, document)
    paths = _find(manifest, document, problems)
    maps = _maps(manifest, document, problems)
    if problems:
        raise ReflectanceFitError(sorted(problems, key=lambda p: (p.line or 0, p.message)))
    camera, optics = manifest.camera, manifest.polarizer
    names = tuple(camera.channels)
    noise = None
    if camera.noise:
        gain = _by_channel(camera.noise.gain_e_per_dn, names)
        read = _by_channel(camera.noise.read_noise_e, names)
        noise = {name: Noise(gain[name], read[name]) for name in names}
    return Capture(
        path=path,
        sample_name=manifest.sample.name,
        sample_note=manifest.sample.note or None,
        exterior_ior=manifest.exterior_ior,
        reading=_reading(camera, maps),
        channels={name: Channel(band.wavelength_nm, band.fwhm_nm) for name, band in camera.channels.items()},
        noise=noise,
        transfer={},
        focal_length_px=camera.focal_length_px,
        diattenuation=_by_channel(optics.diattenuation if optics else 1.0, names),
        polarizer_stated=optics is not None,
        retardance_deg=_by_channel(manifest.retarder.retardance_deg if manifest.retarder else {}, names),
        geometry=_geometry(manifest),
        light_shape=manifest.light.shape,
        light_uniform=manifest.light.uniform,
        registration=_registration(manifest),
        half_angle_deg=manifest.light.half_angle_deg,
        frames=tuple(
            _frame(manifest, entry, where, document.line(("frames", i)) or 0)
            for i, (entry, where) in enumerate(zip(manifest.frames, paths, strict=True))
        ),
        nuisances=manifest.nuisances_by_name(),
        common_sigmas={},
        priors=manifest.priors.by_name(),
        inputs=(
            (path.name, sha256_of(path)),
            *((str(getattr(camera, key)), sha256_of(where)) for key, where in maps.items()),
        ),
        document=document,
    )


def _reading(camera: Camera, maps: dict[str, Path]) -> Reading:
    filters = ("R", "G", "B") if camera.sensor in ("bayer", "dofp_bayer") else ("mono",)

    def levels(stated: float | dict[str, float] | None) -> dict[str, float] | None:
        return stated if stated is None or isinstance(stated, dict) else dict.fromkeys(filters, stated)

    return Reading(
        sensor=camera.sensor,
        layout_deg=camera.dofp_layout_deg,
        encoding=camera.encoding,
        pattern=camera.pattern or "RGGB",
        black_dn=levels(camera.black_dn),
        white_dn=levels(camera.white_dn),
        offset_map=maps.get("offset_map"),
        gain_map=maps.get("gain_map"),
    )


def _find(manifest: Manifest, document: Document, problems: list[Problem]) -> list[Path]:
    """Where the frames' files are; adds to ``problems`` those that cannot be used or appear twice."""
    paths: list[Path] = []
    lines: dict[Path, int | None] = {}
    for i, frame in enumerate(manifest.frames):
        place = ("frames", i, "file")
        try:
            path = existing(Path(document.file), frame.file)
        except ReflectanceFitError as error:
            problems += [document.problem(place, f"frames.{i}: {p}") for p in error.problems]
            continue
        if path in lines:
            message = f"frames.{i}: {frame.file} is also the frame of line {lines[path]}; keep one"
            problems.append(document.problem(place, message))
        lines.setdefault(path, document.line(place))
        paths.append(path)
    return paths


def _maps(manifest: Manifest, document: Document, problems: list[Problem]) -> dict[str, Path]:
    """Where the camera's maps are, by key; adds to ``problems`` those that are not there."""
    found: dict[str, Path] = {}
    for key in ("offset_map", "gain_map"):
        file = getattr(manifest.camera, key)
        if file is not None:
            try:
                found[key] = existing(Path(document.file), file)
            except ReflectanceFitError as error:
                place = ("camera", key)
                problems += [document.problem(place, f"camera.{key}: {p}") for p in error.problems]
    return found


def _by_channel(stated: float | dict[str, float], names: tuple[str, ...]) -> dict[str, float]:
    if isinstance(stated, dict):
        return {name: stated.get(name, math.nan) for name in names}
    return dict.fromkeys(names, stated)


def _geometry(manifest: Manifest) -> Geometry:
    geometry = manifest.geometry
    if isinstance(geometry.sphere, Ball):
        x, y = geometry.sphere.center_px
        return Sphere((x, y), geometry.sphere.radius_px)
    if geometry.sphere is not None:
        return SphereSought()
    if geometry.charuco is not None:
        across, down = geometry.charuco.squares
        stated = geometry.charuco
        board = Board((across, down), stated.square_mm, stated.marker_mm, stated.dictionary)
        return BoardSought(board, stated.sample_offset_mm)
    return Stated(_or_nan(geometry.s_axis_deg))


def _registration(manifest: Manifest) -> Registration:
    """What is stated; else a board is registered, and what may have no texture to hold on to is not."""
    return manifest.registration or ("translation" if manifest.geometry.kind == "charuco" else "none")


def _frame(manifest: Manifest, entry: FrameEntry, path: Path, line: int) -> Frame:
    region = entry.region or manifest.region
    s_axis = entry.s_axis_deg
    return Frame(
        file=entry.file,
        path=path,
        line=line,
        sha256=entry.sha256,
        role=entry.role,
        theta_deg=_or_nan(entry.theta_deg),
        theta_deg_sigma=entry.theta_deg_sigma or 0.0,
        analyzer_deg=_or_nan(entry.analyzer_deg),
        retarder_deg=_or_nan(entry.retarder_deg),
        exposure=Exposure(entry.exposure_s, entry.iso),
        light=_light(manifest, entry),
        region=(region[0], region[1], region[2], region[3]) if region else None,
        s_axis_deg=_or_nan(manifest.geometry.s_axis_deg if s_axis is None else s_axis),
        set=entry.set,
        gain_group=_gain_group(manifest, entry),
        channels=tuple(manifest.camera.channels) if entry.channel is None else (entry.channel,),
        material=entry.material,
    )


def _light(manifest: Manifest, entry: FrameEntry) -> tuple[float, float, float, float]:
    """The beam on the sample; of a polarizer frame what the lamp sends, which the lines above it do not say."""
    if entry.role == "polarizer" and entry.light is None:
        return 1.0, math.nan, math.nan, 0.0
    return (entry.light or manifest.light).vector()


def _gain_group(manifest: Manifest, entry: FrameEntry) -> str | None:
    """What the frame states; else one gain for each angle of a set, for all under uniform light or by references."""
    if entry.gain_group is not None:
        return entry.gain_group
    known = any(f.role == "reference" and f.material != WHITE and f.set == entry.set for f in manifest.frames)
    if known:
        # What the sample reflects over what is known to reflect: the lamp is out of it at every angle.
        return entry.set
    if manifest.geometry.kind == "stated":
        # Darks and flats have no angle, and nothing reads their gain.
        return entry.set if entry.theta_deg is None else f"{entry.set}:{entry.theta_deg:.10g}"
    return entry.set if manifest.light.uniform else None


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value
