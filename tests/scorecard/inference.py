"""Posteriors that can be trusted: calibration, coverage, recovery, choice and verdicts of the fit, by simulation."""

from __future__ import annotations

import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Protocol, TypeVar

import inference_optimizer
from card import Figure, Table
from inference_calibration import calibration_figures, trial
from inference_captures import SEED
from inference_families import FAMILIES
from inference_faults import DIM, FAULTS, control, fault_figures, planted, truncated
from inference_plan import plan_figures
from inference_quadrature import LEAST_ESS, SCENES, compared, quadrature_figures
from inference_recovery import (
    DESIGNS,
    MATERIALS,
    NUISANCES,
    disturbed,
    recovered,
    recovery_figures,
    robust_figures,
)
from inference_verdicts import BLIND, DIELECTRIC, GLASS_STEEP, METAL, verdict, verdict_figures

T = TypeVar("T")

PROCESSES = 2
THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
EMCEE_QUICK = ("absorbing plastic", "near Brewster")


@dataclass(frozen=True, slots=True)
class Size:
    """How many of everything."""

    importance: int  # truths a family
    emcee: int
    emcee_families: tuple[str, ...]
    fault: int
    cell: int  # captures of each material by each design
    robust: int
    good: int  # captures of dielectrics, and of metals
    blind: int  # of each kind
    least_ess: float = LEAST_ESS
    scenes: int = len(SCENES)


QUICK = Size(1000, 200, EMCEE_QUICK, fault=200, cell=200, robust=600, good=400, blind=100)
FULL = Size(
    3000,
    1000,
    tuple(family.name for family in FAMILIES),
    fault=600,
    cell=2000,
    robust=3000,
    good=3000,
    blind=300,
)


def about(*, full: bool) -> str:
    size = FULL if full else QUICK
    return (
        f"Seed {SEED}. Captures come from readable Fresnel and Mueller code that the fit does not use. Calibration: "
        f"{size.importance} truths of each of {len(FAMILIES)} families by importance sampling, {size.emcee} of each of "
        f"{len(size.emcee_families)} by emcee, from priors of eta, k and nuisances that the fit has too; gains from 1/g over a "
        "factor of 100, so bright that their prior does not matter; models given. Ranks are among 99 draws; bands of "
        "their ECDF are exact and hold at 99 % over all quantities and families of a method, as do the binomial bands of "
        f"coverage. Recovery: {size.cell} captures in each of {len(MATERIALS)} x {len(DESIGNS)} cells, optimum only. Disturbances: "
        f"{size.robust} captures of glass at 16 angles behind 4 analyzers, noise 0.05 % of a mirror's signal; priors as in the "
        f"contract, but a sigma of 0.02 for the polarizer. Choice: {size.good} captures each, model auto; inputs that cannot "
        f"know: {size.blind} of each kind. {inference_optimizer.about(full=full)}"
    )


def figures(*, full: bool) -> Iterator[Figure | Table]:
    yield from measured(FULL if full else QUICK)
    yield from plan_figures()
    with workers() as each:
        found = each(inference_optimizer.compared, inference_optimizer.scenes(full=full), "multistarts")
    yield from inference_optimizer.figures(found, full=full)


class Each(Protocol):
    def __call__(self, job: Callable[[int], T], n: int, what: str) -> list[T]: ...


@contextmanager
def workers() -> Iterator[Each]:
    """Processes, and the function that spreads a job over them."""
    os.environ.update(dict.fromkeys(THREADS, "1"))  # the workers' libraries read it as they are loaded
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(PROCESSES, context) as pool:

        def each(job: Callable[[int], T], n: int, what: str) -> list[T]:
            """``job`` of 0 to n - 1."""
            started = time.perf_counter()
            found = list(pool.map(job, range(n), chunksize=max(1, min(10, n // (4 * PROCESSES)))))
            print(f"{what}: {n} in {time.perf_counter() - started:.1f} s", file=sys.stderr, flush=True)
            return found

        yield each


def measured(size: Size) -> Iterator[Figure | Table]:
    """All but the optimiser's figures."""
    with workers() as each:
        healthy = {f.name: each(partial(trial, f, "importance"), size.importance, f.name) for f in FAMILIES}
        yield from calibration_figures("importance", healthy, FAMILIES)
        some = [family for family in FAMILIES if family.name in size.emcee_families]
        by_emcee = {f.name: each(partial(trial, f, "emcee"), size.emcee, f"{f.name}, emcee") for f in some}
        yield from calibration_figures("emcee", by_emcee, some)
        compare = partial(compared, least_ess=size.least_ess)
        comparisons = each(compare, size.scenes, "quadrature")
        yield from quadrature_figures(comparisons)
        healthy[DIM.name] = each(control, size.fault, DIM.name)
        faulty = {f.name: each(partial(planted, f), f.trials(size.fault), f.name) for f in FAULTS}
        yield from fault_figures(faulty, healthy, each(truncated, 1, "truncated chain")[0])
        cells = {
            (material, design): each(partial(recovered, material, design), size.cell, f"{material}, {design}")
            for material in MATERIALS
            for design in DESIGNS
        }
        yield from recovery_figures(cells)
        arms = [
            each(partial(disturbed, nuisances), size.robust, f"disturbed, {len(nuisances)} nuisances")
            for nuisances in (NUISANCES, {})
        ]
        yield from robust_figures(*arms)
        kinds = {DIELECTRIC: size.good, METAL: size.good, **dict.fromkeys((*BLIND, GLASS_STEEP), size.blind)}
        verdicts = {kind: each(partial(verdict, kind), n, kind) for kind, n in kinds.items()}
        yield from verdict_figures(verdicts)
