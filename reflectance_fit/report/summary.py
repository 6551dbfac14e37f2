"""Many reports as one table: a row a sample and channel, as CSV for spreadsheets and YAML for programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from reflectance_fit.report.schema import Report
from reflectance_fit.report.write import Dumper

SCHEMA = "reflectance_fit/batch/1"
_ESTIMATES = ("eta", "k", "brewster_deg")
CHANNEL = (
    "channel", "wavelength_nm", "model", "p_value",
    *(f"{name}{part}" for name in _ESTIMATES for part in ("", "_sd", "_ci95_low", "_ci95_high", "_status")),
    "warnings",
)  # fmt: skip

Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Line:
    """One sample: its folder, its input as the user wrote it, and the channels' rows or why there are none."""

    sample: str
    input: str
    name: str | None
    channels: tuple[Row, ...]
    failure: str | None


def channel_rows(report: Report) -> tuple[Row, ...]:
    """What the table says of each channel; absent numbers are None, warnings the codes that concern it."""
    return tuple(_row(report, channel) for channel in report.channels)


def _row(report: Report, channel: Any) -> Row:
    fit = report.fits[channel.fit]
    row: Row = {
        "channel": channel.channel,
        "wavelength_nm": channel.wavelength_nm,
        "model": fit.model.name,
        "p_value": fit.fit.p_value,
    }
    for name in _ESTIMATES:
        estimate = getattr(channel, name)
        low, high = estimate.ci95 or (None, None)
        row |= {name: estimate.median, f"{name}_sd": estimate.sd}
        row |= {f"{name}_ci95_low": low, f"{name}_ci95_high": high, f"{name}_status": estimate.status}
    codes = {warning.code for warning in report.warnings if warning.channel in (None, channel.channel)}
    return row | {"warnings": sorted(codes)}


def summary_csv(lines: Sequence[Line]) -> str:
    """A header and a row a channel; a sample that failed has one row, with its reason."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["sample", "input", "name", *CHANNEL, "failure"])
    for line in lines:
        for row in line.channels or ({},):
            cells = [row.get(key) for key in CHANNEL[:-1]]
            codes = " ".join(row.get("warnings", ()))
            writer.writerow([line.sample, line.input, line.name, *cells, codes, line.failure])
    return out.getvalue()


def summary_yaml(lines: Sequence[Line]) -> str:
    """The same as a tree: samples, each with its channels or its failure."""
    data = {
        "schema": SCHEMA,
        "samples": [
            {"sample": line.sample, "input": line.input}
            | (
                {"failure": line.failure}
                if line.failure is not None
                else {"name": line.name, "channels": list(line.channels)}
            )
            for line in lines
        ],
    }
    return yaml.dump(data, Dumper=Dumper, sort_keys=False, allow_unicode=True, width=110)
