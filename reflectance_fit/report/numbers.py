"""Numbers as a report shows them."""

from __future__ import annotations


def short(value: float, digits: int = 9) -> float:
    """Rounded to significant digits: more would be noise, and a person has to read it."""
    return float(f"{value:.{digits}g}")
