"""Do the residuals scatter, or do they bend?

Where the residuals themselves gave the sigma, chi2 is 1 a degree of freedom
whatever the model, and says nothing.  The order of their signs still does: of
independent residuals the number of runs of equal sign is known (Wald &
Wolfowitz, Ann. Math. Stat. 11, 147, 1940), and drop-outs of a few rows do not
matter to it.
"""

from __future__ import annotations

import math

import numpy as np

from reflectance_fit.result import Fit

FEWEST = 20  # of rows, for the count to be normal


def too_few_runs(fit: Fit) -> float | None:
    """Standard deviations by which runs are missing along angle and analyzer, over all groups of equal gain.

    None where every sigma was stated, or rows are too few to say.
    """
    o, residuals = fit.observations, fit.optimum.residuals
    if not fit.estimated_sigma:
        return None
    missing, variance = 0.0, 0.0
    groups = np.char.add(np.char.add(o.gain_group, "|"), o.quantity)
    for group in np.unique(groups):
        members = np.flatnonzero(groups == group)
        order = np.lexsort((np.nan_to_num(o.analyzer_deg[members]), o.theta_deg[members]))
        above = residuals[members[order]] > np.median(residuals[members])
        n, positive = len(above), int(above.sum())
        product = 2.0 * positive * (n - positive)
        if n < FEWEST or product == 0:
            continue
        runs = 1 + int(np.count_nonzero(above[1:] != above[:-1]))
        missing += product / n + 1 - runs
        variance += product * (product - n) / (n * n * (n - 1))
    return missing / math.sqrt(variance) if variance > 0 else None
