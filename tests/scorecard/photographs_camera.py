"""What the camera and the polarizer do: pictures that move with the analyzer, noise from pairs of flats."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from card import Figure
from photographs_scenes import BOARD, FOCAL_PX, FloatArray, answers, board_spec, ingested

from reflectance_fit.capture.read import read_capture
from reflectance_fit.capture.reading import read_frame
from reflectance_fit.capture.register import match, view_of
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.picture import Optics
from reflectance_fit.data_synthetic.rig import Setting
from reflectance_fit.data_synthetic.spec import ANALYZER_DEG, CaptureSpec

WEDGE_PX, SHEEN = 2.3, 0.4
MOST_PX = 0.02
GAIN, READ = 0.005, 0.02
_STOPS = (0, -1, -2, -3, -4)


def about(*, full: bool) -> str:
    return (
        f"Registration: boards at 30 and 55 deg whose picture moves on a circle of {WEDGE_PX} pixels, and whose paper "
        f"is polarized by {SHEEN:.0%} in directions that turn across it. Noise: two flats at each of "
        f"{len(_STOPS)} exposures and two darks of each, the standard sensor, nothing stated. "
        f"Seeds 0 to {_seeds(full) - 1}."
    )


def _seeds(full: bool) -> int:
    return 12 if full else 3


def figures(pool: ProcessPoolExecutor, *, full: bool) -> Iterator[Figure]:
    """The largest errors of all seeds, frames and channels."""
    moved = [pool.submit(registered, seed) for seed in range(_seeds(full))]
    noisy = [pool.submit(noise, seed) for seed in range(_seeds(full))]

    def of_moved(found: list[FloatArray]) -> Iterator[Figure]:
        errors = np.concatenate(found)
        worst = float(np.abs(errors).max())
        yield Figure.judged(
            f"registration under {SHEEN:.0%} polarized shading: largest error",
            f"{worst:.4f} px (rms {np.sqrt(np.mean(errors**2)):.4f}, N = {errors.size})",
            f"{MOST_PX} px at most",
            worst <= MOST_PX,
        )

    def of_noise(found: list[FloatArray]) -> Iterator[Figure]:
        gain, read = np.abs(np.array(found)).max(axis=(0, 1))
        yield Figure.judged(
            "gain from pairs of flats: largest error", f"{gain:.2%}", f"{GAIN:.1%}", gain <= GAIN
        )
        yield Figure.judged("read noise: largest error", f"{read:.2%}", f"{READ:.0%}", read <= READ)

    yield from answers("registration", f"{MOST_PX} px at most", moved, of_moved)
    yield from answers("gain and read noise from pairs of flats", f"{GAIN:.1%}, {READ:.0%}", noisy, of_noise)


def registered(seed: int) -> FloatArray:
    """Errors in x and y of each frame of a view against its first, pixels, shape (frames, 2)."""
    spec = board_spec(
        seed,
        angles_deg=(30.0, 55.0),
        board=replace(BOARD, sheen=SHEEN),
        optics=Optics(FOCAL_PX, 0.7, WEDGE_PX),
        flats=0,
        darks=0,
    )
    errors = []
    with tempfile.TemporaryDirectory() as folder:
        capture = read_capture(write_capture(Path(folder) / "capture", spec))
        samples = capture.role("sample")
        for at in range(0, len(samples), len(ANALYZER_DEG)):
            shown = [
                view_of(read_frame(f.path, capture.reading)) for f in samples[at : at + len(ANALYZER_DEG)]
            ]
            assert samples[at].region is not None
            x0, y0, x1, y1 = samples[at].region
            sample = slice(y0, y1), slice(x0, x1)
            start = np.array(spec.optics.shift_px(ANALYZER_DEG[0]))
            for view, analyzer_deg in zip(shown[1:], ANALYZER_DEG[1:], strict=True):
                found = match(shown[0], view, "translation", sample)
                true = np.array(spec.optics.shift_px(analyzer_deg)) - start
                errors.append(np.array(found.shift.offset) - true if found.found else np.full(2, np.inf))
    return np.array(errors)


def noise(seed: int) -> FloatArray:
    """Relative errors of gain and read noise of each channel, shape (channels, 2)."""
    spec = CaptureSpec(
        "N-BK7",
        angles_deg=(45.0,),
        settings=(Setting(0.0),),
        seed=seed,
        flats=2,
        flat_stops=_STOPS,
        darks=2,
        noise_profile=False,
    )
    found, _ = ingested(spec)
    sensor, noises = spec.sensor, found.capture.transfer
    return np.array(
        [
            (
                noises[channel.name].gain_e_per_dn / sensor.gain_e_per_dn - 1,
                noises[channel.name].read_noise_e / sensor.read_noise_e - 1,
            )
            if channel.name in noises
            else (np.inf, np.inf)
            for channel in spec.channels
        ]
    )
