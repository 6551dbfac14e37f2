"""How many paths a second, and how soon a picture is as clean: the renderer against Mitsuba 3, in turns."""

from __future__ import annotations

import importlib.util
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numba
import numpy as np
from card import Figure
from render_peer import Peer, sample_variance

from reflectance_fit.render.pack import pack
from reflectance_fit.render.run import render
from reflectance_fit.render.scene import (
    AreaLight,
    Camera,
    Conductor,
    ConstantEnvironment,
    Dielectric,
    Lambertian,
    Polarization,
    Rectangle,
    Scene,
    Spectrum,
    Sphere,
    Surface,
    constant,
)
from reflectance_fit.render.settings import Mode, Settings

THREADS, SIZE, DEPTH = 2, 512, 6
SAMPLES, SAMPLES_SCALAR = 64, 8
VARIANCE_SEEDS, VARIANCE_SAMPLES = 8, 16
SAME = 0.1
# Ours over theirs, in samples a second and in time to equal variance.
PROMISES = (
    ("rgb", "llvm_ad_rgb", 3.5),
    ("rgb", "scalar_rgb", 14.0),
    ("Stokes", "llvm_ad_mono_polarized", 2.5),
)


def _scene(*, grey: bool) -> Scene:
    """Three balls in the corner of a room under a panel."""
    red, blue = (constant(0.5), constant(0.4)) if grey else (_rgb(0.6, 0.4, 0.3), _rgb(0.3, 0.4, 0.6))
    eta, k = (constant(0.25), constant(3.0)) if grey else (_rgb(0.18, 0.42, 1.37), _rgb(3.42, 2.35, 1.77))
    surfaces = (
        Surface(Rectangle((0, 0, 0), (4, 0, 0), (0, 4, 0)), Lambertian(red)),
        Surface(Rectangle((0, 3, 2), (4, 0, 0), (0, 0, 2)), Lambertian(blue)),
        Surface(Sphere((-1.6, 0.3, 0.8), 0.8), Dielectric(constant(1.5))),
        Surface(Sphere((0.1, 0.9, 0.9), 0.9), Conductor(eta, k)),
        Surface(Sphere((1.8, 0.2, 0.8), 0.8), Conductor(eta, k, 0.3)),
    )
    panel = AreaLight(Rectangle((0, 0, 4), (1, 0, 0), (0, -1, 0)), constant(5.0))
    camera = Camera((0, -6.5, 2.4), (0, 0, 0.8), (0, 0, 1), (SIZE, SIZE))
    return Scene(camera, surfaces, (panel, ConstantEnvironment(constant(0.3))), max_depth=DEPTH)


def _rgb(*values: float) -> Spectrum:
    return Spectrum(np.array(values))


@dataclass(slots=True)
class Runner:
    """What renders, the samples of a picture, and how long each took; ``first``: the first picture, compiling included."""

    draw: Callable[[int, int], float]
    samples: int
    variance: Callable[[], float]
    why: Callable[[], str]
    first: float
    seconds: list[float]

    @property
    def speed(self) -> float:
        """Million samples a second."""
        return SIZE * SIZE * self.samples / statistics.median(self.seconds) / 1e6


def about(*, full: bool) -> str:
    return (
        f"Two walls, glass, metal and rough metal balls, a panel and constant surroundings, {SIZE} x {SIZE}, {DEPTH} rays "
        f"a path at most, {THREADS} threads, {SAMPLES} samples a pixel ({SAMPLES_SCALAR} of scalar variants), float32, "
        f"independent sampling on both sides; medians of {_rounds(full)} rounds in which everyone takes a turn, in a new order each; in brackets "
        "million samples a second. Stokes: all four components, of a grey scene with one channel on both sides. Variance "
        f"of a sample: median over pixels, from {VARIANCE_SEEDS} pictures of {VARIANCE_SAMPLES} samples. Mitsuba's variants in processes "
        "of their own, which wait while others work. First pictures: compiling included, ours from an empty or a full cache as found."
    )


def figures(*, full: bool) -> Iterator[Figure]:
    runners = _runners()
    order = np.random.default_rng(0)
    for _ in range(_rounds(full)):
        # In a new order each time: what ran before leaves caches and clocks as it likes.
        for runner in order.permutation(np.array(list(runners.values()), dtype=object)):
            if not runner.why():
                runner.seconds.append(runner.draw(runner.samples, len(runner.seconds) + 1))
    for mine, theirs, least in PROMISES:
        yield _ratio(runners, mine, theirs, least)
    yield _ratio(runners, "rgb, double", "llvm_ad_rgb", None)
    yield _ratio(runners, "rgb, Sobol", "llvm_ad_rgb", None)
    yield _ratio(runners, "spectral", "llvm_ad_spectral", None)
    for mine, theirs, least in (*PROMISES, ("rgb, Sobol", "llvm_ad_rgb", None)):
        yield _equal_variance(runners, mine, theirs, least)
    yield from _unpolarized(runners)
    for name, runner in runners.items():
        if not runner.why():
            steady = SIZE * SIZE * runner.samples / runner.speed / 1e6
            yield Figure.reported(f"{name}: first picture, s", f"{runner.first:.1f}, later ones {steady:.2f}")


def _rounds(full: bool) -> int:
    return 15 if full else 7


def _runners() -> dict[str, Runner]:
    colour, grey = _scene(grey=False), _scene(grey=True)
    found = {
        "rgb": _ours(colour, "rgb"),
        "rgb, double": _ours(colour, "rgb", precision="double"),
        "rgb, Sobol": _ours(colour, "rgb", sampler="sobol"),
        "rgb, of a polarized light": _ours(_polarized(colour), "rgb"),
        "spectral": _ours(colour, "spectral"),
        "Stokes": _ours(grey, "polarized"),
    }
    peers: tuple[tuple[str, Scene, Mode], ...] = (
        ("llvm_ad_rgb", colour, "rgb"),
        ("scalar_rgb", colour, "rgb"),
        ("llvm_ad_spectral", colour, "spectral"),
        ("llvm_ad_mono_polarized", grey, "polarized"),
    )
    for variant, scene, mode in peers:
        found[variant] = _theirs(variant, scene, mode)
    return found


def _ours(scene: Scene, mode: Mode, **how: Any) -> Runner:
    settings = Settings(mode, SAMPLES, **{"sampler": "independent", **how})

    def draw(samples: int, seed: int) -> float:
        started = time.perf_counter()
        render(scene, replace(settings, samples=samples, seed=seed), threads=THREADS)
        return time.perf_counter() - started

    def variance() -> float:
        few = replace(settings, samples=VARIANCE_SAMPLES)
        pictures = [
            render(scene, replace(few, seed=seed), threads=THREADS).mean[..., 0]
            for seed in range(VARIANCE_SEEDS)
        ]
        return sample_variance(pictures, VARIANCE_SAMPLES)

    return Runner(draw, SAMPLES, variance, lambda: "", draw(SAMPLES, 0), [])


def _theirs(variant: str, scene: Scene, mode: Mode) -> Runner:
    samples = SAMPLES_SCALAR if variant.startswith("scalar") else SAMPLES
    if importlib.util.find_spec("mitsuba") is None:
        return Runner(
            lambda *_: np.nan, samples, lambda: np.nan, lambda: "mitsuba is not installed", np.nan, []
        )
    peer = Peer(variant, scene, mode)

    def variance() -> float:
        return peer.variance(VARIANCE_SAMPLES, VARIANCE_SEEDS)

    return Runner(peer.render, samples, variance, lambda: peer.why, peer.render(samples, 0), [])


def _ratio(runners: dict[str, Runner], mine: str, theirs: str, least: float | None) -> Figure:
    name, target = f"{mine} over {theirs}, samples a second", "none" if least is None else f"{least} at least"
    if why := runners[theirs].why():
        return Figure.not_run(name, target, why)
    ours, other = runners[mine].speed, runners[theirs].speed
    value = f"{ours / other:.2f} ({ours:.1f} over {other:.2f})"
    return (
        Figure.reported(name, value)
        if least is None
        else Figure.judged(name, value, target, ours / other >= least)
    )


def _equal_variance(runners: dict[str, Runner], mine: str, theirs: str, least: float | None) -> Figure:
    name = f"{mine}, times faster to equal variance than {theirs}"
    target = "none" if least is None else f"{least} at least"
    if why := runners[theirs].why():
        return Figure.not_run(name, target, why)
    ours, other = runners[mine], runners[theirs]
    own, peers = ours.variance(), other.variance()
    ratio = (peers / other.speed) / (own / ours.speed)
    value = f"{ratio:.2f} (variance of a sample {own:.2g} and {peers:.2g})"
    return (
        Figure.reported(name, value) if least is None else Figure.judged(name, value, target, ratio >= least)
    )


def _polarized(scene: Scene) -> Scene:
    """The same with polarized light, which `rgb` does not look at."""
    lights = tuple(replace(light, polarization=Polarization((1.0, 0.0, 0.0, 1.0))) for light in scene.lights)
    return replace(scene, lights=lights)


def _unpolarized(runners: dict[str, Runner]) -> Iterator[Figure]:
    """What polarization costs where it is not asked for: nothing, for the machine code is the same."""
    settings = Settings("rgb", SAMPLES)
    scene = _scene(grey=False)
    packed = [pack(s, settings) for s in (scene, _polarized(scene))]
    kernels = [(numba.typeof(p.has), numba.typeof(p.tables)) for p in packed]
    name = "a scene without polarization calls the kernel built without it"
    yield Figure.judged(
        name, "same" if kernels[0] == kernels[1] else "another", "same", kernels[0] == kernels[1]
    )
    ratio = runners["rgb, of a polarized light"].speed / runners["rgb"].speed
    yield Figure.judged("and takes as long", f"{ratio:.3f}", f"1 +- {SAME}", abs(ratio - 1.0) <= SAME)
