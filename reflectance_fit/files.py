"""Files written whole or not at all, and all or none."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from reflectance_fit.errors import Problem, ReflectanceFitError

_STAGE = ".unfinished."
_LOCK = ".lock"


def write_together(
    folder: Path, fill: Callable[[Path], object], *, last: str, superseded: Iterable[Path] = ()
) -> None:
    """Let ``fill`` write files into a temporary folder, then move them all into ``folder``.

    Until every file is complete ``folder`` stays as it was, absent included.
    ``last`` is moved last: where it stands, the rest does.  Of the files
    ``superseded`` those that were not written anew are removed; whatever else
    is in ``folder`` stays.
    """
    # On the same file system as the target, so that moving is renaming.
    stage = Path(tempfile.mkdtemp(prefix=_STAGE, dir=_nearest_existing(folder)))
    try:
        fill(stage)
        files = sorted((p for p in stage.rglob("*") if p.is_file()), key=lambda p: (p.name == last, p))
        targets = [folder / path.relative_to(stage) for path in files]
        for path, target in zip(files, targets, strict=True):
            _flush(path)
            if target.is_dir():
                message = "a folder stands where the file should be; move it away"
                raise ReflectanceFitError(Problem(str(target), None, message))
        for path, target in zip(files, targets, strict=True):
            target.parent.mkdir(parents=True, exist_ok=True)
            path.replace(target)
        for path in set(superseded) - set(targets):
            path.unlink(missing_ok=True)
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def write_whole(path: Path, fill: Callable[[Path], object]) -> None:
    """Let ``fill`` write one file under another name, then move it to ``path``: complete, or as it was before."""
    write_together(path.parent, lambda stage: fill(stage / path.name), last=path.name)


def check_writable(folder: Path) -> None:
    """Raise, before any work is done, where ``folder`` cannot be made or written; leaves nothing behind."""
    try:
        existing = _nearest_existing(folder)
        if not existing.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "a file stands where the folder should be")
        with tempfile.TemporaryFile(dir=existing):
            pass
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        message = f"cannot write here: {reason}; choose another -o"
        raise ReflectanceFitError(Problem(str(folder), None, message)) from error


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Hold ``folder``, made where it is not, for one run: another meets ReflectanceFitError.

    The system lets go when the process ends, however it ends.  What killed
    processes left unfinished in ``folder`` and the folders in it is removed,
    before and after.
    """
    import fcntl

    folder.mkdir(parents=True, exist_ok=True)
    with (folder / _LOCK).open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            message = "another run writes here; wait for it to end, or choose another -o"
            raise ReflectanceFitError(Problem(str(folder), None, message)) from error
        _sweep(folder)
        try:
            yield
        finally:
            _sweep(folder)


def _sweep(folder: Path) -> None:
    for pattern in (f"{_STAGE}*", f"*/{_STAGE}*"):
        for stage in folder.glob(pattern):
            shutil.rmtree(stage, ignore_errors=True)


def _nearest_existing(path: Path) -> Path:
    while not path.exists() and path != path.parent:
        path = path.parent
    return path


def _flush(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())
