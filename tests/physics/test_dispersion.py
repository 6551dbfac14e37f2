"""Each formula against a published index, and against its equation written out by hand.

Coefficients are those of the refractiveindex.info database (CC0), file named in each case.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

from reflectance_fit.physics.dispersion import index_from_formula

# number, coefficients, wavelength um, published index, tolerance (its last digit), provenance
PUBLISHED = [
    pytest.param(
        1,
        [0, 0.6961663, 0.0684043, 0.4079426, 0.1162414, 0.8974794, 9.896161],
        0.5876,
        1.45846,
        1e-5,
        id="1 fused silica: Malitson 1965, table 1",
    ),
    pytest.param(
        2,
        [0, 1.03961212, 0.00600069867, 0.231792344, 0.0200179144, 1.01046945, 103.560653],
        0.5875618,
        1.51680,
        1e-5,
        id="2 N-BK7: Schott data sheet, n_d",
    ),
    pytest.param(
        3,
        [2.5613591, -0.01200739, 2, 0.020780357, -2, 0.001425606, -4, -0.00011027477, -6, 1.1477786e-05, -8],
        0.5875618,
        1.620955,
        1e-6,
        id="3 TIM11: Ohara catalogue, n_d",
    ),
    pytest.param(
        4,
        [5.913, 0.2441, 0, 0.0803, 1, 0, 0, 0, 1],
        0.5893,
        2.6124,
        1e-3,
        id="4 rutile, ordinary: n_D of Palik's Handbook",
    ),
    pytest.param(
        5,
        [1.35265, 0.00306, -2, 0.00002, -4],
        0.5893,
        1.3614,
        5e-4,
        id="5 ethanol, 20 C: n_D of the CRC Handbook",
    ),
    pytest.param(6, [0, 0.032953, 90.392], 0.5893, 1.000376, 1e-6, id="6 ammonia, 0 C: n_D of Kaye and Laby"),
    pytest.param(
        7,
        [3.41983, 0.159906, -0.123109, 1.26878e-6, -1.95104e-9],
        10.0,
        3.4179,
        5e-3,
        id="7 silicon, 10 um (Edwards): Salzberg and Villa 1957",
    ),
    pytest.param(
        8,
        [0.452505, 0.09939, 0.070537, -0.000150],
        0.5893,
        2.253,
        5e-3,
        id="8 silver bromide (Schroeter): n_D of the CRC Handbook",
    ),
    pytest.param(
        9,
        [2.51527, 0.0240, 0.0300, 0.020, 1.52, 0.8771],
        0.5893,
        1.606,
        1e-3,
        id="9 urea, extraordinary (Rosker): about 1.60 to 1.61",
    ),
]


@pytest.mark.parametrize(("number", "coefficients", "wavelength_um", "published", "tolerance"), PUBLISHED)
def test_meets_a_published_index(number, coefficients, wavelength_um, published, tolerance):
    assert index_from_formula(number, wavelength_um, coefficients) == pytest.approx(published, abs=tolerance)


def by_hand(number: int, w: float, c: list[float]) -> float:
    """Every term written out, as on refractiveindex.info, C1 being c[0]; w in micrometres."""
    if number == 1:
        return sqrt(1 + c[0] + c[1] * w**2 / (w**2 - c[2] ** 2) + c[3] * w**2 / (w**2 - c[4] ** 2))
    if number == 2:
        return sqrt(1 + c[0] + c[1] * w**2 / (w**2 - c[2]) + c[3] * w**2 / (w**2 - c[4]))
    if number == 3:
        return sqrt(c[0] + c[1] * w ** c[2] + c[3] * w ** c[4])
    if number == 4:
        resonances = c[1] * w ** c[2] / (w**2 - c[3] ** c[4]) + c[5] * w ** c[6] / (w**2 - c[7] ** c[8])
        return sqrt(c[0] + resonances + c[9] * w ** c[10] + c[11] * w ** c[12])
    if number == 5:
        return c[0] + c[1] * w ** c[2] + c[3] * w ** c[4]
    if number == 6:
        return 1 + c[0] + c[1] / (c[2] - w**-2) + c[3] / (c[4] - w**-2)
    if number == 7:
        pole = 1 / (w**2 - 0.028)
        return c[0] + c[1] * pole + c[2] * pole**2 + c[3] * w**2 + c[4] * w**4 + c[5] * w**6
    if number == 8:
        y = c[0] + c[1] * w**2 / (w**2 - c[2]) + c[3] * w**2
        return sqrt((1 + 2 * y) / (1 - y))
    return sqrt(c[0] + c[1] / (w**2 - c[2]) + c[3] * (w - c[4]) / ((w - c[4]) ** 2 + c[5]))


# Every coefficient different and every one in use, so that a swapped pair shows.
GENERIC = {
    1: [0.1, 0.7, 0.11, 0.4, 9.0],
    2: [0.1, 0.7, 0.012, 0.4, 90.0],
    3: [2.3, -0.01, 2.0, 0.02, -2.0],
    4: [2.1, 0.2, 0.5, 0.3, 2.0, 0.15, 1.5, 0.2, 3.0, -0.01, 2.0, 0.003, -3.0],
    5: [1.5, 0.004, -2.0, 0.0003, -4.0],
    6: [0.00001, 0.05, 238.0, 0.0017, 57.0],
    7: [1.5, 0.003, 0.0002, -0.004, 0.0003, 0.00005],
    8: [0.25, 0.05, 0.02, -0.003],
    9: [2.5, 0.02, 0.03, 0.05, 1.5, 0.9],
}


@pytest.mark.parametrize("number", GENERIC)
def test_equals_its_equation_written_out(number):
    wavelengths_um = np.array([[0.4, 0.55, 0.7], [0.9, 1.1, 1.3]])
    expected = [[by_hand(number, w, GENERIC[number]) for w in row] for row in wavelengths_um.tolist()]
    n = index_from_formula(number, wavelengths_um, GENERIC[number])
    assert n.shape == wavelengths_um.shape
    np.testing.assert_allclose(n, expected, rtol=1e-14)


@pytest.mark.parametrize("number", GENERIC)
def test_a_scalar_gives_a_scalar_and_nothing_is_modified(number):
    coefficients = list(GENERIC[number])
    wavelengths_um = np.array([0.5, 0.6])
    wavelengths_um.setflags(write=False)
    n = index_from_formula(number, wavelengths_um, coefficients)
    assert isinstance(index_from_formula(number, 0.5, coefficients), float)
    assert index_from_formula(number, 0.5, coefficients) == n[0]
    assert coefficients == GENERIC[number]


@pytest.mark.parametrize("number", [3, 4, 5])
def test_a_constant_alone_is_a_constant_index(number):
    expected = 1.5 if number == 5 else sqrt(1.5)
    np.testing.assert_allclose(
        index_from_formula(number, [0.4, 0.8], [1.5]), [expected, expected], rtol=1e-15
    )


@pytest.mark.parametrize(
    ("number", "wavelength_um", "coefficients", "message"),
    [
        (0, 0.5, [1.5], "no formula 0"),
        (10, 0.5, [1.5], "1 to 9"),
        (1, 0.5, [], "not 0"),
        (1, 0.5, [0, 0.7], "not 2"),
        (4, 0.5, [1, 2, 3], "takes 1, 5, 9,"),
        (7, 0.5, [1, 2], "takes 3, 4, 5, 6 coefficients"),
        (8, 0.5, [1, 2, 3], "takes 4 coefficients"),
        (9, 0.5, [1, 2, 3, 4, 5], "takes 6 coefficients"),
        (5, 0.0, [1.5], "positive and finite"),
        (5, -0.5, [1.5], "positive and finite"),
        (5, np.nan, [1.5], "positive and finite"),
        (5, np.inf, [1.5], "positive and finite"),
        (5, 0.5, [np.nan], "coefficients of formula 5 must be finite"),
        (3, 0.5, [-1.0], "no positive real index at 0.5 um"),
        (5, [0.5, 0.6], [0.55, -1.0, 1.0], "at 0.6 um"),
        (2, [0.7, 0.5], [0, 0.7, 0.25], "at 0.5 um"),  # on the resonance itself
    ],
)
def test_refuses_what_gives_no_index(number, wavelength_um, coefficients, message):
    with pytest.raises(ValueError, match=message):
        index_from_formula(number, wavelength_um, coefficients)
