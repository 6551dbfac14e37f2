"""One regime in one format: our rungs and the peers against the reference, on the points of one search."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from fresnel_oracle import AMPLITUDES, POWERS, Point, Reference, reference
from fresnel_peers import Powers, peers_of
from fresnel_regimes import CONDUCTOR, DIELECTRIC, NEAR_MATCH, SCALES, Floats, Regime
from fresnel_search import moved, search
from numpy.typing import NDArray

from reflectance_fit.physics import fresnel
from reflectance_fit.physics.bulk import unpolarized

SEED = 20250611
FEW = ("mean",)  # what bulk has
RUNGS = ("double_word", "compensated", "plain")
JUDGED = RUNGS[:2]


def _bulk(c: NDArray[Any], *index: NDArray[Any], rung: fresnel.Rung) -> tuple[NDArray[Any]]:
    """An array of one angle at a time, because there is one index for all."""
    parts = [unpolarized(c[i : i + 1], *(x[i] for x in index), rung=rung) for i in range(len(c))]
    return (np.concatenate(parts),)


ENTRIES: dict[str, Callable[..., tuple[NDArray[Any], ...]]] = {
    "cosine": fresnel.reflectances,
    "bulk": _bulk,
    "angle": fresnel.reflectances_at_angle,
    "degrees": fresnel.reflectances_at_deg,
    "near match": fresnel.reflectances_near_match,
}
# How far an input may be moved by ulps, as a power of two, and where eta and k stay.
REACH = {np.float64: 32, np.float32: 10}
LARGEST = {np.float64: 1e100, np.float32: 1e37}
TOP = {"cosine": 1.0, "bulk": 1.0, "near match": 1.0, "angle": np.pi / 2, "degrees": 90.0}


@dataclass(frozen=True, slots=True)
class Trial:
    """Where to look, how the angle and the index are handed over, and in which format."""

    kind: str
    regime: str
    entry: str = "cosine"
    dtype: type[np.floating[Any]] = np.float64

    @property
    def outputs(self) -> tuple[str, ...]:
        return FEW if self.entry == "bulk" else POWERS

    def family(self) -> Regime:
        (found,) = (
            one
            for one in (*DIELECTRIC, *CONDUCTOR, *NEAR_MATCH)
            if (one.kind, one.name, one.near_match) == (self.kind, self.regime, self.entry == "near match")
        )
        return found

    def inputs(self, u: Floats, ulps: NDArray[np.int64]) -> list[NDArray[Any]]:
        """What the function gets at a point of the search: (cosine or angle, index, k), inside its domain."""
        first, index, k = self.family().points(u, SCALES[self.dtype])
        images = [_angle(self.entry, first), index, k]
        rounded = [x.astype(self.dtype) for x in images]
        for i, jump in enumerate(ulps):
            rounded[i] = moved(rounded[i], jump)
        largest = self.dtype(LARGEST[self.dtype])
        lowest = -np.inf if self.entry == "near match" else 1 / largest
        return [
            np.minimum(rounded[0], self.dtype(TOP[self.entry])),
            np.clip(rounded[1], self.dtype(lowest), largest),
            np.minimum(rounded[2], largest),
        ]

    def call(self, inputs: list[NDArray[Any]], rung: str) -> NDArray[Any]:
        """Ours, shape (n, outputs)."""
        given = inputs if self.kind == "conductor" else inputs[:2]
        powers = np.stack(ENTRIES[self.entry](*given, rung=rung), axis=-1)
        if powers.dtype != self.dtype:
            raise TypeError(f"{self.entry} gives {powers.dtype} for {np.dtype(self.dtype)}")
        return powers


def _point(inputs: list[NDArray[Any]], i: int) -> Point:
    first, index, k = (float(x[i]) for x in inputs)
    return first, index, k


@dataclass(slots=True)
class Worst:
    """The largest error and where it was."""

    error: float = -1.0
    at: Point = (np.nan, np.nan, np.nan)

    def see(self, errors: Floats, inputs: list[NDArray[Any]]) -> None:
        i = int(np.argmax(errors))
        if errors[i] > self.error:
            self.error = float(errors[i])
            self.at = _point(inputs, i)


@dataclass(slots=True)
class Found:
    """What a trial came to: ``worst`` by (rung, output) in ulp, of an angle over 1 + ``spread``; by rung the
    powers ``outside`` [0, 1] or NaN and the amplitudes that are not finite; |R + T - 1|; of peers the same."""

    trial: Trial
    points: int = 0
    values: int = 0
    worst: dict[tuple[str, str], Worst] = field(default_factory=dict)
    outside: dict[str, int] = field(default_factory=lambda: dict.fromkeys(RUNGS, 0))
    outside_at: dict[str, Point] = field(default_factory=dict)
    imbalance: Worst = field(default_factory=Worst)
    peers: dict[str, tuple[Worst, int]] = field(default_factory=dict)


def run(trial: Trial, evaluations: int) -> Found:
    """Search the worst points of ``trial``; the same in every process."""
    found = Found(trial)
    peers = [p for p in peers_of(trial.kind, trial.dtype) if p.installed and trial.entry == "cosine"]

    def errors(u: Floats, ulps: NDArray[np.int64]) -> Floats:
        inputs = trial.inputs(u, ulps)
        exact = reference(trial.entry, inputs, trial.dtype)
        columns = [_ours(trial, rung, inputs, exact, found) for rung in RUNGS]
        for peer in peers:
            some = [x[:: peer.every] for x in inputs]
            with np.errstate(all="ignore"):
                powers = peer.call(*some)
            _peer(peer.name, powers, exact, peer.every, some, found)
        found.points += len(inputs[0])
        # What is only reported is one objective, what is judged one an output.
        return np.column_stack([*columns[: len(JUDGED)], *(c.max(axis=1) for c in columns[len(JUDGED) :])])

    seed = zlib.crc32(f"{trial.kind} {trial.regime} {trial.entry} {np.dtype(trial.dtype)}".encode())
    search(
        errors,
        trial.family().axes,
        3 if trial.kind == "conductor" else 2,
        evaluations,
        np.random.default_rng([SEED, seed]),
        REACH[trial.dtype],
    )
    return found


def _ours(trial: Trial, rung: str, inputs: list[NDArray[Any]], exact: Reference, found: Found) -> Floats:
    """Errors of a rung, shape (n, outputs), entered into ``found``."""
    powers = trial.call(inputs, rung)
    outputs = list(trial.outputs)
    columns = [POWERS.index(output) for output in outputs]
    errors = exact.powers.columns(columns).errors(powers) / (1.0 + exact.spread[:, columns])
    wrong = ~((powers >= 0) & (powers <= 1))
    if trial.entry == "cosine" and trial.dtype is np.float64:
        given = inputs if trial.kind == "conductor" else inputs[:2]
        fields = np.stack(fresnel.amplitudes(*given, rung=rung), axis=-1)
        wrong = np.hstack([wrong, ~np.isfinite(fields)])
        errors = np.hstack([errors, np.hypot(exact.real.errors(fields.real), exact.imag.errors(fields.imag))])
        outputs += AMPLITUDES
    for output, column in zip(outputs, errors.T, strict=True):
        found.worst.setdefault((rung, output), Worst()).see(column, inputs)
    found.outside[rung] += int(wrong.sum())
    found.values += wrong.size
    if wrong.any():
        i = int(np.argmax(wrong.any(axis=1)))
        found.outside_at[rung] = _point(inputs, i)
    if trial.outputs == POWERS:
        found.imbalance.see(imbalance(powers).max(axis=1), inputs)
    return errors


def _peer(
    name: str, powers: Powers, exact: Reference, every: int, inputs: list[NDArray[Any]], found: Found
) -> None:
    worst, outside = found.peers.get(name, (Worst(), 0))
    for output, values in powers.items():
        worst.see(exact.powers.columns(POWERS.index(output), every).errors(values), inputs)
        outside += int((~((values >= 0) & (values <= 1))).sum())
    found.peers[name] = worst, outside


def imbalance(powers: NDArray[Any]) -> Floats:
    """|R + T - 1| of s, p and their mean without rounding error, shape (n, 3)."""
    r, t = (powers[:, part].astype(np.float64) for part in (slice(0, 3), slice(3, 6)))
    high = r + t
    rest = high - r
    low = (r - (high - rest)) + (t - rest)
    return np.nan_to_num(np.abs((high - 1.0) + low), nan=np.inf)


def _angle(entry: str, c: Floats) -> Floats:
    """Of a cosine, by whichever arc function keeps its digits."""
    if entry not in ("angle", "degrees"):
        return c
    steep, right = 2.0 * np.arcsin(np.sqrt((1.0 - c) / 2.0)), np.arcsin(c)
    if entry == "angle":
        return np.where(c > 0.5, steep, np.pi / 2 - right)
    return np.where(c > 0.5, np.degrees(steep), 90.0 - np.degrees(right))
