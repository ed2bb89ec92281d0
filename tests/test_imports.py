"""If these fail, a reader can't take one module after another, or a command waits for what it doesn't need."""

import ast
import graphlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def modules(package):
    return {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in (ROOT / package).rglob("*.py")}


def imported(path):
    """Dotted names, those inside functions too."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
            yield node.module


@pytest.mark.parametrize("package", ["src/config", "src/experiment", "src"])
def test_no_module_imports_itself_by_a_detour(package):
    known = modules(package)
    graph = {name: {each for each in imported(path) if each in known} - {name} for name, path in known.items()}
    graphlib.TopologicalSorter(graph).prepare()  # raises CycleError, which names the modules


@pytest.mark.parametrize(
    ("package", "forbidden"),
    [("benchmarks", "tests"), ("src", "tests"), ("src", "benchmarks"), ("src", "analysis"), ("analysis", "src")],
)
def test_what_a_package_never_imports(package, forbidden):
    guilty = {
        name
        for name, path in modules(package).items()
        for each in imported(path)
        if f"{each}.".startswith(f"{forbidden}.")
    }
    assert not guilty
