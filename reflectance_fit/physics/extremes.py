"""Where squares of squares leave the range of float64: the plain formulas in decimal numbers of 100 digits.

Indices above 1e21 or below 1e-21, transmittances below 1e-240, an interface
that differs from none by less than 1e-120.  Decimals have room for every
exponent, and 100 digits are more than two float64 can cancel, so one
evaluation serves all rungs.  It costs some 0.1 ms an element.
"""

from __future__ import annotations

import decimal

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.rungs import Core, Floats

_DIGITS = 100
# The kernels form eighth powers of the index; pairs need 53 more bits below the result.
_LARGE, _SMALL = 2.0**70, 2.0**-70
_MATCHED, _MATCHED_AT_GRAZING, _GRAZING = 2.0**-400, 2.0**-180, 2.0**-90
_FAINT = 2.0**-800


def out_of_range(c: Floats, eta: Floats, eta_minus_one: Floats, k: Floats) -> NDArray[np.bool_]:
    """Where the compiled kernels would overflow or underflow, shape of c."""
    distance = np.maximum(np.abs(eta_minus_one), k)
    large = np.maximum(eta, k) > _LARGE
    small = np.maximum(eta, k) < _SMALL
    matched = (distance < _MATCHED) | ((distance < _MATCHED_AT_GRAZING) & (c < _GRAZING))
    # Transmittance goes with c eta k beyond the critical angle.
    faint = (c > 0.0) & ((c < _FAINT) | ((k > 0.0) & (c * eta * k < _FAINT)))
    result: NDArray[np.bool_] = large | small | matched | faint
    return result


def in_decimals(core: Core, *arguments: Floats) -> NDArray[np.float64]:
    """What a core of ``rungs`` gives in decimals, shape (4, N); NaN where it divides zero by zero.

    ``arguments`` are the core's: c, sine, eta, eta_minus_one and k, shape (N,).
    """
    context = decimal.Context(prec=_DIGITS, traps=[], Emax=decimal.MAX_EMAX, Emin=decimal.MIN_EMIN)
    with decimal.localcontext(context):
        c, sine, eta, eta_minus_one, k = (
            np.array([decimal.Decimal(float(x)) for x in values], dtype=object) for values in arguments
        )
        near = (arguments[2] >= 0.5) & (arguments[2] <= 2.0)
        eta = np.where(near, eta_minus_one + 1, eta)
        eta_minus_one = np.where(near, eta_minus_one, eta - 1)
        return np.array([[float(x) for x in row] for row in core(c, sine, eta, eta_minus_one, k)])
