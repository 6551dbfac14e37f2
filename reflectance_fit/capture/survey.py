"""Looks at all frames of a view together: what is masked, what there is to see."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reflectance_fit.capture.bins import Mask, Region
from reflectance_fit.capture.calibrate import channel_of
from reflectance_fit.capture.frames import (
    Ball,
    Capture,
    Exposure,
    Frame,
    OnBoard,
    Sphere,
    darks_for,
    flats_for,
)
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.capture.masks import Rings, highlights, stray_light
from reflectance_fit.capture.raw import Plane
from reflectance_fit.capture.thumbnails import CellPicture
from reflectance_fit.measured import Note
from reflectance_fit.views import BoolArray, FloatArray, StokesMaps, ViewMaps, stokes_maps

MOST_MASKED = 0.5
"""Of a sample's cells: what shows less of the sample than of something else is rejected."""

HIGHLIGHTS, STRAY, CLIPPED = "highlights and dust", "stray light", "clipped"


@dataclass(frozen=True, slots=True)
class Survey:
    """Sensor pixels to leave out (None: none), why frames are rejected (by file), and what to tell."""

    mask: Mask | None
    rejected: dict[str, str]
    notes: tuple[Note, ...]


def views_of(capture: Capture, frames: Iterable[Frame]) -> list[tuple[Frame, ...]]:
    """The sample frames that show the same from the same place, in the order of the manifest."""
    views: dict[tuple[object, ...], list[Frame]] = {}
    geometry = capture.geometry
    for frame in frames:
        pose = geometry.poses[frame.path].view if isinstance(geometry, OnBoard) else frame.theta_deg
        # Angles that are not stated are NaN, which is unlike itself.
        views.setdefault((frame.set, str(pose), frame.light), []).append(frame)
    return [tuple(view) for view in views.values()]


def survey(
    capture: Capture,
    settings: Mapping[Path, Exposure],
    cells: Mapping[Path, Path],
    frames: Sequence[Frame],
    seen: Callable[[ViewMaps], None] | None = None,
) -> Survey:
    """What the sample ``frames`` show.

    ``cells`` maps a frame's path to its CellPicture on the disk.  ``seen`` is
    called with the maps of each view, of the channel in the middle.
    """
    mask: Mask | None = None
    rejected: dict[str, str] = {}
    notes = []
    for view in views_of(capture, frames):
        looks = _Looks(capture, settings, cells, view)
        maps = [one for channel in capture.channels if (one := looks.maps(channel)) is not None]
        if not maps:
            continue
        if seen:
            seen(maps[len(maps) // 2])
        inside = maps[0].inside
        shares = {}
        for reason in (HIGHLIGHTS, STRAY):
            masked = np.any([m.masked[reason] for m in maps], axis=0)
            shares[reason] = float(masked.sum() / max(1, inside.sum()))
        parts = ", ".join(f"{reason} {100 * share:.2g} %" for reason, share in shares.items() if share)
        left_out = np.any([m.masked[reason] for m in maps for reason in (HIGHLIGHTS, STRAY)], axis=0)
        if left_out.sum() > MOST_MASKED * inside.sum():
            rejected |= {frame.file: f"shows too little of the sample alone ({parts})" for frame in view}
        elif parts:
            notes.append(Note("MASKED", f"{view[0].file} to {view[-1].file}: {parts} of the sample left out"))
            found = looks.first.grid.mask(left_out, looks.first.shape)
            mask = found if mask is None else mask | found
    return Survey(mask, rejected, tuple(notes))


class _Looks:
    """The pictures of one view, each calibrated: dark subtracted, flat and exposure divided out."""

    def __init__(
        self,
        capture: Capture,
        settings: Mapping[Path, Exposure],
        cells: Mapping[Path, Path],
        view: tuple[Frame, ...],
    ) -> None:
        self._capture, self._settings, self._cells, self._view = capture, settings, cells, view
        self._shown = [(frame, CellPicture.load(cells[frame.path])) for frame in view]
        self.first = self._shown[0][1]
        x, y = self.first.grid.centres()
        bins = bins_of(capture, view[0])
        self._rings: Rings | None = None
        if isinstance(bins, Region):
            self._inside: BoolArray = bins.holds(x, y)
            self._theta: FloatArray = np.array(math.radians(view[0].theta_deg))
        else:
            seen, theta, s_axis = bins.angles(x.ravel(), y.ravel())
            angles = np.full((2, x.size), np.nan)
            angles[:, seen] = theta, s_axis
            self._theta, s_axes = angles.reshape(2, *x.shape)
            self._inside = np.isfinite(self._theta)
            if isinstance(capture.geometry, Sphere | Ball):
                self._rings = Rings(self._theta, s_axes)

    def maps(self, channel: str) -> ViewMaps | None:
        """What the view shows of a channel; None where no frame is of it."""
        pictures, axes_deg = [], []
        for frame, shown in self._shown:
            # A retarder's frames are another experiment.
            if math.isnan(frame.retarder_deg):
                for plane, picture in self._calibrated(frame, shown, channel):
                    pictures.append(picture)
                    axes_deg.append(frame.analyzer_deg if plane.axis_deg is None else plane.axis_deg)
        if not pictures:
            return None
        signals = np.stack(pictures)
        clipped = np.isinf(signals).any(axis=0) & self._inside
        stokes = stokes_maps(signals, np.radians(axes_deg), self._capture.diattenuation[channel])
        told = stokes is not None
        if stokes is None:
            # Too few axes for the polarization; brightness still shows dots.
            unknown = np.full(signals.shape[1:], np.nan)
            total = np.where(np.isfinite(signals).all(axis=0), signals, np.nan).sum(axis=0)
            stokes = StokesMaps(np.where(total > 0, total, np.nan), unknown, unknown, None)
        usable = self._inside & np.isfinite(stokes.s0)
        masked = {
            HIGHLIGHTS: highlights(stokes, usable, self._rings),
            STRAY: stray_light(stokes, usable, self._rings) if told else np.zeros_like(usable),
            CLIPPED: clipped,
        }
        grid, frame = self.first.grid, self._view[0]
        known = self._theta[self._inside] if self._theta.ndim else self._theta
        flat = self._rings is None and np.isfinite(known).any()
        angle = f", {np.degrees(np.median(known)):.4g}°" if flat else ""
        return ViewMaps(
            name=f"set {frame.set}{angle}",
            channel=channel,
            left=grid.left,
            top=grid.top,
            pitch=grid.pitch,
            stokes=stokes,
            theta=self._theta,
            inside=self._inside,
            masked=masked,
        )

    def _calibrated(self, frame: Frame, shown: CellPicture, channel: str) -> list[tuple[Plane, FloatArray]]:
        """Each plane of ``channel`` in one frame, DN per second or shares of the flat."""
        planes = [plane for plane in shown.planes if channel_of(frame, plane) == channel]
        above, flats = self._above_dark(frame, shown), []
        for flat in flats_for(frame, self._capture.frames):
            if picture := self._load(flat, shown):
                level = self._above_dark(flat, picture)
                flats.append(np.where(np.isfinite(level), level, np.nan))
        with np.errstate(invalid="ignore", divide="ignore"):
            if flats:
                above = above / np.mean(flats, axis=0)
        return [(plane, above[shown.planes.index(plane)]) for plane in planes]

    def _above_dark(self, frame: Frame, shown: CellPicture) -> FloatArray:
        """DN per second above the darks, shape (planes, h, w)."""
        darks = [
            # A clipped cell of a dark tells nothing.
            np.where(np.isfinite(picture.means), picture.means, np.nan)
            for dark in darks_for(frame, self._capture.frames, self._settings)
            if (picture := self._load(dark, shown))
        ]
        above = shown.means - np.mean(darks, axis=0) if darks else shown.means
        return np.asarray(above, dtype=np.float64) / float(self._settings[frame.path].seconds or math.nan)

    def _load(self, frame: Frame, like: CellPicture) -> CellPicture | None:
        """A dark's or flat's picture; None where it was not read or is of other cells."""
        path = self._cells.get(frame.path)
        picture = CellPicture.load(path) if path is not None else None
        return picture if picture is not None and picture.grid == like.grid else None
