"""Angles of incidence from pictures: of a board by its corners, of a ball by its outline."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from card import Figure
from photographs_scenes import FOCAL_PX, SIZE, answers, board_spec, in_region, ingested

from reflectance_fit.capture.bins import Region
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.data_synthetic.picture import Optics
from reflectance_fit.data_synthetic.rig import Setting
from reflectance_fit.data_synthetic.spec import standard_spec

TILTS_DEG = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 65.0)
MOST_DEG = 0.05
_RIM_DEG = 76.0  # beyond which no bin of a ball reaches
_GEOMETRY_VIEWS = 10


class Tilt(NamedTuple):
    tilt_deg: float
    error_deg: float
    sigma_deg: float


def about(*, full: bool) -> str:
    return (
        f"Tilts: {', '.join(f'{t:g}' for t in TILTS_DEG)} deg, seeds 0 to {_seeds(full) - 1}, once with the focal "
        f"length stated and once from {_GEOMETRY_VIEWS} views of the board. Balls: the same seeds, light all around."
    )


def _seeds(full: bool) -> int:
    return 12 if full else 3


def figures(pool: ProcessPoolExecutor, *, full: bool) -> Iterator[Figure]:
    """Errors of angles, the largest of all seeds."""
    target = f"{MOST_DEG} deg at most"
    seeds = range(_seeds(full))
    stated = [pool.submit(tilts, seed, 0) for seed in seeds]
    calibrated = [pool.submit(tilts, seed, _GEOMETRY_VIEWS) for seed in seeds]
    balls = [pool.submit(ball, seed) for seed in seeds]
    # What is promised is of a lens that views of the board show; without any, its distortion stays unknown.
    for how, jobs in (("views of the board", calibrated), ("focal length stated alone", stated)):
        name = f"tilt of a board up to 65 deg, {how}: largest error"
        promised = jobs is calibrated

        def of_tilts(
            found: list[list[Tilt]], name: str = name, how: str = how, promised: bool = promised
        ) -> Iterator[Figure]:
            errors = np.array([tilt.error_deg for one in found for tilt in one])
            z = np.array([tilt.error_deg / tilt.sigma_deg for one in found for tilt in one])
            worst = float(np.abs(errors).max())
            value = f"{worst:.3f} deg (rms {np.sqrt(np.mean(errors**2)):.3f}, N = {len(errors)})"
            good = worst <= MOST_DEG
            yield Figure.judged(name, value, target, good) if promised else Figure.reported(name, value)
            yield Figure.reported(
                f"tilt of a board, {how}: rms error over sigma", f"{np.sqrt(np.mean(z**2)):.2f}"
            )

        yield from answers(name, target, jobs, of_tilts)

    def of_balls(found: list[tuple[float, float]]) -> Iterator[Figure]:
        theta, s_axis = (max(one[i] for one in found) for i in (0, 1))
        yield Figure.judged(
            f"angle on a ball up to {_RIM_DEG:g} deg: largest error",
            f"{theta:.3f} deg",
            target,
            theta <= MOST_DEG,
        )
        yield Figure.judged(
            "direction of s on a ball: largest error", f"{s_axis:.3f} deg", target, s_axis <= MOST_DEG
        )

    yield from answers(f"angle on a ball up to {_RIM_DEG:g} deg: largest error", target, balls, of_balls)


def tilts(seed: int, geometry_views: int) -> list[Tilt]:
    """Each region's mean angle against the mean of what its pixels see."""
    settings = (Setting(0.0), Setting(90.0))
    spec = board_spec(
        seed, angles_deg=TILTS_DEG, settings=settings, geometry_views=geometry_views, flats=0, darks=0
    )
    found, shown = ingested(spec)
    rows = found.measurement.observations
    out = []
    for view, tilt_deg in zip(shown, TILTS_DEG, strict=True):
        of_view = (rows.gain_group == view.stated["gain_group"]) & (rows.channel == "G")
        theta_deg = np.average(rows.theta_deg[of_view], weights=rows.pixels[of_view])
        true_deg = math.degrees(float(in_region(view).mean()))
        sigma_deg = math.hypot(float(rows.theta_deg_sigma[of_view].mean()), _common(found.capture.geometry))
        out.append(Tilt(tilt_deg, float(theta_deg) - true_deg, sigma_deg))
    return out


def _common(geometry: Any) -> float:
    """Standard deviation of what all angles are off by together, degrees."""
    return float(geometry.common_sigma_deg)


def ball(seed: int) -> tuple[float, float]:
    """Largest errors of the angle and of the direction of s, degrees, over pixels of the ball that are used."""
    spec = standard_spec("N-BK7", shape="sphere", seed=seed)
    sensor = replace(spec.sensor, width=SIZE[0], height=SIZE[1])
    spec = replace(spec, sensor=sensor, optics=Optics(FOCAL_PX, 0.7))
    found, (view,) = ingested(spec)
    bins = bins_of(found.capture, found.samples[0].frame)
    assert not isinstance(bins, Region)
    y, x = (z.ravel().astype(float) for z in np.indices((SIZE[1], SIZE[0])))
    inside, theta, s_axis = bins.angles(x, y)
    scene: Any = view.scene
    true_theta, true_s = scene.incidence(x[inside], y[inside])
    turned = np.abs((s_axis - true_s + math.pi / 2) % math.pi - math.pi / 2)
    return math.degrees(np.abs(theta - true_theta).max()), math.degrees(turned.max())
