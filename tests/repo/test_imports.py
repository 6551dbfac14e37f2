"""Imports point one way, and each heavy dependency has one home."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = {
    "reflectance_fit": "reflectance_fit",
    "cli": "reflectance_fit.cli",
    "data_synthetic": "reflectance_fit.data_synthetic",
}

# From the bottom up; a part imports from its own layer or below.
LAYERS = (
    {"angles"},  # cosines of degrees by numpy alone, so that physics may stand on it
    {"physics"},
    {"observations", "examination", "material", "materials", "priors", "result", "errors", "strict_yaml"}
    | {"files", "inputs", "manifests", "measured", "nuisances", "observations_columns", "observations_file"}
    | {"children", "samples", "views", "yaml_edit", "map_columns"},
    {"measurement", "capture", "inference", "report", "plot", "data_synthetic", "render", "scale", "pixels"},
    {"workflow", "workflow_schlick", "workflow_plan", "workflow_board", "workflow_ingest", "planning"}
    | {"workflow_render", "workflow_batch", "workflow_map", "mapping", "map_rows"},
    {"demonstration"},
    {"cli"},
)
RANK = {part: rank for rank, layer in enumerate(LAYERS) for part in layer}
SIBLINGS = LAYERS[3]

HOMES = {
    "nlopt": "reflectance_fit.inference.optimize",
    "emcee": ("reflectance_fit.inference.posterior", "reflectance_fit.inference.ensembles"),
    "arviz_stats": "reflectance_fit.inference",
    "matplotlib": "reflectance_fit.plot",
    "PIL": "reflectance_fit.plot",
    "click": "reflectance_fit.cli",
    "rich": "reflectance_fit.cli",
    "h5netcdf": (
        "reflectance_fit.report.netcdf",
        "reflectance_fit.report.map_file",
        "reflectance_fit.observations_file",
    ),
    "ruamel": ("reflectance_fit.strict_yaml", "reflectance_fit.yaml_edit"),
    "OpenEXR": ("reflectance_fit.render", "reflectance_fit.report.map_file"),
    "rawpy": "reflectance_fit.capture.raw",
    "dask": "reflectance_fit.scale.cluster",
    "distributed": "reflectance_fit.scale.cluster",
    "colour": "reflectance_fit.render.colour",
    "cv2": (
        "reflectance_fit.capture",
        "reflectance_fit.data_synthetic.target",
        "reflectance_fit.render.pictures",
    ),
}


def modules() -> Iterator[tuple[str, Path]]:
    """Every module's dotted name as installed, and its file."""
    for folder, package in FOLDERS.items():
        for path in sorted((ROOT / folder).rglob("*.py")):
            steps = path.relative_to(ROOT / folder).with_suffix("").parts
            yield ".".join([package, *(s for s in steps if s != "__init__")]), path


def imports(module: str, path: Path) -> set[str]:
    """Dotted names that ``module`` imports anywhere, functions and TYPE_CHECKING blocks included."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parent = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parent, *filter(None, [base])])
            # ``from package import module`` names the module, not the package.
            found |= {f"{base}.{alias.name}" for alias in node.names}
    return found


def inside(name: str, package: str) -> bool:
    return name == package or name.startswith(package + ".")


IMPORTS = {module: imports(module, path) for module, path in modules()}


def part(module: str) -> str:
    """``inference`` of ``reflectance_fit.inference.run``; empty for the package itself."""
    return [*module.split("."), ""][1]


def test_the_walk_sees_relative_and_nested_imports():
    assert "reflectance_fit.cli.options.output_options" in IMPORTS["reflectance_fit.cli.fit"]
    assert "reflectance_fit.workflow.fit_to_folder" in IMPORTS["reflectance_fit.cli.fit"]
    assert "arviz_stats.base.array_stats" in IMPORTS["reflectance_fit.inference.posterior"]


def test_every_part_has_a_layer():
    assert {part(module) for module in IMPORTS} - {""} <= set(RANK)


@pytest.mark.parametrize("module", [module for module in IMPORTS if part(module)])
def test_imports_point_one_way(module):
    here = part(module)
    ours = {part(name) for name in IMPORTS[module] if inside(name, "reflectance_fit")} - {here}
    assert {there for there in ours if RANK.get(there, 99) > RANK[here]} == set()
    if here in SIBLINGS:
        # Synthetic captures are pictures that the renderer may make; a pixel's equations are those of the fit.
        may = {"data_synthetic": {"render"}, "pixels": {"inference"}}.get(here, set())
        assert ours & SIBLINGS <= may


@pytest.mark.parametrize("module", [module for module in IMPORTS if part(module) == "physics"])
def test_physics_needs_only_arrays(module):
    allowed = {"numpy", "scipy", "numba", *sys.stdlib_module_names}
    ours = ("reflectance_fit.physics", "reflectance_fit.angles")
    foreign = {n for n in IMPORTS[module] if n.split(".")[0] not in allowed}
    assert {n for n in foreign if not any(inside(n, package) for package in ours)} == set()


@pytest.mark.parametrize("dependency", HOMES)
def test_heavy_dependencies_have_one_home(dependency):
    users = {m for m, names in IMPORTS.items() if any(inside(n, dependency) for n in names)}
    assert users
    homes = HOMES[dependency] if isinstance(HOMES[dependency], tuple) else (HOMES[dependency],)
    assert {user for user in users if not any(inside(user, home) for home in homes)} == set()


def test_the_package_itself_imports_ours_only_for_type_checkers():
    """``import reflectance_fit`` must cost nothing: see test_startup.py for what it loads."""
    tree = ast.parse((ROOT / "reflectance_fit" / "__init__.py").read_text(encoding="utf-8"))
    at_once = [n for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom)]
    assert {getattr(n, "module", None) or n.names[0].name for n in at_once} <= sys.stdlib_module_names
