"""The nine dispersion formulas of refractiveindex.info, as functions of wavelength.

Every formula takes ``wavelength_um`` (micrometres, positive, any shape) and its
``coefficients`` C1, C2, ... in the order of the database, and returns the index n
in the shape of the wavelength; in the equations, w is the wavelength.  Where an
equation has no real solution (next to a resonance) a formula gives NaN;
``index_from_formula`` checks, and raises.  Nothing here knows the range over
which a set of coefficients was fitted: that belongs to the data file.

Equations: M. N. Polyanskiy, "Dispersion formulas", refractiveindex.info
database (CC0), doc/Dispersion formulas.pdf; described in Sci. Data 11, 94
(2024), https://doi.org/10.1038/s41597-023-02898-2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def sellmeier(wavelength_um: ArrayLike, coefficients: Sequence[float]) -> FloatArray:
    """Formula 1: n^2 - 1 = C1 + C2 w^2 / (w^2 - C3^2) + C4 w^2 / (w^2 - C5^2) + ...

    Resonances in micrometres.  W. Sellmeier, Ann. Phys. 219, 272 (1871).
    """
    w2 = _squared(wavelength_um)
    return _root(1 + coefficients[0] + sum((b * w2 / (w2 - c**2) for b, c in _pairs(coefficients)), 0 * w2))


def sellmeier_2(wavelength_um: ArrayLike, coefficients: Sequence[float]) -> FloatArray:
    """Formula 2: n^2 - 1 = C1 + C2 w^2 / (w^2 - C3) + C4 w^2 / (w^2 - C5) + ...

    Resonances already squared, in square micrometres: the form of the Schott catalogue.
    """
    w2 = _squared(wavelength_um)
    return _root(1 + coefficients[0] + sum((b * w2 / (w2 - c) for b, c in _pairs(coefficients)), 0 * w2))


def polynomial(wavelength_um: ArrayLike, coefficients: Sequence[float]) -> FloatArray:
    """Formula 3: n^2 = C1 + C2 w^C3 + C4 w^C5 + ...

    With exponents 2, -2, -4, -6, -8 it is the older formula of the Schott and Ohara catalogues.
    """
    return _root(_power_series(wavelength_um, coefficients))


def refractiveindex_info(wavelength_um: ArrayLike, coefficients: Sequence[float]) -> FloatArray:
    """Formula 4: n^2 = C1 + C2 w^C3 / (w^2 - C4^C5) + C6 w^C7 / (w^2 - C8^C9) + C10 w^C11 + ...

    The database's own mixture of formulas 1 to 3.
    """
    w = np.asarray(wavelength_um, dtype=float)
    total = coefficients[0] + 0 * w
    for i in range(1, min(9, len(coefficients)), 4):
        b, p, c, q = coefficients[i : i + 4]
        total = total + b * w**p / (w**2 - c**q)
    return _root(total + _power_series(w, [0.0, *coefficients[9:]]))


def cauchy(wavelength_um: ArrayLike, coefficients: Sequence[float]) -> FloatArray:
    """Formula 5: n = C1 + C2 w^C3 + C4 w^C5 + ...

    With exponents -2 and -4 it is Cauchy's equation.  A. L. Cauchy, Memoire sur la
    dispersion de la lumiere (1836).
    """
    return _power_series(wavelength_um, coefficients)


def gases(wavelength_um: ArrayLike, coefficients: Sequence[float]) -> FloatArray:
    """Formula 6: n - 1 = C1 + C2 / (C3 - w^-2) + C4 / (C5 - w^-2) + ...

    Resonances as squared wavenumbers, per square micrometre: the form of Edlen and
    Ciddor for air.
    """
    wavenumber2 = 1 / _squared(wavelength_um)
    return (
        1 + coefficients[0] + sum((b / (c - wavenumber2) for b, c in _pairs(coefficients)), 0 * wavenumber2)
    )


def herzberger(wavelength_um: ArrayLike, coefficients: Sequence[float]) -> FloatArray:
    """Formula 7: n = C1 + C2 L + C3 L^2 + C4 w^2 + C5 w^4 + C6 w^6, with L = 1 / (w^2 - 0.028).

    M. Herzberger, Opt. Acta 6, 197 (1959); later C may be absent and are then 0.
    """
    w2 = _squared(wavelength_um)
    pole = 1 / (w2 - 0.028)
    c = coefficients
    return c[0] + c[1] * pole + c[2] * pole**2 + sum((b * w2**i for i, b in enumerate(c[3:], 1)), 0 * w2)


def retro(wavelength_um: ArrayLike, coefficients: Sequence[float]) -> FloatArray:
    """Formula 8: (n^2 - 1) / (n^2 + 2) = C1 + C2 w^2 / (w^2 - C3) + C4 w^2.

    The Lorentz-Lorenz form used by H. Schroeter, Z. Phys. 67, 24 (1931).
    """
    w2 = _squared(wavelength_um)
    c1, c2, c3, c4 = coefficients
    refraction = c1 + c2 * w2 / (w2 - c3) + c4 * w2
    return _root((1 + 2 * refraction) / (1 - refraction))


def exotic(wavelength_um: ArrayLike, coefficients: Sequence[float]) -> FloatArray:
    """Formula 9: n^2 = C1 + C2 / (w^2 - C3) + C4 (w - C5) / ((w - C5)^2 + C6).

    Used for urea: M. J. Rosker, K. Cheng and C. L. Tang, IEEE J. Quantum Electron. 21, 1600 (1985).
    """
    w = np.asarray(wavelength_um, dtype=float)
    c1, c2, c3, c4, c5, c6 = coefficients
    return _root(c1 + c2 / (w**2 - c3) + c4 * (w - c5) / ((w - c5) ** 2 + c6))


_ODD = tuple(range(1, 18, 2))
_FORMULAS: dict[int, tuple[Callable[[ArrayLike, Sequence[float]], FloatArray], tuple[int, ...]]] = {
    1: (sellmeier, _ODD),
    2: (sellmeier_2, _ODD),
    3: (polynomial, _ODD),
    4: (refractiveindex_info, (1, 5, *_ODD[4:])),
    5: (cauchy, _ODD),
    6: (gases, _ODD),
    7: (herzberger, (3, 4, 5, 6)),
    8: (retro, (4,)),
    9: (exotic, (6,)),
}


def index_from_formula(number: int, wavelength_um: ArrayLike, coefficients: Sequence[float]) -> FloatArray:
    """The index n by refractiveindex.info's formula of this number.

    Parameters
    ----------
    number : int
        1 to 9.
    wavelength_um : float, shape S
        Wavelength in micrometres, positive and finite.
    coefficients : sequence of float
        C1, C2, ... as the database lists them.

    Returns
    -------
    n : float, shape S
        Finite and positive.

    Raises
    ------
    ValueError
        Unknown formula, wrong number of coefficients, a wavelength that is not
        positive, or no positive real index at one of the wavelengths.
    """
    if number not in _FORMULAS:
        raise ValueError(f"there is no formula {number}; the formulas are 1 to {max(_FORMULAS)}")
    formula, counts = _FORMULAS[number]
    if len(coefficients) not in counts:
        allowed = ", ".join(str(count) for count in counts)
        raise ValueError(f"formula {number} takes {allowed} coefficients, not {len(coefficients)}")
    if not np.all(np.isfinite(coefficients)):
        raise ValueError(f"the coefficients of formula {number} must be finite")
    w = np.asarray(wavelength_um, dtype=float)
    # Written so that NaN fails too.
    if not np.all((w > 0) & (w < np.inf)):
        raise ValueError("the wavelength must be positive and finite, in micrometres")
    with np.errstate(all="ignore"):
        n = formula(w, coefficients)
        bad = ~((n > 0) & (n < np.inf))
    if np.any(bad):
        raise ValueError(f"formula {number} has no positive real index at {w[bad].flat[0]:g} um")
    return n


def _squared(wavelength_um: ArrayLike) -> FloatArray:
    return np.asarray(wavelength_um, dtype=float) ** 2


def _root(n_squared: FloatArray) -> FloatArray:
    root: FloatArray = np.sqrt(n_squared)
    return root


def _pairs(coefficients: Sequence[float]) -> Iterator[tuple[float, float]]:
    """(C2, C3), (C4, C5), ..."""
    return zip(coefficients[1::2], coefficients[2::2], strict=True)


def _power_series(wavelength_um: ArrayLike, coefficients: Sequence[float]) -> FloatArray:
    w = np.asarray(wavelength_um, dtype=float)
    return coefficients[0] + sum((b * w**p for b, p in _pairs(coefficients)), 0 * w)
