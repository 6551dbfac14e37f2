"""Keys of a scene that hold a quantity over wavelength: one number, three, or a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from reflectance_fit.manifests import Block, Number, Text, Wavelength
from reflectance_fit.render.scene import Spectrum

N = TypeVar("N")
B = TypeVar("B")

Encoding = Literal["srgb", "linear"]
Share = Annotated[Number, Field(ge=0, le=1)]
# Far beyond any lamp, and small enough that products of a few stay finite in single precision.
Light = Annotated[Number, Field(ge=0, le=1e9)]
Eta = Annotated[Number, Field(gt=0, le=100)]
K = Annotated[Number, Field(ge=0, le=100)]


class Table(Block):
    """Straight lines between rows, held constant beyond the ends."""

    wavelength_nm: Annotated[tuple[Wavelength, ...], Field(min_length=1)] = Field(
        description="Vacuum wavelengths, increasing"
    )
    values: tuple[Number, ...] = Field(description="One for each wavelength")

    @model_validator(mode="after")
    def _matched(self) -> Table:
        if len(self.values) != len(self.wavelength_nm):
            raise ValueError(
                f"{len(self.wavelength_nm)} wavelengths but {len(self.values)} values; give as many of each"
            )
        if any(b <= a for a, b in zip(self.wavelength_nm, self.wavelength_nm[1:], strict=False)):
            raise ValueError("wavelength_nm must increase, each wavelength once")
        return self


class ShareTable(Table):
    values: tuple[Share, ...] = Field(description="One for each wavelength, in [0, 1]")


class LightTable(Table):
    values: tuple[Light, ...] = Field(description="One for each wavelength, 0 or above")


class EtaTable(Table):
    values: tuple[Eta, ...] = Field(description="One for each wavelength, above 0")


class KTable(Table):
    values: tuple[K, ...] = Field(description="One for each wavelength, 0 or above")


class Texture(Block):
    texture: Text = Field(description="Picture inside the folder of this file: PNG, EXR or HDR")
    encoding: Encoding | None = Field(default=None, description="PNG: how its values follow light")


def _spelling(value: Any) -> str:
    if isinstance(value, dict):
        return "texture" if "texture" in value else "table"
    if isinstance(value, Texture):
        return "texture"
    return "table" if isinstance(value, Table) else "triple" if isinstance(value, list | tuple) else "number"


_Values = Annotated[
    Annotated[N, Tag("number")]
    | Annotated[Annotated[tuple[N, ...], Field(min_length=3, max_length=3)], Tag("triple")]
    | Annotated[B, Tag("table")],
    Discriminator(_spelling),
]
Reflectance = _Values[Share, ShareTable]
Textured = Annotated[
    Annotated[Share, Tag("number")]
    | Annotated[Annotated[tuple[Share, ...], Field(min_length=3, max_length=3)], Tag("triple")]
    | Annotated[ShareTable, Tag("table")]
    | Annotated[Texture, Tag("texture")],
    Discriminator(_spelling),
]
Emission = _Values[Light, LightTable]
Index = _Values[Eta, EtaTable]
Absorption = _Values[K, KTable]


def spectrum(value: float | Sequence[float] | Table) -> Spectrum:
    """The checked value as the renderer takes it."""
    if isinstance(value, Table):
        return Spectrum(np.array(value.values), np.array(value.wavelength_nm))
    return Spectrum(np.atleast_1d(np.array(value, dtype=float)))
