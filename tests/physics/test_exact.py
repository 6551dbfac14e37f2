"""Pairs of float64 against rational numbers, which do not round."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.physics.exact import Pair, pair, square

NUMBERS = st.floats(1e-60, 1e60) | st.floats(-1e60, -1e-60)
ROUNDING = Fraction(1, 2**100)


def exact(value):
    return Fraction(float(value.high)) + Fraction(float(value.low))


@st.composite
def pairs(draw):
    """Two words, the second anywhere below the first."""
    high = draw(NUMBERS)
    return pair(high) + high * draw(st.floats(-1e-16, 1e-16))


def close(found, expected, scale=None):
    return abs(exact(found) - expected) <= ROUNDING * abs(scale if scale is not None else expected)


@given(a=NUMBERS)
def test_a_square_is_exact(a):
    assert exact(square(a)) == Fraction(a) ** 2


@given(a=NUMBERS, b=NUMBERS)
def test_the_sum_of_two_numbers_is_exact_to_two_words(a, b):
    total = Fraction(a) + Fraction(b)
    assert close(pair(a) + b, total)
    assert close(a - pair(b), Fraction(a) - Fraction(b))


@given(a=pairs(), b=pairs())
def test_every_operation_keeps_thirty_digits(a, b):
    x, y = exact(a), exact(b)
    assert close(a + b, x + y)
    assert close(a - b, x - y)
    assert close(a * b, x * y)
    assert close(a / b, x / y)


@given(a=pairs())
def test_the_root_squared_is_the_number(a):
    a = a if a.high > 0 else -a
    assert close(a.sqrt() * a.sqrt(), exact(a))


def test_the_root_of_zero_and_of_a_tiny_number():
    tiny = pair([0.0, 5e-324, 1e-300, 4e-280]).sqrt()
    assert tiny.high == pytest.approx([0.0, np.sqrt(5e-324), 1e-150, 2e-140], rel=1e-15)
    assert np.all(np.abs(tiny.low) <= np.spacing(tiny.high))
    subnormal = np.geomspace(5e-324, 1e-285, 2000)
    assert (pair(subnormal).sqrt()).high == pytest.approx(np.sqrt(subnormal), rel=1e-15)


@given(a=pairs(), b=pairs())
def test_the_low_word_is_below_the_last_place_of_the_high(a, b):
    for result in (a + b, a * b, a / b):
        assert isinstance(result, Pair)
        assert abs(result.low) <= np.spacing(abs(result.high))


def test_an_array_on_the_left_gives_pairs_too():
    left = np.array([1.0, 2.0]) * pair([3.0, 4.0])
    assert isinstance(left, Pair)
    assert list(left.high) == [3.0, 8.0]
