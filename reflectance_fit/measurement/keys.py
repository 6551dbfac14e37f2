"""The parts that the keys of ``measurement.yaml`` are made of: known names, and types of single values."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, StrictInt, StrictStr

from reflectance_fit.manifests import Wavelength, known
from reflectance_fit.observations import Quantity

COORDINATES = ("theta_deg", "wavelength_nm", "analyzer_deg", "retarder_deg", "retardance_deg")
QUANTITIES = tuple(str(quantity) for quantity in Quantity)
SIGMAS = tuple(f"{name}_sigma" for name in ("theta_deg", *QUANTITIES))
WOOLLAM_QUANTITIES = ("psi_deg", "delta_deg", "reflectance_s", "reflectance_p")


def _column(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | str) or value == "":
        raise ValueError("must be a column number, counted from 0, or the text of a header")
    if isinstance(value, int) and value < 0:
        raise ValueError("columns are counted from 0")
    return value


def _sense(value: Any) -> Any:
    if isinstance(value, bool) or value not in (1, -1):
        raise ValueError("must be 1 or -1")
    return value


Wavelengths = Annotated[tuple[Wavelength, ...], Field(min_length=1)]
ColumnName = Annotated[str, known("column", COORDINATES + QUANTITIES + SIGMAS)]
ConstantName = Annotated[str, known("constant", COORDINATES + SIGMAS)]
Sense = Annotated[Literal[1, -1], BeforeValidator(_sense)]
ColumnRef = Annotated[StrictInt | StrictStr, BeforeValidator(_column)]
