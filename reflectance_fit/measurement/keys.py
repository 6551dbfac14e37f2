"""The parts that the keys of ``measurement.yaml`` are made of: known names, and types of single values."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    Strict,
    StrictInt,
    StrictStr,
    field_validator,
)

from reflectance_fit.errors import suggestion
from reflectance_fit.observations import Quantity
from reflectance_fit.priors import NUISANCES

COORDINATES = ("theta_deg", "wavelength_nm", "analyzer_deg", "retarder_deg", "retardance_deg")
QUANTITIES = tuple(str(quantity) for quantity in Quantity)
SIGMAS = tuple(f"{name}_sigma" for name in ("theta_deg", *QUANTITIES))
WOOLLAM_QUANTITIES = ("psi_deg", "delta_deg", "reflectance_s", "reflectance_p")
WAVELENGTHS_NM = (100.0, 20000.0)


def _known(kind: str, names: tuple[str, ...]) -> AfterValidator:
    def check(name: str) -> str:
        if name not in names:
            near = suggestion(name, names) or f"; known are {', '.join(names)}"
            raise ValueError(f"unknown {kind}{near}")
        return name

    return AfterValidator(check)


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


def known_keys(names: tuple[str, ...]) -> dict[str, Any]:
    """JSON Schema that lets editors complete the keys of a mapping."""
    return {"propertyNames": {"enum": list(names)}}


Number = Annotated[float, Strict()]
Positive = Annotated[Number, Field(gt=0)]
Count = Annotated[StrictInt, Field(ge=0)]
Text = Annotated[str, Field(min_length=1)]
Wavelength = Annotated[Number, Field(ge=WAVELENGTHS_NM[0], le=WAVELENGTHS_NM[1])]
Wavelengths = Annotated[tuple[Wavelength, ...], Field(min_length=1)]
ColumnName = Annotated[str, _known("column", COORDINATES + QUANTITIES + SIGMAS)]
ConstantName = Annotated[str, _known("constant", COORDINATES + SIGMAS)]
NuisanceName = Annotated[str, _known("nuisance", tuple(NUISANCES))]
Sense = Annotated[Literal[1, -1], BeforeValidator(_sense)]
ColumnRef = Annotated[StrictInt | StrictStr, BeforeValidator(_column)]


class Block(BaseModel):
    """A mapping of the file: unknown keys, empty values and numbers that are not finite are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _not_null(cls, value: Any) -> Any:
        # A key with nothing after it is half an edit: `nuisances:` would else mean the opposite of `{}`.
        if value is None:
            raise ValueError("has no value; give one or remove the key")
        return value
