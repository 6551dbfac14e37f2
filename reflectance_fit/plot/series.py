"""Which rows belong together on a picture: panels of one unit, series of one setting."""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.colors import to_hex, to_rgb
from numpy.typing import NDArray

from reflectance_fit.observations import Observations, Quantity
from reflectance_fit.plot import style
from reflectance_fit.plot.text import THETA, printable

IntArray = NDArray[np.int64]

ABSCISSAS = {
    "theta_deg": THETA,
    "analyzer_deg": "analyzer angle φ (deg)",
    "retarder_deg": "retarder angle (deg)",
}
_RATIOS = {
    Quantity.RATIO_PS: "Rₚ / Rₛ (ratio)",
    Quantity.DOLP: "degree of polarization (fraction)",
    Quantity.PSI_DEG: "Ψ (deg)",
    Quantity.DELTA_DEG: "Δ (deg)",
}
_MARKERS = "osD^vP"
# More than these are no longer told apart by a legend.
LEGEND_ENTRIES = 8


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Rows that one curve goes through, in the order of the abscissa."""

    rows: IntArray
    label: str
    colour: str
    marker: str


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """Series that share an abscissa and a unit."""

    kind: str  # "power" or the quantity
    abscissa: str  # a key of ABSCISSAS
    ylabel: str
    series: tuple[Series, ...]


def panels(observations: Observations) -> list[Panel]:
    """The panels of a fit: powers together, every kind of ratio by itself."""
    is_power = np.array([Quantity(q).is_power for q in observations.quantity])
    kinds = np.where(is_power, "power", observations.quantity)
    result = []
    for kind in ["power", *_RATIOS]:
        rows = np.flatnonzero(kinds == kind)
        if len(rows):
            part = observations.select(rows)
            abscissa = _abscissa(part)
            ylabel = _power_label(part) if kind == "power" else _RATIOS[Quantity(kind)]
            result.append(Panel(kind, abscissa, ylabel, tuple(_series(observations, rows, abscissa))))
    return result


def _abscissa(part: Observations) -> str:
    """What was scanned: the coordinate with the most distinct settings, the angle of incidence if equal."""

    def settings(name: str) -> int:
        column = getattr(part, name)
        return len(np.unique(column[np.isfinite(column)]))

    return max(ABSCISSAS, key=settings)


def _power_label(part: Observations) -> str:
    gains = {Quantity(q).has_gain for q in np.unique(part.quantity)}
    if gains == {True}:
        return "signal / gain (fraction)"
    return "reflectance (fraction)" if gains == {False} else "reflectance, signal / gain (fraction)"


def _series(observations: Observations, rows: IntArray, abscissa: str) -> list[Series]:
    part = observations.select(rows)
    settings = [name for name in (*ABSCISSAS, "retardance_deg") if name != abscissa and name != "theta_deg"]
    if abscissa != "theta_deg":
        settings.append("theta_deg")
    columns = [_codes(part.quantity), _codes(part.set), *(_codes(getattr(part, n)) for n in settings)]
    columns.append(np.unique(part.light, axis=0, return_inverse=True)[1].reshape(-1))
    _, first, member = np.unique(np.stack(columns), axis=1, return_index=True, return_inverse=True)
    member = member.reshape(-1)
    several_sets = len(np.unique(part.set)) > 1
    several_lights = len(np.unique(part.light, axis=0)) > 1
    result: list[Series] = []
    for number in np.argsort(first):
        mine = rows[member == number]
        mine = mine[np.argsort(getattr(observations, abscissa)[mine], kind="stable")]
        row = mine[0]
        name = _name(observations, row, abscissa)
        if several_lights:
            name += ", light ({:.3g}, {:.3g}, {:.3g})".format(*observations.light[row, 1:])
        if several_sets:
            name += f", {printable(str(observations.set[row]), 16)}"
        turn = len(result) / max(1, member.max())
        colour = _colour(observations, row) if abscissa == "theta_deg" else to_hex(_shade(turn))
        # Colour alone does not tell six settings apart; a scan's many shades need no second sign.
        marker = _MARKERS[len(result) % len(_MARKERS)] if abscissa == "theta_deg" else _MARKERS[0]
        result.append(Series(mine, name, colour, marker))
    return result


def _codes(column: NDArray[np.float64] | NDArray[np.str_]) -> IntArray:
    """Equal numbers for equal entries, NaN equal to NaN."""
    return np.unique(column, return_inverse=True)[1].reshape(-1)


def _shade(turn: float) -> tuple[float, float, float, float]:
    # The palest tenth of the map would be lost on white.
    red, green, blue, alpha = matplotlib.colormaps["viridis"](0.9 * turn)
    return red, green, blue, alpha


def _name(observations: Observations, row: int, abscissa: str) -> str:
    if abscissa != "theta_deg":
        return f"θ = {observations.theta_deg[row]:g}°"
    quantity = Quantity(str(observations.quantity[row]))
    analyzer = observations.analyzer_deg[row]
    if quantity == Quantity.SIGNAL and np.isfinite(analyzer):
        plate = observations.retarder_deg[row]
        return f"analyzer {analyzer:g}°" + (f", plate {plate:g}°" if np.isfinite(plate) else "")
    fixed = {
        Quantity.SIGNAL_S: "s",
        Quantity.SIGNAL_P: "p",
        Quantity.REFLECTANCE_S: "s",
        Quantity.REFLECTANCE_P: "p",
        Quantity.SIGNAL: "no analyzer",
        Quantity.REFLECTANCE: "unpolarized",
    }
    return fixed.get(quantity, "measured")


def _colour(observations: Observations, row: int) -> str:
    """s and p in their colours, an analyzer between them by the share of p that it passes."""
    quantity = str(observations.quantity[row])
    for ending, colour in (("_s", style.S), ("_p", style.P)):
        if quantity.endswith(ending):
            return colour
    analyzer = observations.analyzer_deg[row]
    if quantity != Quantity.SIGNAL or not np.isfinite(analyzer):
        return style.OTHER
    share = np.sin(np.radians(analyzer)) ** 2
    mixed = _mix(np.array(to_rgb(style.S)), style.P, share)
    # As much of p on the other side of s, or behind a retarder, is another curve.
    slant = np.sin(np.radians(2 * analyzer))
    if np.isfinite(observations.retarder_deg[row]):
        mixed = _mix(mixed, style.K if slant > 0 else style.ENSEMBLES[1], 0.7 * abs(slant))
    elif slant < 0:
        mixed = _mix(mixed, style.OTHER, 0.7 * abs(slant))
    red, green, blue = mixed
    return to_hex((red, green, blue))


def _mix(rgb: NDArray[np.float64], other: str, share: float) -> NDArray[np.float64]:
    return (1 - share) * rgb + share * np.array(to_rgb(other))
