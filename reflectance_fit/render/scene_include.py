"""The files of a scene: the one that was named, and those that it includes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from reflectance_fit.errors import Problem, ReflectanceFitError
from reflectance_fit.inputs import existing, sha256_of
from reflectance_fit.manifests import check_schema
from reflectance_fit.render.scene_blocks import SceneBlock
from reflectance_fit.strict_yaml import Document, load, validate


@dataclass(frozen=True, slots=True, eq=False)
class SceneSource:
    """One file: its keys, their lines, and where other files are looked for from."""

    block: SceneBlock
    document: Document
    path: Path
    sha256: str


@dataclass(frozen=True, slots=True)
class _Waiting:
    path: Path
    ancestors: tuple[Path, ...]


def read_sources(path: Path) -> list[SceneSource]:
    """``path`` and all that it includes, itself first, each once.

    Raises ReflectanceFitError with the problems of all files, or with one line
    for a file that includes itself or is included twice.
    """
    sources: list[SceneSource] = []
    problems: list[Problem] = []
    met: set[Path] = set()
    waiting = [_Waiting(path, ())]
    while waiting:
        here = waiting.pop(0)
        try:
            document = load(here.path)
            check_schema(document, "scene")
            block = validate(document, SceneBlock)
            sources.append(SceneSource(block, document, here.path, sha256_of(here.path)))
        except ReflectanceFitError as error:
            problems += error.problems
            continue
        chain = (*here.ancestors, here.path.resolve())
        met.add(chain[-1])
        for i, found in _included(sources[-1], problems):
            _check_new(sources[-1], i, found.resolve(), chain, met)
            met.add(found.resolve())
            waiting.append(_Waiting(found, chain))
    if problems:
        raise ReflectanceFitError(dict.fromkeys(problems))
    return sources


def _included(source: SceneSource, problems: list[Problem]) -> Iterator[tuple[int, Path]]:
    for i, name in enumerate(source.block.include):
        try:
            existing(source.path, name)
            yield i, source.path.parent / name
        except ReflectanceFitError as error:
            problems += [
                source.document.problem(("include", i), f"{p.file}: {p.message}" if p.file else p.message)
                for p in error.problems
            ]


def _check_new(source: SceneSource, i: int, found: Path, chain: tuple[Path, ...], met: set[Path]) -> None:
    if found in chain:
        loop = " > ".join(path.name for path in (*chain[chain.index(found) :], found))
        message = f"a file that includes itself ({loop}); remove this line"
    elif found in met:
        message = f"{found.name} is included twice; once is enough"
    else:
        return
    raise ReflectanceFitError(source.document.problem(("include", i), message))
