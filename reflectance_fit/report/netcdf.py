"""posterior.nc: draws as a NetCDF4 file that ArviZ opens, written and read without ArviZ."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.inputs import check_regular
from reflectance_fit.result import Fit

FloatArray = NDArray[np.float64]

UNITS = {"cauchy_b_um2": "um2"}  # angles are in degrees, the rest has none

MAX_DRAWS = 50_000_000  # a file may claim any number without holding one


def write_posterior(fits: Sequence[Fit], path: Path) -> None:
    """Groups ``posterior`` and ``sample_stats`` with dims (chain, draw, channel).

    Variables: eta, k, r0, the angles in degrees, the nuisances; where a
    channel lacks one (a dielectric has no second Brewster angle) it is NaN.
    A chain is one walker; ``ensemble`` names the one it belongs to.  Channels
    with fewer walkers or draws repeat none: the file holds the common number.
    """
    chains = min(fit.posterior.log_density.shape[0] for fit in fits)
    draws = min(fit.posterior.log_density.shape[1] for fit in fits)
    sources = [_draws(fit) for fit in fits]
    names = list(dict.fromkeys(name for source in sources for name in source))
    picks = [_even(fit.posterior.log_density.shape[0], chains) for fit in fits]
    with h5netcdf.File(path, "w") as file:
        file.attrs["title"] = "posterior draws of reflectance_fit"
        file.attrs["conventions"] = "index eta + ik relative to vacuum, k >= 0; angles in degrees"
        posterior = _group(file, "posterior", chains, draws, [fit.channel for fit in fits])
        for name in names:
            variable = posterior.create_variable(name, ("chain", "draw", "channel"), float, fillvalue=np.nan)
            columns = [
                source[name][pick, -draws:] if name in source else np.full((chains, draws), np.nan)
                for source, pick in zip(sources, picks, strict=True)
            ]
            variable[...] = np.stack(columns, axis=-1)
            variable.attrs["units"] = UNITS.get(name, "degree" if name.endswith("_deg") else "1")
        stats = _group(file, "sample_stats", chains, draws, [fit.channel for fit in fits])
        density = stats.create_variable("lp", ("chain", "draw", "channel"), float)
        density[...] = np.stack(
            [fit.posterior.log_density[pick, -draws:] for fit, pick in zip(fits, picks, strict=True)], axis=-1
        )
        ensemble = stats.create_variable("ensemble", ("chain",), int)
        ensemble[...] = fits[0].posterior.ensemble[picks[0]]


def read_index_draws(path: Path, channels: Sequence[str]) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Draws of eta and k, relative to vacuum, of each of ``channels``; one-dimensional.

    Raises ReflectanceFitError where the file is no posterior.nc, or one of
    other channels.
    """
    check_regular(path, str(path))
    try:
        found, eta, k = _index(path)
    except Exception as error:  # whatever the libraries below make of broken bytes
        why = str(error).partition("(")[0].strip() or type(error).__name__
        raise ReflectanceFitError(
            Problem(str(path), None, f"is no posterior.nc of a fit: {why:.100}")
        ) from error
    if found != list(channels):
        message = "has other channels than report.yaml beside it; fit again, or move it away"
        raise ReflectanceFitError(Problem(str(path), None, message))
    if not (np.all(eta > 0) and np.all(k >= 0) and np.all(np.isfinite(eta)) and np.all(np.isfinite(k))):
        raise ReflectanceFitError(Problem(str(path), None, "has draws that are no index: fit again"))
    return {name: (eta[..., i].ravel(), k[..., i].ravel()) for i, name in enumerate(channels)}


def _index(path: Path) -> tuple[list[str], FloatArray, FloatArray]:
    """Names of the channels, and draws of eta and k, shape (chain, draw, channel)."""
    h5py = h5netcdf.core.h5py

    def inside(parent: Any, name: str, kind: type) -> Any:
        # Links and virtual data could name any file of the reader's.
        found: Any = parent[name] if isinstance(parent.get(name, getlink=True), h5py.HardLink) else None
        elsewhere = kind is h5py.Dataset and found is not None and (found.external or found.is_virtual)
        if not isinstance(found, kind) or elsewhere:
            raise ValueError(f"it has no {name}")
        return found

    with h5py.File(path, "r") as file:
        group = inside(file, "posterior", h5py.Group)
        names, eta, k = (inside(group, name, h5py.Dataset) for name in ("channel", "eta", "k"))
        if eta.ndim != 3 or eta.shape != k.shape or names.shape != eta.shape[2:]:
            raise ValueError("its eta and k are not (chain, draw, channel)")
        if not 0 < eta.size <= MAX_DRAWS:
            raise ValueError(f"it has {eta.size} draws")
        return [str(name) for name in names.asstr()[...]], eta[...].astype(float), k[...].astype(float)


def _draws(fit: Fit) -> dict[str, FloatArray]:
    """Everything a fit drew; ``k_conductor`` are the draws behind the upper limit of k where k = 0 was chosen."""
    draws = {**fit.posterior.samples, **fit.derived}
    if fit.shared is not None:
        draws["cauchy_b_um2"] = fit.shared.cauchy_b_um2
    if fit.k_posterior is not None:
        # Fewer draws were asked for: each stands several times, chain by chain, which no quantile minds.
        found, shape = fit.k_posterior.samples["k"], fit.posterior.log_density.shape
        chain, draw = (_even(have, want) for have, want in zip(found.shape, shape, strict=True))
        draws["k_conductor"] = found[np.ix_(chain, draw)]
    return draws


def _even(available: int, wanted: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """``wanted`` of ``available`` walkers, evenly spread, so that every ensemble keeps its share."""
    return np.arange(wanted, dtype=np.int64) * available // wanted


def _group(file: h5netcdf.File, name: str, chains: int, draws: int, channels: list[str]) -> h5netcdf.Group:
    group = file.create_group(name)
    group.dimensions = {"chain": chains, "draw": draws, "channel": len(channels)}
    group.create_variable("chain", ("chain",), int)[...] = np.arange(chains)
    group.create_variable("draw", ("draw",), int)[...] = np.arange(draws)
    labels = np.array(channels, dtype=object)
    variable = group.create_variable("channel", ("channel",), h5netcdf.core.h5py.string_dtype())
    variable[...] = labels
    return group
