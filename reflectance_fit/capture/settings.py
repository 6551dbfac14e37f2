"""What must be right before a photograph is decoded: structure, exposure and ISO."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from reflectance_fit.capture.frames import Capture, Exposure, Frame
from reflectance_fit.capture.image_headers import read_image_header
from reflectance_fit.capture.structure import check_structure
from reflectance_fit.capture.tiff import read_tags
from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.inputs import sha256_of


def check_hashes(capture: Capture, found: Mapping[Path, str]) -> None:
    """Raise for the files among ``found`` (path to sha256) that are not what the manifest says."""
    problems = [
        _at(
            capture,
            frame,
            f"has changed: its sha256 is {found[frame.path][:12]}..., not {frame.sha256[:12]}...; "
            "restore the file, or state its new hash",
        )
        for frame in capture.frames
        if frame.sha256 is not None and frame.path in found and frame.sha256 != found[frame.path]
    ]
    if problems:
        raise ReflectanceFitError(problems)


def read_settings(capture: Capture) -> dict[Path, Exposure]:
    """Exposure and ISO of every frame: the manifest's, else the file's.

    Raises for files that are no raw photographs, unknown exposures, and more
    than one ISO, with the line of each frame.
    """
    problems: list[Problem] = []
    settings: dict[Path, Exposure] = {}
    for frame in capture.frames:
        try:
            found = _found(frame, capture.reading.encoding)
        except ReflectanceFitError as error:
            if frame.path.is_file():
                check_hashes(capture, {frame.path: sha256_of(frame.path)})
            problems += [_at(capture, frame, p.message) for p in error.problems]
            continue
        settings[frame.path] = frame.settings(found)
        if not settings[frame.path].seconds:
            problems.append(_at(capture, frame, "has no exposure time; state exposure_s"))
    # Of photographs that only show where the camera stood no value is used.
    measured = [settings[f.path] for f in capture.frames if f.path in settings and f.role != "geometry"]
    isos = sorted({s.iso for s in measured if s.iso is not None})
    if len(isos) > 1:
        text = ", ".join(f"{iso:g}" for iso in isos)
        message = f"the frames were taken at ISO {text}: their gains and noise differ; use one"
        problems.append(Problem(str(capture.path), None, message))
    if problems:
        raise ReflectanceFitError(problems)
    return settings


def _found(frame: Frame, encoding: str | None) -> Exposure:
    """What the file says; ReflectanceFitError for what should not be decoded."""
    if encoding is not None:
        read_image_header(frame.path)
        return Exposure(None, None)
    tags = read_tags(frame.path)
    check_structure(tags, frame.file)
    return Exposure(tags.exposure_s, None if tags.iso is None else float(tags.iso))


def _at(capture: Capture, frame: Frame, message: str) -> Problem:
    return Problem(str(capture.path), frame.line, f"{frame.file} {message}")
