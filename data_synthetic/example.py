"""The example tables shipped with the package, written by ``tables.write_example``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from reflectance_fit.errors import ReflectanceFitError, suggestion
from reflectance_fit.strict_yaml import load

_FOLDER = Path(__file__).parent / "example"
FILES = ("measurement.yaml", "scan.csv", "truth.yaml")


@dataclass(frozen=True, slots=True)
class Truth:
    """What the synthesis put in: index relative to vacuum, angle of the sample in air."""

    eta: float
    k: float
    brewster_deg: float


def example_names() -> tuple[str, ...]:
    """The materials with a shipped example: a dielectric and a conductor."""
    return tuple(sorted((path.name for path in _FOLDER.iterdir()), reverse=True))


def copy_example(material: str, folder: Path) -> Truth:
    """Copy the example's files into ``folder`` and return its truth."""
    if material not in example_names():
        near = suggestion(material, example_names()) or f"; choose {' or '.join(example_names())}"
        raise ReflectanceFitError(f"no example of '{material}'{near}")
    folder.mkdir(parents=True, exist_ok=True)
    for name in FILES:
        (folder / name).write_bytes((_FOLDER / material / name).read_bytes())
    channel = load(folder / "truth.yaml").data["channels"][0]
    return Truth(channel["eta"], channel["k"], channel["brewster_deg"])
