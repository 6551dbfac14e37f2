"""The built-in materials: what they are called, where they come from, how well they are known.

``index.yaml`` beside this module lists them; ``constants/`` holds one file for each.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from reflectance_fit.errors import ReflectanceFitError, suggestion
from reflectance_fit.materials.loader import OpticalConstants, RelativeTo, load_optical_constants
from reflectance_fit.strict_yaml import load, validate

_FOLDER = Path(__file__).parent
# "silicon carbide" is not silicon.
_ANION = r"\w*(?:ox|nitr|carb|sulf|sulph|selen|tellur|fluor|chlor|brom|iod|arsen|phosph|bor|silic)ide"


class Entry(BaseModel):
    """One built-in material.

    ``spread`` is the relative spread (one standard deviation) of eta between
    published tables; ``aliases`` are lower-case words people write for it.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    file: str
    kind: Literal["dielectric", "semiconductor", "metal"]
    relative_to: RelativeTo
    citation: str
    spread: float = Field(gt=0)
    aliases: tuple[str, ...] = ()
    note: str = ""


class _Index(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    materials: tuple[Entry, ...]


@functools.cache
def entries() -> Mapping[str, Entry]:
    """Every built-in material by its name, in the order of the index."""
    index = validate(load(_FOLDER / "index.yaml"), _Index)
    return MappingProxyType({entry.name: entry for entry in index.materials})


def names() -> tuple[str, ...]:
    """The names of the built-in materials."""
    return tuple(entries())


def entry(name: str) -> Entry:
    """The material of this name or alias, whatever its case, spaces and hyphens.

    Raises ReflectanceFitError, with the nearest known name, when there is none.
    """
    known = {_key(word): found for found in entries().values() for word in (found.name, *found.aliases)}
    found = known.get(_key(name))
    if found is None:
        words = [word for e in entries().values() for word in (e.name, *e.aliases)]
        near = suggestion(name, words) or suggestion(name.casefold(), words)
        raise ReflectanceFitError(
            f"no built-in material '{name}'{near or '; `reflectance-fit materials list` shows them all'}"
        )
    return found


def get(name: str) -> OpticalConstants:
    """The optical constants of a built-in material by its name or an alias.

    Raises ReflectanceFitError, with the nearest known name, when there is none.
    """
    return _load(entry(name))


def match(sample_name: str) -> Entry | None:
    """The one built-in material that a free-text sample name speaks of, or None.

    A name or alias counts where it stands as whole words ("K9 prism" is N-BK7),
    with or without the spaces and hyphens in it; chemical symbols of one or two
    letters count only as they are spelt ("Ag", not "AG"), and an element does not
    stand for its compounds ("iron oxide").  Where two words overlap the longer
    one wins ("N-SF11" over "SF11").  A name with two materials in it ("gold on
    silicon") has no one answer: None.
    """
    hits = [
        (hit.start(), hit.end(), found)
        for pattern, found in _patterns()
        for hit in pattern.finditer(sample_name)
    ]
    hits.sort(key=lambda hit: (hit[0] - hit[1], hit[0]))
    kept: list[tuple[int, int, Entry]] = []
    for start, end, found in hits:
        if all(end <= other_start or start >= other_end for other_start, other_end, _ in kept):
            kept.append((start, end, found))
    materials = {found.name: found for *_, found in kept}
    return next(iter(materials.values())) if len(materials) == 1 else None


@functools.cache
def _load(found: Entry) -> OpticalConstants:
    return load_optical_constants(
        _FOLDER / "constants" / found.file, relative_to=found.relative_to, name=found.name
    )


@functools.cache
def _patterns() -> tuple[tuple[re.Pattern[str], Entry], ...]:
    return tuple(
        (_pattern(word), found) for found in entries().values() for word in (found.name, *found.aliases)
    )


def _pattern(word: str) -> re.Pattern[str]:
    """Finds ``word`` as whole words; letters and digits may be set apart ("BK 7", "fused_silica")."""
    parts = re.findall(r"[A-Za-z]+|[0-9]+", word)
    symbol = len(word) <= 2 and word.isalpha()
    # Not \b: an underscore in "gold_mirror" must end the word too.
    text = r"(?<![^\W_])" + r"[\s_-]*".join(parts) + rf"(?![^\W_]|[\s_-]+{_ANION})"
    return re.compile(text, 0 if symbol else re.IGNORECASE)


def _key(word: str) -> str:
    return re.sub(r"[\s_-]+", "", word).casefold()
