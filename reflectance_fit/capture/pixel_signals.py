"""Calibrated signals of every pixel of a map, a part of the picture at a time.

A map's pixel is a cell of the sensor's pattern: a pixel of a sensor without
filters, 2 x 2 pixels of a Bayer sensor.  It stands where the first view shows
it; other frames show it where registration or the board says, else at the same
place.  What makes a signal of it is what makes one of a bin of angles.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.capture.bins import BoolArray, Cells, FloatArray, Shift
from reflectance_fit.capture.brackets import merged
from reflectance_fit.capture.calibrate import Calibrated, channel_of
from reflectance_fit.capture.decoding import served_by
from reflectance_fit.capture.frames import Capture, Exposure, Frame, OnBoard, flats_for
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.capture.pixel_means import Places, middle_of, pixel_means
from reflectance_fit.capture.pixel_views import View, angles, to_view, view_of
from reflectance_fit.capture.raw import Plane, RawFrame
from reflectance_fit.capture.reduce import FrameMeans
from reflectance_fit.capture.signals import compared
from reflectance_fit.capture.unpack import SavedMask, Unpacked
from reflectance_fit.errors import Problem, ReflectanceFitError


@dataclass(frozen=True, slots=True, eq=False)
class PixelRow:
    """What one row of signals was seen through; angles in radians from the picture's horizontal, NaN: none."""

    view: int
    gain_group: str
    analyzer: float
    diattenuation: float
    retarder: float
    retardance: float
    light: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class PixelSignals:
    """One channel of some cells.

    ``value`` and ``variance``, float32 of shape (rows, cells): DN a second, NaN where a row does
    not count.  ``saturated`` and ``masked`` say why, shape (cells,): in any of the rows; ``inside``
    where the sample is, in all views.
    """

    rows: tuple[PixelRow, ...]
    views: tuple[View, ...]
    value: NDArray[np.float32]
    variance: NDArray[np.float32]
    inside: BoolArray
    saturated: BoolArray
    masked: BoolArray


@dataclass(frozen=True, slots=True, eq=False)
class PixelSource:
    """All that is needed to read any part of a capture, pixel by pixel.

    ``frames`` are the sample's, ``files`` every file's pixels; ``shifts`` and ``mask`` as in Ingested,
    ``hot`` are the sensor's pixels to leave out.
    """

    capture: Capture
    settings: Mapping[Path, Exposure]
    frames: tuple[Frame, ...]
    files: Mapping[Path, Unpacked]
    shifts: Mapping[Path, Shift]
    mask: SavedMask | None
    hot: SavedMask | None

    def extent(self) -> Cells:
        """Every whole cell of the sample; ReflectanceFitError where no pixel is in all regions."""
        first = self.files[self.frames[0].path]
        frames = [f for f in self.frames if view_of(self.capture, f) == view_of(self.capture, self.frames[0])]
        if not isinstance(self.capture.geometry, OnBoard):
            frames = list(self.frames)
        height, width = first.about.shape
        boxes = [bins_of(self.capture, frame).box() for frame in frames]
        top, left = (max(0, *(box[i].start for box in boxes)) for i in (0, 1))
        bottom = min(height, *(box[0].stop for box in boxes))
        right = min(width, *(box[1].stop for box in boxes))
        n = len(first.frame.channels)
        top, left = math.ceil(top / n) * n, math.ceil(left / n) * n
        rows, columns = (bottom - top) // n, (right - left) // n
        if rows < 1 or columns < 1:
            message = "no pixel is in the region of every frame; a map needs one region for all of them"
            raise ReflectanceFitError(Problem(str(self.capture.path), None, message))
        return Cells(left, top, n, rows, columns)

    def signals(self, channel: str, cells: Cells) -> PixelSignals:
        """The rows of a channel, in the order of the manifest."""
        used = [frame for frame in self.frames if channel in frame.channels]
        cells = replace(cells, shares_gain=self._shares_gain(used))
        firsts: dict[object, Frame] = {}
        for frame in used:
            firsts.setdefault(view_of(self.capture, frame), frame)
        numbers = {view: number for number, view in enumerate(firsts)}
        x, y = self._positions(used[0], channel, cells)
        seen = [angles(self.capture, self.frames[0], frame, x, y) for frame in firsts.values()]
        masked = np.stack([self._masked(frame, cells) for frame in firsts.values()])
        signals = merged(_Tile(self, channel, cells).calibrated(frame) for frame in used)
        rows, values, variances, clipped = [], [], [], []
        for sample in signals:
            view = numbers[view_of(self.capture, sample.frame)]
            for plane, own in sample.of(channel):
                lost = own.saturated | own.rejected | masked[view]
                rows.append(self._row(sample, plane, channel, view, seen[view]))
                values.append(np.where(lost, math.nan, own.value))
                variances.append(own.variance)
                clipped.append(own.saturated)
        inside = np.all([np.isfinite(v.theta) & np.isfinite(v.s_direction) for v, _ in seen], axis=0)
        return PixelSignals(
            rows=tuple(rows),
            views=tuple(view for view, _ in seen),
            value=np.array(values, dtype=np.float32),
            variance=np.array(variances, dtype=np.float32),
            inside=np.broadcast_to(inside, (cells.count,)),
            saturated=np.any(clipped, axis=0),
            masked=np.any(masked, axis=0),
        )

    def _shares_gain(self, frames: list[Frame]) -> bool:
        """Whether all frames of one gain see a point by the same pixels, over the same flats."""
        if any(frame.path in self.shifts for frame in frames):
            return False
        flats = {tuple(f.path for f in flats_for(frame, self.capture.frames)) for frame in frames}
        return len(flats) == 1 and not (
            isinstance(self.capture.geometry, OnBoard) and any(frame.gain_group for frame in frames)
        )

    def places(self, frame: Frame) -> Places | None:
        """From the map's positions to those in ``frame``, None where they are the same."""
        moved, shift = to_view(self.capture, self.frames[0], frame), self.shifts.get(frame.path)
        if moved is None or shift is None:
            return moved or (shift.forward if shift else None)
        return lambda x, y: shift.forward(*moved(x, y))

    def _positions(self, frame: Frame, channel: str, cells: Cells) -> tuple[FloatArray, FloatArray]:
        raw = self.files[frame.path].frame
        plane = next(plane for plane in raw.planes() if channel_of(frame, plane) == channel)
        x, y = cells.places(*middle_of(raw, plane.channel))
        return x.ravel(), y.ravel()

    def _masked(self, frame: Frame, cells: Cells) -> BoolArray:
        """Whether a pixel of the cell is left out in the view of ``frame``, shape (cells,)."""
        if self.mask is None:
            return np.zeros(cells.count, dtype=bool)
        moved, mask = to_view(self.capture, self.frames[0], frame), self.mask.open()
        found = np.zeros((cells.rows, cells.columns), dtype=bool)
        height, width = mask.shape
        for dy in range(cells.pitch):
            for dx in range(cells.pitch):
                x, y = cells.places(dx, dy)
                if moved is not None:
                    x, y = moved(x, y)
                row = np.clip(np.rint(y), 0, height - 1).astype(np.int64)
                column = np.clip(np.rint(x), 0, width - 1).astype(np.int64)
                found |= (mask.bits[row, column >> 3] >> (7 - (column & 7))) & 1 == 1
        return found.ravel()

    def _row(
        self, sample: Calibrated, plane: Plane, channel: str, view: int, seen: tuple[View, float]
    ) -> PixelRow:
        capture, frame = self.capture, sample.frame
        axis_deg = frame.analyzer_deg if plane.axis_deg is None else plane.axis_deg
        group = frame.gain_group or frame.set
        if isinstance(capture.geometry, OnBoard) and frame.gain_group is None:
            group = f"{frame.set}:view {capture.geometry.poses[frame.path].view}"
        has_retarder = not math.isnan(frame.retarder_deg)
        return PixelRow(
            view=view,
            gain_group=group,
            analyzer=math.radians(axis_deg),
            diattenuation=capture.diattenuation[channel] * seen[1],
            retarder=math.radians(frame.retarder_deg),
            retardance=math.radians(capture.retardance_deg[channel]) if has_retarder else math.nan,
            light=frame.light,
        )


class _Tile:
    """The means of every file over some cells, each found once."""

    def __init__(self, source: PixelSource, channel: str, cells: Cells) -> None:
        self._source, self._channel, self._cells = source, channel, cells
        self._still: dict[Path, FrameMeans] = {}
        self._hot = None if source.hot is None else source.hot.open()
        self._clip: dict[Plane, float] = {}
        for file in source.files.values():
            for plane, clip in file.about.clip.items():
                self._clip[plane] = min(clip, self._clip.get(plane, clip))

    def calibrated(self, frame: Frame) -> Calibrated:
        source = self._source
        places = source.places(frame)
        # What the frame shows elsewhere its darks and flats must say of that place.
        means = self._still if places is None else {}
        raw = source.files[frame.path].frame
        planes = [plane for plane in raw.planes() if channel_of(frame, plane) == self._channel]
        for served in served_by(source.capture, frame, source.settings):
            if served.path in source.files and served.path not in means:
                file = source.files[served.path]
                means[served.path] = self._means(file, file.open(), planes, places)
        return compared(source.capture, frame, source.settings, means, self._cells)

    def _means(
        self, file: Unpacked, frame: RawFrame, planes: list[Plane], places: Places | None
    ) -> FrameMeans:
        found = {
            plane: pixel_means(frame, plane, self._cells, places, self._hot, self._clip[plane])
            for plane in planes
        }
        return replace(file.about, bins=(self._cells,), planes=(found,))
