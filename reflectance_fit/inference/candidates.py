"""Models with nuisances and noise, each fitted once, when it is asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from reflectance_fit.inference import models, robust, search
from reflectance_fit.inference.models import Model
from reflectance_fit.inference.optimize import Basin
from reflectance_fit.inference.rows import Rows
from reflectance_fit.priors import Prior
from reflectance_fit.result import Noise, Optimum


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """A candidate at its optimum; ``nuisances`` are those that were asked for, ``rows`` what it was fitted to."""

    model: Model
    nuisances: tuple[str, ...]
    rows: Rows
    optimum: Optimum
    basins: list[Basin]

    @property
    def noise(self) -> Noise:
        return "student_t" if self.rows.heavy_tailed else "normal"

    @property
    def described(self) -> str:
        """In words: conductor with angle_offset_deg and diffuse, student_t."""
        added = f" with {' and '.join(self.nuisances)}" if self.nuisances else ""
        return f"{self.optimum.model}{added}{', student_t' if self.rows.heavy_tailed else ''}"

    @property
    def parameters(self) -> int:
        return len(self.optimum.parameters) + len(self.optimum.gains)


class Candidates:
    """Fits models on demand, each once; with the nuisances of ``sigmas`` (name -> sigma) that are asked for.

    Those that are ``known`` (name -> measured sigma) are in every model; one that is asked for has the sigma of
    ``sigmas`` instead.
    """

    def __init__(
        self,
        rows: Rows,
        gains: list[str],
        priors: Mapping[str, Prior],
        sigmas: Mapping[str, float],
        estimated: list[str],
        known: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self._rows, self._gains, self._priors = rows, gains, priors
        self._sigmas, self._estimated, self._known = sigmas, estimated, known
        self._tried: dict[tuple[str, frozenset[str], bool], Tried] = {}

    def __call__(self, name: str, nuisances: Iterable[str]) -> Tried:
        """With normal noise."""
        asked = frozenset(nuisances)
        key = (name, asked, False)
        if key not in self._tried:
            sigmas = {n: s for n, s in self._sigmas.items() if n in asked}
            model = models.build(name, self._rows, self._priors, {**self._known, **sigmas}, self._estimated)
            optimum, basins = search.find(model, self._rows, self._gains)
            self._tried[key] = Tried(model, tuple(sigmas), self._rows, optimum, basins)
        return self._tried[key]

    def heavy_tailed(self, name: str, nuisances: Iterable[str]) -> Tried:
        """With outliers: noise of Student's t."""
        key = (name, frozenset(nuisances), True)
        if key not in self._tried:
            normal = self(name, nuisances)
            optimum, basins = robust.find(
                normal.model, normal.rows, self._gains, normal.optimum, normal.basins
            )
            heavy = normal.rows._replace(heavy_tailed=True)
            self._tried[key] = Tried(normal.model, normal.nuisances, heavy, optimum, basins)
        return self._tried[key]

    def beside(self, other: Tried, name: str) -> Tried:
        """The model ``name`` with the nuisances and the noise of ``other``."""
        fit = self.heavy_tailed if other.rows.heavy_tailed else self
        return fit(name, other.nuisances)

    @property
    def tried(self) -> tuple[Tried, ...]:
        return tuple(sorted(self._tried.values(), key=lambda t: t.optimum.bic))
