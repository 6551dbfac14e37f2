"""YAML from strangers: read once, by YAML 1.2 rules, with a line number for every value.

Anchors, aliases, merges, tags, duplicate keys, several documents, deep nesting
and large files are refused, all of them in one pass over the parser's events,
before anything is built (a 400-byte file of nested merges stops an ordinary
loader for minutes).  ``validate`` turns the result into a pydantic model and
reports every problem of the file at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import AliasEvent, Event, MappingStartEvent, ScalarEvent, SequenceStartEvent
from ruamel.yaml.nodes import ScalarNode

from reflectance_fit.errors import Problem, ReflectanceFitError, suggestion
from reflectance_fit.inputs import check_regular

MAX_BYTES = 1_000_000
MAX_DEPTH = 20
MAX_DIGITS = 400

Path_ = tuple[str | int, ...]
Model = TypeVar("Model", bound=BaseModel)


@dataclass(frozen=True, slots=True)
class Document:
    """A parsed file: plain Python values, and the line of each by its path."""

    file: str
    data: Any
    lines: dict[Path_, int] = field(repr=False)

    def line(self, path: Iterable[str | int]) -> int | None:
        """The line of the value at ``path``, or of its nearest parent that has one."""
        steps = tuple(path)
        while steps not in self.lines and steps:
            steps = steps[:-1]
        return self.lines.get(steps)

    def problem(self, path: Iterable[str | int], message: str) -> Problem:
        return Problem(self.file, self.line(path), message)


def read_text(path: Path, *, name: str | None = None, max_bytes: int = MAX_BYTES) -> str:
    """The text of a regular file of at most ``max_bytes``, or a one-line error."""
    shown = name or str(path)
    check_regular(path, shown)
    try:
        raw = path.read_bytes() if path.stat().st_size <= max_bytes else None
    except OSError as error:
        raise ReflectanceFitError(Problem(shown, None, f"cannot be read: {error.strerror}")) from error
    if raw is None:
        raise ReflectanceFitError(
            Problem(shown, None, f"is larger than {max_bytes / 1e6:g} MB; is it the right file?")
        )
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise ReflectanceFitError(Problem(shown, None, "is not text (UTF-8); is it the right file?"))
    if not text.strip():
        raise ReflectanceFitError(Problem(shown, None, "is empty; is it the right file?"))
    return text


def load(path: Path) -> Document:
    """Read ``path``; raises ReflectanceFitError with every problem of form found."""
    file = str(path)
    return parse(read_text(path), file)


def parse(text: str, file: str) -> Document:
    """As ``load``, from a string; ``file`` is the name shown in messages."""
    builder = _Builder(file)
    try:
        data = builder.document(iter(YAML(typ="safe", pure=True).parse(text)))
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        what = " ".join(str(error.problem or error.context or "not YAML").split())
        builder.problems.append(Problem(file, mark.line + 1 if mark else None, f"not valid YAML: {what}"))
    except (YAMLError, ValueError) as error:
        builder.problems.append(Problem(file, None, f"not valid YAML: {' '.join(str(error).split())}"))
    if builder.problems:
        raise ReflectanceFitError(builder.problems)
    return Document(file, data, builder.lines)


class _Builder:
    """Builds plain values from parser events, and keeps where each stood."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.lines: dict[Path_, int] = {}
        self.problems: list[Problem] = []
        self._resolver = YAML(typ="safe", pure=True).resolver

    def document(self, events: Iterator[Event]) -> Any:
        data: Any = None
        documents = 0
        for event in events:
            kind = type(event).__name__
            if kind == "DocumentStartEvent":
                documents += 1
                if documents > 1:
                    self._refuse(event, "holds more than one document; keep the first")
                    break
                data = self._value(next(events), events, ())
        return data

    def _value(self, event: Event, events: Iterator[Event], path: Path_) -> Any:
        self.lines.setdefault(path, event.start_mark.line + 1)
        self._check(event)
        if isinstance(event, MappingStartEvent | SequenceStartEvent) and len(path) >= MAX_DEPTH:
            # Raised, not collected: going on would recurse as deep as the file likes.
            raise ReflectanceFitError(
                Problem(self.file, event.start_mark.line + 1, f"nested deeper than {MAX_DEPTH} levels")
            )
        if isinstance(event, MappingStartEvent):
            return self._mapping(events, path)
        if isinstance(event, SequenceStartEvent):
            items: list[Any] = []
            while type(event := next(events)).__name__ != "SequenceEndEvent":
                items.append(self._value(event, events, (*path, len(items))))
            return items
        return self._scalar(event) if isinstance(event, ScalarEvent) else None

    def _mapping(self, events: Iterator[Event], path: Path_) -> dict[str, Any]:
        mapping: dict[str, Any] = {}
        while type(event := next(events)).__name__ != "MappingEndEvent":
            self._check(event)
            if not isinstance(event, ScalarEvent):
                self._refuse(event, "a key must be a plain word")
                self._value(event, events, (*path, "?"))
                self._value(next(events), events, (*path, "?"))
                continue
            key = event.value
            if key == "<<":
                self._refuse(event, "merge keys (<<) are refused; write the values out")
            elif key in mapping:
                first = self.lines[(*path, key)]
                self._refuse(event, f"duplicate key '{key}' (first in line {first}); keep one")
            else:
                self.lines[(*path, key)] = event.start_mark.line + 1
            value = self._value(next(events), events, (*path, key))
            mapping.setdefault(key, value)
        return mapping

    def _check(self, event: Event) -> None:
        if isinstance(event, AliasEvent):
            self._refuse(event, f"aliases (*{event.anchor}) are refused; write the value out")
            return
        if anchor := getattr(event, "anchor", None):
            self._refuse(event, f"anchors (&{anchor}) are refused; write the value out")
        if tag := getattr(event, "tag", None):
            self._refuse(event, f"tags ({tag}) are refused; remove it")

    def _scalar(self, event: ScalarEvent) -> Any:
        if not event.implicit[0]:
            return event.value
        tag = str(self._resolver.resolve(ScalarNode, event.value, event.implicit))
        text = event.value.replace("_", "")
        try:
            if tag.endswith(":null"):
                return None
            if tag.endswith(":bool"):
                return event.value.lower() == "true"
            if tag.endswith((":int", ":float")) and len(text) > MAX_DIGITS:
                self._refuse(event, f"a number of {len(text)} digits is refused")
            elif tag.endswith(":int"):
                return int(text, 0) if text[:2].lower() in ("0x", "0o", "0b") else int(text)
            elif tag.endswith(":float"):
                return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
        except ValueError:
            pass
        return event.value

    def _refuse(self, event: Event, message: str) -> None:
        self.problems.append(Problem(self.file, event.start_mark.line + 1, message))


# pydantic's own words for these speak of Python.
_PLAIN = {
    "model_type": "must be a block of keys (key: value)",
    "dict_type": "must be a block of keys (key: value)",
    "tuple_type": "must be a list ([a, b])",
    "list_type": "must be a list ([a, b])",
    "string_type": "must be text; put it in quotes",
    "string_too_short": "must not be empty",
    "string_unicode": "must be text, without half characters (surrogates)",
}


def validate(document: Document, model: type[Model]) -> Model:
    """``document`` as ``model``, or ReflectanceFitError with one line per problem.

    The messages name the value's path, say what was found, and suggest the
    nearest known key for an unknown one.
    """
    try:
        return model.model_validate(document.data)
    except ValidationError as error:
        problems = [_problem(document, model, item) for item in error.errors() if not _follows(item)]
        raise ReflectanceFitError(sorted(set(problems), key=lambda p: (p.line or 0, p.message))) from None


def _follows(item: Any) -> bool:
    """Whether a list is called too short only because items of it are wrong: those have their own lines."""
    return bool(item["type"] == "too_short" and len(item["input"]) >= item["ctx"]["min_length"])


def _problem(document: Document, model: type[BaseModel], item: Any) -> Problem:
    # Union branches add their own names to pydantic's locations; the file knows only its keys.
    path: Path_ = ()
    steps = [step for step in item["loc"] if step != "[key]"]
    for step in steps:
        if isinstance(step, int) or _has(document.data, (*path, step)):
            path = (*path, step)
    found = item.get("input")
    kind = item["type"]
    if kind == "missing":
        path = (*path, steps[-1])
    where = ".".join(str(step) for step in path)
    if kind == "extra_forbidden":
        known = _known_keys(model, path[:-1])
        message = f"unknown key '{path[-1]}'{suggestion(str(path[-1]), known)}"
        if path[-1] in known:  # of another kind of block
            message = f"'{path[-1]}' does not go with the keys beside it; remove it"
        parent = ".".join(str(step) for step in path[:-1])
        return document.problem(path, f"{parent}: {message}" if parent else message)
    if kind == "missing":
        parent = ".".join(str(step) for step in path[:-1])
        return document.problem(
            path[:-1], f"{parent + ': ' if parent else ''}'{path[-1]}' is missing; add it"
        )
    message = _PLAIN.get(kind) or item["msg"].removeprefix("Value error, ")
    message = message.replace("Input should be", "must be").replace("Tuple should have", "must have")
    message = message.removesuffix(" after validation").replace(" after validation,", ",")
    shown = isinstance(found, bool | int | str) or (isinstance(found, float) and math.isfinite(found))
    if shown and len(steps) == len(item["loc"]):  # a key is in the path already
        message += f" (found {found!r:.60})"
    return document.problem(path, f"{where}: {message}" if where else message)


def _has(data: Any, path: Path_) -> bool:
    for step in path:
        try:
            data = data[step]
        except (LookupError, TypeError):
            return False
    return True


def _known_keys(model: Any, path: Path_) -> list[str]:
    """The field names of the model that ``path`` leads to, for suggestions."""
    for step in path:
        models = list(_models_in(model))
        model = next(
            (
                m.model_fields[step].annotation
                for m in models
                if isinstance(step, str) and step in m.model_fields
            ),
            model,
        )
    return [field.alias or name for m in _models_in(model) for name, field in m.model_fields.items()]


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models_in(argument)
