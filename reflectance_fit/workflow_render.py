"""The command ``render``: a scene file in, an OpenEXR picture with its previews out."""

from __future__ import annotations

import importlib.metadata
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.files import check_writable, write_together
from reflectance_fit.material import Material
from reflectance_fit.physics.stokes import analyzer_signal
from reflectance_fit.render.choose import Choice, choose
from reflectance_fit.render.difference import Difference, difference, relative_error
from reflectance_fit.render.film import Film
from reflectance_fit.render.image import channels, polarization, row_polarization, write_exr
from reflectance_fit.render.run import Progress, render
from reflectance_fit.render.scene import Scene
from reflectance_fit.render.scene_file import read_scene
from reflectance_fit.render.settings import Fresnel, Mode, Settings
from reflectance_fit.report.read import material_of, read_report

Floats = NDArray[np.float64]
Report = Callable[[str, int, int], None]

SAMPLES = 64
SAMPLES_WITH_ERROR = 65536
POLARIZED = ("polarized", "spectral_polarized")


@dataclass(frozen=True, slots=True)
class Wish:
    """What is asked of a render.

    Parameters
    ----------
    mode : Mode or "auto"
    samples : int or None
        Paths a pixel, at most where ``error`` is given; None: 64, or 65536 with ``error``.
    error : float or None
        Stop at this standard error, a share of the picture's mean.
    compare : bool
        Also by the approximation ``fresnel`` (Schlick's where that is "exact"), and the difference.
    size_px : int, int, or None
        Width and height instead of the scene's.
    analyzers_deg : sequence of float
        Also a sheet of pictures behind an analyzer at these angles, counter-clockwise from horizontal.
    stops : float or None
        Exposure of the previews in powers of two; None: automatic.
    """

    mode: Mode | Literal["auto"] = "auto"
    samples: int | None = None
    error: float | None = None
    fresnel: Fresnel = "exact"
    compare: bool = False
    sampler: Literal["independent", "sobol"] = "sobol"
    precision: Literal["single", "double"] = "single"
    seed: int = 0
    size_px: tuple[int, int] | None = None
    analyzers_deg: Sequence[float] = ()
    stops: float | None = None

    @property
    def approximation(self) -> Fresnel:
        return "schlick" if self.compare and self.fresnel == "exact" else self.fresnel


@dataclass(frozen=True, slots=True, eq=False)
class Rendered:
    """What was rendered, how well, and into which files; ``discarded`` samples of all pictures were not numbers."""

    choice: Choice
    approximation: Fresnel
    notes: tuple[str, ...]
    film: Film
    seconds: float
    error: float
    discarded: int
    stops: float
    clipped: float
    difference: Difference | None
    files: tuple[Path, ...]


def render_to_file(path: Path, out: Path, wish: Wish, *, progress: Report | None = None) -> Rendered:
    """Render the scene at ``path`` into ``out`` and pictures beside it, all or none.

    Beside NAME.exr: NAME.png, the preview; NAME-polarization.png where Stokes vectors were
    carried; NAME-compare.png and NAME-analyzer.png where asked for.
    """
    check_writable(out.parent)
    read = read_scene(path, _fitted)
    scene = read.scene
    if wish.size_px is not None:
        scene = replace(scene, camera=replace(scene.camera, size_px=wish.size_px))
    try:
        choice = _choice(scene, wish, progress)
        settings = _settings(wish, choice.mode)
        exact_or_asked = "exact" if wish.compare else wish.fresnel
        started = time.perf_counter()
        film = render(scene, replace(settings, fresnel=exact_or_asked), _told("rendering", wish, progress))
        seconds = time.perf_counter() - started
        other = None
        if wish.compare:
            told = _told(f"rendering by {wish.approximation}", wish, progress)
            # As many samples as the first took, drawn in the same groups: the same random numbers.
            never = None if wish.error is None else 0.0
            same = replace(settings, fresnel=wish.approximation, samples=film.samples, error=never)
            other = render(scene, same, told)
    except ValueError as error:
        raise ReflectanceFitError(Problem(str(path), None, str(error))) from error
    return _write(path.name, out, wish, choice, read.notes, film, other, seconds)


def _fitted(path: Path) -> Material:
    return material_of(read_report(path), path)


def _choice(scene: Scene, wish: Wish, progress: Report | None) -> Choice:
    approximate = wish.approximation != "exact"
    if wish.analyzers_deg and scene.camera.analyzer_deg is not None:
        raise ValueError("the camera has an analyzer already; remove analyzer_deg, or do without --analyzer")
    if wish.analyzers_deg and approximate:
        raise ValueError("pictures behind an analyzer need exact Fresnel; an approximation has no s and p")
    if wish.mode != "auto":
        if wish.analyzers_deg and wish.mode not in POLARIZED:
            raise ValueError(f"mode {wish.mode} has no Stokes vectors for --analyzer; leave --mode to auto")
        return Choice(wish.mode, "as asked")
    polarized = True if wish.analyzers_deg else False if approximate else None

    def pilot(small: Scene, settings: Settings) -> Film:
        told = _told(f"trial: {settings.mode}", replace(wish, error=None), progress)
        return render(small, replace(settings, precision=wish.precision), told)

    return choose(scene, pilot, polarized=polarized)


def _settings(wish: Wish, mode: Mode) -> Settings:
    default = SAMPLES if wish.error is None else SAMPLES_WITH_ERROR
    return Settings(
        mode=mode,
        samples=default if wish.samples is None else wish.samples,
        seed=wish.seed,
        sampler=wish.sampler,
        precision=wish.precision,
        error=wish.error,
    )


def _told(what: str, wish: Wish, progress: Report | None) -> Callable[[Progress], None] | None:
    """Progress in samples a pixel, of as many as the target of error will take."""
    if progress is None:
        return None
    # Nothing is heard from a render before its code is there: 20 s, where a scene is the first of its kind.
    waiting = "loading, or compiling once"
    progress(waiting, 0, 1)

    def told(now: Progress) -> None:
        progress(waiting, 1, 1)
        total = float(now.total)
        if wish.error is not None and now.error is not None:
            total = min(total, now.samples * max(1.0, (now.error / wish.error) ** 2))
        progress(what, int(now.samples), math.ceil(total))

    return told


def _write(
    name: str,
    out: Path,
    wish: Wish,
    choice: Choice,
    notes: tuple[str, ...],
    film: Film,
    other: Film | None,
    seconds: float,
) -> Rendered:
    # matplotlib takes a second to load: not before the picture is there.
    from reflectance_fit.plot.render import automatic_stops, clipped_share, write_figure, write_preview
    from reflectance_fit.plot.render_panels import draw_analyzers, draw_compare, draw_polarization

    radiance = film.mean[..., 0]
    stops = automatic_stops(radiance) if wish.stops is None else wish.stops
    compared = None if other is None else difference(film, other)
    layers = channels(film)
    stem = out.stem

    def fill(stage: Path) -> None:
        write_preview(stage / f"{stem}.png", radiance, stops)
        if film.mode in POLARIZED:
            write_figure(stage / f"{stem}-polarization.png", draw_polarization(name, *polarization(film)))
        if wish.analyzers_deg:
            pictures = {angle: analyzer_signal(film.mean, np.radians(angle)) for angle in wish.analyzers_deg}
            degree, _ = polarization(film)
            # Half of the light passes on average.
            sheet = draw_analyzers(name, pictures, degree, row_polarization(film), stops + 1.0)
            write_figure(stage / f"{stem}-analyzer.png", sheet)
        if other is not None and compared is not None:
            layers.update(
                {f"{wish.approximation}.{c}": v for c, v in channels(other).items() if "." not in c}
            )
            both: dict[str, Floats] = {"exact": radiance, wish.approximation: other.mean[..., 0]}
            lines = difference_lines(wish.approximation, compared)
            write_figure(
                stage / f"{stem}-compare.png", draw_compare(name, both, compared.signed, lines, stops)
            )
        write_exr(stage / out.name, layers, _about(name, wish, film))

    written = [out, out.with_suffix(".png")]
    written += [out.with_name(f"{stem}-polarization.png")] if film.mode in POLARIZED else []
    written += [out.with_name(f"{stem}-analyzer.png")] if wish.analyzers_deg else []
    written += [out.with_name(f"{stem}-compare.png")] if wish.compare else []
    write_together(out.parent, fill, last=out.name)
    return Rendered(
        choice=choice,
        approximation=wish.approximation,
        notes=notes,
        film=film,
        seconds=seconds,
        error=relative_error(film),
        discarded=film.discarded + (0 if other is None else other.discarded),
        stops=stops,
        clipped=clipped_share(radiance, stops),
        difference=compared,
        files=tuple(written),
    )


def difference_lines(name: str, found: Difference) -> tuple[str, ...]:
    """What an approximation does to the picture's luminance, in words and numbers."""
    level = found.level / 100
    over_all = (
        f"{name} − exact, luminance: RMS {found.rms:.3g} ({found.rms / level:.3g} % of the exact mean), "
        f"mean {found.mean:+.3g} ({found.mean / level:+.3g} %)"
    )
    largest = (
        f"largest {found.largest:+.3g} ({100 * found.relative_largest:+.3g} % of exact there) "
        f"at column {found.column}, row {found.row}; standard error of a pixel's difference below {found.noise:.2g}"
    )
    return over_all, largest


def _about(name: str, wish: Wish, film: Film) -> dict[str, str | int | float]:
    about: dict[str, str | int | float] = {
        "version": importlib.metadata.version("reflectance_fit"),
        "scene": name,
        "mode": film.mode,
        "samples": film.samples,
        "seed": wish.seed,
        "sampler": wish.sampler,
        "precision": wish.precision,
        "fresnel": "exact" if wish.compare else wish.fresnel,
        "error": relative_error(film),
    }
    return {f"reflectance_fit.{key}": value for key, value in about.items()}
