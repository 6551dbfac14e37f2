"""What pyproject.toml ships is what the tree holds."""

import importlib.metadata
import tomllib
from pathlib import Path

import reflectance_fit

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SETUPTOOLS = PROJECT["tool"]["setuptools"]
TOPS = {
    "reflectance_fit": "reflectance_fit",
    "cli": "reflectance_fit.cli",
    "data_synthetic": "reflectance_fit.data_synthetic",
}


def folder_of(package: str) -> Path:
    """Where a package of the explicit list lives, by the longest entry of package-dir."""
    mapping = SETUPTOOLS["package-dir"]
    head = max((name for name in mapping if f"{package}.".startswith(f"{name}.")), key=len)
    return ROOT / mapping[head] / package[len(head) :].replace(".", "/").lstrip("/")


def files(folder: Path) -> list[Path]:
    return [p for p in folder.rglob("*") if p.is_file() and "__pycache__" not in p.parts]


def test_the_package_list_is_the_tree():
    found = {
        ".".join([package, *path.parent.relative_to(ROOT / top).parts])
        for top, package in TOPS.items()
        for path in files(ROOT / top)
        if path.suffix == ".py"
    }
    assert sorted(SETUPTOOLS["packages"]) == sorted(found)


def test_every_package_has_an_init():
    for package in SETUPTOOLS["packages"]:
        assert (folder_of(package) / "__init__.py").is_file(), package


def test_package_data_is_every_other_file():
    matched = [
        path
        for package, patterns in SETUPTOOLS["package-data"].items()
        for pattern in patterns
        for path in folder_of(package).glob(pattern)
    ]
    others = [path for top in TOPS for path in files(ROOT / top) if path.suffix != ".py"]
    assert sorted(matched) == sorted(others)
    for package, patterns in SETUPTOOLS["package-data"].items():
        for pattern in patterns:
            assert list(folder_of(package).glob(pattern)), f"{package}: {pattern} matches nothing"


def test_the_version_is_stated_once():
    version = PROJECT["project"]["version"]
    assert importlib.metadata.version("reflectance_fit") == version
    assert reflectance_fit.__version__ == version


def test_the_command_is_the_one_in_the_tree():
    assert PROJECT["project"]["scripts"] == {"reflectance-fit": "reflectance_fit.cli.main:cli"}
