"""Whether the photographs of a capture agree with its manifest and with one another, once they are decoded."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

from reflectance_fit.capture.decoding import served_by
from reflectance_fit.capture.frames import Ball, Capture, Exposure, Frame, Sphere
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.capture.reduce import FrameMeans
from reflectance_fit.errors import Problem, ReflectanceFitError


def check_planes(capture: Capture, means: Mapping[Path, FrameMeans]) -> None:
    """A colour sensor stated mono, or the other way round, is the manifest's fault: say it once."""
    sensor = capture.reading.sensor
    for frame in capture.frames:
        if frame.path in means:
            planes = list(means[frame.path].planes[0])
            has = sorted({plane.channel for plane in planes})
            found = ("mono" in has, planes[0].axis_deg is not None)
            if found != (sensor in ("mono", "dofp"), sensor in ("dofp", "dofp_bayer")):
                message = f"{frame.file} has the planes {', '.join(has)}, but camera.sensor says {sensor}; correct it"
                raise ReflectanceFitError(Problem(str(capture.path), frame.line, message))


def check_sizes(
    capture: Capture,
    settings: Mapping[Path, Exposure],
    means: Mapping[Path, FrameMeans],
    frames: Iterable[Frame],
) -> None:
    """The region or the ball must be in the picture, and darks and flats must show the same pixels."""
    problems = []
    sizes = Counter(one.shape for one in means.values())
    for frame in frames:
        if frame.path not in means:
            continue
        bins = bins_of(capture, frame)
        others = {one.path: one for one in served_by(capture, frame, settings) if one is not frame}
        own = [plane.pixels for plane in means[frame.path].over(bins).values()]
        if not sum(int(pixels.sum()) for pixels in own):
            what = "ball" if isinstance(capture.geometry, Sphere | Ball) else "region"
            message = f"{frame.file} does not show the {what}: it is outside the picture; correct it"
            problems.append(Problem(str(capture.path), frame.line, message))
        for other in others.values():
            if other.path in means and means[other.path].shape != means[frame.path].shape:
                # The one that is like fewer others is the stranger.
                odd, usual = sorted((other, frame), key=lambda one: sizes[means[one.path].shape])
                message = f"{odd.file} is not of the size of {usual.file}; use frames of one camera setting"
                problems.append(Problem(str(capture.path), odd.line, message))
    if problems:
        raise ReflectanceFitError(sorted(set(problems), key=lambda p: p.line or 0))


def unused_bits(capture: Capture, means: Mapping[Path, FrameMeans]) -> list[str]:
    """What to tell of counts that were left-justified; the frames must all be alike."""
    found = {frame.path: means[frame.path].unused_bits for frame in capture.frames if frame.path in means}
    most = max(found.values(), default=0)
    for frame in capture.frames:
        if found.get(frame.path, most) != most:
            message = f"{frame.file} leaves {found[frame.path]} low bits empty and others {most}; use one pixel format"
            raise ReflectanceFitError(Problem(str(capture.path), frame.line, message))
    return [f"counts are multiples of {2**most}, and were divided by that"] if most else []
