"""``map``: each pixel as its own fit, honest intervals, and the same bytes wherever and however it is computed."""

from __future__ import annotations

import math
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np
import yaml
from card import Figure
from scale_cluster import Killer, cluster
from scipy.stats import binom

from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.rig import LIGHTS, MONO_CHANNELS, Setting
from reflectance_fit.data_synthetic.sensor import Sensor
from reflectance_fit.data_synthetic.spec import CaptureSpec
from reflectance_fit.mapping import MapJob, Tile, compute_tile
from reflectance_fit.pixels.status import Status
from reflectance_fit.scale.executors import executor
from reflectance_fit.workflow import fit
from reflectance_fit.workflow_map import map_to_files

ALONE = 6  # pixels of each capture that are fitted by themselves
TILES = (24, 40, 512)
WORKERS = (1, 2, 4)
KILLS = 6
_SENSOR = Sensor(width=256, height=192, pattern="MONO")
_POISON = (24, 48)  # row and column of the tile that kills
_COMMAND = (
    sys.executable,
    "-c",
    "from reflectance_fit.cli.main import cli; cli(prog_name='reflectance-fit')",
    "map",
)


def about() -> str:
    return (
        f"`map`: synthetic captures of N-BK7 (50 and 60 degrees) and Au (65 and 75 degrees, light at 45 degrees, with a "
        f"retarder) of 128 x 96 pixels, and of a ball of N-BK7 on a Bayer sensor, seed 0, nothing wrong with the rig; single "
        f"fits are `fit` of a capture whose region is the pixel. Dask as above; tiles of {', '.join(map(str, TILES))} pixels; "
        f"workers are killed {KILLS} times amid tiles that are slowed down to 0.1 s."
    )


def figures(folder: Path) -> Iterator[Figure]:
    captures = {"glass": _glass(folder), "metal": _metal(folder), "ball": _ball(folder)}
    maps = {}
    for name, (capture, _) in captures.items():
        maps[name] = _mapped(capture, folder / f"{name}.nc")
    yield from _alone(captures, maps)
    yield from _coverage(captures, maps)
    yield from _on_dask(captures["glass"][0], folder)
    yield _poisoned(captures["glass"][0], folder)


Made = tuple[Path, tuple[float, float]]


def _write(folder: Path, name: str, spec: CaptureSpec) -> Made:
    write_capture(folder / name, spec)
    path = folder / name / "capture.yaml"
    data = yaml.safe_load(path.read_text()) | {"nuisances": {}}
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return path, spec.index_of(spec.channels[0])


def _glass(folder: Path) -> Made:
    angles = (50.0, 60.0)
    return _write(
        folder, "glass", CaptureSpec("N-BK7", angles_deg=angles, sensor=_SENSOR, channels=MONO_CHANNELS)
    )


def _metal(folder: Path) -> Made:
    settings = [Setting(a) for a in (0.0, 45.0, 90.0, 135.0)] + [Setting(a, 0.0) for a in (45.0, 135.0)]
    return _write(
        folder,
        "metal",
        CaptureSpec(
            "Au",
            angles_deg=(65.0, 75.0),
            settings=tuple(settings),
            light=LIGHTS["linear45"],
            sensor=_SENSOR,
            channels=MONO_CHANNELS,
        ),
    )


def _ball(folder: Path) -> Made:
    return _write(
        folder, "ball", CaptureSpec("N-BK7", shape="sphere", sensor=Sensor(width=480, height=360), darks=4)
    )


def _mapped(capture: Path, out: Path) -> dict[str, Any]:
    with executor(1) as workers:
        map_to_files(capture, out, workers, progress=lambda *_: None)
    return _read(out)


def _read(path: Path) -> dict[str, Any]:
    with h5netcdf.File(path, "r") as file:
        return {name: variable[...] for name, variable in file.variables.items()}


def _alone(captures: dict[str, Made], maps: dict[str, dict[str, Any]]) -> Iterator[Figure]:
    for name, model in (("glass", "dielectric"), ("metal", "conductor")):
        path, _ = captures[name]
        numbers = maps[name]
        data = yaml.safe_load(path.read_text())
        generator = np.random.default_rng(0)
        worst = 0.0
        for row, column in generator.integers(0, numbers["eta"].shape[1:], (ALONE, 2)):
            x, y = int(numbers["x"][column]), int(numbers["y"][row])
            for frame in data["frames"]:
                if frame["role"] == "sample":
                    frame["region"] = [x, y, x + 1, y + 1]
            one = path.with_name("one.yaml")
            one.write_text(yaml.safe_dump(data, sort_keys=False))
            best = fit(one, model=model, posterior="laplace").fits[0].optimum
            worst = max(worst, abs(numbers["eta"][0, row, column] - best.eta))
            if model == "conductor":
                worst = max(worst, abs(numbers["k"][0, row, column] - best.k))
        yield Figure.judged(
            f"map of {name}: {ALONE} pixels against the single fit of each",
            f"{worst:.1e}",
            "1e-6 at most",
            worst <= 1e-6,
        )


def _coverage(captures: dict[str, Made], maps: dict[str, dict[str, Any]]) -> Iterator[Figure]:
    """Of independent pixels: the band of all pixels together and of 1,000 channels of them holds 99.7 %."""
    for name, field in (("glass", "eta"), ("metal", "eta"), ("metal", "k"), ("ball", "eta")):
        numbers, truth = maps[name], captures[name][1][field == "k"]
        counted = np.isin(numbers["status"][0], [Status.IDENTIFIED, Status.AMBIGUOUS])
        off = np.abs(numbers[field][0] - truth)[counted]
        inside = int(np.sum(off <= 1.96 * numbers[f"{field}_sigma"][0][counted]))
        low, high = binom.interval(0.997, off.size, 0.95)
        # What all pixels share is not in their sigma: the eta of all together is known to a tenth of it here.
        yield Figure.judged(
            f"map of {name}: truth inside 1.96 sigma of {field}, {off.size} pixels",
            f"{inside / off.size:.4f}",
            f"{low / off.size:.4f} to {high / off.size:.4f}",
            low <= inside <= high,
        )


def slow_tile(job: MapJob, tile: Tile) -> None:
    """So that a tile can be killed amid its work."""
    time.sleep(0.05)
    compute_tile(job, tile)
    tile.path.unlink()
    time.sleep(0.05)
    compute_tile(job, tile)


def poison_tile(job: MapJob, tile: Tile) -> None:
    """Kills whoever computes one tile."""
    if (tile.row, tile.column) == _POISON:
        os.kill(os.getpid(), signal.SIGKILL)
    compute_tile(job, tile)


def _on_dask(capture: Path, folder: Path) -> Iterator[Figure]:
    out = folder / "on-dask.nc"
    expected = (folder / "glass.nc").read_bytes()
    same, runs = 0, 0
    here = {"PYTHONPATH": str(Path(__file__).parent)}
    for workers in WORKERS:
        place = folder / f"map-{workers}"
        place.mkdir()
        with cluster(place, workers, env=here) as (file, _):
            for tile in TILES:
                words = [*_COMMAND, capture, "-o", out, "--tile", tile, "--scheduler", file, "-q"]
                done = subprocess.run([*map(str, words)], check=False)
                same += done.returncode == 0 and out.read_bytes() == expected
                runs += 1
                out.unlink(missing_ok=True)
            if workers == 2:
                killed = _killed(capture, out, file)
                good = out.exists() and out.read_bytes() == expected
                out.unlink(missing_ok=True)
    yield Figure.judged(
        f"map on {', '.join(map(str, WORKERS))} Dask workers, {len(TILES)} sizes of tiles: as of one process",
        f"{same} of {runs}",
        "all, byte for byte",
        same == runs,
    )
    yield Figure.judged(
        "map on 2 Dask workers that are killed (-9) amid tiles",
        f"{'equal' if good else 'differs'}, {killed} deaths",
        "equal byte for byte",
        good and killed >= KILLS // 2,
    )


def _killed(capture: Path, out: Path, scheduler: Path) -> int:
    begun = lambda: any(out.parent.glob(f".{out.name}.unfinished.*/tile-*.npz"))
    killer = Killer(begun, times=KILLS, every_s=1.0)
    with executor(None, str(scheduler)) as workers:
        map_to_files(capture, out, workers, tile=16, progress=lambda *_: None, compute=slow_tile)
    return killer.stop()


def _poisoned(capture: Path, folder: Path) -> Figure:
    out, place = folder / "poison.nc", folder / "map-poison"
    place.mkdir()
    with (
        cluster(place, 2, env={"PYTHONPATH": str(Path(__file__).parent)}) as (file, _),
        executor(None, str(file)) as workers,
    ):
        map_to_files(capture, out, workers, tile=24, progress=lambda *_: None, compute=poison_tile)
    found, whole = _read(out), _read(folder / "glass.nc")
    lost = found["status"][0] == Status.TILE_LOST
    there = np.zeros_like(lost)
    there[_POISON[0] : _POISON[0] + 24, _POISON[1] : _POISON[1] + 24] = True
    rest = np.array_equal(found["eta"][0][~there], whole["eta"][0][~there], equal_nan=True)
    good = np.array_equal(lost, there) and bool(np.isnan(found["eta"][0][there]).all()) and rest
    return Figure.judged(
        "map with a tile that kills its worker",
        f"{int(lost.sum())} pixels masked as tile_lost, the rest {'equal' if rest else 'differs'}",
        f"{24 * 24} masked, the rest equal",
        good,
    )
