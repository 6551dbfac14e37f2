"""What every verb shares: options on output, and how errors reach the user."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from reflectance_fit.errors import ReflectanceFitError

LOGGER = "reflectance_fit"
Command = TypeVar("Command", bound=Callable[..., Any])


class ErrorHandlingGroup(click.Group):
    """Turns errors into ``Error:`` lines: 1 for what the user can mend, 130 when interrupted."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except ReflectanceFitError as error:
            lines = error.lines()
        except KeyboardInterrupt:
            click.echo("Interrupted; nothing was written. Start again with the same command:", err=True)
            click.echo(f"  {_this_command()}", err=True)
            ctx.exit(130)
        except BrokenPipeError:
            # The reader of our output went away (`| head`); that is its right.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            ctx.exit(0)
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            lines = [f"Error: {where}{error.strerror or error}"]
        except Exception as error:
            if logging.getLogger(LOGGER).isEnabledFor(logging.DEBUG):
                raise
            first = (str(error).splitlines() or [""])[0]
            lines = [
                f"Error: an error of ours, not yours: {type(error).__name__}: {first}; "
                "please report it with the output of the same command and -v"
            ]
        for line in lines:
            click.echo(line, err=True)
        ctx.exit(1)


def _this_command() -> str:
    import shlex

    return shlex.join(["reflectance-fit", *sys.argv[1:]])


def output_options(command: Command) -> Command:
    """``-q``, ``-v`` and ``--log-file``, before or after the verb."""

    def level(_ctx: click.Context, parameter: click.Parameter, value: bool) -> None:
        if value:
            quiet = parameter.name == "quiet"
            logging.getLogger(LOGGER).setLevel(logging.ERROR if quiet else logging.DEBUG)

    def log_file(_ctx: click.Context, _parameter: click.Parameter, value: str | None) -> None:
        if value is None:
            return
        try:
            handler = logging.FileHandler(value, encoding="utf-8")
        except OSError as error:
            raise click.BadParameter(f"{value}: {error.strerror}") from error
        handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
        logger = logging.getLogger(LOGGER)
        logger.addHandler(handler)
        if logger.level == logging.NOTSET:
            logger.setLevel(logging.INFO)

    for option in (
        click.option("--log-file", metavar="FILE", expose_value=False, callback=log_file, help="Also log to FILE."),
        click.option("-v", "--verbose", is_flag=True, expose_value=False, callback=level, help="Say more."),
        click.option("-q", "--quiet", is_flag=True, expose_value=False, callback=level, help="Only errors."),
    ):
        command = option(command)
    return command


def is_quiet() -> bool:
    return logging.getLogger(LOGGER).level >= logging.ERROR


seed_option = click.option(
    "--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True, help="Same seed, same result."
)


def out_folder_option(default: str | None = None) -> Callable[[Command], Command]:
    """``-o DIR``, required unless it has a default."""
    return click.option(
        "-o",
        "--out",
        type=click.Path(path_type=Path),
        required=default is None,
        default=default,
        show_default=default is not None,
        metavar="DIR",
        help="Folder for the results.",
    )
