"""Photographs with perspective, blur, noise, vignetting and a leaky analyzer: what is left of their errors."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

import photographs_camera
import photographs_fits
import photographs_geometry
import photographs_polarization
import photographs_real
from card import Figure
from photographs_scenes import FOCAL_PX, SIZE, start

from reflectance_fit.children import ONE_THREAD

PROCESSES = 2
PARTS = (photographs_geometry, photographs_polarization, photographs_camera, photographs_fits)


def about(*, full: bool) -> str:
    return (
        f"Synthetic pictures of {SIZE[0]} x {SIZE[1]} pixels, focal length {FOCAL_PX:.0f} pixels, Gaussian blur of 0.7 "
        "pixels, vignetting, PRNU, shot and read noise as of a typical camera, N-BK7, written as DNG (one as TIFF) and "
        "read as ever but in the process that measures. Boards: 7 x 5 squares of 16 mm that fill 72 % of the width. "
        + " ".join(part.about(full=full) for part in (*PARTS, photographs_real))
    )


def figures(*, full: bool) -> Iterator[Figure]:
    # As in the workers that decode; threads of OpenBLAS that wait would take as much of the processors as the work.
    os.environ |= ONE_THREAD
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(PROCESSES, context, start) as pool:
        for part in PARTS:
            yield from part.figures(pool, full=full)
    yield from photographs_real.figures()
