"""Words on pictures: labels for people, and names from files made harmless."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from functools import cache

from reflectance_fit.result import Fit

THETA = "angle of incidence θ (deg)"

_LABELS = {
    "eta": "η",
    "k": "k",
    "angle_offset_deg": "angle offset (deg)",
    "dark_offset": "dark offset (a.u.)",
    "diffuse": "diffuse fraction",
    "source_dolp": "source DoLP",
    "source_azimuth_deg": "source azimuth (deg)",
    "analyzer_offset_deg": "analyzer offset (deg)",
    "diattenuation": "diattenuation",
}


def label(name: str) -> str:
    """A parameter's name with its unit, as a person would write it."""
    if name in _LABELS:
        return _LABELS[name]
    if found := re.fullmatch(r"sigma\[(.*)\]", name):
        return f"σ of {label(found[1])}"
    words = name.replace("_", " ")
    return printable(words.removesuffix(" deg") + " (deg)" if words.endswith(" deg") else words)


def printable(text: str, most: int = 48) -> str:
    """Outside text for a picture: no control or bidi characters, no missing glyphs, not too long."""
    shown = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text[: most + 1])
    shown = "".join(c if _has_glyph(c) else "\N{REPLACEMENT CHARACTER}" for c in shown)
    # matplotlib leaves labels that begin with an underscore out of legends.
    shown = re.sub("^_+", "", shown)
    return shown if len(shown) <= most else shown[: most - 1] + "…"


@cache
def _has_glyph(character: str) -> bool:
    from matplotlib.font_manager import findfont, get_font

    return bool(get_font(findfont("DejaVu Sans")).get_char_index(ord(character)))


def subject(fit: Fit) -> str:
    """What a picture is about: "550 nm, dielectric"."""
    wavelength = f"{fit.wavelength_nm:g} nm"
    channel = printable(fit.channel, 24)
    what = wavelength if channel == wavelength else f"{channel} ({wavelength})"
    return f"{what}, {fit.posterior.model}"


def with_error(value: float, sd: float) -> str:
    """ "55.9 ± 0.3": as many digits as the standard deviation supports."""
    if not (math.isfinite(sd) and sd > 0):
        return f"{value:.6g}"
    # Two digits where the first is a 1: 0.1 for 0.14 would be off by 40 %.
    leading = math.floor(math.log10(sd))
    digits = max(0, -leading + (1 if sd / 10**leading < 1.95 else 0))
    if digits > 5 and abs(value) < 1e-3:
        return f"{value:.2g} ± {sd:.1g}".replace("-", "−")
    # Adding zero turns a rounded -0.0 into 0.0.
    return f"{round(value, digits) + 0.0:.{digits}f} ± {sd:.{digits}f}".replace("-", "−")


def slugs(names: Iterable[str]) -> list[str]:
    """A distinct piece of a file name for each name: letters, digits, dot and dash only."""
    taken: set[str] = set()
    result = []
    for name in names:
        base = re.sub(r"[^A-Za-z0-9.-]+", "", name)[:40].strip(".-") or "channel"
        slug, number = base, 1
        # Some file systems do not tell upper from lower case.
        while slug.lower() in taken:
            number += 1
            slug = f"{base}-{number}"
        taken.add(slug.lower())
        result.append(slug)
    return result
