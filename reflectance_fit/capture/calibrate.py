"""Frames reduced to signals: dark subtracted, flat and exposure divided out, sigma by the noise model.

A signal is DN per second.  Its sigma is that of the mean over a bin: shot and
read noise of the pixels, of the frame and of its darks.  Fixed patterns (PRNU,
vignetting) are equal in all frames that share a gain and go into that gain; on
a ball or a board they do not, and flats divide them out at the price of their
own noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.bins import Bins, Cells, Region
from reflectance_fit.capture.frames import Capture, Exposure, Frame
from reflectance_fit.capture.plane_means import PlaneMeans
from reflectance_fit.capture.raw import Plane
from reflectance_fit.capture.reduce import FrameMeans

FloatArray = NDArray[np.float64]

# A few hot pixels are clipped in every frame; more than this share, and the mean is too low.
SATURATED_SHARE = 1e-3
QUANTISATION = 1 / 12  # DN^2
TYPICAL_PRNU = 0.005  # where no flat divides it out


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """One channel of one frame; arrays of shape (bins,).

    ``unlike`` is that part of the variance which the same pixels repeat in
    every frame: 0 where it goes into a gain.
    """

    value: FloatArray
    variance: FloatArray
    unlike: FloatArray
    per_dn: FloatArray
    pixels: NDArray[np.int64]
    saturated: NDArray[np.bool_]
    rejected: NDArray[np.bool_]
    theta: FloatArray
    theta_squared: FloatArray
    cos_2phi: FloatArray
    sin_2phi: FloatArray

    @property
    def mean(self) -> float:
        """Over all pixels of the bins that are not clipped."""
        weight = np.where(self.saturated, 0, self.pixels)
        total = weight.sum()
        return float(np.sum(weight * np.nan_to_num(self.value)) / total) if total else math.nan


@dataclass(frozen=True, slots=True, eq=False)
class Calibrated:
    """A sample frame ready to become rows: ``signals`` over ``bins``, a plane being a channel behind a polarizer."""

    frame: Frame
    exposure: Exposure
    bins: Bins | Cells
    signals: dict[Plane, Signals]

    def of(self, channel: str) -> list[tuple[Plane, Signals]]:
        """The planes of a channel: one, or one an axis where pixels have polarizers."""
        return [(plane, signals) for plane, signals in self.signals.items() if plane.channel == channel]

    @property
    def saturated_share(self) -> float:
        """Of all pixels in the bins, those whose bin is clipped."""
        pixels = sum(int(s.pixels.sum()) for s in self.signals.values())
        clipped = sum(int(s.pixels[s.saturated].sum()) for s in self.signals.values())
        return clipped / pixels if pixels else 0.0


def calibrate(
    capture: Capture,
    frame: Frame,
    exposure: Exposure,
    bins: Bins | Cells,
    means: FrameMeans,
    darks: Sequence[FrameMeans],
    flats: Sequence[tuple[FrameMeans, float, Sequence[FrameMeans]]],
) -> Calibrated:
    """Signals of every plane of a sample frame over ``bins``.

    ``flats`` are (means, exposure in seconds, its darks).
    """
    signals = {}
    for plane, own in means.over(bins).items():
        channel = channel_of(frame, plane)
        if channel is None:
            continue
        noise = _noise(capture, frame, plane, means, darks, [flat[0] for flat in flats])
        value, variance = _minus_darks(own, noise, [d.over(bins)[plane] for d in darks])
        seconds = float(exposure.seconds or math.nan)
        value, variance = value / seconds, variance / seconds**2
        per_dn = np.full_like(value, 1 / seconds)
        # Where many angles are seen at once each bin has its own pixels: what they differ by is in no gain.
        transfer = capture.transfer.get(channel)
        prnu = TYPICAL_PRNU if transfer is None or math.isnan(transfer.prnu) else transfer.prnu
        unlike = (prnu * value) ** 2 / np.maximum(own.pixels, 1)
        angles, saturated = [own], _is_saturated(own)
        if flats:
            angles = [flat[0].over(bins)[plane] for flat in flats]
            levels, noises = zip(*(_flat(flat, bins, plane, noise) for flat in flats), strict=True)
            clipped = np.stack([_is_saturated(angle) for angle in angles])
            # Where every flat is clipped there is no level to divide by.
            dark_enough = ~clipped | clipped.all(axis=0)
            count = dark_enough.sum(axis=0)
            level = np.sum(dark_enough * np.stack(levels), axis=0) / count
            saturated = saturated | clipped.all(axis=0)
            value, variance, per_dn = value / level, variance / level**2, per_dn / level
            unlike = value**2 * np.sum(dark_enough * np.stack(noises), axis=0) / (count * level) ** 2
        if isinstance(bins, Region) or (isinstance(bins, Cells) and bins.shares_gain):
            unlike = np.zeros_like(value)
        signals[Plane(channel, plane.axis_deg)] = Signals(
            value=value,
            variance=variance + unlike,
            unlike=unlike,
            per_dn=per_dn,
            pixels=own.pixels.astype(np.int64),
            saturated=saturated,
            rejected=np.zeros(len(value), dtype=np.bool_),
            theta=np.mean([a.theta for a in angles], axis=0),
            theta_squared=np.mean([a.theta_squared for a in angles], axis=0),
            cos_2phi=np.mean([a.cos_2phi for a in angles], axis=0),
            sin_2phi=np.mean([a.sin_2phi for a in angles], axis=0),
        )
    return Calibrated(frame, exposure, bins, signals)


def _is_saturated(means: PlaneMeans) -> NDArray[np.bool_]:
    return np.asarray(means.saturated > SATURATED_SHARE * means.pixels)


def channel_of(frame: Frame, plane: Plane) -> str | None:
    """The manifest's name of what a plane of the file sees; None for what the frame is not used for."""
    name = frame.channels[0] if plane.channel == "mono" else plane.channel
    return name if name in frame.channels else None


def pixel_noise(capture: Capture, frame: Frame) -> dict[str, tuple[float, float]]:
    """(a, b) of a pixel's variance a * mean + b, DN^2, by the manifest, else by pairs; by channel of the sensor."""
    found = {channel: (t.slope, t.floor) for channel, t in capture.transfer.items()}
    for channel, noise in (capture.noise or {}).items():
        read_dn = noise.read_noise_e / noise.gain_e_per_dn
        found[channel] = (1 / noise.gain_e_per_dn, read_dn**2 + QUANTISATION)
    # A sensor without colour filters sees whichever channel the frame is for.
    only = frame.channels[0]
    return found | {"mono": found[only]} if only in found else found


def _noise(
    capture: Capture,
    frame: Frame,
    plane: Plane,
    means: FrameMeans,
    darks: Sequence[FrameMeans],
    flats: Sequence[FrameMeans],
) -> tuple[float, float]:
    """(a, b) of a pixel's variance a * mean + b, DN^2: the manifest's, the file's, that of pairs or flats, or NaN."""
    stated = pixel_noise(capture, frame)
    if capture.noise is not None:
        return stated[plane.channel]
    if means.noise is not None and plane.channel in means.noise:
        return means.noise[plane.channel]
    if plane.channel in stated:
        return stated[plane.channel]
    if not flats:
        return math.nan, math.nan
    # How neighbours differ holds the pixels' own differences too, so this errs to the large side.
    floor = float(np.mean([d.scatter[plane][1] for d in darks])) if darks else QUANTISATION
    slopes = [(variance - floor) / mean for mean, variance in (f.scatter[plane] for f in flats)]
    return max(float(np.mean(slopes)), 0.0), floor


def _minus_darks(
    own: PlaneMeans, noise: tuple[float, float], darks: Sequence[PlaneMeans]
) -> tuple[FloatArray, FloatArray]:
    """Mean above the darks (above the black level without any), and its variance; DN."""
    value, variance = own.mean, _variance(own, noise)
    if darks:
        value = value - np.mean([d.mean for d in darks], axis=0)
        variance = variance + np.sum([_variance(d, noise) for d in darks], axis=0) / len(darks) ** 2
    return value, variance


def _variance(means: PlaneMeans, noise: tuple[float, float]) -> FloatArray:
    slope, floor = noise
    pixel = slope * np.maximum(means.mean, 0.0) + floor
    return np.asarray(pixel / np.maximum(means.pixels, 1))


def _flat(
    flat: tuple[FrameMeans, float, Sequence[FrameMeans]],
    bins: Bins | Cells,
    plane: Plane,
    noise: tuple[float, float],
) -> tuple[FloatArray, FloatArray]:
    """A flat's level over the bins, DN per second, and its variance."""
    means, seconds, darks = flat
    value, variance = _minus_darks(means.over(bins)[plane], noise, [d.over(bins)[plane] for d in darks])
    return value / seconds, variance / seconds**2
