"""Keys of a scene that place shapes, and the shapes that they stand for."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from reflectance_fit.manifests import Block, Number
from reflectance_fit.render import scene

# Beyond, single precision cannot tell a surface from what lies on it.
FARTHEST = 1e6
SMALLEST = 1e-6
# What five digits of an edge leave, as 0.70711.
_RIGHT_ANGLE = 1e-4


def _not_zero(vector: tuple[float, ...]) -> tuple[float, ...]:
    if math.hypot(*vector) < SMALLEST:
        raise ValueError("has no length; give it a direction")
    return vector


def across(u: tuple[float, ...], v: tuple[float, ...]) -> bool:
    """Whether two vectors are at right angles, as well as files state them."""
    return abs(sum(a * b for a, b in zip(u, v, strict=True))) <= _RIGHT_ANGLE * math.hypot(*u) * math.hypot(
        *v
    )


def along(u: tuple[float, ...], v: tuple[float, ...]) -> bool:
    """Whether two vectors lie in one line."""
    return math.hypot(*np.cross(u, v)) <= _RIGHT_ANGLE * math.hypot(*u) * math.hypot(*v)


def vector(values: tuple[float, ...]) -> scene.Vector:
    x, y, z = values
    return float(x), float(y), float(z)


Coordinate = Annotated[Number, Field(ge=-FARTHEST, le=FARTHEST)]
Length = Annotated[Number, Field(ge=SMALLEST, le=FARTHEST)]
Vector = Annotated[tuple[Coordinate, ...], Field(min_length=3, max_length=3)]
Direction = Annotated[Vector, AfterValidator(_not_zero)]


class Sphere(Block):
    center: Vector = Field(description="[x, y, z]")
    radius: Length = Field(description="Above 0")

    def shape(self) -> scene.Sphere:
        return scene.Sphere(vector(self.center), self.radius)


class Rectangle(Block):
    center: Vector = Field(description="[x, y, z]")
    u: Direction = Field(description="From the centre to the middle of one edge")
    v: Direction = Field(
        description="From the centre to the middle of the next edge; the front is along u x v"
    )

    @model_validator(mode="after")
    def _right_angle(self) -> Rectangle:
        if not across(self.u, self.v):
            raise ValueError("u and v must be at right angles")
        return self

    def shape(self) -> scene.Rectangle:
        u = np.array(self.u)
        # Exactly at right angles, for frames are made of them.
        v = np.array(self.v) - u * (np.dot(u, self.v) / np.dot(u, u))
        return scene.Rectangle(vector(self.center), vector(self.u), vector(tuple(v)))


class Disk(Block):
    center: Vector = Field(description="[x, y, z]")
    radius: Length = Field(description="Above 0")
    normal: Direction = Field(description="The front is along it")
    u: Direction | None = Field(
        default=None, description="In the disk, where sheets count angles from; default: horizontal"
    )

    @model_validator(mode="after")
    def _right_angle(self) -> Disk:
        if self.u is not None and not across(self.u, self.normal):
            raise ValueError("u must be at right angles to normal")
        return self

    def shape(self) -> scene.Disk:
        normal = np.array(self.normal) / math.hypot(*self.normal)
        u = np.array([1.0, 0.0, 0.0]) if along(self.normal, (0, 0, 1)) else np.cross([0, 0, 1], normal)
        if self.u is not None:
            u = np.array(self.u)
        u = u - normal * np.dot(normal, u)
        u *= self.radius / np.linalg.norm(u)
        return scene.Disk(vector(self.center), vector(tuple(normal)), vector(tuple(u)))


class Plane(Block):
    point: Vector = Field(description="Any point of it")
    normal: Direction = Field(description="The front is along it")

    def shape(self) -> scene.Plane:
        return scene.Plane(vector(self.point), vector(self.normal))


class Box(Block):
    center: Vector = Field(description="[x, y, z]")
    size: Annotated[tuple[Length, ...], Field(min_length=3, max_length=3)] = Field(
        description="Along x, y and z before it is turned"
    )
    turn_deg: Number = Field(default=0.0, description="About the vertical z, counter-clockwise from above")

    def faces(self) -> list[scene.Rectangle]:
        """Its six sides, fronts outward."""
        turn = math.radians(self.turn_deg)
        c, s = math.cos(turn), math.sin(turn)
        halves = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) * np.array(self.size)[:, None] / 2
        center = np.array(self.center)
        found = []
        for i in range(3):
            n, u, v = halves[i], halves[(i + 1) % 3], halves[(i + 2) % 3]
            for side, first in ((n, u), (-n, -u)):
                found.append(scene.Rectangle(*(vector(tuple(x)) for x in (center + side, first, v))))
        return found


class Placed(Block):
    """Exactly one shape."""

    sphere: Sphere | None = Field(default=None, description="A sphere; dielectrics lie inside")
    rectangle: Rectangle | None = Field(default=None, description="Flat, four right angles")
    disk: Disk | None = Field(default=None, description="Flat and round")
    plane: Plane | None = Field(default=None, description="Flat, without end")
    box: Box | None = Field(default=None, description="Six rectangles, fronts outward")

    @model_validator(mode="after")
    def _one_shape(self) -> Placed:
        if len(self.model_fields_set & set(Placed.model_fields)) != 1:
            raise ValueError(f"give exactly one shape: {', '.join(Placed.model_fields)}")
        return self

    def shapes(self) -> list[scene.Shape]:
        if self.box is not None:
            return [*self.box.faces()]
        one = self.sphere or self.rectangle or self.disk or self.plane
        return [one.shape()] if one else []
