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
    ("arrays", "kernels", "progress"),
    ("directions", "files", "settings", "transform"),
    ("camera",),
    ("drives", "method", "sight"),
    ("plots",),
    ("run",),
    ("cli",),
    ("__init__", "__main__"),
)
"""Modules and packages of the library, from the bottom; each may import from lower layers only."""

LAYER = {name: rank for rank, names in enumerate(LAYERS) for name in names}
LAB = r"intervis\.lab(\.\w+)*"
FILES = [
    path for path in sorted(ROOT.rglob("*.py")) if path.relative_to(ROOT).parts[0] != "lab"
]  # fmt: skip


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


def test_every_module_has_a_layer():
    assert {place(path) for path in FILES} == set(LAYER)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_imports_run_downwards(path):
    own = place(path)
    for name in imported(ast.parse(path.read_text())):
        target = name.split(".")[1] if "." in name else "__version__"
        if target in (own, "__version__"):
            continue
        assert target in LAYER, f"{name} is not part of the library"
        assert LAYER[target] < LAYER[own], f"{own} must not import {name}"


def test_only_the_table_of_commands_names_the_laboratory():
    named = []
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text())):
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
