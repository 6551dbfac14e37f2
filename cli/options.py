"""What every verb shares: options on output, and how errors reach the user."""

from __future__ import annotations

import logging
import math
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import click

from reflectance_fit.errors import Problem, ReflectanceFitError, printable

LOGGER = logging.getLogger("reflectance_fit")
# Else logging's last resort would print errors a second time.
LOGGER.addHandler(logging.NullHandler())
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
            LOGGER.error("interrupted")
            click.echo(
                "Interrupted; no unfinished file is left. Start again with the same command:", err=True
            )
            click.echo(f"  {_this_command()}", err=True)
            ctx.exit(130)
        except BrokenPipeError:
            # The reader of our output went away (`| head`); that is its right.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            ctx.exit(0)
        except OSError as error:
            file = None if error.filename is None else str(error.filename)
            lines = ReflectanceFitError(Problem(file, None, error.strerror or str(error))).lines()
        except Exception as error:
            if ctx.meta.get(_key("verbose")):
                raise
            LOGGER.debug("traceback of the error below", exc_info=True)
            first = (str(error).splitlines() or [""])[0]
            lines = [
                printable(
                    f"Error: an error of ours, not yours: {type(error).__name__}: {first}; "
                    "please report it with the output of the same command and -v"
                )
            ]
        for line in lines:
            LOGGER.error("%s", line.removeprefix("Error: "))
            click.echo(line, err=True)
        raise click.exceptions.Exit(1)


def _this_command() -> str:
    import shlex

    return shlex.join(["reflectance-fit", *sys.argv[1:]])


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Where an interrupted run left chains in ``folder``, say how to continue it instead of starting again."""
    try:
        yield
    except KeyboardInterrupt:
        if not (folder / ".checkpoint").exists():
            raise
        LOGGER.error("interrupted")
        command = _this_command().removesuffix(" --resume")
        click.echo(f"Interrupted; what was sampled is kept in {folder}. Continue with:", err=True)
        click.echo(f"  {command} --resume", err=True)
        click.get_current_context().exit(130)


class _Terminal(logging.Handler):
    """``-v``: the log on stderr, without the errors, which are printed in any case."""

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno < logging.ERROR:
            click.echo(self.format(record), err=True)


def output_options(command: Command) -> Command:
    """``-q``, ``-v`` and ``--log-file``, before or after the verb."""

    def remember(ctx: click.Context, parameter: click.Parameter, value: bool) -> None:
        if value and not ctx.meta.get(_key(str(parameter.name))):
            ctx.meta[_key(str(parameter.name))] = True
            if parameter.name == "verbose":
                _listen(ctx, _Terminal())

    def log_file(ctx: click.Context, _parameter: click.Parameter, value: str | None) -> None:
        if value is None:
            return
        try:
            handler = logging.FileHandler(value, encoding="utf-8")
        except OSError as error:
            raise click.BadParameter(f"{value}: {error.strerror}") from error
        handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
        _listen(ctx, handler)

    for option in (
        click.option(
            "--log-file", metavar="FILE", expose_value=False, callback=log_file, help="Also log to FILE."
        ),
        click.option(
            "-v", "--verbose", is_flag=True, expose_value=False, callback=remember, help="Say more."
        ),
        click.option(
            "-q", "--quiet", is_flag=True, expose_value=False, callback=remember, help="Only errors."
        ),
    ):
        command = option(command)
    return command


def _key(option: str) -> str:
    return f"{__name__}.{option}"


def _listen(ctx: click.Context, handler: logging.Handler) -> None:
    """Log to ``handler`` until the command ends."""
    LOGGER.setLevel(logging.DEBUG)
    LOGGER.addHandler(handler)

    def stop() -> None:
        LOGGER.removeHandler(handler)
        handler.close()

    ctx.find_root().call_on_close(stop)


def is_quiet() -> bool:
    """Whether ``-q`` was given to the command that runs."""
    ctx = click.get_current_context(silent=True)
    return ctx is not None and bool(ctx.meta.get(_key("quiet")))


def degrees(_ctx: click.Context, _param: click.Parameter, value: str | None) -> tuple[float, ...]:
    """Of an option, as its callback: a list of angles, nothing for nothing."""
    if value is None:
        return ()
    try:
        angles = tuple(float(part) for part in value.split(","))
    except ValueError:
        angles = (math.nan,)
    if not all(math.isfinite(angle) for angle in angles):
        raise click.BadParameter(f"'{value}' is not a list of degrees such as 30,45,60")
    return angles


seed_option = click.option(
    "--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True, help="Same seed, same result."
)


def fit_options(command: Command) -> Command:
    """``--model``, ``--posterior`` and ``--no-plots``."""
    for option in (
        click.option("--no-plots", is_flag=True, help="Write no pictures."),
        click.option(
            "--posterior",
            type=click.Choice(["emcee", "importance", "laplace"]),
            help="How to sample. Default: emcee, and importance above 16 channels; where its own test fails, emcee.",
        ),
        click.option(
            "--model",
            type=click.Choice(["auto", "dielectric", "conductor", "fixed_k", "fixed_eta"]),
            default="auto",
            show_default=True,
            help="auto chooses by BIC whether k > 0 is needed, and nuisances where the input has no block; fixed_k and fixed_eta take the value in priors.",
        ),
    ):
        command = option(command)
    return command


def executor_options(command: Command) -> Command:
    """``--jobs``, ``--scheduler`` and ``--insecure-cluster``, of verbs with many tasks."""
    for option in (
        click.option(
            "--insecure-cluster",
            "insecure",
            is_flag=True,
            help="Let --scheduler be tcp:// to another machine: nothing is encrypted, anyone may answer.",
        ),
        click.option(
            "--scheduler",
            metavar="ADDRESS|FILE",
            callback=_no_jobs_elsewhere,
            help="Run on a Dask cluster: its tls:// or tcp:// address, the scheduler's file, or 'local'.",
        ),
        click.option(
            "--jobs",
            type=click.IntRange(1, 1024),
            metavar="N",
            is_eager=True,
            help="Worker processes on this machine; 1: none but this one. Default: one a core.",
        ),
    ):
        command = option(command)
    return command


def _no_jobs_elsewhere(ctx: click.Context, _param: click.Parameter, value: str | None) -> str | None:
    if value not in (None, "local") and ctx.params.get("jobs") is not None:
        raise click.UsageError(
            "--jobs is for this machine; a cluster has the workers that were started for it"
        )
    return value


def out_folder_option(default: str | None = None) -> Callable[[Command], Command]:
    """``-o DIR``, required unless it has a default."""
    # A default of None, even that, would make the option optional.
    need: dict[str, Any] = (
        {"required": True} if default is None else {"default": default, "show_default": True}
    )
    return click.option(
        "-o", "--out", type=click.Path(path_type=Path), metavar="DIR", help="Folder for the results.", **need
    )
