"""A plan as text: what each design can be expected to give, and in words what none of them can."""

from __future__ import annotations

import math
from itertools import groupby
from typing import TYPE_CHECKING

import click

from .tables import plus_minus, show, table_of

if TYPE_CHECKING:
    from rich.text import Text

    from reflectance_fit.planning import Option, Plan

TITLES = {
    "analyzer": "with an analyzer on the camera",
    "lamp polarizer": "with a polarizer on the lamp too",
    "quarter-wave plate": "with a quarter-wave plate before the analyzer too",
}
# Whatever the angles and the noise.
NEVER = {
    "analyzer": "the phase between s and p; k only through k^2",
    "lamp polarizer": "the sign of S3; a small k only through k^2",
    "quarter-wave plate": "a film on the surface from another eta and k",
}
HEADINGS = ("at every angle", "angles (deg)", "frames", "eta", "k", "Brewster (deg)")


def print_plan(found: Plan) -> None:
    """A table an equipment: the usual angles, the best; then the assumptions."""
    from reflectance_fit.planning import recommended

    chosen, subject = recommended(found), found.subject
    click.echo(
        f"{found.title}: eta = {subject.eta:.4f}, k = {subject.k:.4g} assumed, {found.frames} photographs"
    )
    for best in found.best:
        click.echo()
        needs = best.design.kind.equipment
        table = table_of(TITLES[needs])
        for heading in HEADINGS:
            table.add_column(heading, no_wrap=True)
        options = [o for o in found.usual if o.design.kind.equipment == needs]
        for option in (*options, best):
            name = "usual" if option is not best else "best, recommended" if best is chosen else "best"
            table.add_row(*_cells(option, name))
        show(table)
        for option in (*options, best):
            for words in _more_than_the_cells(option):
                click.echo(f"  {_angles(option)}, {option.design.kind.name}: {words}")
        click.echo(f"  never told: {NEVER[needs]}")
    _print_assumptions(found)


def _print_assumptions(found: Plan) -> None:
    known = (item for item in found.subject.nuisances.items() if math.isfinite(item[1]))
    nuisances = ", ".join(f"{name} {sigma:g}" for name, sigma in known)
    click.echo(f"\nassumed: noise {100 * found.noise:.2g} % of each signal, an unknown gain at each angle,")
    click.echo(f"  and, unknown but fitted, {nuisances} (one sd; dark_offset of the largest signal).")
    click.echo("  A polarizer on the lamp and a plate are taken as exact.")
    if found.noise < 1e-3:
        click.echo("  Few lamps repeat to 0.1 %: see what --noise 0.001 leaves of this.")


def _cells(option: Option, name: str) -> list[Text]:
    from rich.text import Text

    f = option.expected
    cells = (
        option.design.kind.name,
        f"{_angles(option)} ({name})",
        str(option.design.frames),
        _value(f.eta, f.eta_sd),
        f"< {f.k_limit:.2g} (95 %)" if f.k_limit is not None else _value(f.k, f.k_sd),
        _value(f.brewster_deg, f.brewster_sd_deg),
    )
    return [Text(cell) for cell in cells]


def _more_than_the_cells(option: Option) -> list[str]:
    return [words for words in option.expected.cannot if "upper limit" not in words]


def _value(value: float, sd: float | None) -> str:
    return "not identified" if sd is None else plus_minus(value, sd)


def _angles(option: Option) -> str:
    """ "60 x2, 77.5"."""
    groups = [(angle, len(list(same))) for angle, same in groupby(option.design.angles_deg)]
    return ", ".join(f"{angle:g}" + (f" x{count}" if count > 1 else "") for angle, count in groups)
