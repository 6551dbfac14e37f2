"""Progress on stderr: a bar with rate and time left; silent where stderr is no terminal or -q was given."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from .options import is_quiet


class Reporter(Protocol):
    """What a workflow reports to."""

    def sampling(self, channel: str, done: int, most: int) -> None: ...

    def drawing(self, name: str) -> None: ...


@contextmanager
def progress() -> Iterator[Reporter]:
    """A live display while the block runs."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    display = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f} {task.fields[unit]}, {task.fields[rate]}"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=is_quiet() or not console.is_terminal,
    )

    class Bars:
        def __init__(self) -> None:
            self._tasks: dict[str, TaskID] = {}

        def sampling(self, channel: str, done: int, most: int) -> None:
            task = self._task(f"sampling {channel}", most, "steps")
            speed = display.tasks[task].speed
            display.update(task, completed=done, rate=f"{speed:.0f}/s" if speed else "")

        def drawing(self, name: str) -> None:
            task = self._task("drawing", 8, "pictures")
            display.update(task, advance=1, rate=name)

        def _task(self, description: str, total: int, unit: str) -> TaskID:
            from rich.markup import escape

            if description not in self._tasks:
                self._tasks[description] = display.add_task(
                    escape(description), total=total, unit=unit, rate=""
                )
            return self._tasks[description]

    with display:
        yield Bars()
