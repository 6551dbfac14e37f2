"""``scene.yaml``: what its keys are.

The models state each key by itself and print as a JSON Schema that editors
complete from.  What entries and files say about one another is checked in
scene_file.py.  docs/formats/scene.md is the same in prose.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Discriminator, Field, Tag, model_validator

from reflectance_fit.manifests import Block, Number, Text, Wavelength
from reflectance_fit.render.scene_lights import Light
from reflectance_fit.render.scene_materials import Material
from reflectance_fit.render.scene_shapes import Direction, Length, Placed, Vector, along

Pixels = Annotated[int, Field(strict=True, ge=1, le=8192)]


def _spelling(value: Any) -> str:
    return "name" if isinstance(value, str) else "block"


class SurfaceEntry(Placed):
    """A shape of a material."""

    material: Annotated[
        Annotated[Text, Tag("name")] | Annotated[Material, Tag("block")], Discriminator(_spelling)
    ] = Field(description="A name under materials, or the material itself")
    name: Text | None = Field(default=None, description="For messages")


class Camera(Block):
    position: Vector = Field(description="[x, y, z]")
    target: Vector = Field(description="What is in the middle of the picture")
    up: Direction = Field(default=(0.0, 0.0, 1.0), description="Up in the picture")
    size_px: Annotated[tuple[Pixels, ...], Field(min_length=2, max_length=2)] = Field(
        description="[width, height]"
    )
    fov_deg: Annotated[Number, Field(gt=0, lt=180)] | None = Field(
        default=None, description="Perspective: horizontal field of view; default: 40"
    )
    width: Length | None = Field(default=None, description="Orthographic: width of what is seen")
    analyzer_deg: Number | None = Field(
        default=None,
        description="Transmission axis of an analyzer before the lens, counter-clockwise from the picture's horizontal",
    )
    channels_nm: Annotated[tuple[Wavelength, ...], Field(min_length=3, max_length=3)] = Field(
        default=(600.0, 550.0, 450.0), description="Wavelengths that stand for R, G and B"
    )

    @model_validator(mode="after")
    def _a_view(self) -> Camera:
        if self.fov_deg is not None and self.width is not None:
            raise ValueError("give fov_deg (perspective) or width (orthographic), not both")
        view = tuple(t - p for t, p in zip(self.target, self.position, strict=True))
        if not any(view):
            raise ValueError("target is where the camera stands; move one of them")
        if along(view, self.up):
            raise ValueError("up is along the view; choose another direction")
        return self


class SceneBlock(Block):
    """Shapes, materials, lights and a camera."""

    model_config = ConfigDict(title="reflectance_fit scene")

    schema_: Literal["reflectance_fit/scene/1"] = Field(alias="schema", description="Format and version")
    camera: Camera | None = Field(default=None, description="May be absent from included files alone")
    exterior_ior: Annotated[Number, Field(gt=0, le=10)] = Field(
        default=1.000277, description="Index of what lies between the shapes; default: air"
    )
    max_depth: Annotated[int, Field(strict=True, ge=1, le=1000)] = Field(
        default=8, description="Longest path, in rays: 1 shows lights alone"
    )
    include: tuple[Text, ...] = Field(
        default=(), description="Scene files whose materials, surfaces and lights are added"
    )
    materials: dict[Text, Material] = Field(default={}, description="Name to material")
    surfaces: tuple[SurfaceEntry, ...] = Field(default=(), description="What light meets")
    lights: tuple[Light, ...] = Field(default=(), description="Where light comes from")
