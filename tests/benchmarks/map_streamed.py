"""The command ``map`` on 64 megapixels of photographs: how fast, and in how much memory."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
from card import Figure

from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng
from reflectance_fit.physics.fresnel import reflectances

SIDE = 8192
ANALYZERS_DEG = (0, 45, 90, 135)
MOST_GB = 1.0
_GAIN, _READ, _BLACK, _WHITE, _TOP = 2.2, 3.0, 512, 16383, 9000.0  # electrons a DN, electrons, DN
_COMMAND = (
    sys.executable,
    "-c",
    "from reflectance_fit.cli.main import cli; cli(prog_name='reflectance-fit')",
    "map",
)


def about() -> str:
    return (
        f"Streamed: `map` of {len(ANALYZERS_DEG)} uncompressed DNG files of {SIDE} x {SIDE} pixels, flat glass at 40 degrees, a "
        "worker a core, start to end: checking, unpacking, estimating, compressing and writing MAP.nc, the preview; kernels "
        "compiled before. Memory: proportional set size of the command and all of its processes together, ten times a second."
    )


def figures() -> Iterator[Figure]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _run(_capture(folder / "small", 256), folder / "small.nc")
        seconds, together, alone = _run(_capture(folder / "large", SIDE), folder / "large.nc")
        file = (folder / "large.nc").stat().st_size
    pixels = SIDE * SIDE
    yield Figure.reported(
        "streamed from files: megapixels a second",
        f"{pixels / 1e6 / seconds:.2f} ({seconds:.0f} s; MAP.nc has {file / 1e6:.0f} MB)",
    )
    yield Figure.judged(
        "peak memory, 64 megapixels streamed: all processes together (the largest alone)",
        f"{together / 1e9:.2f} GB ({alone / 1e9:.2f})",
        f"{MOST_GB} GB at most",
        together <= MOST_GB * 1e9,
    )


def _capture(folder: Path, side: int) -> Path:
    """Noise as a sensor's, different in every frame and every 256 rows."""
    folder.mkdir()
    r = reflectances(np.cos(np.radians(40.0)), 1.5)
    frames = []
    span = _WHITE - _BLACK
    profile = (1 / (_GAIN * span), (_READ / _GAIN / span) ** 2)
    for number, angle in enumerate(ANALYZERS_DEG):
        share = r.s * np.cos(np.radians(angle)) ** 2 + r.p * np.sin(np.radians(angle)) ** 2
        mean = _TOP * share / r.s
        generator = np.random.default_rng(number)
        cfa = np.empty((side, side), dtype=np.uint16)
        sigma = np.float32(np.sqrt(mean / _GAIN + (_READ / _GAIN) ** 2))
        for row in range(0, side, 256):
            noise = generator.standard_normal((256, side), dtype=np.float32) * sigma
            cfa[row : row + 256] = np.rint(np.clip(_BLACK + mean + noise, 0, _WHITE))
        metadata = DngMetadata("MONO", 14, (_BLACK,) * 4, _WHITE, Fraction(1, 60), 100, (profile,))
        write_dng(folder / f"{number}.dng", cfa, metadata)
        frames.append(f"  - {{file: {number}.dng, theta_deg: 40, analyzer_deg: {angle}}}\n")
    path = folder / "capture.yaml"
    path.write_text(
        "schema: reflectance_fit/capture/1\nsample: {name: benchmark}\nnuisances: {}\n"
        "camera: {sensor: mono, channels: {'550': {wavelength_nm: 550}}}\n"
        f"geometry: {{kind: stated, s_axis_deg: 0}}\nframes:\n{''.join(frames)}"
    )
    return path


def _run(capture: Path, out: Path) -> tuple[float, float, float]:
    """Seconds, and the largest memory of all processes together and of one, bytes."""
    started = time.perf_counter()
    command = [*_COMMAND, str(capture), "-o", str(out), "--model", "dielectric", "-q"]
    running = subprocess.Popen(command)
    together = alone = 0.0
    while running.poll() is None:
        sizes = [_pss(pid) for pid in _tree(running.pid)]
        together, alone = max(together, sum(sizes)), max(alone, *sizes)
        time.sleep(0.1)
    if running.returncode:
        raise RuntimeError(f"map ended with {running.returncode}")
    return time.perf_counter() - started, together, alone


def _tree(root: int) -> list[int]:
    """The process and all that it started."""
    parents = {}
    for place in Path("/proc").glob("[0-9]*"):
        try:
            parents[int(place.name)] = int((place / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
    found, new = [root], [root]
    while new:
        new = [pid for pid, parent in parents.items() if parent in new]
        found += new
    return found


def _pss(pid: int) -> float:
    try:
        text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    except OSError:
        return 0.0
    size = re.search(r"^Pss: +(\d+) kB", text, re.MULTILINE)
    return 1024.0 * int(size.group(1)) if size else 0.0


if __name__ == "__main__":
    for figure in figures():
        print(figure)
