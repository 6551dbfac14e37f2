"""``truth.yaml``: what a synthetic capture or table was made from, to compare results with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import yaml
from pydantic import ConfigDict, Field

from reflectance_fit.files import write_whole
from reflectance_fit.manifests import (
    Block,
    Count,
    NuisanceName,
    Number,
    Positive,
    Text,
    Wavelength,
    check_schema,
    known_keys,
)
from reflectance_fit.priors import NUISANCES
from reflectance_fit.strict_yaml import load, validate


class TrueChannel(Block):
    channel: Text = Field(description="Name of the channel")
    wavelength_nm: Wavelength = Field(description="Vacuum wavelength, nm")
    eta: Positive = Field(description="Refractive index relative to vacuum")
    k: Annotated[Number, Field(ge=0)] = Field(description="Extinction, relative to vacuum")
    brewster_deg: Annotated[Number, Field(ge=0, le=90)] = Field(
        description="Angle where R_p is least, seen from the exterior, degrees"
    )


class TrueView(Block):
    theta_deg: Annotated[Number, Field(ge=0, le=90)] = Field(
        description="Angle of incidence at the centre of the region, degrees"
    )
    s_axis_deg: Number = Field(
        description="Direction of s there, counter-clockwise from the picture's horizontal"
    )


class Truth(Block):
    """What went into a synthetic measurement."""

    model_config = ConfigDict(title="reflectance_fit truth", populate_by_name=True)

    schema_: Literal["reflectance_fit/truth/1"] = Field(
        default="reflectance_fit/truth/1", alias="schema", description="Format and version"
    )
    material: Text = Field(description="Name among the built-in materials")
    channels: Annotated[tuple[TrueChannel, ...], Field(min_length=1)] = Field(description="One a channel")
    nuisances: dict[NuisanceName, Number] = Field(
        default={},
        description="Faults that the manifest does not tell, by name and unit of the nuisances",
        json_schema_extra=known_keys(tuple(NUISANCES)),
    )
    views: tuple[TrueView, ...] | None = Field(
        default=None,
        description="Where no frame states its angle: one a tilt of the sample, in the order of the frames",
    )
    frames: Count | None = Field(default=None, description="Number of photographs; absent for tables")
    seed: Count = Field(description="Seed of the noise")


def read_truth(path: Path) -> Truth:
    """The truth at ``path``; ReflectanceFitError with every problem found."""
    document = load(path)
    check_schema(document, "truth")
    return validate(document, Truth)


def write_truth(truth: Truth, path: Path) -> None:
    """Write ``path``, whole or not at all."""
    data = truth.model_dump(mode="json", by_alias=True, exclude_none=True)
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True)
    write_whole(path, lambda part: part.write_text(text, encoding="utf-8"))
