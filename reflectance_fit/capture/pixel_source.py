"""A capture made ready to be read pixel by pixel."""

from __future__ import annotations

from pathlib import Path

from reflectance_fit.capture.decoding import Progress, served_by
from reflectance_fit.capture.ingest import Ingested
from reflectance_fit.capture.pixel_signals import PixelSource
from reflectance_fit.capture.unpack import SavedMask, unpack


def pixel_source(ingested: Ingested, folder: Path, progress: Progress | None = None) -> PixelSource:
    """Unpack the frames that ``ingested`` used into ``folder``, where the source reads them from then on."""
    capture = ingested.capture
    frames = tuple(sample.frame for sample in ingested.samples)
    needed = {
        file.path: file
        for frame in frames
        for file in served_by(capture, frame, ingested.settings)
        if file.file not in ingested.rejected
    }
    files, hot = unpack(capture, needed.values(), folder, progress)
    mask = None if ingested.mask is None else SavedMask.of(ingested.mask, folder / "mask.npy")
    return PixelSource(capture, ingested.settings, frames, files, ingested.shifts, mask, hot)
