"""Is it a BRDF?  Reciprocity, energy conservation and sign of any function given to the checks.

Directions come from Sobol' sequences (scipy), so a run repeats for its seed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from reflectance_fit.physics.brdf import Brdf, mirrored
from reflectance_fit.physics.hemisphere import direction
from reflectance_fit.physics.reflection import directional_albedo

Floats = NDArray[np.float64]

# Rounding in a lobe of width w is an ulp over w^2: that of a lobe of 1e-4 rad is 1e-8.
_SAME = 1e-6
_LEAST_ANGLE = 1e-6
_GRAZING = np.pi / 2.0 - 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class ReciprocityCheck:
    """The pair of directions, shape (3,), for which f(a, b) and f(b, a) differ most.

    ``violation`` is their difference over the larger modulus, in [0, 2].
    """

    violation: float
    incoming: Floats
    outgoing: Floats
    value: float
    swapped: float

    @property
    def reciprocal(self) -> bool:
        """Whether the two agree to rounding, 1e-6 for the sharpest lobes."""
        return self.violation <= _SAME


@dataclass(frozen=True, slots=True, eq=False)
class EnergyCheck:
    """The largest directional albedo, its direction of incidence, shape (3,), and the least BRDF value.

    ``converged`` is false where a quadrature missed its tolerance: then the
    albedo of some direction is known to ``error``, the largest estimate, at best.
    """

    albedo: float
    error: float
    incoming: Floats
    least: float
    converged: bool

    @property
    def conserves(self) -> bool:
        """Whether no more light leaves than arrives, none is negative, and all quadratures converged."""
        return self.converged and self.albedo <= 1.0 + 1e-8 and self.least >= 0.0


def check_reciprocity(brdf: Brdf, log2_pairs: int = 13, seed: int = 0) -> ReciprocityCheck:
    """Compare f(a, b) with f(b, a) on 2^log2_pairs pairs, half of them close to mirror directions.

    The latter are 1e-6 to 1 rad off (log-uniform), so that a lobe however sharp is met where it is large.

    Parameters
    ----------
    brdf : function of incoming, outgoing
        See `brdf`.
    log2_pairs : int
        At least 1.
    seed : int
        Of the scrambled sequence.

    Raises
    ------
    ValueError
        If the BRDF is NaN or infinite somewhere.
    """
    u = qmc.Sobol(5, rng=np.random.default_rng(seed)).random_base2(log2_pairs)
    a, b = (direction(np.arccos(u[:, i]), 2.0 * np.pi * u[:, i + 1]) for i in (0, 2))
    step = _LEAST_ANGLE ** u[:, 4]
    near = mirrored(a) + step[:, None] * (b - mirrored(a))
    near = near / np.linalg.norm(near, axis=-1, keepdims=True)
    b = np.where((np.arange(len(a)) % 2 == 0)[:, None], b, near)
    forth, back = _checked(brdf(a, b)), _checked(brdf(b, a))
    larger = np.maximum(np.maximum(np.abs(forth), np.abs(back)), np.finfo(np.float64).tiny / 1e-16)
    violation = np.abs(forth - back) / larger
    i = int(np.argmax(violation))
    return ReciprocityCheck(float(violation[i]), a[i], b[i], float(forth[i]), float(back[i]))


def check_energy(brdf: Brdf, log2_directions: int = 5, seed: int = 0) -> EnergyCheck:
    """Find the largest `directional_albedo` over directions of incidence, and any negative value.

    Parameters
    ----------
    brdf : function of incoming, outgoing
        See `brdf`.
    log2_directions : int
        2^log2_directions directions, uniform in theta and phi, besides the normal and four within 1e-3 rad of
        grazing.  Each costs a quadrature: about 0.1 s for a smooth BRDF, more for a sharp one.
    seed : int
        Of the scrambled sequence.

    Raises
    ------
    ValueError
        If the BRDF is NaN or infinite somewhere.

    Notes
    -----
    What the quadrature can and cannot see: `reflection.outgoing_radiance`.
    """
    u = qmc.Sobol(2, rng=np.random.default_rng(seed)).random_base2(log2_directions)
    sampled = direction(u[:, 0] * _GRAZING, 2.0 * np.pi * u[:, 1])
    ends = direction([0.0, *[_GRAZING] * 4], [0.0, 0.3, 1.9, 3.4, 5.0])
    beams = np.concatenate([sampled, ends])
    albedos = [directional_albedo(brdf, beam) for beam in beams]
    worst = int(np.argmax([albedo.value for albedo in albedos]))
    return EnergyCheck(
        albedos[worst].value,
        max(albedo.error for albedo in albedos),
        beams[worst],
        float(np.min(_checked(brdf(beams[:, None], beams[None, :])))),
        all(albedo.converged for albedo in albedos),
    )


def _checked(values: Floats) -> Floats:
    if not np.all(np.isfinite(values)):
        raise ValueError("the BRDF is NaN or infinite somewhere")
    return values
