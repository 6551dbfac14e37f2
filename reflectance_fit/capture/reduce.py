"""From one file to a few numbers a bin: what runs inside the decoding worker."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from reflectance_fit.capture.bins import Bins, Box, Cells, Mask, Shift
from reflectance_fit.capture.dofp_cells import uneven_cells
from reflectance_fit.capture.plane_means import PlaneMeans, plane_means
from reflectance_fit.capture.raw import Plane, RawFrame
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.capture.thumbnails import cell_means
from reflectance_fit.inputs import sha256_of


@dataclass(frozen=True, slots=True, eq=False)
class FrameMeans:
    """A frame reduced: for each kind of bins asked for, the means of every plane.

    ``noise`` maps a channel to (a, b): the variance of a pixel is a * mean + b
    in DN^2, by the file's noise profile; None without one.  ``scatter`` maps a
    plane to its mean (DN above black) and the variance between neighbouring
    pixels, both over the middle half of the sensor.  ``clip`` maps a plane to
    what counts as clipped, DN above black.  ``shape`` is the sensor's, (h, w).
    ``sha256`` is the file's, "" of a frame that comes from none;
    ``unused_bits`` as in RawFrame.  ``uneven`` maps a channel to how many cells
    fail the test of ``uneven_cells``, and to all.
    """

    bins: tuple[Bins | Cells, ...]
    planes: tuple[dict[Plane, PlaneMeans], ...]
    noise: dict[str, tuple[float, float]] | None
    scatter: dict[Plane, tuple[float, float]]
    clip: dict[Plane, float]
    shape: tuple[int, int]
    sha256: str = ""
    unused_bits: int = 0
    uneven: dict[str, tuple[int, int]] = field(default_factory=dict)

    def over(self, bins: Bins | Cells) -> dict[Plane, PlaneMeans]:
        """The planes' means over one of ``bins``."""
        return self.planes[self.bins.index(bins)]


@dataclass(frozen=True, slots=True)
class Changed:
    """A file whose bytes are not those that the manifest states; it was not decoded."""

    sha256: str


def reduce_file(
    path: Path,
    reading: Reading,
    stated_sha256: str | None,
    bins: tuple[Bins, ...],
    is_flat: bool = False,
    shift: Shift | None = None,
    mask: Mask | None = None,
    cell_noise: Mapping[str, tuple[float, float]] | None = None,
    cells: tuple[Box, Path] | None = None,
) -> FrameMeans | Changed:
    """Check, decode and reduce one file; ReflectanceFitError for what cannot be read.

    ``cell_noise`` is the noise to test cells of polarizers with, for channels of which the file does not tell;
    None: they are not tested.  ``cells`` are rows and columns to be seen as a CellPicture, and the file to write
    that to.
    """
    found = sha256_of(path)
    if stated_sha256 not in (None, found):
        return Changed(found)
    frame = read_frame(path, reading)
    # That frames differ in size is told by the capture as a whole.
    fitting = mask if mask is not None and mask.shape == frame.cfa.shape else None
    if cells is not None:
        cell_means(frame, cells[0], shift, fitting).save(cells[1])
    means = reduce_frame(frame, bins, is_flat, shift, fitting)
    uneven = {}
    if cell_noise is not None and bins:
        uneven = uneven_cells(frame, bins[0], (means.noise or {}) | dict(cell_noise), shift, fitting)
    return replace(means, sha256=found, uneven=uneven)


def reduce_frame(
    frame: RawFrame,
    bins: tuple[Bins, ...],
    is_flat: bool = False,
    shift: Shift | None = None,
    mask: Mask | None = None,
) -> FrameMeans:
    """Average ``frame`` over each of ``bins``, less the pixels of ``mask``.

    ``bins`` are places in the first frame of the view; ``shift`` says where
    this frame shows them.  A sample's mean over its flat's is the mean
    reflectance of a bin weighted by the flat, so it belongs to angles weighted
    alike: those of the flat.
    """
    noise = None
    if frame.noise_profile is not None:
        # The profile speaks of (DN - black) / (white - black).
        span = {
            c: float((frame.white - frame.black)[frame.channels == c].mean()) for c in frame.noise_profile
        }
        noise = {c: (s * span[c], o * span[c] ** 2) for c, (s, o) in frame.noise_profile.items()}
    planes = tuple(
        {plane: plane_means(frame, plane, which, is_flat, shift, mask) for plane in frame.planes()}
        for which in bins
    )
    scatter = {plane: _scatter(frame, plane) for plane in frame.planes()}
    above = frame.clip - frame.black
    clip = {plane: min(float(above[site]) for site in frame.sites(plane)) for plane in frame.planes()}
    height, width = frame.cfa.shape
    return FrameMeans(bins, planes, noise, scatter, clip, (height, width), unused_bits=frame.unused_bits)


def _scatter(frame: RawFrame, plane: Plane) -> tuple[float, float]:
    """Mean, and half the mean squared difference of horizontal neighbours: blind to slow gradients."""
    y, x = frame.sites(plane)[0]
    n = len(frame.channels)
    height, width = frame.cfa.shape
    rows = slice(height // 4 // n * n + y, 3 * height // 4, n)
    columns = slice(width // 4 // n * n + x, 3 * width // 4, n)
    dn = frame.cfa[rows, columns].astype(np.float32)
    return float(dn.mean() - frame.black[y, x]), float(0.5 * np.mean(np.diff(dn, axis=1) ** 2))
