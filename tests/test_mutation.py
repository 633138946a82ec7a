"""The list of known survivors of tools/mutation speaks of the code as it is."""

import ast
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SETTINGS = tomllib.loads((ROOT / "tools" / "mutation.toml").read_text())


def lines_of(module, where):
    """Lines of a function or class by its qualified name, '' for the whole module, stripped.

    A difference between two texts may take a line and the one before it: those are there, too.
    """
    text = (ROOT / module).read_text()
    node = ast.parse(text)
    for name in filter(None, where.split(".")):
        (node,) = (one for one in node.body if getattr(one, "name", None) == name)
    lines = text.splitlines()
    if where:
        first = min([node.lineno, *(one.lineno for one in node.decorator_list)])
        lines = lines[first - 1 : node.end_lineno]
    lines = [line.strip() for line in lines]
    return [*lines, *map(" ".join, pairwise(lines))]


def test_every_module_and_every_test_is_there():
    for module, tests in SETTINGS["tests"].items():
        assert tests, module
        for path in (module, *tests):
            assert (ROOT / path).is_file(), path


@pytest.mark.parametrize("package", SETTINGS["package"], ids=lambda one: one["name"])
def test_every_module_and_test_of_a_package_is_there(package):
    modules = {path.name for path in (ROOT / package["folder"]).glob(package.get("files", "*.py"))}
    assert len(modules) > 5
    assert set(package.get("tests_of", {})) <= modules
    for tests in (package["tests"], *package.get("tests_of", {}).values()):
        assert tests
        assert all((ROOT / path).is_file() for path in tests)


@pytest.mark.parametrize(
    "known", SETTINGS.get("known", []), ids=lambda one: f"{one['where']}: {one['line']}"
)
def test_a_known_survivor_has_its_line_and_a_reason(known):
    assert set(known) == {"module", "where", "line", "mutants", "reason"}
    folders = [one["folder"] for one in SETTINGS["package"]]
    assert known["module"] in SETTINGS["tests"] or known["module"].startswith(tuple(folders))
    assert known["line"] in lines_of(known["module"], known["where"])
    assert known["mutants"]
    assert known["line"] not in known["mutants"]
    assert len(known["reason"]) > 20
