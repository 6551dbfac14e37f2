"""Frames of a polarized lamp: the analyzer's diattenuation and zero, and a capture with both put right."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from reflectance_fit.capture.calibrate import Calibrated
from reflectance_fit.capture.frames import Capture, Frame
from reflectance_fit.capture.polarizer import PolarizerFit, combine, fit_polarizer
from reflectance_fit.errors import Problem, ReflectanceFitError

# Between the axes of one sensor, or its series: more is no error of the zero but another arrangement.
_LARGEST_SPREAD = math.radians(5.0)
_LEAST_SERIES = 3


@dataclass(frozen=True, slots=True)
class _Point:
    """One signal: the axis as stated and the source's direction (radians, NaN: unknown)."""

    axis: float
    source: float
    source_dolp: float
    value: float
    variance: float


def with_polarizer(capture: Capture, series: Sequence[Calibrated]) -> tuple[Capture, list[str]]:
    """``capture`` with what its polarizer frames say, and the words to tell it.

    A stated diattenuation stays.  Where the source's direction is stated the
    analyzer angles of all frames, or the axes of the pixels, are corrected.

    Raises ReflectanceFitError where the frames tell nothing, or where the axes
    of a sensor's pixels turn the other way.
    """
    tried = {channel: _fit(capture, channel, series) for channel in capture.channels}
    fits = {channel: fit for channel, fit in tried.items() if fit is not None}
    if not fits:
        message = (
            "polarizer frames tell nothing: give three analyzer angles, or two that are crossed, not clipped"
        )
        raise _wrong(capture, series[0].frame, message)
    told = []
    if not capture.polarizer_stated:
        measured = {channel: fit.diattenuation for channel, fit in fits.items()}
        # The nuisance multiplies the diattenuation.
        relative = {channel: fit.diattenuation_sigma / fit.diattenuation for channel, fit in fits.items()}
        capture = replace(
            capture,
            diattenuation=capture.diattenuation | measured,
            common_sigmas=capture.common_sigmas | {"diattenuation": relative},
        )
        words = ", ".join(f"{channel} {_ratio(fit)}" for channel, fit in fits.items())
        told.append(f"extinction ratio by the polarizer frames: {words}")
    zeros = [fit for fit in fits.values() if _knows_source(series) and not math.isnan(fit.axis_error)]
    if zeros:
        zero = combine(zeros)
        error_deg, sigma_deg = math.degrees(zero.axis_error), math.degrees(zero.axis_error_sigma)
        capture = _turned(capture, error_deg, sigma_deg)
        message = (
            f"analyzer axes corrected by {error_deg:+.3f} deg (sigma {sigma_deg:.3f}) by the polarizer frames"
        )
        told.append(message)
    return capture, told


def _fit(capture: Capture, channel: str, series: Sequence[Calibrated]) -> PolarizerFit | None:
    """Of one channel, all groups of points that share a gain combined; None where they are too few."""
    fits = []
    for frame, points in _groups(channel, series):
        known = [0.0 if math.isnan(p.source) else p.source for p in points]
        try:
            fit = fit_polarizer(
                [p.value for p in points],
                [p.variance for p in points],
                [p.axis - source for p, source in zip(points, known, strict=True)],
                points[0].source_dolp,
            )
        except ValueError:
            continue
        fits.append((frame, fit))
    zeros = [fit.axis_error for _, fit in fits if not math.isnan(fit.axis_error)]
    if _knows_source(series) and zeros:
        off = [abs(math.remainder(z - zeros[0], math.pi)) for z in zeros]
        if max(off) > _LARGEST_SPREAD:
            message = (
                f"the axes disagree by {math.degrees(max(off)):.0f} deg in {channel}: the layout or an angle is not "
                "as stated; is dofp_layout_deg mirrored, or turned the other way?"
            )
            raise _wrong(capture, fits[0][0], message)
    return combine([fit for _, fit in fits]) if fits else None


def _groups(channel: str, series: Sequence[Calibrated]) -> Iterator[tuple[Frame, list[_Point]]]:
    """Points of one gain: frames of one set; on polarizers of its own each axis over the frames, or a frame's axes.

    The axes of a sensor differ in response, which a series over a turning
    source of known direction does not feel.
    """
    points: dict[tuple[str, float | None], list[tuple[Frame, _Point]]] = {}
    for sample in series:
        for plane, s in sample.of(channel):
            if s.saturated[0] or not s.pixels[0]:
                continue
            frame = sample.frame
            s0, s1, s2, _ = frame.light
            known = not math.isnan(s1)
            axis_deg = frame.analyzer_deg if plane.axis_deg is None else plane.axis_deg
            variance = float(s.variance[0])
            point = _Point(
                math.radians(axis_deg),
                0.5 * math.atan2(s2, s1) if known else math.nan,
                math.hypot(s1, s2) / s0 if known else 1.0,
                float(s.value[0]),
                # Without a noise model all frames count alike.
                variance if variance > 0 else 1.0,
            )
            points.setdefault((frame.set, plane.axis_deg), []).append((frame, point))
    by_pixel = any(axis is not None for _, axis in points)
    turning = by_pixel and all(
        len({round(math.degrees(p.source) % 180, 3) for _, p in own}) >= _LEAST_SERIES and _all_known(own)
        for own in points.values()
    )
    if turning or not by_pixel:
        for own in points.values():
            yield own[0][0], [point for _, point in own]
        return
    frames: dict[str, list[tuple[Frame, _Point]]] = {}
    for frame, point in (entry for own in points.values() for entry in own):
        frames.setdefault(frame.file, []).append((frame, point))
    for own in frames.values():
        yield own[0][0], [point for _, point in own]


def _all_known(points: Sequence[tuple[Frame, _Point]]) -> bool:
    return not any(math.isnan(point.source) for _, point in points)


def _knows_source(series: Sequence[Calibrated]) -> bool:
    return all(not math.isnan(sample.frame.light[1]) for sample in series)


def _turned(capture: Capture, error_deg: float, sigma_deg: float) -> Capture:
    """All analyzers turned by the error, whose sigma they share."""
    frames = tuple(replace(f, analyzer_deg=f.analyzer_deg + error_deg) for f in capture.frames)
    layout = capture.reading.layout_deg
    if layout is not None:
        layout = tuple(tuple(axis + error_deg for axis in row) for row in layout)
    common = capture.common_sigmas | {"analyzer_offset_deg": dict.fromkeys(capture.channels, sigma_deg)}
    return replace(
        capture, frames=frames, reading=replace(capture.reading, layout_deg=layout), common_sigmas=common
    )


def _ratio(fit: PolarizerFit) -> str:
    if not fit.is_resolved:
        return f"above {2 / fit.diattenuation_sigma:.0f}:1" if fit.diattenuation_sigma > 0 else "infinite"
    return f"{fit.extinction_ratio:.0f}:1 (D = {fit.diattenuation:.5f} +- {fit.diattenuation_sigma:.1g})"


def _wrong(capture: Capture, frame: Frame, reason: str) -> ReflectanceFitError:
    return ReflectanceFitError(Problem(str(capture.path), frame.line, f"{frame.file} {reason}"))
