"""How the files of a capture are to be read, and the reading: what a worker does before it reduces."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.clipping import measured_white
from reflectance_fit.capture.images import decode_samples
from reflectance_fit.capture.pixel_maps import PixelMaps, checked_maps, read_map
from reflectance_fit.capture.plausible import implausible
from reflectance_fit.capture.raw import RawFrame, decode
from reflectance_fit.errors import Problem, ReflectanceFitError

_MOST_UNUSED = 8  # bits of 16


@dataclass(frozen=True, slots=True)
class Reading:
    """What the manifest says of the camera.

    ``sensor`` is bayer, mono, dofp or dofp_bayer; ``layout_deg`` holds the
    transmission axes of a dofp sensor's 2 x 2 pixels, rows from the top.
    ``encoding`` is linear or srgb for PNG and TIFF, None for raw files;
    ``pattern`` the colours of the 2 x 2 cell, or of 2 x 2 groups of a
    dofp_bayer, where the files do not tell.  ``black_dn`` and ``white_dn``
    replace the files' levels, by channel of the sensor ("mono" without filters).
    ``offset_map`` and ``gain_map`` are TIFF files of the camera's own.
    """

    sensor: str = "bayer"
    layout_deg: tuple[tuple[float, ...], ...] | None = None
    encoding: str | None = None
    pattern: str = "RGGB"
    black_dn: Mapping[str, float] | None = None
    white_dn: Mapping[str, float] | None = None
    offset_map: Path | None = None
    gain_map: Path | None = None


def read_frame(path: Path, reading: Reading) -> RawFrame:
    """One frame, its pixels named and its levels set as the manifest says.

    A sensor with other colour filters than stated keeps those of its file.
    Raises ReflectanceFitError for what cannot be read, and for what decodes to
    something that is no photograph.
    """
    frame = decode(path) if reading.encoding is None else _of_samples(path, reading, reading.encoding)
    frame = _without_unused_bits(_with_levels(_as_stated(frame, reading), reading))
    reason = implausible(frame.cfa, frame.black, frame.white)
    if reason:
        raise ReflectanceFitError(Problem(str(path), None, reason))
    maps = None
    if reading.offset_map or reading.gain_map:
        maps = _maps(reading.offset_map, reading.gain_map, frame.cfa.shape)
    white = measured_white(frame.cfa, frame.black, frame.white)
    return replace(frame, maps=maps, measured_white=white)


def _of_samples(path: Path, reading: Reading, encoding: str) -> RawFrame:
    """The frame of a PNG or TIFF, which says nothing of filters, levels or exposure."""
    samples, white = decode_samples(path, encoding)
    return RawFrame(
        cfa=samples,
        channels=_pattern(reading) if reading.sensor == "bayer" else np.full((2, 2), "mono"),
        axes_deg=np.full((2, 2), np.nan),
        black=np.zeros((2, 2)),
        white=np.full((2, 2), white),
        exposure_s=None,
        iso=None,
        noise_profile=None,
    )


def _pattern(reading: Reading) -> NDArray[np.str_]:
    return np.array(list(reading.pattern)).reshape(2, 2)


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
    colours = np.repeat(np.repeat(_pattern(reading), 2, axis=0), 2, axis=1)
    profile = frame.noise_profile
    return replace(
        frame,
        channels=colours,
        axes_deg=np.tile(axes, (2, 2)),
        black=np.tile(frame.black, (2, 2)),
        white=np.tile(frame.white, (2, 2)),
        noise_profile=profile and {str(colour): profile["mono"] for colour in colours.flat},
    )


def _with_levels(frame: RawFrame, reading: Reading) -> RawFrame:
    """Black and white as stated; the noise profile, which is in parts of their distance, stays the same in DN."""
    if not reading.black_dn and not reading.white_dn:
        return frame
    black, white = (
        np.vectorize(lambda channel, own, stated=stated: (stated or {}).get(channel, own), otypes=[float])(
            frame.channels, levels
        )
        for levels, stated in ((frame.black, reading.black_dn), (frame.white, reading.white_dn))
    )
    profile = frame.noise_profile
    if profile is not None:
        wider = {c: _range(frame.channels, frame.white - frame.black, c) for c in profile}
        wider = {c: was / _range(frame.channels, white - black, c) for c, was in wider.items()}
        profile = {c: (s * wider[c], o * wider[c] ** 2) for c, (s, o) in profile.items()}
    return replace(frame, black=black, white=white, noise_profile=profile)


def _range(channels: NDArray[np.str_], distance: NDArray[np.float64], channel: str) -> float:
    return float(distance[channels == channel].mean())
