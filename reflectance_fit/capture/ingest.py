"""A capture's photographs to observations: decoded apart, reduced, calibrated, one row a bin."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from reflectance_fit.capture.agreement import check_planes, check_sizes, unused_bits
from reflectance_fit.capture.allowed import allowed_for
from reflectance_fit.capture.balance import check_balance, check_cells
from reflectance_fit.capture.bins import Mask, Shift
from reflectance_fit.capture.brackets import merged
from reflectance_fit.capture.calibrate import Calibrated
from reflectance_fit.capture.decoding import Progress, decode, jobs_of, shifts_of
from reflectance_fit.capture.first_looks import first_looks
from reflectance_fit.capture.frames import Ball, Capture, Exposure, Sphere, flats_for
from reflectance_fit.capture.geometry import bins_of
from reflectance_fit.capture.linearity import nonlinear
from reflectance_fit.capture.locate import locate
from reflectance_fit.capture.observe import angle_rows, flat_rows
from reflectance_fit.capture.reference import check_references, references_for
from reflectance_fit.capture.settings import check_hashes, read_settings
from reflectance_fit.capture.signals import compared, flat_alone, knows_noise
from reflectance_fit.capture.survey import survey
from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.inputs import sha256_of
from reflectance_fit.measured import Measurement, Note
from reflectance_fit.views import ViewMaps


@dataclass(frozen=True, slots=True, eq=False)
class Ingested:
    """What a fit needs, and what became of every photograph.

    ``samples`` are the sample frames that were used, ``rejected`` maps the
    others' files to the reason, ``unused`` are darks and flats that serve no
    sample frame, ``settings`` every file's exposure and ISO, ``told`` what the
    calibration frames say, a line each.  ``shifts`` says where frames of a view
    show what its first frame shows; ``mask`` is what is left out of that.
    """

    capture: Capture
    measurement: Measurement
    samples: tuple[Calibrated, ...]
    rejected: dict[str, str]
    unused: frozenset[str]
    settings: dict[Path, Exposure]
    told: tuple[str, ...]
    shifts: dict[Path, Shift]
    mask: Mask | None


def ingest(
    capture: Capture, *, progress: Progress | None = None, seen: Callable[[ViewMaps], None] | None = None
) -> Ingested:
    """Decode, reduce and calibrate every frame of ``capture``.

    ``progress`` is called with (what, frames done, frames in all), ``seen``
    with what each view shows.  Raises
    ReflectanceFitError for hashes that do not match, unknown exposures, mixed
    ISO, files that are no raw photographs, and captures of which nothing is
    left.  A file that kills its decoder costs that frame and a warning.
    """
    settings = read_settings(capture)
    check_references(capture)
    capture, rejected = locate(capture, progress)
    capture, first = first_looks(capture, settings, progress)
    located = [frame for frame in capture.role("sample") if frame.file not in rejected]
    shifts, lost = shifts_of(capture, located, progress)
    jobs = jobs_of(capture, settings, [frame for frame in located if frame.path not in lost])
    with tempfile.TemporaryDirectory() as folder:
        cells = {path: Path(folder) / f"{number}.npz" for number, path in enumerate(jobs)}
        means, errors, hashes = decode(capture, jobs, progress, shifts, cells)
        there = [frame for frame in located if frame.path in means]
        looked = survey(capture, settings, {path: cells[path] for path in means}, there, seen)
    if looked.mask:
        again = {path: jobs[path] for path in means}
        means, _, _ = decode(capture, again, progress, shifts, masked=looked.mask)
    errors = first.errors | lost | errors
    hashes |= {frame.path: sha256_of(frame.path) for frame in capture.frames if frame.path not in hashes}
    check_hashes(capture, hashes)
    rejected |= {frame.file: errors[frame.path] for frame in capture.frames if frame.path in errors}
    rejected |= looked.rejected
    check_planes(capture, means)
    check_sizes(capture, settings, means, capture.role("sample"))
    told_of_bits = unused_bits(capture, means)
    for frame in capture.role("sample"):
        # Among frames that are divided by their flats it would be out of proportion.
        flats = flats_for(frame, capture.frames)
        if flats and not any(flat.path in means for flat in flats):
            rejected.setdefault(frame.file, "has lost all of its flats")
        references = references_for(frame, capture.frames)
        if references and not any(r.path in means for r in references):
            rejected.setdefault(frame.file, "has lost its reference")
    samples = [
        compared(capture, frame, settings, means, bins_of(capture, frame))
        for frame in capture.role("sample")
        if frame.file not in rejected
    ]
    if not samples:
        problems = [Problem(str(capture.path), None, f"{file} {reason}") for file, reason in rejected.items()]
        raise ReflectanceFitError(problems)
    rows_of = angle_rows if isinstance(capture.geometry, Sphere | Ball) else flat_rows
    views = merged(samples)
    observations = rows_of(capture, views)
    nuisances, common = allowed_for(capture, observations)
    notes = [Note("ROWS_IGNORED", f"{file} {reason}") for file, reason in rejected.items()]
    notes += looked.notes
    white = [
        flat_alone(capture, flat, settings, means) for flat in capture.role("flat") if flat.path in means
    ]
    notes += [Note("NOT_LINEAR", text) for text in nonlinear([*samples, *white])]
    notes += check_balance(capture, views)
    notes += check_cells(capture, means)
    if not all(
        knows_noise(capture, means[s.frame.path], plane.channel) for s in samples for plane in s.signals
    ):
        message = "sigma is from how neighbouring pixels of the flats differ, their own differences included"
        if capture.role("flat"):
            notes.append(Note("SIGMA_ESTIMATED", f"{message}; take the flats and a dark in pairs"))
    if any(frame.sha256 is None for frame in capture.frames):
        notes.append(
            Note("NO_HASHES", "a damaged photograph can pass unnoticed; ingest --write-hashes states them")
        )
    measurement = Measurement(
        path=capture.path,
        sample_name=capture.sample_name,
        exterior_ior=capture.exterior_ior,
        observations=observations,
        nuisances=nuisances,
        priors=capture.priors,
        warnings=tuple(notes),
        inputs=(*capture.inputs, *((frame.file, hashes[frame.path]) for frame in capture.frames)),
        sample_note=capture.sample_note,
        common_sigmas=common,
    )
    # Frames of role geometry have served when they were not rejected.
    used = set(jobs) | first.used | {frame.path for frame in capture.role("geometry")}
    unused = frozenset(f.file for f in capture.frames if f.path not in used and f.file not in rejected)
    told = (*first.told, *told_of_bits)
    return Ingested(
        capture, measurement, tuple(samples), rejected, unused, settings, told, shifts, looked.mask
    )
