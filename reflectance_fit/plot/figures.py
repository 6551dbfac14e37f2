"""Every picture of a result, written to one folder."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from matplotlib.figure import Figure

from reflectance_fit.plot.chains import draw_autocorrelation, draw_rank, draw_trace
from reflectance_fit.plot.corner import draw_corner
from reflectance_fit.plot.curve import Predict
from reflectance_fit.plot.fit import draw_fit
from reflectance_fit.plot.priors import draw_prior_posterior
from reflectance_fit.plot.residuals import draw_residuals
from reflectance_fit.plot.schlick import draw_schlick
from reflectance_fit.plot.spectrum import draw_spectrum
from reflectance_fit.plot.style import save
from reflectance_fit.plot.text import slugs
from reflectance_fit.result import Fit

# Beyond this many channels a folder of pictures is no longer looked at.
MOST_CHANNELS = 12
_OF_CHAINS = ("trace", "autocorrelation")

T = TypeVar("T")


@contextmanager
def _collecting_later() -> Iterator[None]:
    """No garbage collection while a picture is drawn, and after it only of what the picture left.

    matplotlib makes so many objects that collecting takes a fifth of the time,
    most of it spent on objects that were there before.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.collect(0)
        if enabled:
            gc.enable()


def pictures(fits: Sequence[Fit]) -> int:
    """How many pictures ``draw_all`` draws for these fits, each as PNG and SVG."""
    return sum(8 if fit.posterior.chains else 6 for fit in _shown(list(fits))) + (len(fits) >= 3)


def _shown(channels: list[T]) -> list[T]:
    """All, or the first, the middle and the last of too many."""
    few = len(channels) <= MOST_CHANNELS
    return channels if few else [channels[0], channels[len(channels) // 2], channels[-1]]


def draw_all(
    fits: Sequence[Fit],
    folder: Path,
    predictor: Callable[[Fit], Predict],
    *,
    progress: Callable[[str], None] | None = None,
) -> list[Path]:
    """Draw and write every picture of ``fits``, as PNG and SVG; returns the paths.

    One channel gives ``fit.png``, several give ``fit-CHANNEL.png``.  With more
    than 12 channels only the first, the middle and the last get their own
    pictures.  Only emcee's chains have a ``trace`` and an ``autocorrelation``.
    From 3 channels on, ``spectrum`` shows them all.  ``progress``
    is called with each picture's name before it is drawn; ``predictor`` gives
    each fit's model as a function.
    """
    draw: dict[str, Callable[[Fit], Figure]] = {
        "fit": lambda fit: draw_fit(fit, predictor(fit)),
        "residuals": draw_residuals,
        "corner": draw_corner,
        "trace": draw_trace,
        "autocorrelation": draw_autocorrelation,
        "rank": draw_rank,
        "prior_posterior": draw_prior_posterior,
        "schlick": draw_schlick,
    }
    folder.mkdir(parents=True, exist_ok=True)
    paths: list[Path] = []

    def write(name: str, figure: Callable[[], Figure]) -> None:
        if progress is not None:
            progress(name)
        with _collecting_later():
            paths.extend(save(figure(), folder, name))

    endings = [""] if len(fits) == 1 else [f"-{slug}" for slug in slugs(fit.channel for fit in fits)]
    for fit, ending in _shown(list(zip(fits, endings, strict=True))):
        for name, function in draw.items():
            if name in _OF_CHAINS and fit.posterior.chains is None:
                continue
            write(name + ending, lambda fit=fit, function=function: function(fit))  # type: ignore[misc]
    if len(fits) >= 3:
        write("spectrum", lambda: draw_spectrum(fits))
    return paths
