"""Degree and direction of polarization of what photographs show, against Fresnel at their own angles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from card import Figure
from photographs_scenes import FOCAL_PX, SIZE, FloatArray, answers, board_spec, in_region, ingested

from reflectance_fit.data_synthetic.rig import MONO_CHANNELS, STATED_DIATTENUATION, Faults, Setting
from reflectance_fit.data_synthetic.spec import IMX250, CaptureSpec
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.observations import Observations
from reflectance_fit.physics.fresnel import reflectances

TILTS_DEG = (30.0, 45.0, 56.0, 65.0)
LEAK = 0.96  # diattenuation: an extinction ratio of 49
MOST_DOLP, MOST_AOLP_DEG = 2e-3, 0.05
_APART_DEG = 0.3
KINDS = ("analyzer before the lens", "polarizers on the pixels", "polarizers under colour filters", "TIFF")


class Light(NamedTuple):
    """Errors of one view and channel."""

    dolp: float
    aolp_deg: float


def about(*, full: bool) -> str:
    return (
        f"Polarization: boards at {', '.join(f'{t:g}' for t in TILTS_DEG)} deg, an analyzer of diattenuation {LEAK}, "
        f"seeds 0 to {_seeds(full) - 1}; bias is the mean over seeds, the worst of views and channels is given. "
        "Of the sensor with polarizers under colour filters, pictures are twice as large."
    )


def _seeds(full: bool) -> int:
    return 12 if full else 3


def figures(pool: ProcessPoolExecutor, *, full: bool) -> Iterator[Figure]:
    """A figure each of DoLP and AoLP for every kind of sensor and file."""
    jobs = {kind: [pool.submit(lights, kind, seed) for seed in range(_seeds(full))] for kind in KINDS}
    for kind, submitted in jobs.items():

        def of_lights(found: list[list[Light]], kind: str = kind) -> Iterator[Figure]:
            mean = np.mean(np.array(found), axis=0)  # (views and channels, 2)
            dolp, aolp = (float(error) for error in np.abs(mean).max(axis=0))
            yield Figure.judged(
                f"DoLP bias, {kind}", f"{dolp:.1e}", f"{MOST_DOLP:g} at most", dolp <= MOST_DOLP
            )
            yield Figure.judged(
                f"AoLP bias, {kind}", f"{aolp:.3f} deg", f"{MOST_AOLP_DEG} deg at most", aolp <= MOST_AOLP_DEG
            )

        yield from answers(
            f"DoLP and AoLP bias, {kind}", f"{MOST_DOLP:g}, {MOST_AOLP_DEG} deg", submitted, of_lights
        )


def spec_of(kind: str, seed: int) -> CaptureSpec:
    spec = board_spec(
        seed,
        angles_deg=TILTS_DEG,
        faults=Faults(diattenuation=LEAK),
        stated_diattenuation=LEAK,
        nuisances={},
        darks=1,
        flats=1,
    )
    assert LEAK != STATED_DIATTENUATION
    if kind == KINDS[0]:
        return spec
    under_filters = kind == KINDS[2]
    # A cell of 4 x 4 pixels is one point of the picture that the board is looked for in.
    finer = 2 if under_filters else 1
    sensor = replace(
        spec.sensor,
        width=finer * SIZE[0],
        height=finer * SIZE[1],
        pattern="RGGB" if under_filters else "MONO",
        layout_deg=IMX250,
    )
    return replace(
        spec,
        sensor=sensor,
        optics=replace(spec.optics, focal_px=finer * FOCAL_PX),
        settings=(Setting(None),),
        channels=spec.channels if under_filters else MONO_CHANNELS,
        files="tiff" if kind == "TIFF" else "dng",
    )


def lights(kind: str, seed: int) -> list[Light]:
    """Of each view and channel: the means over its region against the means of Fresnel's."""
    spec = spec_of(kind, seed)
    found, shown = ingested(spec)
    rows = found.measurement.observations
    out = []
    for view in shown:
        theta = in_region(view)
        for channel in spec.channels:
            eta, k = spec.index_of(channel)
            powers = reflectances(np.cos(theta), eta / AIR_INDEX, k / AIR_INDEX)
            true = float(np.mean(powers.s - powers.p) / np.mean(powers.s + powers.p))
            of_view = (rows.gain_group == view.stated["gain_group"]) & (rows.channel == channel.name)
            s0, s1, s2 = _stokes(rows, of_view)
            out.append(Light(math.hypot(s1, s2) / s0 - true, math.degrees(0.5 * math.atan2(s2, s1))))
    return out


def _stokes(rows: Observations, of_view: FloatArray) -> FloatArray:
    """In the frame of s: each ring by weighted least squares, and their mean by pixels."""
    total, pixels = np.zeros(3), 0.0
    # Rows of one ring are at one angle but for where the pixels of each plane are; rings are degrees apart.
    number = np.flatnonzero(of_view)
    number = number[np.argsort(rows.theta_deg[number])]
    for of_ring in np.split(number, np.flatnonzero(np.diff(rows.theta_deg[number]) > _APART_DEG) + 1):
        phi, d = np.radians(rows.analyzer_deg[of_ring]), rows.diattenuation[of_ring]
        design = np.stack([np.ones_like(phi), d * np.cos(2 * phi), d * np.sin(2 * phi)], axis=1) / 2
        weight = 1 / rows.sigma[of_ring]
        stokes = np.linalg.lstsq(design * weight[:, None], rows.value[of_ring] * weight, rcond=None)[0]
        count = float(rows.pixels[of_ring].sum())
        total, pixels = total + count * stokes, pixels + count
    return np.asarray(total / pixels)
