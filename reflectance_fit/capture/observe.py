"""Calibrated frames to rows: one a bin, frames of equal light pooled where angles are seen all at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.calibrate import Calibrated, FloatArray, Signals
from reflectance_fit.capture.frames import Capture, Frame, OnBoard, Stated
from reflectance_fit.capture.geometry import SECTORS, theta_sigma
from reflectance_fit.capture.raw import Plane
from reflectance_fit.capture.spread import Spread, over_cone, over_region
from reflectance_fit.observations import Flag, Observations, Quantity, concatenate

MIN_PIXELS = 20  # of a bin that holds one angle of many


def flat_rows(capture: Capture, samples: Sequence[Calibrated]) -> Observations:
    """One row a frame, plane and ring of angles, for a flat sample."""
    parts = []
    for channel in capture.channels:
        for sample in samples:
            for plane, signals in sample.of(channel):
                rows = _stated(capture, sample.frame, plane, signals)
                if isinstance(capture.geometry, OnBoard):
                    rows = _measured(capture.geometry, sample.frame, signals)
                parts.append(_observations(capture, channel, sample.frame, rows))
    return concatenate(parts)


def _stated(capture: Capture, frame: Frame, plane: Plane, signals: Signals) -> Rows:
    """The angle that the manifest states, at the middle of the region."""
    axis_deg = frame.analyzer_deg if plane.axis_deg is None else plane.axis_deg
    theta, s_axis = math.radians(frame.theta_deg), math.radians(frame.s_axis_deg)
    spread = Spread(theta, 0.0, 1.0)
    geometry = capture.geometry
    if isinstance(geometry, Stated) and geometry.camera is not None:
        spread = over_region(frame.box(geometry.camera.shape), geometry.camera, theta, s_axis)
    return Rows(
        group=np.array([str(frame.gain_group)]),
        # Bit by bit the stated angle where there is nothing to add.
        theta_deg=np.array([frame.theta_deg + math.degrees(spread.theta - theta)]),
        theta_deg_sigma=np.array([frame.theta_deg_sigma]),
        theta_deg_spread=np.array([math.degrees(spread.width)]),
        analyzer_deg=np.array([axis_deg - frame.s_axis_deg - math.degrees(spread.turn)]),
        modulation=np.array([spread.modulation]),
        value=signals.value,
        variance=signals.variance,
        per_dn=signals.per_dn,
        pixels=signals.pixels,
        saturated=signals.saturated,
        rejected=signals.rejected,
    )


def _measured(board: OnBoard, frame: Frame, signals: Signals) -> Rows:
    """The angles that the board tells, a ring a row; frames of one pose share a gain a ring."""
    pose = board.poses[frame.path]
    group = frame.gain_group or f"{frame.set}:view {pose.view}"
    several = frame.gain_group is None and len(signals.pixels) > 1
    rings = [f"{group}:ring {ring}" if several else group for ring in range(len(signals.pixels))]
    seen = signals.pixels >= MIN_PIXELS

    def of(name: str) -> FloatArray:
        return np.asarray(getattr(signals, name)[seen])

    theta = of("theta")
    return Rows(
        group=np.array(rings)[seen],
        # To a thousandth of a degree, so that frames of one pose stand at one angle whatever their flats.
        theta_deg=np.asarray(np.round(np.degrees(theta), 3), dtype=np.float64),
        theta_deg_sigma=np.full(len(theta), frame.theta_deg_sigma),
        theta_deg_spread=_degrees_of(of("theta_squared") - theta**2),
        analyzer_deg=np.degrees(0.5 * np.arctan2(of("sin_2phi"), of("cos_2phi"))),
        modulation=np.hypot(of("cos_2phi"), of("sin_2phi")),
        value=of("value"),
        variance=of("variance"),
        per_dn=of("per_dn"),
        pixels=np.asarray(signals.pixels[seen]),
        saturated=np.asarray(signals.saturated[seen]),
        rejected=np.asarray(signals.rejected[seen]),
    )


def _degrees_of(variance: FloatArray) -> FloatArray:
    return np.degrees(np.sqrt(np.maximum(variance, 0.0)))


def angle_rows(capture: Capture, samples: Sequence[Calibrated]) -> Observations:
    """One row a channel, ring and sector, frames of equal light pooled.

    All pixels of a bin are at one angle of incidence and, within the sector,
    at nearly one analyzer angle phi from s, whichever frame they are from.
    The signal is linear in cos 2 phi and sin 2 phi, so their means stand for
    the bin exactly: as an analyzer at the mean direction whose diattenuation
    is less by the length of the mean.
    """
    parts = []
    for channel in capture.channels:
        kinds: dict[tuple[object, ...], tuple[Frame, list[Signals]]] = {}
        for sample in samples:
            frame = sample.frame
            _, pooled = kinds.setdefault((frame.light, frame.set, frame.gain_group), (frame, []))
            pooled += [signals for _, signals in sample.of(channel)]
        for frame, pooled in kinds.values():
            if pooled:
                parts.append(_observations(capture, channel, frame, _pool(capture, pooled, frame)))
    return concatenate(parts)


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """What differs from row to row; ``modulation`` is 1 where a bin has one analyzer angle, less where it spans some."""

    group: NDArray[np.str_]
    theta_deg: FloatArray
    theta_deg_sigma: FloatArray
    theta_deg_spread: FloatArray
    analyzer_deg: FloatArray
    modulation: FloatArray
    value: FloatArray
    variance: FloatArray
    per_dn: FloatArray
    pixels: NDArray[np.int64]
    saturated: NDArray[np.bool_]
    rejected: NDArray[np.bool_]


def _pool(capture: Capture, signals: Sequence[Signals], frame: Frame) -> Rows:
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
        theta_deg_sigma=np.degrees(theta_sigma(capture, mean("theta"))),
        theta_deg_spread=_degrees_of(mean("theta_squared") - mean("theta") ** 2),
        analyzer_deg=np.degrees(0.5 * np.arctan2(sin_2phi, cos_2phi)),
        modulation=np.hypot(cos_2phi, sin_2phi),
        value=mean("value"),
        variance=np.sum(weight**2 * np.where(weight > 0, variance, 0.0), axis=0) / total**2,
        per_dn=mean("per_dn"),
        pixels=total.astype(np.int64),
        saturated=clipped[kept],
        rejected=np.zeros(int(np.count_nonzero(kept)), dtype=np.bool_),
    )


def _widened(rows: Rows, half_angle: float) -> Rows:
    """What each pixel collects comes from a cone of directions."""
    if half_angle == 0.0:
        return rows
    theta = np.radians(rows.theta_deg)
    cones = [over_cone(float(t), half_angle) for t in theta]
    shift, width, modulation = np.array(
        [(c.theta - t, c.width, c.modulation) for c, t in zip(cones, theta, strict=True)]
    ).T
    return replace(
        rows,
        theta_deg=rows.theta_deg + np.degrees(shift),
        theta_deg_spread=np.hypot(rows.theta_deg_spread, np.degrees(width)),
        modulation=rows.modulation * modulation,
    )


def _observations(capture: Capture, channel: str, frame: Frame, rows: Rows) -> Observations:
    n = len(rows.value)
    rows = _widened(rows, math.radians(capture.half_angle_deg))
    sigma = np.sqrt(rows.variance)
    return Observations(
        channel=np.full(n, channel),
        wavelength_nm=np.full(n, capture.channels[channel].wavelength_nm),
        set=np.full(n, frame.set),
        gain_group=rows.group,
        theta_deg=rows.theta_deg,
        theta_deg_sigma=rows.theta_deg_sigma,
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
        flag=np.select([rows.rejected, rows.saturated], [Flag.REJECTED, Flag.SATURATED], Flag.USED),
        fwhm_nm=np.full(n, capture.channels[channel].fwhm_nm),
        signal_per_dn=rows.per_dn,
    )
