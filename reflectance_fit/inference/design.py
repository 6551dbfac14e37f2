"""Captures that could be made of a flat sample, and the angles at which they tell most.

A design is one kind of capture (a state of the light, and the camera's
settings to go through at every angle) at some angles of incidence.  The
signals of one angle share an unknown gain, so the information of angles adds
up, and a search needs each angle's only once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import cycle, islice

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.inference.fisher import information, posterior_covariance
from reflectance_fit.inference.forward import ETA, K, neutral_vector, predict_vectors
from reflectance_fit.inference.rows import pack
from reflectance_fit.observations import Flag, Observations, Quantity
from reflectance_fit.priors import Prior

FloatArray = NDArray[np.float64]
Noise = Callable[[FloatArray], FloatArray]

# What a capture needs besides camera and lamp; each has what comes before it.
EQUIPMENT = ("analyzer", "lamp polarizer", "quarter-wave plate")
COMMON_DEG = (30.0, 45.0, 60.0)
# Below 20 degrees lamp and camera are in each other's way; above 80 a sample is a line in the picture.
GRID_DEG = np.arange(20.0, 80.5, 2.5)
_QUARTER_WAVE_DEG = 90.0


@dataclass(frozen=True, slots=True)
class Kind:
    """What is done at every angle.

    ``settings`` are (analyzer_deg, retarder_deg), the latter None where no
    plate is in the beam; ``linear_deg`` is the light's polarization from s
    towards p, None for unpolarized light.
    """

    name: str
    equipment: str
    settings: tuple[tuple[float, float | None], ...]
    linear_deg: float | None = None

    @property
    def frames(self) -> int:
        """At each angle."""
        return len(self.settings)

    @property
    def light(self) -> FloatArray:
        """Stokes vector of power 1 in the (s, p) frame, shape (4,)."""
        if self.linear_deg is None:
            return np.array([1.0, 0.0, 0.0, 0.0])
        twice = np.radians(2 * self.linear_deg)
        return np.array([1.0, np.cos(twice), np.sin(twice), 0.0])


_S_P = ((0.0, None), (90.0, None))
_DIAGONAL = ((45.0, None), (135.0, None))
_PLATE = ((45.0, 0.0), (135.0, 0.0))
KINDS = (
    Kind("s and p", "analyzer", _S_P),
    Kind("four axes", "analyzer", _S_P + _DIAGONAL),
    *(
        Kind(
            f"lamp at {angle:g}, three axes",
            "lamp polarizer",
            ((0.0, None), (60.0, None), (120.0, None)),
            angle,
        )
        for angle in (30.0, 45.0, 60.0)
    ),
    *(
        Kind(f"lamp at {angle:g}, four axes", "lamp polarizer", _S_P + _DIAGONAL, angle)
        for angle in (30.0, 45.0, 60.0)
    ),
    Kind("lamp at 45, plate, four frames", "quarter-wave plate", (*_S_P, _DIAGONAL[0], _PLATE[0]), 45.0),
    Kind("lamp at 45, plate, six frames", "quarter-wave plate", _S_P + _DIAGONAL + _PLATE, 45.0),
)


@dataclass(frozen=True, slots=True)
class Design:
    """A kind of capture at angles of incidence, ascending; an angle that stands twice is photographed twice."""

    kind: Kind
    angles_deg: tuple[float, ...]

    @property
    def frames(self) -> int:
        return self.kind.frames * len(self.angles_deg)


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """The assumed material (relative to vacuum) and circumstances.

    ``noise`` gives one standard deviation of each signal, of light of power 1.
    ``nuisances`` map names to the sigma of their priors, that of
    ``dark_offset`` as a fraction of the largest signal.
    """

    eta: float
    k: float
    exterior_ior: float
    noise: Noise
    priors: Mapping[str, Prior]
    nuisances: Mapping[str, float]


def planned(design: Design, subject: Subject) -> Observations:
    """The rows that a capture by ``design`` would give, without noise."""
    kind, stations = design.kind, len(design.angles_deg)
    n = design.frames
    analyzer, retarder = np.array([[a, np.nan if r is None else r] for a, r in kind.settings]).T
    names = np.repeat([f"{i}" for i in range(stations)], kind.frames)
    rows = Observations(
        channel=np.full(n, "planned"),
        wavelength_nm=np.full(n, np.nan),
        set=names,
        gain_group=names,
        theta_deg=np.repeat(design.angles_deg, kind.frames).astype(float),
        theta_deg_sigma=np.zeros(n),
        theta_deg_spread=np.zeros(n),
        analyzer_deg=np.tile(analyzer, stations),
        retarder_deg=np.tile(retarder, stations),
        retardance_deg=np.tile(np.where(np.isnan(retarder), np.nan, _QUARTER_WAVE_DEG), stations),
        diattenuation=np.ones(n),
        light=np.tile(kind.light, (n, 1)),
        quantity=np.full(n, str(Quantity.SIGNAL)),
        value=np.ones(n),
        sigma=np.ones(n),
        pixels=np.ones(n, dtype=np.int64),
        flag=np.full(n, str(Flag.USED)),
    )
    vector = neutral_vector()
    vector[ETA], vector[K] = subject.eta, subject.k
    packed = pack(rows, subject.exterior_ior)
    value = predict_vectors(packed, vector[None], np.ones(packed.gains))[0]
    return replace(rows, value=value, sigma=subject.noise(value))


def sigmas(subject: Subject, largest: float) -> dict[str, float]:
    """The nuisances' sigmas where the largest signal is ``largest``."""
    return {n: s * largest if n == "dark_offset" else s for n, s in subject.nuisances.items()}


def common(kind: Kind, frames: int) -> Design:
    """``kind`` at 30, 45 and 60 degrees, over and over until ``frames`` are used up."""
    return Design(kind, tuple(sorted(islice(cycle(COMMON_DEG), frames // kind.frames))))


def best(kind: Kind, frames: int, subject: Subject, *, with_k: bool) -> Design:
    """``kind`` at the angles that tell most, by exchange from two starts; the same every time.

    The criterion is the larger relative sd of eta and k; of eta alone
    without ``with_k``, or where k is 0.
    """
    blocks, prior_sd = _blocks(kind, subject)
    scale = np.array([1.0, subject.k]) if with_k and subject.k > 0 else np.ones(1)

    def worst(matrices: FloatArray) -> FloatArray:
        variances = np.diagonal(posterior_covariance(matrices, prior_sd), axis1=-2, axis2=-1)
        return np.asarray(np.max(np.sqrt(variances[..., : len(scale)]) / scale, axis=-1))

    stations = frames // kind.frames
    spread = np.linspace(0, len(blocks) - 1, stations).round().astype(int).tolist()
    greedy: list[int] = []
    for _ in range(stations):
        greedy.append(int(np.argmin(worst(blocks[greedy].sum(axis=0) + blocks))))
    found = [_exchanged(start, blocks, worst) for start in (spread, greedy)]
    chosen = min(found, key=lambda places: float(worst(blocks[places].sum(axis=0))))
    return Design(kind, tuple(sorted(float(GRID_DEG[i]) for i in chosen)))


def _blocks(kind: Kind, subject: Subject) -> tuple[FloatArray, FloatArray]:
    """Each angle's information, shape (A, P, P), and the priors' sd, shape (P,): eta, k if above 0, nuisances."""
    priors = {name: prior for name, prior in subject.priors.items() if name == "eta" or subject.k > 0}
    rows = [planned(Design(kind, (float(angle),)), subject) for angle in GRID_DEG]
    # The search needs one prior for all angles; a design's own largest signal is hardly smaller.
    nuisances = sigmas(subject, max(float(r.value.max()) for r in rows))
    found = [
        information(
            r, subject.eta, subject.k, exterior_ior=subject.exterior_ior, priors=priors, nuisances=nuisances
        )
        for r in rows
    ]
    return np.array([f.matrix for f in found]), found[0].prior_sd


def _exchanged(start: list[int], blocks: FloatArray, worst: Callable[[FloatArray], FloatArray]) -> list[int]:
    """Angles moved one at a time to where they do best, until none moves."""
    places = list(start)
    value = float(worst(blocks[places].sum(axis=0)))
    moved = True
    while moved:
        moved = False
        for i in range(len(places)):
            others = [place for j, place in enumerate(places) if j != i]
            values = worst(blocks[others].sum(axis=0) + blocks)
            place = int(np.argmin(values))
            # A real gain only: rounding must not decide how long this takes.
            if values[place] < value * (1 - 1e-6):
                places[i], value, moved = place, float(values[place]), True
    return places
