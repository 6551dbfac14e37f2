"""``reflectance-fit schema``"""

from __future__ import annotations

import click

from .options import output_options


@click.command()
@click.argument(
    "name", type=click.Choice(["capture", "map", "measurement", "observations", "report", "scene", "truth"])
)
@output_options
def schema(name: str) -> None:
    """Print the schema of a file format, for editors and validators.

    It is a JSON Schema for the YAML formats, a list of variables for observations and maps.

    Example:

    \b
        reflectance-fit schema measurement
    """
    import json

    from reflectance_fit.workflow import json_schema

    click.echo(json.dumps(json_schema(name), indent=2))
