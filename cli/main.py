"""The command ``reflectance-fit``: finds a verb's file only when that verb is asked for."""

from __future__ import annotations

import importlib
from typing import Any

import click

from .options import ErrorHandlingGroup, output_options

VERBS = (
    "demo",
    "synth",
    "ingest",
    "fit",
    "plan",
    "board",
    "schlick",
    "render",
    "map",
    "batch",
    "materials",
    "schema",
)


class LazyGroup(ErrorHandlingGroup):
    """Imports ``reflectance_fit.cli.VERB`` on use, so that --help stays fast."""

    def list_commands(self, _ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, _ctx: click.Context, name: str) -> click.Command | None:
        if name not in VERBS:
            return None
        module: Any = importlib.import_module(f"reflectance_fit.cli.{name}")
        command: click.Command = getattr(module, name)
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            import difflib

            near = difflib.get_close_matches(args[0], VERBS, n=1)
            if not near or "Did you mean" in error.message:
                raise
            raise click.UsageError(f"{error.message} Did you mean '{near[0]}'?", ctx) from error


@click.command(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="reflectance_fit", prog_name="reflectance-fit")
@output_options
def cli() -> None:
    """From measured reflection to refractive index eta, extinction k and Brewster angle.

    Start with a demonstration that needs no data of your own.

    Example:

    \b
        reflectance-fit demo -o demo
    """
