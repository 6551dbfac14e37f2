"""A finished fit's model on any rows: what a plot draws between the points."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.forward import (
    ETA,
    FIRST_NUISANCE,
    FIRST_SIGMA,
    K,
    neutral_vector,
    predict_vectors,
)
from reflectance_fit.inference.likelihood import evaluate
from reflectance_fit.inference.rows import estimated_names, gain_names, pack
from reflectance_fit.observations import Observations
from reflectance_fit.priors import NUISANCES
from reflectance_fit.result import Fit

FloatArray = NDArray[np.float64]


def predictor(fit: Fit) -> Callable[..., FloatArray]:
    """A function of (observations, eta, k, nuisances) that evaluates ``fit``'s model.

    eta, k and each nuisance have shape (D,); missing nuisances are neutral.
    It returns values in each row's unit, shape (D, N), every draw with the
    gains that the fitted data give it.
    """
    measured = pack(fit.observations, fit.exterior_ior)._replace(heavy_tailed=fit.noise == "student_t")
    gains = gain_names(fit.observations)
    largest = dict(zip(map(str, fit.observations.gain_group), measured.largest, strict=True))
    sigmas = [fit.estimated_sigma[name] for name in estimated_names(fit.observations)]
    work = np.empty((2, len(fit.observations)))

    def predict(
        observations: Observations, eta: FloatArray, k: FloatArray, nuisances: Mapping[str, FloatArray]
    ) -> FloatArray:
        scale = np.array([largest[str(group)] for group in observations.gain_group])
        index = [gains.index(str(group)) if group else -1 for group in observations.gain_group]
        rows = pack(observations, fit.exterior_ior)._replace(largest=scale, gain=np.array(index))
        vectors = np.tile(neutral_vector(len(sigmas)), (len(eta), 1))
        vectors[:, ETA], vectors[:, K] = eta, k
        vectors[:, FIRST_SIGMA:] = np.log(sigmas)
        for name, values in nuisances.items():
            vectors[:, FIRST_NUISANCE + NUISANCES[name].index] = values
        out = np.empty((len(eta), len(observations)))
        own = np.empty(len(gains))
        for d in range(len(eta)):
            evaluate(measured, vectors[d], work[0], work[1], own)
            out[d] = predict_vectors(rows, vectors[d : d + 1], own)[0]
        return out

    return predict
