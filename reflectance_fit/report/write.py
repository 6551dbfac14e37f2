"""Reports as YAML: written by PyYAML, because its numbers read alike in YAML 1.1 and 1.2."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from reflectance_fit.material import Material
from reflectance_fit.physics.approximation_ladder import LADDER
from reflectance_fit.report.numbers import short
from reflectance_fit.report.schema import Report, SchlickError

_MAY_BE_ABSENT = ("max_abs_error_posterior", "ns_per_eval")


def report_yaml(report: Report) -> str:
    """The text of report.yaml; optional parts that are absent are left out, absent numbers are null."""
    data = report.model_dump(mode="json", by_alias=True)
    for channel in data["channels"]:
        for name in ("second_brewster_deg", "principal_angle_deg", "literature"):
            if channel[name] is None:
                del channel[name]
        for value in channel.values():
            if isinstance(value, dict) and value.get("modes", ...) is None:
                del value["modes"]
        if channel["schlick"] is not None:
            channel["schlick"] = _without_absent(channel["schlick"])
    for fit in data["fits"]:
        if fit["model"]["dispersion"] is None:
            del fit["model"]["dispersion"]
    if data["sample"]["note"] is None:
        del data["sample"]["note"]
    if data["effort"]["seconds"] is None:
        del data["effort"]["seconds"]
    return yaml.dump(data, Dumper=Dumper, sort_keys=False, allow_unicode=True, width=110)


def approximations_yaml(material: Material, errors: list[SchlickError]) -> str:
    """The text of schlick.yaml: each channel's index and every approximation's errors, then where each is from."""
    rows = zip(material.channels, material.eta, material.k, errors, strict=True)
    data = {
        "schema": "reflectance_fit/approximations/1",
        "material": {"name": material.name, "source": material.source},
        "exterior_ior": material.exterior_ior,
        "channels": [
            {
                "channel": c,
                "eta": short(float(eta)),
                "k": short(float(k)),
                "schlick": _without_absent(e.model_dump(mode="json")),
            }
            for c, eta, k, e in rows
        ],
        "approximations": {
            rung.name: {"source": rung.source, "valid_for": rung.valid_for} for rung in LADDER
        },
    }
    return yaml.dump(data, Dumper=Dumper, sort_keys=False, allow_unicode=True, width=110)


def _without_absent(schlick: dict[str, Any]) -> dict[str, Any]:
    """Without the fields that stand only where there are draws or clocks; other nulls mean infinite."""

    def kept(row: dict[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in row.items() if value is not None or name not in _MAY_BE_ABSENT}

    return kept(schlick) | {"approximations": [kept(row) for row in schlick["approximations"]]}


class Dumper(yaml.SafeDumper):
    """Safe, with short number lists on one line."""


def _sequence(dumper: Dumper, items: list[object]) -> yaml.Node:
    flow = all(isinstance(item, int | float) for item in items)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", items, flow_style=flow)


def _text(dumper: Dumper, text: str) -> yaml.Node:
    try:
        float(text)
    except ValueError:
        quotes = "'" if re.fullmatch("0o[0-7]+", text) else None
    else:
        # PyYAML takes 1e5 for text, as YAML 1.1 does; to YAML 1.2 it is a number.
        quotes = "'"
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=quotes)


Dumper.add_representer(list, _sequence)
Dumper.add_representer(str, _text)


def write_text(text: str, path: Path) -> None:
    path.write_text(text, encoding="utf-8")
