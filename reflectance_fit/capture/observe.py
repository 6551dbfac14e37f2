"""Calibrated frames to rows: dark subtracted, flat and exposure divided out, sigma by the noise model.

A signal is DN per second.  Its sigma is that of the mean over a bin: shot and
read noise of the pixels, of the frame and of its darks.  Fixed patterns (PRNU,
vignetting) are equal in all frames that share a gain and go into that gain; on
a sphere they do not, and flats divide them out at the price of their own noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.frames import Capture, Exposure, Frame
from reflectance_fit.capture.geometry import SECTORS
from reflectance_fit.capture.reduce import Bins, FrameMeans, PlaneMeans, SphereBins
from reflectance_fit.observations import Flag, Observations, Quantity, concatenate

FloatArray = NDArray[np.float64]

# A few hot pixels are clipped in every frame; more than this share, and the mean is too low.
SATURATED_SHARE = 1e-3
QUANTISATION = 1 / 12  # DN^2
MIN_PIXELS = 20  # of a bin on a sphere
TYPICAL_PRNU = 0.005  # where no flat divides it out


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """One channel of one frame; arrays of shape (bins,)."""

    value: FloatArray
    variance: FloatArray
    per_dn: FloatArray
    pixels: NDArray[np.int64]
    saturated: NDArray[np.bool_]
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
    """A sample frame ready to become rows."""

    frame: Frame
    exposure: Exposure
    channels: dict[str, Signals]

    @property
    def saturated_share(self) -> float:
        """Of all pixels in the bins, those whose bin is clipped."""
        pixels = sum(int(s.pixels.sum()) for s in self.channels.values())
        clipped = sum(int(s.pixels[s.saturated].sum()) for s in self.channels.values())
        return clipped / pixels if pixels else 0.0


def calibrate(
    capture: Capture,
    frame: Frame,
    exposure: Exposure,
    bins: Bins,
    means: FrameMeans,
    darks: Sequence[FrameMeans],
    flats: Sequence[tuple[FrameMeans, float, Sequence[FrameMeans]]],
) -> Calibrated:
    """Signals of every channel of a sample frame over ``bins``.

    ``flats`` are (means, exposure in seconds, its darks).
    """
    channels = {}
    for channel in frame.channels:
        plane = "mono" if capture.sensor == "mono" else channel
        own = means.over(bins)[plane]
        noise = _noise(capture, channel, plane, means, darks, [flat[0] for flat in flats])
        value, variance = _minus_darks(own, noise, [d.over(bins)[plane] for d in darks])
        seconds = float(exposure.seconds or math.nan)
        value, variance = value / seconds, variance / seconds**2
        per_dn = np.full_like(value, 1 / seconds)
        # On a sphere each bin has its own pixels, so what they differ by does not go into a gain.
        unlike = (TYPICAL_PRNU * value) ** 2 / np.maximum(own.pixels, 1)
        angles = [own]
        if flats:
            angles = [flat[0].over(bins)[plane] for flat in flats]
            levels, noises = zip(*(_flat(flat, bins, plane, noise) for flat in flats), strict=True)
            level = np.mean(levels, axis=0)
            value, variance, per_dn = value / level, variance / level**2, per_dn / level
            unlike = value**2 * np.sum(noises, axis=0) / (len(flats) * level) ** 2
        if isinstance(bins, SphereBins):
            variance = variance + unlike
        channels[channel] = Signals(
            value=value,
            variance=variance,
            per_dn=per_dn,
            pixels=own.pixels,
            saturated=own.saturated > SATURATED_SHARE * own.pixels,
            theta=np.mean([a.theta for a in angles], axis=0),
            theta_squared=np.mean([a.theta_squared for a in angles], axis=0),
            cos_2phi=np.mean([a.cos_2phi for a in angles], axis=0),
            sin_2phi=np.mean([a.sin_2phi for a in angles], axis=0),
        )
    return Calibrated(frame, exposure, channels)


def _noise(
    capture: Capture,
    channel: str,
    plane: str,
    means: FrameMeans,
    darks: Sequence[FrameMeans],
    flats: Sequence[FrameMeans],
) -> tuple[float, float]:
    """(a, b) of a pixel's variance a * mean + b, DN^2: the manifest's, the file's, that of the flats, or NaN."""
    if capture.noise is not None:
        noise = capture.noise[channel]
        return 1 / noise.gain_e_per_dn, (noise.read_noise_e / noise.gain_e_per_dn) ** 2 + QUANTISATION
    if means.noise is not None and plane in means.noise:
        return means.noise[plane]
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
    flat: tuple[FrameMeans, float, Sequence[FrameMeans]], bins: Bins, plane: str, noise: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """A flat's level over the bins, DN per second, and its variance."""
    means, seconds, darks = flat
    value, variance = _minus_darks(means.over(bins)[plane], noise, [d.over(bins)[plane] for d in darks])
    return value / seconds, variance / seconds**2


def flat_rows(capture: Capture, samples: Sequence[Calibrated]) -> Observations:
    """One row a frame and channel, for a sample whose angle of incidence is stated."""
    parts = []
    for channel in capture.channels:
        for sample in samples:
            if channel in sample.channels:
                s, frame = sample.channels[channel], sample.frame
                rows = Rows(
                    group=np.array([str(frame.gain_group)]),
                    theta_deg=np.array([frame.theta_deg]),
                    theta_deg_spread=np.zeros(1),
                    analyzer_deg=np.array([frame.analyzer_deg - frame.s_axis_deg]),
                    modulation=np.ones(1),
                    value=s.value,
                    variance=s.variance,
                    per_dn=s.per_dn,
                    pixels=s.pixels,
                    saturated=s.saturated,
                )
                parts.append(_observations(capture, channel, frame, rows))
    return concatenate(parts)


def sphere_rows(capture: Capture, samples: Sequence[Calibrated]) -> Observations:
    """One row a channel, ring and sector, frames of equal light pooled.

    All pixels of a bin are at one angle of incidence and, within the sector,
    at nearly one analyzer angle phi from s, whichever frame they are from.
    The signal is linear in cos 2 phi and sin 2 phi, so their means stand for
    the bin exactly: as an analyzer at the mean direction whose diattenuation
    is less by the length of the mean.
    """
    parts = []
    for channel in capture.channels:
        kinds: dict[tuple[object, ...], list[Calibrated]] = {}
        for sample in samples:
            if channel in sample.channels:
                frame = sample.frame
                kinds.setdefault((frame.light, frame.set, frame.gain_group), []).append(sample)
        for pooled in kinds.values():
            rows = _pool([sample.channels[channel] for sample in pooled], pooled[0].frame)
            parts.append(_observations(capture, channel, pooled[0].frame, rows))
    return concatenate(parts)


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """What differs from row to row; ``modulation`` is 1 where a bin has one analyzer angle, less where it spans some."""

    group: NDArray[np.str_]
    theta_deg: FloatArray
    theta_deg_spread: FloatArray
    analyzer_deg: FloatArray
    modulation: FloatArray
    value: FloatArray
    variance: FloatArray
    per_dn: FloatArray
    pixels: NDArray[np.int64]
    saturated: NDArray[np.bool_]


def _pool(signals: Sequence[Signals], frame: Frame) -> Rows:
    """Frames averaged bin by bin, weighted by pixels; clipped bins of a frame are left out of the average."""
    weight = np.stack([np.where(s.saturated, 0, s.pixels) for s in signals])
    total = weight.sum(axis=0)
    kept = total >= MIN_PIXELS
    # A bin that is clipped in every frame stays, as a row that says so.
    clipped = ~kept & (np.sum([s.pixels for s in signals], axis=0) >= MIN_PIXELS)
    kept |= clipped
    weight = np.where(clipped, np.stack([s.pixels for s in signals]), weight)[:, kept].astype(float)
    total = weight.sum(axis=0)

    def mean(name: str) -> FloatArray:
        values = np.stack([getattr(s, name) for s in signals])[:, kept]
        return np.asarray(np.sum(weight * np.where(weight > 0, values, 0.0), axis=0) / total)

    variance = np.stack([s.variance for s in signals])[:, kept]
    cos_2phi, sin_2phi = mean("cos_2phi"), mean("sin_2phi")
    ring = np.repeat(np.arange(len(kept) // SECTORS), SECTORS)[kept]
    return Rows(
        group=np.array([frame.gain_group or f"{frame.set}:ring {r}" for r in ring]),
        theta_deg=np.degrees(mean("theta")),
        theta_deg_spread=np.degrees(np.sqrt(np.maximum(mean("theta_squared") - mean("theta") ** 2, 0.0))),
        analyzer_deg=np.degrees(0.5 * np.arctan2(sin_2phi, cos_2phi)),
        modulation=np.hypot(cos_2phi, sin_2phi),
        value=mean("value"),
        variance=np.sum(weight**2 * np.where(weight > 0, variance, 0.0), axis=0) / total**2,
        per_dn=mean("per_dn"),
        pixels=total.astype(np.int64),
        saturated=clipped[kept],
    )


def _observations(capture: Capture, channel: str, frame: Frame, rows: Rows) -> Observations:
    n = len(rows.value)
    sigma = np.sqrt(rows.variance)
    return Observations(
        channel=np.full(n, channel),
        wavelength_nm=np.full(n, capture.channels[channel].wavelength_nm),
        set=np.full(n, frame.set),
        gain_group=rows.group,
        theta_deg=rows.theta_deg,
        theta_deg_sigma=np.full(n, frame.theta_deg_sigma),
        theta_deg_spread=rows.theta_deg_spread,
        analyzer_deg=rows.analyzer_deg,
        retarder_deg=np.full(n, frame.retarder_deg - frame.s_axis_deg),
        retardance_deg=np.full(
            n, math.nan if math.isnan(frame.retarder_deg) else capture.retardance_deg[channel]
        ),
        diattenuation=capture.diattenuation[channel] * rows.modulation,
        light=np.tile(np.array(frame.light), (n, 1)),
        quantity=np.full(n, str(Quantity.SIGNAL)),
        value=rows.value,
        sigma=sigma,
        pixels=rows.pixels,
        flag=np.where(rows.saturated, str(Flag.SATURATED), str(Flag.USED)),
        fwhm_nm=np.full(n, capture.channels[channel].fwhm_nm),
        signal_per_dn=rows.per_dn,
    )
