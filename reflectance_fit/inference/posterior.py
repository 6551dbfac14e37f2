"""The posterior by emcee: four independent ensembles, judged by nested R-hat.

One ensemble cannot certify itself: walkers trapped in one mode agree with one
another.  Four that start apart can, and nested R-hat (Margossian et al. 2024,
superchain = ensemble) compares them.  R-hat and ESS are arviz-stats', the
autocorrelation time emcee's own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import emcee
import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference import batch
from reflectance_fit.inference.checkpoint import Block, Journal
from reflectance_fit.inference.ensembles import SeparateEnsembles
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.rows import Rows
from reflectance_fit.result import Chains, Posterior

FloatArray = NDArray[np.float64]

ENSEMBLES = 4
WALKERS = 128  # an ensemble; of 64 to 256, the most independent draws a second
BLOCK = 125  # steps between two looks at convergence
MAX_STEPS = 8000
MIN_ESS = 4000.0
LIMIT_ESS = 1000.0  # for a quantile that only bounds: its own error is then 4 % of it
MAX_RHAT = 1.01
# Half of emcee's rule for a single ensemble, because four are compared and R-hat and ESS judge too.
STEPS_PER_TAU = 25
KEPT_DRAWS = 40  # a walker, evenly thinned; more would repeat correlated draws
_TAU_POINTS, _TAU_WALKERS = 8, 32
_TEMPERATURE = 10.0


class Starts(NamedTuple):
    """Points among which walkers start, shape (M, P), the log density they were drawn with, and the basin of each."""

    points: FloatArray
    log_proposal: FloatArray
    basin: NDArray[np.int64]


def sample(
    model: Model,
    rows: Rows,
    starts: Starts,
    seed: tuple[int, ...],
    *,
    min_ess: float = MIN_ESS,
    progress: Callable[[int, int], None] | None = None,
) -> Posterior:
    """Sample ``model`` until converged or MAX_STEPS.

    The first walkers are chosen among ``starts`` by their density: they should
    cover every basin and the prior.
    ``seed`` starts the stream.  ``min_ess`` is the effective
    sample size asked of every parameter.  ``progress`` is called with
    (steps done, steps at most).
    """
    dimensions = len(model.names)
    walkers = max(WALKERS, 4 * dimensions)

    log_density = log_posterior(model, rows)
    density = log_density(starts.points)
    bits = np.random.MT19937(np.random.SeedSequence(seed))
    generator = np.random.Generator(bits)
    first = np.concatenate([_first_walkers(starts, density, walkers, generator) for _ in range(ENSEMBLES)])
    sampler = emcee.EnsembleSampler(
        ENSEMBLES * walkers, dimensions, log_density, vectorize=True, moves=_moves()
    )
    state = emcee.State(first, random_state=np.random.RandomState(bits).get_state())
    # The densities of the first walkers stand for the data.
    settings = (
        emcee.__version__,
        model.name,
        model.names,
        model.priors,
        seed,
        min_ess,
        MAX_STEPS,
    )
    job = (
        repr((*settings, BLOCK, MAX_RHAT, STEPS_PER_TAU)).encode()
        + first.tobytes()
        + log_density(first).tobytes()
    )
    journal = Journal("-".join(map(str, seed)), job)
    earlier = iter(journal.blocks)
    blocks: list[Block] = []

    while True:
        block = next(earlier, None)
        if block is None:
            # The first block is burnt, so it comes with a second.
            block = _advance(sampler, state, BLOCK if blocks else 2 * BLOCK)
            journal.append(block)
        state = _state(block)
        blocks.append(block)
        # (step, walker, parameter)
        whole = np.concatenate([b.chain for b in blocks])
        steps = len(whole)
        if progress:
            progress(steps, MAX_STEPS)
        burn_in = max(steps // 3, BLOCK)
        # (walker, step, parameter) without burn-in; the walkers of an ensemble follow one another.
        chains = whole[burn_in:].transpose(1, 0, 2)
        ess, rhat = _diagnose(model, chains)
        # Of some walkers: the estimate averages over them, and the transforms take time.
        some = whole[:, :: ENSEMBLES * walkers // _TAU_WALKERS]
        long_enough = steps >= STEPS_PER_TAU * _tau(some)
        converged = long_enough and min(ess.values()) >= min_ess and max(rhat.values()) <= MAX_RHAT
        if converged or steps >= MAX_STEPS:
            break

    kept = np.linspace(0, chains.shape[1] - 1, min(KEPT_DRAWS, chains.shape[1])).round().astype(int)
    thinned = chains[:, kept]
    tau_steps, tau = _tau_curve(some)
    # (ensemble, step, parameter)
    mean_walker = np.stack(np.split(whole, ENSEMBLES, axis=1)).mean(axis=2)
    return Posterior(
        model=model.name,
        method="emcee",
        names=model.names,
        samples=model.samples(thinned),
        log_density=np.concatenate([b.log_density for b in blocks])[burn_in:].T[:, kept],
        ensemble=np.repeat(np.arange(ENSEMBLES), walkers),
        ess=ess,
        converged=converged,
        chains=Chains(
            steps=steps,
            burn_in=burn_in,
            acceptance=sum(float(b.accepted.mean()) for b in blocks) / steps,
            rhat_nested=rhat,
            tau_steps=tau_steps,
            tau=tau,
            trace=np.stack(list(model.in_report_units(mean_walker).values()), axis=-1),
        ),
    )


def _advance(sampler: emcee.EnsembleSampler, state: emcee.State, steps: int) -> Block:
    sampler.reset()
    after = sampler.run_mcmc(state, steps, progress=False)
    _, key, position, has_gauss, gauss = after.random_state
    return Block(
        chain=sampler.get_chain(),
        log_density=sampler.get_log_prob(),
        accepted=sampler.backend.accepted.astype(np.int64),
        key=key,
        position=np.array(position),
        has_gauss=np.array(has_gauss),
        gauss=np.array(gauss),
    )


def _state(block: Block) -> emcee.State:
    """Where the next block starts."""
    random = ("MT19937", block.key, int(block.position), int(block.has_gauss), float(block.gauss))
    return emcee.State(block.chain[-1], log_prob=block.log_density[-1], random_state=random)


def log_posterior(model: Model, rows: Rows) -> Callable[[FloatArray], FloatArray]:
    """The log posterior density as a function of coordinates, shape (D, P), up to a constant."""

    likelihood = batch.log_likelihood(model, rows)

    def log_density(x: FloatArray) -> FloatArray:
        prior = model.log_prior(x)
        inside = np.isfinite(prior)
        out = np.full(len(x), -np.inf)
        out[inside] = prior[inside] + likelihood(model.full(x[inside]))
        return out

    return log_density


def _moves() -> list[tuple[emcee.moves.Move, float]]:
    """Differential evolution, a tenth of it with gamma 1, which jumps between modes.

    Of the mixes with stretch and snooker moves tried on tables of 4 to 76
    rows, the most independent draws a second.
    """
    return [(SeparateEnsembles(ENSEMBLES), 0.9), (SeparateEnsembles(ENSEMBLES, gamma=1.0), 0.1)]


def _first_walkers(
    starts: Starts,
    log_density: FloatArray,
    walkers: int,
    generator: np.random.Generator,
) -> FloatArray:
    """Walkers drawn from the starting points by their tempered density, no point twice.

    Tempered, so that ensembles start wider than they end; by density, so that
    a ridge gets its share.  Between basins not tempered: each gets walkers by
    its mass, as the points weigh it, because a walker finds the way out of a
    minor mode only by others that are there too, and one alone never would.
    """
    from scipy.special import logsumexp

    allowed = np.isfinite(log_density)
    if allowed.sum() < 2 * walkers:
        raise ValueError("too few of the starting points have a finite posterior")
    points, proposal, basin = (column[allowed] for column in starts)
    density = log_density[allowed]
    log_weights = density / _TEMPERATURE
    for each in np.unique(basin):
        mine = basin == each
        log_weights[mine] += logsumexp(density[mine] - proposal[mine]) - logsumexp(log_weights[mine])
    # The largest of log weight + Gumbel noise: weighted sampling without replacement.
    keys = log_weights + generator.gumbel(size=len(log_weights))
    return np.asarray(points[np.argsort(keys)[-walkers:]])


def _diagnose(model: Model, chains: FloatArray) -> tuple[dict[str, float], dict[str, float]]:
    """Bulk ESS and nested R-hat of every parameter, from (walker, step, parameter)."""
    from arviz_stats.base import array_stats

    ids = np.repeat(np.arange(ENSEMBLES), len(chains) // ENSEMBLES)
    ess, rhat = {}, {}
    for j, name in enumerate(model.names):
        parameter = chains[..., j]
        ess[name] = float(array_stats.ess(parameter, chain_axis=0, draw_axis=1))
        rhat[name] = float(array_stats.rhat_nested(parameter, superchain_ids=ids, chain_axis=0, draw_axis=1))
    return ess, rhat


def _tau_curve(chain: FloatArray) -> tuple[FloatArray, FloatArray]:
    """emcee's autocorrelation time, the largest over parameters, against the steps it was taken from."""
    steps = np.unique(np.geomspace(50, len(chain), _TAU_POINTS).astype(int))
    return steps.astype(float), np.array([_tau(chain[:n]) for n in steps])


def _tau(chain: FloatArray) -> float:
    """The largest autocorrelation time, from (step, walker, parameter).

    A walker that never moved has no autocorrelation; while there is one, the
    chain's own length is the honest lower bound.
    """
    if np.any(np.ptp(chain, axis=0) == 0):
        return float(len(chain))
    return float(np.max(emcee.autocorr.integrated_time(chain, quiet=True, tol=0)))
