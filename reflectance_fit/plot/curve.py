"""The model between the measured points, and how far the posterior lets it move."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.observations import Observations, Quantity
from reflectance_fit.plot.series import Panel
from reflectance_fit.plot.style import thin
from reflectance_fit.priors import NUISANCES
from reflectance_fit.result import Fit

FloatArray = NDArray[np.float64]

DRAWS = 200
POINTS = 181
BAND = (2.5, 16.0, 84.0, 97.5)


class Predict(Protocol):
    """Model values in each row's own unit, shape (D, N), gains re-estimated for each of D draws.

    A draw with a higher index has a lower gain; with the optimum's gain it
    would miss the data it was accepted for, and bands would be far too wide.
    """

    def __call__(
        self,
        observations: Observations,
        eta: FloatArray,
        k: FloatArray,
        nuisances: dict[str, FloatArray],
    ) -> FloatArray: ...


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A model curve as drawn: ``band`` holds the percentiles of ``BAND``, shape (4, G)."""

    x: FloatArray
    best: FloatArray
    band: FloatArray


class Model:
    """The optimum followed by draws of the posterior, ready to be evaluated on any rows."""

    def __init__(self, fit: Fit, predict: Predict) -> None:
        best, draws = fit.optimum, fit.posterior
        free = {name: thin(draws.flat(name), DRAWS) for name in draws.samples}
        self._eta = np.append(best.eta, free["eta"])
        self._k = np.append(best.k, free["k"])
        self._nuisances = {
            name: np.append(best.parameters.get(name, NUISANCES[name].neutral), free[name])
            for name in free
            if name in NUISANCES
        }
        self._predict = predict
        self._fit = fit

    def gain(self, rows: Observations) -> FloatArray:
        """The optimum's gain of each row, 1 where the value is absolute."""
        return np.array([self._fit.optimum.gains.get(str(group), 1.0) for group in rows.gain_group])

    def curves(self, panel: Panel) -> list[Curve]:
        """The curve through each series of a panel, signals divided by their gain."""
        observations = self._fit.observations
        abscissas, nearest = [], []
        for series in panel.series:
            measured = getattr(observations, panel.abscissa)[series.rows]
            x = self._grid(panel.abscissa, measured)
            abscissas.append(x)
            nearest.append(series.rows[np.argmin(np.abs(x[:, None] - measured), axis=1)])
        scanned: Any = {panel.abscissa: np.concatenate(abscissas)}
        rows = replace(observations.select(np.concatenate(nearest)), **scanned)
        values = self._predict(rows, self._eta, self._k, self._nuisances) / self.gain(rows)
        if panel.kind == Quantity.DELTA_DEG:
            values = values[0] + turn(values - values[0])
        band = np.percentile(values[1:], BAND, axis=0)
        ends = np.cumsum([len(x) for x in abscissas])[:-1]
        each = abscissas, np.split(values[0], ends), np.split(band, ends, axis=1)
        return [Curve(*parts) for parts in zip(*each, strict=True)]

    def _grid(self, abscissa: str, measured: FloatArray) -> FloatArray:
        if abscissa != "theta_deg":
            return np.linspace(measured.min() - 5, measured.max() + 5, POINTS)
        # The offset is added to every angle: no curve point may leave 0 to 90 degrees.
        offset = self._nuisances.get("angle_offset_deg", np.zeros(1))
        return np.linspace(max(0.0, -offset.min()), 90.0 - max(0.0, offset.max()), POINTS)


def turn(difference: FloatArray) -> FloatArray:
    """A difference of two angles in degrees, by the short way round; half turns keep their sign."""
    return np.where(np.abs(difference) <= 180.0, difference, (difference + 180.0) % 360.0 - 180.0)
