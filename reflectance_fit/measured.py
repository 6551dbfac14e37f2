"""What tables or photographs come to: the input of a fit."""

from __future__ import annotations

from dataclasses import dataclass
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
