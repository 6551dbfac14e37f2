"""``ingest``: photographs to an OBS.nc, with pictures of what each view shows."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from pathlib import Path

from reflectance_fit.capture.ingest import Ingested, ingest
from reflectance_fit.capture.read import read_capture
from reflectance_fit.files import check_writable, write_together, write_whole
from reflectance_fit.inputs import sha256_of
from reflectance_fit.observations_file import write_observations
from reflectance_fit.views import ViewMaps
from reflectance_fit.yaml_edit import write_hashes_into

Progress = Callable[[str, int, int], None]

_VIEW = re.compile(r"view-\d+\.(png|svg)")


def ingest_to_file(
    source: Path, out: Path, *, write_hashes: bool, pictures: bool, progress: Progress
) -> Ingested:
    """Read the photographs of a capture.yaml and write their observations to ``out``.

    With ``write_hashes`` the sha256 of every frame is written into the
    capture.yaml first.  With ``pictures`` what each view shows is drawn into
    the folder ``pictures_of(out)``, in place of earlier pictures.
    """
    check_writable(out.parent)
    folder = pictures_of(out)
    if pictures:
        check_writable(folder)
    if write_hashes:
        capture = read_capture(source)
        hashes = {frame.file: sha256_of(frame.path) for frame in capture.frames}
        write_whole(source, lambda part: write_hashes_into(source, part, hashes))
    capture = read_capture(source)
    if not pictures:
        ingested = ingest(capture, progress=progress)
        write_observations(ingested.measurement, out)
        return ingested
    results: list[Ingested] = []

    def fill(stage: Path) -> None:
        from reflectance_fit.plot.style import save
        from reflectance_fit.plot.views import draw_view

        number = itertools.count(1)

        def seen(view: ViewMaps) -> None:
            save(draw_view(view), stage, f"view-{next(number):02d}")

        results.append(ingest(capture, progress=progress, seen=seen))
        write_observations(results[0].measurement, out)

    earlier = [path for path in folder.glob("*") if _VIEW.fullmatch(path.name)]
    write_together(folder, fill, last="view-01.png", superseded=earlier)
    return results[0]


def pictures_of(out: Path) -> Path:
    """The folder of pictures beside an OBS.nc: OBS-pictures."""
    return out.with_name(f"{out.stem}-pictures")
