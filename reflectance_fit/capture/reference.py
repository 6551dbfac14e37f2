"""A known surface in the sample's place: signals over its signals are free of the lamp and the optics.

Sample and reference are seen at the same angle of incidence, through the same analyzer.  Their ratio times what
the reference reflects there is what the sample reflects, so frames of all angles share one gain.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from reflectance_fit.angles import cos_sin_deg
from reflectance_fit.capture.calibrate import Calibrated, Signals
from reflectance_fit.capture.frames import WHITE, Capture, Frame, same_axis
from reflectance_fit.capture.raw import Plane
from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.materials import library
from reflectance_fit.physics.fresnel import amplitudes
from reflectance_fit.physics.mueller import reflection, retarder
from reflectance_fit.physics.stokes import analyzer_signal

# The ratio of two normal numbers is itself nearly normal where the lower one is this many sigmas from 0.
LEAST_SIGNAL = 10.0
_SAME_THETA_DEG = 1e-6


def references_for(frame: Frame, frames: Iterable[Frame]) -> tuple[Frame, ...]:
    """The references of equal set, channels, angle of incidence, light, analyzer and retarder."""
    return tuple(
        other
        for other in frames
        if other.role == "reference"
        and other.set == frame.set
        and set(other.channels) & set(frame.channels)
        and abs(other.theta_deg - frame.theta_deg) <= _SAME_THETA_DEG
        and other.light == frame.light
        and _alike(other.analyzer_deg, frame.analyzer_deg)
        and _alike(other.retarder_deg, frame.retarder_deg)
    )


def check_references(capture: Capture) -> None:
    """Raise ReflectanceFitError for sample frames without a reference in sets that have some: one gain needs all."""
    sets = {frame.set for frame in capture.role("reference")}
    problems = [
        Problem(
            str(capture.path),
            frame.line,
            f"{frame.file} has no reference of equal theta_deg, analyzer, retarder and light as others of its set;"
            " add one, or give the frame a set of its own",
        )
        for frame in capture.role("sample")
        if frame.set in sets and not references_for(frame, capture.frames)
    ]
    if problems:
        raise ReflectanceFitError(problems)


def relative_to(capture: Capture, sample: Calibrated, references: Sequence[Calibrated]) -> Calibrated:
    """The sample's signals over those of the references, times what their material reflects.

    Both are of one bin.  A signal of the references that is clipped, or below 10 of its standard deviations,
    gives no ratio: that row is marked rejected.
    """
    signals = {}
    for plane, own in sample.signals.items():
        theirs = [
            (r.signals[plane], _reflected(capture, r.frame, plane)) for r in references if plane in r.signals
        ]
        if theirs:
            signals[plane] = _over(own, theirs)
    return replace(sample, signals=signals)


def _over(own: Signals, references: Sequence[tuple[Signals, float]]) -> Signals:
    """``references`` are (signals, what the material reflects); several are averaged by their variance."""
    gains = np.array([s.value / power for s, power in references])
    variances = np.array([s.variance / power**2 for s, power in references])
    # Of frames without a noise model all count alike.
    weight = np.where(np.isfinite(variances) & (variances > 0), 1 / variances, 1.0)
    gain = np.sum(weight * gains, axis=0) / weight.sum(axis=0)
    variance = np.sum(weight**2 * variances, axis=0) / weight.sum(axis=0) ** 2
    value = own.value / gain
    # Every exposure of the sample is divided by the same frames.
    common = (value / gain) ** 2 * variance
    clipped = np.any([s.saturated for s, _ in references], axis=0)
    faint = gain < LEAST_SIGNAL * np.sqrt(np.nan_to_num(variance))
    return replace(
        own,
        value=value,
        variance=own.variance / gain**2 + common,
        unlike=own.unlike / gain**2 + common,
        per_dn=own.per_dn / np.abs(gain),
        rejected=own.rejected | clipped | faint,
    )


def _reflected(capture: Capture, reference: Frame, plane: Plane) -> float:
    """What passes the analyzer of a beam of 1 on the reference; 1/2 of white, which keeps no polarization."""
    if reference.material == WHITE:
        return 0.5
    wavelength_nm = capture.channels[plane.channel].wavelength_nm
    eta, k = library.get(str(reference.material)).absolute_index(wavelength_nm)
    cos_theta, _ = cos_sin_deg(reference.theta_deg)
    ior = capture.exterior_ior
    beam = reflection(*amplitudes(cos_theta, float(eta) / ior, float(k) / ior)) @ np.array(reference.light)
    if not math.isnan(reference.retarder_deg):
        axis = math.radians(reference.retarder_deg - reference.s_axis_deg)
        beam = retarder(axis, math.radians(capture.retardance_deg[plane.channel])) @ beam
    axis_deg = reference.analyzer_deg if plane.axis_deg is None else plane.axis_deg
    phi = math.radians(axis_deg - reference.s_axis_deg)
    return float(analyzer_signal(beam, phi, capture.diattenuation[plane.channel]))


def _alike(one: float, other: float) -> bool:
    return same_axis(one, other) or (math.isnan(one) and math.isnan(other))
