"""The files that a manifest names: inside its folder, and known by their sha256."""

from __future__ import annotations

import hashlib
from pathlib import Path

from reflectance_fit.errors import Problem, ReflectanceFitError


def confined(manifest: Path, file: str) -> Path:
    """The absolute path of ``file``, which must lie inside the folder of ``manifest``; it need not exist.

    Raises ReflectanceFitError, with no line and a message that names ``file``,
    for paths that lead outside: absolute ones, "..", symbolic links.
    """
    try:
        folder = manifest.parent.resolve()
        path = (folder / file).resolve()
        inside = path.is_relative_to(folder) and ".." not in Path(file).parts and not Path(file).is_absolute()
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links, a NUL
        raise ReflectanceFitError(f"'{file}' is not a usable path: {error}") from error
    if not inside:
        raise ReflectanceFitError(
            f"'{file}' leads outside the folder of {manifest.name}; copy the file there and name it by its"
            " path from there"
        )
    return path


def check_regular(path: Path, shown: str) -> None:
    """ReflectanceFitError, with ``shown`` for the file, where ``path`` is no regular file that can be looked at."""
    try:
        if path.is_file():
            return
        why = "there is no such file"
        if path.exists():
            why = "is a folder, not a file" if path.is_dir() else "is not a regular file"
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        why = f"cannot be read: {getattr(error, 'strerror', None) or error}"
    raise ReflectanceFitError(Problem(shown, None, why))


def existing(manifest: Path, file: str) -> Path:
    """As ``confined``, for a regular file that is there."""
    path = confined(manifest, file)
    check_regular(path, file)
    return path


def sha256_of(path: Path) -> str:
    """Of the file's bytes, 64 hexadecimal digits; OSError where it cannot be read."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
