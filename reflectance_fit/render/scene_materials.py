"""Keys of a scene that say what surfaces are made of."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from reflectance_fit.manifests import Block, Number, Text
from reflectance_fit.render.scene_spectra import Absorption, Index, Reflectance, Textured
from reflectance_fit.render.scene_types import known_type, type_of


class Lambertian(Block):
    type: Literal["lambertian"]
    reflectance: Textured = Field(
        description="Share of light in [0, 1]: a number, [r, g, b] linear sRGB, a table, a texture"
    )


class Interface(Block):
    """Exactly one of material, report, eta."""

    material: Text | None = Field(default=None, description="A built-in material, as N-BK7 or gold")
    report: Text | None = Field(default=None, description="A report.yaml inside the folder of this file")
    eta: Index | None = Field(default=None, description="Relative to vacuum: a number, [R, G, B] or a table")
    roughness: Annotated[Number, Field(ge=0, le=1)] = Field(
        default=0.0, description="alpha of GGX; 0: smooth"
    )

    @model_validator(mode="before")
    @classmethod
    def _transparent(cls, value: Any) -> Any:
        if isinstance(value, dict) and "k" in value and "k" not in cls.model_fields:
            raise ValueError("k goes with type: conductor; what lets light through is taken not to absorb")
        return value

    @model_validator(mode="after")
    def _one_source(self) -> Interface:
        if len(self.model_fields_set & {"material", "report", "eta"}) != 1:
            raise ValueError("give exactly one of material (a built-in one), report (a fitted one), eta")
        return self


class Dielectric(Interface):
    type: Literal["dielectric"]


class Conductor(Interface):
    type: Literal["conductor"]
    k: Absorption | None = Field(default=None, description="Extinction, beside eta; the index is eta + ik")

    @model_validator(mode="after")
    def _eta_and_k(self) -> Conductor:
        if (self.eta is None) != (self.k is None):
            raise ValueError("eta and k go together; give both")
        return self


class Plastic(Interface):
    type: Literal["plastic"]
    reflectance: Reflectance = Field(description="Of the base below the coat, in [0, 1]")


class Polarizer(Block):
    type: Literal["polarizer"]
    axis_deg: Number = Field(description="Transmission axis, from the shape's u towards its v")
    diattenuation: Annotated[Number, Field(gt=0, le=1)] = Field(
        default=1.0, description="(T_max - T_min) / (T_max + T_min); 1 is ideal"
    )


class Retarder(Block):
    type: Literal["retarder"]
    fast_axis_deg: Number = Field(description="From the shape's u towards its v")
    retardance_deg: Number = Field(description="90: a quarter-wave plate")


Material = Annotated[
    Annotated[Lambertian, Tag("lambertian")]
    | Annotated[Dielectric, Tag("dielectric")]
    | Annotated[Conductor, Tag("conductor")]
    | Annotated[Plastic, Tag("plastic")]
    | Annotated[Polarizer, Tag("polarizer")]
    | Annotated[Retarder, Tag("retarder")],
    Discriminator(type_of),
    known_type("lambertian", "dielectric", "conductor", "plastic", "polarizer", "retarder"),
]
