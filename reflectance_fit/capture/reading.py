"""How the files of a capture are to be read, and the reading: what a worker does before it reduces."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from reflectance_fit.capture.pixel_maps import PixelMaps, checked_maps, read_map
from reflectance_fit.capture.raw import RawFrame, decode

_MOST_UNUSED = 8  # bits of 16


@dataclass(frozen=True, slots=True)
class Reading:
    """What the manifest says of the camera.

    ``sensor`` is bayer, mono, dofp or dofp_bayer; ``layout_deg`` holds the
    transmission axes of a dofp sensor's 2 x 2 pixels, rows from the top, and
    ``colours`` those of a dofp_bayer sensor's 2 x 2 groups.  ``offset_map``
    and ``gain_map`` are TIFF files of the camera's own.
    """

    sensor: str = "bayer"
    layout_deg: tuple[tuple[float, ...], ...] | None = None
    colours: str = "RGGB"
    offset_map: Path | None = None
    gain_map: Path | None = None


def read_frame(path: Path, reading: Reading) -> RawFrame:
    """One frame, its pixels named as the manifest says; ReflectanceFitError for what cannot be read.

    A sensor with other colour filters than stated keeps those of its file.
    """
    frame = _without_unused_bits(_as_stated(decode(path), reading))
    if reading.offset_map or reading.gain_map:
        return replace(frame, maps=_maps(reading.offset_map, reading.gain_map, frame.cfa.shape))
    return frame


@functools.lru_cache(maxsize=1)
def _maps(offset: Path | None, gain: Path | None, shape: tuple[int, ...]) -> PixelMaps:
    """Read once a process: all frames of a capture have the same."""
    images = [None if path is None else read_map(path) for path in (offset, gain)]
    return checked_maps(images[0], images[1], shape, (str(offset), str(gain)))


def _without_unused_bits(frame: RawFrame) -> RawFrame:
    """A sample of 12 bits may come in the upper part of 16: then every value is a multiple of 16.

    Looked for where there are no colour filters in the file, as machine-vision
    cameras write; a photographic camera's gaps are of its white balance.  Two
    empty bits are the least: a digital gain of 2 leaves one.  Neighbouring
    multiples must occur, or the picture merely has few values.
    """
    if "mono" not in frame.channels and np.isnan(frame.axes_deg).all():
        return frame
    set_bits = int(np.bitwise_or.reduce(frame.cfa, axis=None))
    unused = (set_bits & -set_bits).bit_length() - 1
    step = 1 << max(unused, 0)
    if not 2 <= unused <= _MOST_UNUSED or np.min(np.diff(np.unique(frame.cfa)), initial=2 * step) > step:
        return frame
    return replace(
        frame,
        cfa=np.right_shift(frame.cfa, np.uint16(unused)),
        black=frame.black / step,
        white=frame.white / step,
        unused_bits=unused,
    )


def _as_stated(frame: RawFrame, reading: Reading) -> RawFrame:
    """The file of a sensor with polarizers on its pixels does not tell: to it the sensor is monochrome."""
    if reading.layout_deg is None or frame.channels[0, 0] != "mono":
        return frame
    axes = np.array(reading.layout_deg, dtype=np.float64)
    if reading.sensor == "dofp":
        return replace(frame, axes_deg=axes)
    # Each pixel of the Bayer cell is a 2 x 2 group with all four polarizers.
    colours = np.array(list(reading.colours)).reshape(2, 2).repeat(2, axis=0).repeat(2, axis=1)
    return replace(
        frame,
        channels=colours,
        axes_deg=np.tile(axes, (2, 2)),
        black=np.tile(frame.black, (2, 2)),
        white=np.tile(frame.white, (2, 2)),
    )
