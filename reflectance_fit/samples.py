"""Which samples a batch is of: the captures and measurements in folders, and a safe name for each."""

from __future__ import annotations

import hashlib
import os
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from reflectance_fit.errors import Problem, ReflectanceFitError

_KINDS = ("measurement.yaml", "capture.yaml")
_LONGEST = 120  # bytes of a name; file systems allow 255, and files beside it are named after it


@dataclass(frozen=True, slots=True)
class Sample:
    """A manifest or OBS.nc, as the user wrote it, and the name of its result folder."""

    name: str
    source: Path


def find_samples(paths: Iterable[Path], *, leave_out: Path) -> tuple[Sample, ...]:
    """The samples that ``paths`` name, by name: files are taken as they are, folders searched.

    Searched for are ``measurement.yaml``, ``capture.yaml`` and names that end
    in ``.measurement.yaml`` or ``.capture.yaml``, in subfolders too; not in
    hidden ones, through links to folders, or in ``leave_out``.  A file that is
    found twice counts once.

    Raises ReflectanceFitError for a path that is not there, or none found.
    """
    found: dict[Path, tuple[Path, str]] = {}
    problems = []
    for path in paths:
        if path.is_dir():
            here = list(_search(path, leave_out.resolve()))
            if not here:
                message = "holds no capture.yaml or measurement.yaml; is it the right folder?"
                problems.append(Problem(str(path), None, message))
            for source in here:
                found.setdefault(source.resolve(), (source, _short(source.relative_to(path), path)))
        elif path.exists():
            found.setdefault(path.resolve(), (path, _short(Path(path.name), path.parent)))
        else:
            problems.append(Problem(str(path), None, "there is no such file or folder"))
    if problems:
        raise ReflectanceFitError(problems)
    sources, names = zip(*found.values(), strict=True)
    samples = (Sample(name, source) for source, name in zip(sources, _apart(sources, names), strict=True))
    return tuple(sorted(samples, key=lambda sample: sample.name))


def _search(folder: Path, leave_out: Path) -> Iterator[Path]:
    for here, folders, files in os.walk(folder):
        folders[:] = sorted(
            f for f in folders if not f.startswith(".") and (Path(here) / f).resolve() != leave_out
        )
        for file in sorted(files):
            if file in _KINDS or file.endswith(tuple(f".{kind}" for kind in _KINDS)):
                yield Path(here) / file


def _short(file: Path, folder: Path) -> str:
    """``a/b`` of a/b/measurement.yaml and of a/b.measurement.yaml in ``folder``, whose own name is the last resort."""
    stem = file.name
    for kind in _KINDS:
        stem = stem.removesuffix(kind)
    stem = stem.removesuffix(".yaml").removesuffix(".nc").rstrip(".")
    return "/".join([*file.parent.parts, *([stem] if stem else [])]) or folder.resolve().name


def _apart(sources: Sequence[Path], short: Iterable[str]) -> list[str]:
    """Safe names that differ, on file systems that ignore case too: longer where short ones are the same."""
    names = [_safe(name) for name in short]
    names = _where_equal(names, [_safe(source.with_suffix("").as_posix()) for source in sources])
    return _where_equal(names, [f"{n}-{_digest(str(s))}" for n, s in zip(names, sources, strict=True)])


def _where_equal(names: list[str], longer: list[str]) -> list[str]:
    count = Counter(name.casefold() for name in names)
    return [long if count[name.casefold()] > 1 else name for name, long in zip(names, longer, strict=True)]


def _safe(text: str) -> str:
    """A file name of ``text``: letters, digits, dot, dash and underscore; folders apart by two underscores."""
    parts = [
        re.sub(r"[^\w.-]+", "_", unicodedata.normalize("NFC", part)).lstrip(".-") for part in text.split("/")
    ]
    name = "__".join(part for part in parts if part)
    if not name or len(name.encode()) > _LONGEST:
        kept = name.encode()[: _LONGEST - 9].decode(errors="ignore")
        name = f"{kept}-{_digest(text)}".lstrip("-")
    return name


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode(errors="surrogateescape")).hexdigest()[:8]
