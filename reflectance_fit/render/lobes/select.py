"""The few things that code for vectors has to say differently."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import types
from numba.extending import intrinsic

from reflectance_fit.physics.jit import vectorised

Number = TypeVar("Number")


def _like(typing_context: Any, value: Any, number: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.cast(builder, arguments[0], value, number)

    return number(value, number), generate


# A constant in the type of another number: a literal would turn float32 into float64, at half the speed.
like = cast(Callable[[float, float], float], intrinsic(_like))


def _sel(typing_context: Any, condition: Any, a: Any, b: Any) -> Any:
    kind = typing_context.unify_types(a, b)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.select(*arguments)

    return kind(types.boolean, kind, kind), generate


sel = cast(Callable[[bool, Any, Any], Any], intrinsic(_sel))


@vectorised
def cos_sin_turn(u: float) -> tuple[float, float]:
    """Cosine and sine of 2 pi u, for u in [0, 1]; unit length within 4 ulp.

    Notes
    -----
    Taylor series on an eighth of a turn (u is folded twice, both exactly); the first term left out is below
    2e-17.
    """
    one, half = like(1.0, u), like(0.5, u)
    quarter, eighth = like(0.25, u), like(0.125, u)
    # From the turn to a half turn, to a quarter, to an eighth; the signs and the swap come back below.
    lower = u > half
    x = sel(lower, one - u, u)
    left = x > quarter
    x = sel(left, half - x, x)
    steep = x > eighth
    x = sel(steep, quarter - x, x) * like(6.283185307179586, u)
    z = x * x
    sine = like(-7.647163731819816e-13, u) * z + like(1.6059043836821613e-10, u)
    sine = sine * z + like(-2.505210838544172e-08, u)
    sine = sine * z + like(2.7557319223985893e-06, u)
    sine = sine * z + like(-0.0001984126984126984, u)
    sine = sine * z + like(0.008333333333333333, u)
    sine = sine * z + like(-0.16666666666666666, u)
    sine = x + x * z * sine
    cosine = like(4.779477332387385e-14, u) * z + like(-1.1470745597729725e-11, u)
    cosine = cosine * z + like(2.08767569878681e-09, u)
    cosine = cosine * z + like(-2.755731922398589e-07, u)
    cosine = cosine * z + like(2.48015873015873e-05, u)
    cosine = cosine * z + like(-0.001388888888888889, u)
    cosine = cosine * z + like(0.041666666666666664, u)
    cosine = one - half * z + z * z * cosine
    across, up = sel(steep, sine, cosine), sel(steep, cosine, sine)
    return sel(left, -across, across), sel(lower, -up, up)
