"""Which errors a fit of photographs allows for: those that the manifest names, and those that frames have measured."""

from __future__ import annotations

from reflectance_fit.capture.frames import Capture
from reflectance_fit.nuisances import nuisance_sigmas
from reflectance_fit.observations import Observations

# Of every nuisance's unit, and far below the noise of a million pixels: a prior must have a width.
_NEGLIGIBLE = 1e-7


def allowed_for(
    capture: Capture, observations: Observations
) -> tuple[dict[str, float] | None, dict[str, dict[str, float]]]:
    """``Measurement.nuisances`` and ``Measurement.common_sigmas``.

    A sigma that the manifest states goes before the measured one, which stands
    for the default; `nuisances: {}` forbids both.
    """
    stated = capture.nuisances
    if stated == {}:
        return {}, {}
    wide = {
        name: {channel: sigma for channel, sigma in sigmas.items() if sigma > _NEGLIGIBLE}
        for name, sigmas in capture.common_sigmas.items()
        if (stated or {}).get(name) is None
    }
    common = {name: sigmas for name, sigmas in wide.items() if sigmas}
    if stated is None:
        return None, common
    left = {name: sigma for name, sigma in stated.items() if name not in capture.common_sigmas or sigma}
    return nuisance_sigmas(left, capture.document, observations), common
