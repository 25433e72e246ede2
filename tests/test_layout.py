"""The layout of the package: imports run downwards, and the library does not use the laboratory."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import intervis
from intervis.cli import COMMANDS

ROOT = Path(intervis.__file__).parent
LAYERS = (
    ("errors",),
    ("arguments",),
    ("arrays", "kernels", "progress", "result_table"),
    ("delaunay", "directions", "files", "output_folder", "settings", "transform"),
    ("camera",),
    ("drives", "method", "sight"),
    ("live", "plots"),
    ("run", "uses"),
    ("compilation", "view"),
    ("cli",),
    ("__init__", "__main__"),
)
"""Modules and packages of the library, from the bottom; each may import from lower layers only."""

SIGHT_LAYERS = (
    ("kernels",),
    ("box_surface", "ground_map", "occupancy_model", "projected_scan"),
    ("gravity", "sensor"),
    ("answers", "observed_profile", "query_checks", "range_image"),
    ("depth_buffer", "reference", "scan_buffer", "sight"),
    ("box_sight",),
    ("scene",),
    ("explanation",),
    ("__init__",),
)
"""The same for the modules of ``intervis.sight``."""

LAB_LAYERS = (("worlds",), ("truth",), ("paper", "speed"), ("calibrate",), ("cli",), ("__init__",))
"""The same for the packages of ``intervis.lab``, which may import the library."""

LAZY = {"__init__.py", "cli/program.py", "lab/worlds/__init__.py"}
"""Files that import modules by name, when they are first used."""


def ranks(layers: tuple[tuple[str, ...], ...]) -> dict[str, int]:
    """The layer of each module, 0 at the bottom."""
    return {name: rank for rank, names in enumerate(layers) for name in names}


LAYER = ranks(LAYERS)
LAB = r"intervis\.lab(\.\w+)*"
EVERY = sorted(ROOT.rglob("*.py"))
FILES = [path for path in EVERY if path.relative_to(ROOT).parts[0] != "lab"]


def relative(path: Path) -> str:
    """A file below the package's folder."""
    return path.relative_to(ROOT).as_posix()


def place(path: Path) -> str:
    """The module or package of `LAYERS` that a file belongs to."""
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imported(tree: ast.AST) -> Iterator[str]:
    """Absolute names of all modules of the package that some code imports, at any depth."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: relative import"
            # "from intervis import directions" and "from intervis.method import graph" are modules
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        yield from (name for name in names if name.partition(".")[0] == "intervis")


def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def violations(
    tree: ast.AST, own: str, layer: dict[str, int], package: str = "intervis"
) -> list[str]:
    """Imports of modules of a package from a layer that is not below the module `own`."""
    depth = package.count(".") + 1
    found = []
    for name in imported(tree):
        if name != package and not name.startswith(f"{package}."):
            continue
        parts = name.split(".")
        target = parts[depth] if len(parts) > depth else "__init__"
        if target not in layer and target != "__version__":
            target = "__init__"  # a name that the package itself offers
        if target == "__version__" and package == "intervis":
            continue
        if target != own and layer[target] >= layer[own]:
            found.append(name)
    return found


def whole_package_uses(tree: ast.AST) -> Iterator[str]:
    """What code uses of the package after ``import intervis``, which is allowed for the version."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (
                f"{alias.name} as {alias.asname}"
                for alias in node.names
                if alias.name == "intervis" and alias.asname
            )
        if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "intervis":
            yield node.attr


def dynamic_imports(tree: ast.AST) -> list[int]:
    """Lines that import a module by its name."""
    names = {"importlib", "import_module", "__import__"}
    return [
        node.lineno
        for node in ast.walk(tree)
        if (isinstance(node, ast.Import) and names & {alias.name for alias in node.names})
        or (isinstance(node, ast.ImportFrom) and names & {alias.name for alias in node.names})
        or (isinstance(node, ast.Name) and node.id in names)
        or (isinstance(node, ast.Attribute) and node.attr in names)
    ]


def test_every_module_has_a_layer():
    assert {place(path) for path in FILES} == set(LAYER)
    for package, layers in (("sight", SIGHT_LAYERS), ("lab", LAB_LAYERS)):
        there = {
            path.relative_to(ROOT / package).parts[0] for path in (ROOT / package).rglob("*.py")
        }
        assert {name.removesuffix(".py") for name in there} == set(ranks(layers))


@pytest.mark.parametrize("path", FILES, ids=relative)
def test_imports_run_downwards(path):
    found = violations(parsed(path), place(path), LAYER)
    assert not [name for name in found if name != "intervis"]  # see whole_package_uses
    assert not [name for name in imported(parsed(path)) if name.startswith("intervis.lab")]


@pytest.mark.parametrize("path", sorted((ROOT / "sight").rglob("*.py")), ids=relative)
def test_imports_run_downwards_within_sight(path):
    own = path.relative_to(ROOT / "sight").parts[0].removesuffix(".py")
    assert not violations(parsed(path), own, ranks(SIGHT_LAYERS), "intervis.sight")


@pytest.mark.parametrize("path", sorted((ROOT / "lab").rglob("*.py")), ids=relative)
def test_imports_run_downwards_within_the_laboratory(path):
    own = path.relative_to(ROOT / "lab").parts[0].removesuffix(".py")
    assert not violations(parsed(path), own, ranks(LAB_LAYERS), "intervis.lab")
    if own != "cli":
        assert not [name for name in imported(parsed(path)) if name.startswith("intervis.cli")]


@pytest.mark.parametrize("path", EVERY, ids=relative)
def test_the_whole_package_is_imported_for_its_version_only(path):
    assert set(whole_package_uses(parsed(path))) <= {"__version__"}


def test_only_packages_with_lazy_names_import_by_name():
    assert {relative(path) for path in EVERY if dynamic_imports(parsed(path))} == LAZY


@pytest.mark.parametrize(
    "code",
    [
        "from intervis.cli import options",
        "import intervis.run.stream",
        "from intervis import run",
        "from intervis import Scene",
        "def f():\n    from intervis.plots import style",
    ],
)
def test_an_upward_import_is_found(code):
    assert violations(ast.parse(code), "sight", LAYER)


def test_other_ways_upwards_are_found():
    assert violations(
        ast.parse("from intervis.sight import Scene"),
        "scan_buffer",
        ranks(SIGHT_LAYERS),
        "intervis.sight",
    )
    assert violations(
        ast.parse("from intervis.lab.paper import tables"),
        "truth",
        ranks(LAB_LAYERS),
        "intervis.lab",
    )
    assert list(whole_package_uses(ast.parse("import intervis\nintervis.Scene()"))) == ["Scene"]
    assert list(whole_package_uses(ast.parse("import intervis as i\ni.Scene()")))
    for code in ("import importlib", "from importlib import import_module", "__import__('os')"):
        assert dynamic_imports(ast.parse(code))


def test_only_the_table_of_commands_names_the_laboratory():
    named = []
    for path in FILES:
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Constant) and re.fullmatch(LAB, str(node.value)):
                named.append((path.relative_to(ROOT).as_posix(), node.value))
    expected = [name for name in COMMANDS.values() if name.startswith("intervis.lab")]
    assert named == [("cli/__init__.py", name) for name in expected]


def test_importing_the_whole_library_imports_nothing_of_the_laboratory():
    modules = [
        ".".join(("intervis", *path.relative_to(ROOT).with_suffix("").parts))
        for path in FILES
        if path.name not in ("__init__.py", "__main__.py")
    ]
    code = (
        "import sys\n"
        "from importlib import import_module\n"
        f"for name in {modules!r}: import_module(name)\n"
        "print([name for name in sys.modules if name.startswith('intervis.lab')])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
