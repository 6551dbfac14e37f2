"""Progress on stderr: a bar with rate and time left; silent where stderr is no terminal or -q was given."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from .options import is_quiet

Report = Callable[[str, int, int], None]


@contextmanager
def progress() -> Iterator[Report]:
    """A live display while the block runs; call what it gives with (what, done, of how many)."""
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    display = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f} of {task.total:.0f}, {task.fields[rate]}"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=is_quiet() or not console.is_terminal,
    )
    tasks: dict[str, TaskID] = {}

    def report(what: str, done: int, total: int) -> None:
        if what not in tasks:
            tasks[what] = display.add_task(escape(what), total=total, rate="")
        speed = display.tasks[tasks[what]].speed
        display.update(tasks[what], completed=done, total=total, rate=f"{speed:.3g}/s" if speed else "")

    with display:
        yield report
