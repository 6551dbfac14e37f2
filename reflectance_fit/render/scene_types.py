"""Blocks that name their ``type``: which types there are is said before the wrong one's keys are looked at."""

from __future__ import annotations

from typing import Any

from pydantic import BeforeValidator

from reflectance_fit.errors import suggestion


def known_type(*names: str) -> BeforeValidator:
    """Refuses a block whose ``type`` is missing or none of ``names``."""

    def check(value: Any) -> Any:
        if not isinstance(value, dict):
            raise ValueError("must be a block of keys (key: value)")  # noqa: TRY004 - pydantic collects these
        name = value.get("type")
        if name is None:
            raise ValueError(f"'type' is missing; add one of {', '.join(names)}")
        if name not in names:
            near = suggestion(str(name), names) or f"; known are {', '.join(names)}"
            raise ValueError(f"unknown type '{name!s:.40}'{near}")
        return value

    return BeforeValidator(check)


def type_of(value: Any) -> Any:
    """What a union is told apart by, in a file or in a model."""
    return value["type"] if isinstance(value, dict) else value.type
