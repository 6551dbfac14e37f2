"""The parts that manifests are made of: types of single values, and the blocks they have in common.

A manifest is a YAML file that a user writes beside the data: measurement.yaml
beside tables, capture.yaml beside photographs.  What only one of them has is
in its own package.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    Strict,
    StrictInt,
    field_validator,
    model_validator,
)

from reflectance_fit.errors import Problem, ReflectanceFitError, suggestion
from reflectance_fit.priors import ETA_PRIOR, K_PRIOR, NUISANCES, Prior
from reflectance_fit.strict_yaml import Document

WAVELENGTHS_NM = (100.0, 20000.0)


def known(kind: str, names: tuple[str, ...]) -> AfterValidator:
    """Refuses words that are not among ``names``, with the nearest one that is."""

    def check(name: str) -> str:
        if name not in names:
            near = suggestion(name, names) or f"; known are {', '.join(names)}"
            raise ValueError(f"unknown {kind}{near}")
        return name

    return AfterValidator(check)


def known_keys(names: tuple[str, ...]) -> dict[str, Any]:
    """JSON Schema that lets editors complete the keys of a mapping."""
    return {"propertyNames": {"enum": list(names)}}


Number = Annotated[float, Strict()]
Positive = Annotated[Number, Field(gt=0)]
Count = Annotated[StrictInt, Field(ge=0)]
Text = Annotated[str, Field(min_length=1)]
Wavelength = Annotated[Number, Field(ge=WAVELENGTHS_NM[0], le=WAVELENGTHS_NM[1])]
NuisanceName = Annotated[str, known("nuisance", tuple(NUISANCES))]


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


class Sample(Block):
    name: Text = Field(
        description="What was measured; a known material's name is compared with the literature"
    )
    note: str = Field(default="", description="Free text, carried along")


class Polarization(Block):
    """State of the incident beam in the (s, p) frame of docs/conventions.md; no key: unpolarized."""

    stokes: Annotated[tuple[Number, ...], Field(min_length=4, max_length=4)] | None = Field(
        default=None, description="[S0, S1, S2, S3]; +S1 is s, S3 > 0 is right circular"
    )
    linear_deg: Number | None = Field(
        default=None, description="Linear polarization, degrees from s towards p"
    )
    circular: Literal["right", "left"] | None = Field(default=None, description="Circular polarization")

    @model_validator(mode="after")
    def _at_most_one(self) -> Polarization:
        if self._named() > 1:
            raise ValueError("give exactly one of stokes, linear_deg, circular")
        if self.stokes is not None:
            s0, *rest = self.stokes
            if s0 <= 0:
                raise ValueError("S0, the first of stokes, must be above 0")
            if math.hypot(*rest) > s0 * (1 + 1e-9):
                raise ValueError("more polarized than possible: S1^2 + S2^2 + S3^2 must not exceed S0^2")
        return self

    def _named(self) -> int:
        return len(self.model_fields_set & set(Polarization.model_fields))

    def vector(self) -> tuple[float, float, float, float]:
        """The Stokes vector."""
        if self.stokes is not None:
            return (self.stokes[0], self.stokes[1], self.stokes[2], self.stokes[3])
        if self.linear_deg is not None:
            twice = math.radians(2 * self.linear_deg)
            return 1.0, math.cos(twice), math.sin(twice), 0.0
        return 1.0, 0.0, 0.0, {"right": 1.0, "left": -1.0, None: 0.0}[self.circular]


class Light(Polarization):
    """The incident beam in the (s, p) frame of docs/conventions.md; exactly one key."""

    @model_validator(mode="after")
    def _one(self) -> Light:
        if self._named() != 1:
            raise ValueError("give exactly one of stokes, linear_deg, circular")
        return self


class NuisanceEntry(Block):
    sigma: Positive | None = Field(
        default=None, description="One standard deviation of its prior; default: documented"
    )


class PriorRange(Block):
    """One key: the kind of prior and its range, or the value that is known."""

    uniform: Annotated[tuple[Number, ...], Field(min_length=2, max_length=2)] | None = None
    log_uniform: Annotated[tuple[Number, ...], Field(min_length=2, max_length=2)] | None = None
    fixed: Number | None = None

    @model_validator(mode="after")
    def _range(self) -> PriorRange:
        if len(self.model_fields_set) != 1:
            raise ValueError("give exactly one of uniform, log_uniform, fixed")
        if self.fixed is not None:
            if self.fixed < 0:
                raise ValueError("fixed must be at 0 or above")
            return self
        low, high = self.uniform or self.log_uniform or (0.0, 0.0)
        if not low < high:
            raise ValueError("the range must be [low, high] with low below high")
        if low < 0 or (self.log_uniform and low == 0):
            raise ValueError(f"the range must start {'above 0' if self.log_uniform else 'at 0 or above'}")
        return self

    def prior(self) -> Prior:
        if self.fixed is not None:
            return Prior("fixed", self.fixed, self.fixed)
        if self.uniform:
            return Prior("uniform", *self.uniform)
        return Prior("log_uniform", *(self.log_uniform or ()))


class Priors(Block):
    eta: PriorRange | None = Field(default=None, description="Refractive index relative to vacuum, above 0")
    k: PriorRange | None = Field(default=None, description="Extinction, 0 or above")

    @model_validator(mode="after")
    def _physical(self) -> Priors:
        if self.eta and (self.eta.fixed == 0 or (self.eta.uniform and self.eta.uniform[0] == 0)):
            raise ValueError("eta must be above 0")
        if self.eta and self.k and self.eta.fixed is not None and self.k.fixed is not None:
            raise ValueError("eta and k are both fixed: nothing is left to fit")
        return self

    def by_name(self) -> dict[str, Prior]:
        """eta and k, the documented default where a range is not stated."""
        return {
            "eta": self.eta.prior() if self.eta else Prior("log_uniform", *ETA_PRIOR),
            "k": self.k.prior() if self.k else Prior("uniform", *K_PRIOR),
        }


class Subject(Block):
    """What was measured, and what the fit may assume about it: the keys that all manifests have."""

    sample: Sample = Field(description="What was measured")
    exterior_ior: Positive = Field(default=1.000277, description="Index around the sample; default: air")
    nuisances: dict[NuisanceName, NuisanceEntry] | None = Field(
        default=None,
        description="What the fit may vary besides eta and k; {} forbids all",
        json_schema_extra=known_keys(tuple(NUISANCES)),
    )
    priors: Priors = Field(default=Priors(), description="Ranges of eta and k")

    def nuisances_by_name(self) -> dict[str, float | None] | None:
        """Name to stated sigma, None for the default; None in all where the choice is left to the fit."""
        if self.nuisances is None:
            return None
        return {name: entry.sigma for name, entry in self.nuisances.items()}


def check_schema(document: Document, kind: str) -> None:
    """ReflectanceFitError where the document does not say that it is a ``kind`` file of version 1.

    Said first and alone: every other message about a file of another kind would mislead.
    """
    due = f"reflectance_fit/{kind}/1"
    if not isinstance(document.data, dict):
        message = f"is not a {kind} file: lines of 'key: value' are due"
    elif (found := document.data.get("schema")) == due:
        return
    elif found is None:
        message = f"'schema: {due}' is missing; add it as the first line"
    elif isinstance(found, str) and (parts := found.split("/"))[0] == "reflectance_fit" and len(parts) == 3:
        message = f"is a {parts[1]} file ({found}); a {kind} file ({due}) is due here"
        if parts[1] == kind:
            message = f"schema {found} is not known to this version, which reads {due}"
    else:
        message = f"schema must be '{due}' (found {found!r:.60})"
    raise ReflectanceFitError(Problem(document.file, document.line(("schema",)), message))
