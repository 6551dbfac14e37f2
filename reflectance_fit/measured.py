"""What tables or photographs come to: the input of a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from reflectance_fit.observations import Observations
from reflectance_fit.priors import Prior


class Note(NamedTuple):
    """Something a reader has to tell: one of the report's warning codes, and the words."""

    code: str
    message: str


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """Observations, and what their manifest says about fitting them.

    ``exterior_ior`` is the index around the sample.  ``nuisances`` maps name
    to the sigma of its prior, inf for flat; None where the file leaves the
    choice to the fit, empty where it forbids all.  ``priors`` holds eta and k.
    ``inputs`` are (file as written, sha256), the manifest first.
    ``common_sigmas`` maps a nuisance to the sigma that was measured of it, by
    channel: an error that all rows of the channel share.
    """

    path: Path
    sample_name: str
    exterior_ior: float
    observations: Observations
    nuisances: dict[str, float] | None
    priors: dict[str, Prior]
    warnings: tuple[Note, ...]
    inputs: tuple[tuple[str, str], ...]
    sample_note: str | None = None
    common_sigmas: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def known(self, channel: str) -> dict[str, float]:
        """``common_sigmas`` of one channel: nuisance to sigma."""
        return {name: sigmas[channel] for name, sigmas in self.common_sigmas.items() if channel in sigmas}
