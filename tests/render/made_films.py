"""Films that nobody rendered: physical Stokes vectors from random numbers."""

import numpy as np

from reflectance_fit.render.film import Film


def film(mode, shape=(5, 7), seed=0, level=1.0):
    """Its light is polarized to at most 0.9, and its errors are a tenth of its radiance."""
    rng = np.random.default_rng(seed)
    channels = 1 if mode == "scalar" else 3
    s0 = level * rng.uniform(0.1, 4.0, (*shape, channels))
    if mode not in ("polarized", "spectral_polarized"):
        mean = s0[..., None]
    else:
        direction = rng.normal(size=(*shape, channels, 3))
        direction *= rng.uniform(0, 0.9, (*shape, channels, 1)) / np.linalg.norm(
            direction, axis=-1, keepdims=True
        )
        mean = s0[..., None] * np.concatenate([np.ones((*shape, channels, 1)), direction], axis=-1)
    error = np.broadcast_to(0.1 * s0[..., None], mean.shape)
    return Film(mode=mode, mean=mean, error=error, samples=16)
