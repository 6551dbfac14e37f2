"""Area lights of uniform radiance, seen from a receiver with position and normal.

Rectangles and disks shine from one side, that of their normal; spheres outwards.
`irradiance` is the closed form; `light_integrals` has the integrals it solves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reflectance_fit.physics.radiometry import checked_direction, checked_point, checked_power

Floats = NDArray[np.float64]

_RIGHT_ANGLE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class RectangleLight:
    """Corner, two perpendicular edges from it, shape (3,) each, and radiance.

    Shines to the side of u x v, the one from which the turn from u to v is counter-clockwise.
    """

    corner: ArrayLike
    edge_u: ArrayLike
    edge_v: ArrayLike
    radiance: float = 1.0

    def __post_init__(self) -> None:
        checked_power(self.radiance, "radiance")
        checked_point(self.corner, "corner")
        u, v = checked_direction(self.edge_u, "edge_u"), checked_direction(self.edge_v, "edge_v")
        if abs(float(u @ v)) > _RIGHT_ANGLE:
            raise ValueError("the edges of a rectangle light must be perpendicular")

    @property
    def corners(self) -> Floats:
        """Shape (4, 3), counter-clockwise as seen from the bright side."""
        corner, u, v = (np.asarray(x, dtype=np.float64) for x in (self.corner, self.edge_u, self.edge_v))
        return np.stack([corner, corner + u, corner + u + v, corner + v])

    @property
    def edges(self) -> Floats:
        """Shape (4, 3): from each corner to the next."""
        u, v = np.asarray(self.edge_u, dtype=np.float64), np.asarray(self.edge_v, dtype=np.float64)
        return np.stack([u, v, -u, -v])

    @property
    def normal(self) -> Floats:
        """Unit vector to the bright side."""
        unit = checked_direction(self.edge_u, "edge_u"), checked_direction(self.edge_v, "edge_v")
        return checked_direction(np.cross(*unit), "normal")


@dataclass(frozen=True, slots=True, eq=False)
class DiskLight:
    """Center and normal, shape (3,) each, radius and radiance; shines to the side of its normal."""

    center: ArrayLike
    normal: ArrayLike
    radius: float
    radiance: float = 1.0

    def __post_init__(self) -> None:
        checked_power(self.radiance, "radiance")
        checked_point(self.center, "center")
        checked_direction(self.normal, "normal")
        _check_radius(self.radius)


@dataclass(frozen=True, slots=True, eq=False)
class SphereLight:
    """Center, shape (3,), radius and radiance; shines outwards."""

    center: ArrayLike
    radius: float
    radiance: float = 1.0

    def __post_init__(self) -> None:
        checked_power(self.radiance, "radiance")
        checked_point(self.center, "center")
        _check_radius(self.radius)

    def checked_distance(self, position: Floats) -> tuple[Floats, Floats]:
        """Vector from position to the center, (..., 3), and its length; ValueError inside the sphere."""
        towards = np.asarray(self.center, dtype=np.float64) - position
        distance = np.linalg.norm(towards, axis=-1)
        if not np.all(distance > self.radius):
            raise ValueError("the receiver lies on or inside the sphere light; move it out")
        return towards, distance


Light = RectangleLight | DiskLight | SphereLight
# Factor of a light's radiance, from unit vectors (..., 3) from the receiver to the light.
Weight = Callable[[Floats], Floats]


def _check_radius(radius: float) -> None:
    if not 0.0 < radius < np.inf:
        raise ValueError("the radius of a light must be positive and finite")
