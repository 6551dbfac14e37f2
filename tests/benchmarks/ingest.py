"""What ``ingest`` costs beside decoding alone, and how much memory it takes however many frames there are."""

from __future__ import annotations

import json
import os
import statistics
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import imagecodecs
import numpy as np
from card import Figure

from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng

FRAMES, SIDES = 24, (4000, 6000)
LARGE_SIDES, DISTINCT = (5464, 8192), 4
MOST_RATIO, MOST_GB, MOST_GROWTH_MB = 1.5, 0.6, 1.0
BLACK, WHITE = 512, 15871
_FEW = 8

_BARE = """
import sys, time
from multiprocessing import get_context
from bare_unpack import unpack
if __name__ == "__main__":
    started = time.perf_counter()
    with get_context("spawn").Pool(int(sys.argv[1])) as pool:
        pool.map(unpack, sys.argv[2:], chunksize=1)
    print(time.perf_counter() - started)
"""
_UNPACK = """
import rawpy
def unpack(path):
    with rawpy.imread(path) as raw:
        raw.raw_image_visible.copy()
"""
_INGEST = """
import json, resource, sys, time
from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.read import read_capture
started = time.perf_counter()
ingested = ingest(read_capture(sys.argv[1]))
seconds = time.perf_counter() - started
assert not ingested.rejected
# What getrusage says of a process itself includes the memory of the one that started it.
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
workers = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
print(json.dumps({"seconds": seconds, "own_kib": int(status["VmHWM"].split()[0]), "worker_kib": workers}))
"""


def about(*, full: bool) -> str:
    return (
        f"{FRAMES} frames of {SIDES[1]} x {SIDES[0]} pixels, 14-bit lossless JPEG with two sensor rows in one, stated "
        f"geometry: `ingest` against unpacking and copying by rawpy in as many processes, starting them included; "
        f"medians of {_runs(full)} rounds, the two by turns. Memory: resident at most, of the command and of its "
        f"largest worker, for {DISTINCT} files of {LARGE_SIDES[1]} x {LARGE_SIDES[0]} pixels under {_many(full)} names."
    )


def figures(*, full: bool) -> Iterator[Figure]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        yield from _speed(folder, full)
    with tempfile.TemporaryDirectory() as name:
        yield from _memory(Path(name), full)


def _runs(full: bool) -> int:
    return 9 if full else 3


def _many(full: bool) -> int:
    return 400 if full else 40


def _speed(folder: Path, full: bool) -> Iterator[Figure]:
    files = [_frame(folder / f"{i:02d}.dng", SIDES, i) for i in range(FRAMES)]
    manifest = _manifest(folder / "capture.yaml", files)
    processes = min(8, os.cpu_count() or 1)
    (folder / "bare_unpack.py").write_text(_UNPACK)
    (folder / "bare.py").write_text(_BARE)
    (folder / "ingest.py").write_text(_INGEST)
    bare, whole = [], []
    for _ in range(_runs(full)):
        bare.append(float(_run(folder / "bare.py", str(processes), *map(str, files))))
        whole.append(json.loads(_run(folder / "ingest.py", str(manifest)))["seconds"])
    ratio = statistics.median(whole) / statistics.median(bare)
    yield Figure.judged(
        "ingest over bare unpacking",
        f"{ratio:.2f} ({statistics.median(whole):.1f} s, {statistics.median(bare):.1f} s)",
        f"{MOST_RATIO} at most",
        ratio <= MOST_RATIO,
    )


def _memory(folder: Path, full: bool) -> Iterator[Figure]:
    distinct = [_frame(folder / f"distinct{i}.dng", LARGE_SIDES, i) for i in range(DISTINCT)]
    (folder / "ingest.py").write_text(_INGEST)
    peaks = []
    for count in (_FEW, _many(full)):
        files = [folder / f"{count}-{i:03d}.dng" for i in range(count)]
        for i, file in enumerate(files):
            file.hardlink_to(distinct[i % DISTINCT])
        manifest = _manifest(folder / f"capture{count}.yaml", files)
        peaks.append(json.loads(_run(folder / "ingest.py", str(manifest))))
    few, many = peaks
    largest = max(many["own_kib"], many["worker_kib"]) * 1024 / 1e9
    yield Figure.judged(
        f"largest process, {_many(full)} frames of {LARGE_SIDES[0] * LARGE_SIDES[1] / 1e6:.0f} megapixels",
        f"{largest:.2f} GB",
        f"{MOST_GB} GB at most",
        largest <= MOST_GB,
    )
    for who in ("own", "worker"):
        growth = (many[f"{who}_kib"] - few[f"{who}_kib"]) * 1024 / 1e6 / (_many(full) - _FEW)
        yield Figure.judged(
            f"growth a frame, {'the command' if who == 'own' else 'a worker'}",
            f"{growth:.3f} MB",
            f"{MOST_GROWTH_MB} MB at most",
            growth <= MOST_GROWTH_MB,
        )


def _run(script: Path, *arguments: str) -> str:
    return subprocess.run(
        [sys.executable, str(script), *arguments], capture_output=True, check=True, text=True
    ).stdout


def _frame(path: Path, sides: tuple[int, int], seed: int) -> Path:
    """A DNG of a noisy gradient, 14-bit lossless JPEG."""
    generator = np.random.default_rng(seed)
    level = np.linspace(1500.0, 9000.0, sides[1], dtype=np.float32)
    noise = generator.standard_normal(sides, dtype=np.float32) * np.sqrt(level / 2.2)
    cfa = np.clip(BLACK + level + noise, 0, WHITE).astype(np.uint16)
    write_dng(path, cfa, DngMetadata("RGGB", 14, (BLACK,) * 4, WHITE, Fraction(1, 60), 100, ((3e-5, 1e-8),)))
    # Two sensor rows side by side in one row of the JPEG: neighbours are then of one colour.
    pairs = cfa.reshape(sides[0] // 2, 2 * sides[1])
    _replace_pixels(path, imagecodecs.ljpeg_encode(pairs, bitspersample=14))
    return path


def _replace_pixels(path: Path, coded: bytes) -> None:
    """The same file with its strip coded as lossless JPEG: Compression 7, StripByteCounts."""
    data = bytearray(path.read_bytes())
    (count,) = struct.unpack_from("<H", data, 8)
    for at in range(10, 10 + 12 * count, 12):
        (tag,) = struct.unpack_from("<H", data, at)
        if tag == 259:
            struct.pack_into("<H", data, at + 8, 7)
        elif tag == 279:
            struct.pack_into("<I", data, at + 8, len(coded))
        elif tag == 273:
            (start,) = struct.unpack_from("<I", data, at + 8)
    path.write_bytes(bytes(data[:start]) + coded)


def _manifest(path: Path, files: list[Path]) -> Path:
    """Four analyzer angles at each angle of incidence."""
    frames = "".join(
        f"  - {{file: {file.name}, theta_deg: {30 + 5 * (i // 4 % 10)}, analyzer_deg: {45 * (i % 4)}, set: {i // 40}}}\n"
        for i, file in enumerate(files)
    )
    channels = ", ".join(f"{c}: {{wavelength_nm: {nm}}}" for c, nm in (("R", 600), ("G", 550), ("B", 450)))
    path.write_text(
        "schema: reflectance_fit/capture/1\nsample: {name: benchmark}\n"
        f"camera: {{sensor: bayer, channels: {{{channels}}}}}\n"
        f"geometry: {{kind: stated, s_axis_deg: 0}}\nframes:\n{frames}"
    )
    return path
