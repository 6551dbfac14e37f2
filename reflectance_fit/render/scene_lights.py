"""Keys of a scene that say where light comes from."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from reflectance_fit.manifests import Number, Positive, Text
from reflectance_fit.manifests import Polarization as State
from reflectance_fit.render.scene import Polarization
from reflectance_fit.render.scene_shapes import Direction, Disk, Rectangle, Sphere, Vector, along, vector
from reflectance_fit.render.scene_spectra import Emission, Encoding, Table
from reflectance_fit.render.scene_types import known_type, type_of


class _Polarized(State):
    """State of emitted light; no key: unpolarized."""

    linear_deg: Number | None = Field(
        default=None, description="Linear polarization, counter-clockwise from axis for the receiver"
    )
    axis: Direction | None = Field(
        default=None,
        description="Direction that S1 > 0 refers to, seen along the ray; default: up, [0, 0, 1]",
    )

    @model_validator(mode="after")
    def _axis_of_something(self) -> _Polarized:
        if self.axis is not None and not self._named():
            raise ValueError("axis goes with stokes, linear_deg or circular; add one or remove it")
        return self

    def polarization(self) -> Polarization:
        """S0 = 1: how bright the light is stands elsewhere."""
        s0, s1, s2, s3 = self.vector()
        return Polarization((1.0, s1 / s0, s2 / s0, s3 / s0), vector(self.axis or (0.0, 0.0, 1.0)))


def _shines(value: Any) -> None:
    if not any(value.values if isinstance(value, Table) else value if isinstance(value, tuple) else (value,)):
        raise ValueError("a light of 0 everywhere is none; make it brighter or remove it")


class PointLight(_Polarized):
    type: Literal["point"]
    position: Vector = Field(description="[x, y, z]")
    intensity: Emission = Field(description="Power per solid angle")

    @model_validator(mode="after")
    def _bright(self) -> PointLight:
        _shines(self.intensity)
        return self


class DirectionalLight(_Polarized):
    type: Literal["directional"]
    direction: Direction = Field(description="In which the light travels")
    irradiance: Emission = Field(description="On a plane at right angles to it")

    @model_validator(mode="after")
    def _bright(self) -> DirectionalLight:
        _shines(self.irradiance)
        if self.polarization().is_polarized and along(self.axis or (0.0, 0.0, 1.0), self.direction):
            raise ValueError("axis lies along direction, where it names no polarization; choose another axis")
        return self


class _AreaLight(_Polarized):
    radiance: Emission = Field(description="Of its front, alike in all directions")

    @model_validator(mode="after")
    def _bright(self) -> _AreaLight:
        _shines(self.radiance)
        return self


class SphereLight(_AreaLight, Sphere):
    type: Literal["sphere"]


class RectangleLight(_AreaLight, Rectangle):
    type: Literal["rectangle"]


class DiskLight(_AreaLight, Disk):
    type: Literal["disk"]


class Environment(_Polarized):
    """From all directions that meet nothing."""

    type: Literal["environment"]
    radiance: Emission | None = Field(default=None, description="Alike in all directions")
    image: Text | None = Field(
        default=None,
        description="Latitude-longitude picture, EXR, HDR or PNG, inside the folder of this file",
    )
    encoding: Encoding | None = Field(default=None, description="PNG: how its values follow light")
    scale: Positive | None = Field(default=None, description="Factor of the image's values; default: 1")

    @model_validator(mode="after")
    def _one_source(self) -> Environment:
        if (self.radiance is None) == (self.image is None):
            raise ValueError("give exactly one of radiance, image")
        if self.radiance is not None:
            if self.encoding is not None or self.scale is not None:
                raise ValueError("encoding and scale go with image; remove them")
            _shines(self.radiance)
        return self


Light = Annotated[
    Annotated[PointLight, Tag("point")]
    | Annotated[DirectionalLight, Tag("directional")]
    | Annotated[SphereLight, Tag("sphere")]
    | Annotated[RectangleLight, Tag("rectangle")]
    | Annotated[DiskLight, Tag("disk")]
    | Annotated[Environment, Tag("environment")],
    Discriminator(type_of),
    known_type("point", "directional", "sphere", "rectangle", "disk", "environment"),
]
