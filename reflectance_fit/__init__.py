"""From measured reflection to refractive index, extinction and Brewster angle.

    from reflectance_fit import fit
    result = fit("measurement.yaml")
    result.report.channels[0].eta.median

The names below are imported when first used, so that importing the package
costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from reflectance_fit.capture.frames import Capture as Capture
    from reflectance_fit.material import Material as Material
    from reflectance_fit.measured import Measurement as Measurement
    from reflectance_fit.workflow import fit as fit

__all__ = ["Capture", "Material", "Measurement", "__version__", "fit"]

_HOMES = {
    "Capture": "reflectance_fit.capture.frames",
    "Material": "reflectance_fit.material",
    "Measurement": "reflectance_fit.measured",
    "fit": "reflectance_fit.workflow",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("reflectance_fit")
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
