"""Which frames of a capture are pairs of one scene, and the noise of the sensor by them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from reflectance_fit.capture.bins import Mask
from reflectance_fit.capture.frames import Capture, Exposure, Frame
from reflectance_fit.capture.hot import hot_of
from reflectance_fit.capture.photon_transfer import PairBlocks, PhotonTransfer, compare_pair, fit_transfer
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.capture.tiff import read_tags
from reflectance_fit.errors import ReflectanceFitError


class Pair(NamedTuple):
    first: Frame
    second: Frame

    @property
    def is_dark(self) -> bool:
        return self.first.role == "dark"


def pairs_of(capture: Capture, settings: Mapping[Path, Exposure]) -> list[Pair]:
    """Darks and flats equal in all that the manifest says, two by two; none where the noise is known or no flats are.

    Noise that the manifest or the files state goes before.
    """
    flats = capture.role("flat")
    if capture.noise is not None or not flats or _has_profile(flats[0].path):
        return []
    alike: dict[tuple[object, ...], list[Frame]] = {}
    for frame in (*flats, *capture.role("dark")):
        key = (frame.role, frame.set, frame.channels, str(frame.analyzer_deg), settings[frame.path])
        alike.setdefault(key, []).append(frame)
    return [
        Pair(first, second)
        for frames in alike.values()
        for first, second in zip(frames[::2], frames[1::2], strict=False)
    ]


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """Block statistics of a pair by channel, one list entry a position of the cell; of darks the hot pixels of either."""

    blocks: dict[str, list[PairBlocks]]
    hot: Mask | None


def compare_files(
    path: Path, other: Path, reading: Reading, is_dark: bool, hot: Mask | None = None
) -> Compared:
    """Two files against each other, less the pixels of ``hot``; runs in a worker."""
    one, two = (read_frame(p, reading) for p in (path, other))
    if one.cfa.shape != two.cfa.shape:
        raise ReflectanceFitError("is not of the size of its pair")
    if is_dark:
        hot = hot_of(one, path) | hot_of(two, other)
    n = len(one.channels)
    left_out = hot.picture() if hot is not None and hot.shape == one.cfa.shape else None
    found: dict[str, list[PairBlocks]] = {}
    for y, x in np.ndindex(n, n):
        where = (slice(y, None, n), slice(x, None, n))
        offset = None if one.maps is None else one.maps.offset
        black = float(one.black[y, x]) if offset is None else offset[where]
        blocks = compare_pair(
            one.cfa[where],
            two.cfa[where],
            black,
            float(one.clip[y, x]),
            dark=is_dark,
            hot=None if left_out is None else left_out[where],
        )
        found.setdefault(str(one.channels[y, x]), []).append(blocks)
    return Compared(found, hot if is_dark else None)


def transfer_of(capture: Capture, pairs: Iterable[tuple[Pair, Compared]]) -> dict[str, PhotonTransfer]:
    """The noise of each channel of the manifest that pairs of flats tell."""
    told = list(pairs)
    found: dict[str, PhotonTransfer] = {}
    for channel in capture.channels:
        flats = [b for pair, one in told if not pair.is_dark for b in _of(pair, one.blocks, channel)]
        darks = [b for pair, one in told if pair.is_dark for b in _of(pair, one.blocks, channel)]
        if flats:
            try:
                found[channel] = fit_transfer(flats, darks)
            except ValueError:  # one level: there is no line
                continue
    return found


def _of(pair: Pair, blocks: Mapping[str, list[PairBlocks]], channel: str) -> Iterator[PairBlocks]:
    """Those of a channel; a sensor without filters sees whatever the frame is for."""
    if pair.is_dark or channel in pair.first.channels:
        yield from blocks.get(channel, blocks.get("mono", []))


def _has_profile(path: Path) -> bool:
    tags = read_tags(path)
    return tags.image is not None and tags.image.noise_profile is not None
