"""Mutation run: which mutations there are, and what is found out about them."""

import importlib
import json
import subprocess
import sys
from pathlib import Path

import pytest

TOOLS = Path(__file__).resolve().parents[2] / "tools"

SOURCE = """
def larger(a, b):
    return a if a > b else b
"""
TESTS = """
from made.steps import larger
def test_larger():
    assert (larger(1, 2), larger(2, 1)) == (2, 2)
"""
SURVIVOR = "src/made/steps.py::larger: return a if a > b else b -> return a if a >= b else b"


@pytest.fixture
def mutations(monkeypatch):
    monkeypatch.syspath_prepend(str(TOOLS))
    return importlib.import_module("mutations")


@pytest.fixture
def project(tmp_path):
    """A project of one function, whose tests do not ask about equal numbers."""
    for name, text in {
        "pyproject.toml": "[tool.pytest.ini_options]\naddopts = ['--doctest-modules']\n",
        "src/made/__init__.py": "",
        "src/made/steps.py": SOURCE,
        "tests/made/test_steps.py": TESTS,
    }.items():
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return tmp_path


def run(project, *options):
    command = [sys.executable, TOOLS / "mutants.py", "--root", project, *options]
    area = ["--area", "src/made=tests/made"]
    return subprocess.run([*command, *area], capture_output=True, text=True, timeout=120)


def test_a_run_finds_the_survivor_and_goes_on_where_it_stopped(project):
    before = {file: file.read_text() for file in project.rglob("*.py")}
    first = run(project)
    assert first.returncode == 0, first.stderr
    assert {file: file.read_text() for file in project.rglob("*.py")} == before
    results = project / "out" / "mutants.jsonl"
    lines = results.read_text().splitlines()
    outcomes = {fields["key"]: fields["outcome"] for fields in map(json.loads, lines)}
    assert [key for key, outcome in outcomes.items() if outcome == "survived"] == [SURVIVOR]
    assert list(outcomes.values()).count("killed") == 2
    assert "src/made/steps.py:3  [comparison]" in first.stdout
    assert "67%" in first.stdout

    results.write_text("\n".join(lines[:2]) + "\n" + lines[2][:20])  # stopped while it was writing
    second = run(project)
    assert "3 mutants, 2 of them tested before" in second.stdout
    assert "[1/1]" in second.stdout
    assert "67%" in second.stdout

    (project / "tests/made/test_steps.py").write_text(TESTS + "\n# Changed\n")
    assert "3 mutants, 0 of them" in run(project, "--list").stdout


def test_tests_that_do_not_start_are_no_kills(project):
    file = project / "tests/made/test_steps.py"
    text = "def test_all():\n    import os\n    from made.steps import larger\n"
    file.write_text(text + "    larger(2, 1) == 2 or os._exit(4)\n")
    stopped = run(project)
    assert stopped.returncode == 1
    assert "the tests do not start" in stopped.stderr


def test_equivalent_mutants_are_left_out_with_a_reason(project):
    listed = project / "tools" / "equivalent_mutants.txt"
    listed.parent.mkdir()
    listed.write_text(f"# Comment\n\n{SURVIVOR}  # equal numbers are the same number\n")
    assert SURVIVOR not in run(project, "--list").stdout
    other = SURVIVOR.replace("src/made", "src/other")
    listed.write_text(f"{SURVIVOR}  # equal numbers\n{other}  # of a folder that is not tested\n")
    assert SURVIVOR not in run(project, "--list").stdout
    for line, message in (
        (SURVIVOR, "gives no reason"),
        (f"{SURVIVOR} + 1  # no such mutant", "do not exist"),
    ):
        listed.write_text(line + "\n")
        refused = run(project, "--list")
        assert refused.returncode == 2
        assert message in refused.stderr


def test_tests_that_fail_without_a_mutant_stop_the_run(project):
    (project / "src/made/steps.py").write_text(SOURCE.replace(">", "<"))
    refused = run(project)
    assert refused.returncode == 2
    assert "tests/made fails without a mutant" in refused.stderr


def test_the_sample_depends_on_the_seed_alone(project):
    samples = {seed: run(project, "--list", "--count", "1", "--seed", seed) for seed in "0123"}
    assert run(project, "--list", "--count", "1", "--seed", "2").stdout == samples["2"].stdout
    assert len({sample.stdout for sample in samples.values()}) > 1


@pytest.mark.parametrize(
    ("source", "mutated"),
    [
        ("f(1 < x == 2.0)", ["f(1 <= x == 2.0)", "f(1 >= x == 2.0)", "f(1 < x != 2.0)"]),
        ("f(a and b)", ["f(a or b)"]),
        ("f(a + b * c)", ["f(a - b * c)", "f(a + b / c)"]),
        ("x -= n", ["x += n"]),
        ("f(-x, not y)", ["f(x, not y)", "f(-x, y)"]),
        ("f(3, 0.5, 0.0, True)", ["f(4, 0.5, 0.0, True)", "f(3, 0.75, 0.0, True)"]),
        ("f(0.0, True)", ["f(1.0, True)", "f(0.0, False)"]),
        ("np.minimum(a, b)", ["np.maximum(a, b)"]),
        ("x = a.max()", ["x = a.min()"]),
        ("known(a, given=b, needed=c)", ["known(a, needed=c)"]),
        ("if a: f()", ["if not a:"]),
        ("x[0] = a", ["pass"]),
        ("for i in x: continue", ["pass"]),
        ("match a:\n    case 1 if b < 2: f()", ["case 1 if b <= 2:"]),
    ],
)
def test_operators(mutations, source, mutated):
    defaults = mutations.defaults_of(["def known(a, given=1, *, needed): ..."])
    found = [one.mutated for one in mutations.mutations_of(source, defaults)]
    assert set(mutated) <= set(found)
    assert "known(a, given=b)" not in found


@pytest.mark.parametrize(
    ("source", "mutated"),
    [
        ("def f():\n    return g(x)", ["return None"]),
        ("def f():\n    return x < y", ["return not x < y", "return x <= y", "return x >= y"]),
        ("@kernel\ndef f():\n    return g(x)", []),
        ("def f():\n    x = g()", []),
        ("def f():\n    x = g()\n    x = h(x)", ["pass"]),
    ],
)
def test_all_mutations_of_a_function(mutations, source, mutated):
    assert [one.mutated for one in mutations.mutations_of(source)] == mutated


def test_each_mutation_is_another_program_and_names_its_place(mutations):
    source = (
        "class A:\n    def f(self, n=1):\n        x = n + 1\n        x = x + 1\n        x = x + 1\n"
    )
    found = mutations.mutations_of(source)
    assert len({one.source for one in found}) == len(found) == len({one.name for one in found})
    assert {one.function for one in found} == {"A.f"}
    assert [one.line for one in found if one.mutated == "def f(self, n=2):"] == [2]
    assert [one.line for one in found if one.mutated.startswith("x = x + 2")] == [4, 5]


@pytest.mark.parametrize(
    "source",
    [
        '"""Text 1."""',
        "X: tuple[int, 3]",
        "import a",
        "Angle = int | float",
        "__version__ = f(1)",
        "def f(x: g(1)) -> g(2): ...",
        "def __repr__(self):\n    return 1 + 2",
        "@dataclass(frozen=True)\nclass A: ...",
        "log.info('%d', 1 + 2)",
        "assert x < 1",
        "f'{1 + 2:3}'",
        "if TYPE_CHECKING:\n    x = 1",
    ],
)
def test_what_no_test_should_notice_is_left_as_it_is(mutations, source):
    assert [one.mutated for one in mutations.mutations_of(source)] == []


def test_the_text_of_an_error_is_left_as_it_is(mutations):
    found = mutations.mutations_of("def f():\n    raise ValueError(1 + 2)")
    assert [one.mutated for one in found] == ["pass"]


def test_the_listed_equivalent_mutants_exist():
    """A changed line leaves its entry behind, and `make mutants` would stop."""
    command = [sys.executable, str(TOOLS / "mutants.py"), "--list", "--count", "1"]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr + ran.stdout
