"""Random numbers as a function of seed, pixel, sample and dimension, so that nothing depends on who draws first."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from numba import types
from numba.extending import intrinsic

from reflectance_fit.physics.jit import vectorised
from reflectance_fit.render.kernels.lanes import (
    DEPTH,
    DRAWS,
    KEY,
    SAMPLE,
    Has,
    Words,
    i32,
    u32,
)
from reflectance_fit.render.lobes.select import like


def _reversed_bits(typing_context: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitreverse(arguments[0])

    return types.uint32(types.uint32), generate


reversed_bits = cast(Callable[[int], int], intrinsic(_reversed_bits))


@vectorised
def mix(x: int) -> int:
    """A permutation of 32 bits in which every bit in changes every bit out with probability near 1/2.

    Notes
    -----
    Wellons, "hash-prospector", with the constants that T. Ettinger found for it.
    """
    x = u32(x ^ u32(x >> u32(16)))
    x = u32(x * u32(0x21F0AAAD))
    x = u32(x ^ u32(x >> u32(15)))
    x = u32(x * u32(0xD35A2D97))
    return u32(x ^ u32(x >> u32(15)))


@vectorised
def unit(word: int, number: float) -> float:
    """Upper 24 bits as a number in [0, 1) of the type of ``number``."""
    return like(i32(u32(word >> u32(8))), number) * like(2.0**-24, number)


@vectorised
def _scrambled(x: int, seed: int) -> int:
    """Owen's scrambling of the reversed bits of ``x``: each bit is flipped by the ones above it.

    Notes
    -----
    Burley, "Practical Hash-based Owen Scrambling", J. Comput. Graph. Tech. 9 (2020) no. 4, after Laine and
    Karras, with N. Vegdahl's constants.
    """
    x = u32(x ^ u32(x * u32(0x3D20ADEA)))
    x = u32(x + seed)
    x = u32(x * u32(u32(seed >> u32(16)) | u32(1)))
    x = u32(x ^ u32(x * u32(0x05526C56)))
    return u32(x ^ u32(x * u32(0x53A22864)))


@vectorised
def _second(x: int) -> int:
    """Reversed bits of Sobol's second coordinate of point number ``x``: Pascal's triangle modulo 2 times its bits."""
    x = u32(x ^ u32(u32(x & u32(0xAAAAAAAA)) >> u32(1)))
    x = u32(x ^ u32(u32(x & u32(0xCCCCCCCC)) >> u32(2)))
    x = u32(x ^ u32(u32(x & u32(0xF0F0F0F0)) >> u32(4)))
    x = u32(x ^ u32(u32(x & u32(0xFF00FF00)) >> u32(8)))
    return u32(x ^ u32(u32(x & u32(0xFFFF0000)) >> u32(16)))


@vectorised
def prepared(sobol: tuple[int, ...], start: int, pixel: int, group: int, number: int) -> tuple[int, int]:
    """What ``pair`` takes as key and sample for sample ``number`` of a pixel's group; ``start`` comes from the seed."""
    word = u32(u32(mix(pixel) ^ start) + u32(group * u32(0x9E3779B1)))
    if len(sobol) > 0:
        return mix(word), reversed_bits(number)
    return mix(u32(word + u32(number * u32(0x85EBCA77)))), number


@vectorised
def pair(sobol: tuple[int, ...], key: int, sample: int, dimension: int, number: float) -> tuple[float, float]:
    """Two numbers in [0, 1): of an Owen-scrambled (0, 2)-sequence in a shuffled order, or independent ones.

    ``key`` and ``sample`` are ``prepared``; independent numbers have a key for each sample.
    """
    seed = mix(u32(key + u32(dimension * u32(0x9E3779B9))))
    if len(sobol) > 0:
        other = mix(u32(seed ^ u32(0x85EBCA6B)))
        third = mix(u32(other + u32(0xC2B2AE35)))
        index = reversed_bits(_scrambled(sample, seed))
        first = reversed_bits(_scrambled(index, other))
        return unit(first, number), unit(reversed_bits(_scrambled(_second(index), third)), number)
    return unit(seed, number), unit(mix(u32(seed ^ u32(0x85EBCA6B))), number)


@vectorised
def draw(has: Has, I: Words, j: int, number: int, one: float) -> tuple[float, float]:
    """Pair ``number`` below DRAWS of the ray that lane j follows."""
    dimension = u32(u32(I[DEPTH + j] * u32(DRAWS)) + u32(number))
    return pair(has.sobol, I[KEY + j], I[SAMPLE + j], dimension, one)
