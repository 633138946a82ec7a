"""A name of a public class stands for one thing in the whole package."""

import ast
from collections import Counter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "adhesion_can"

# Classes of the running service that had these names before the rule. Names go from this list, and
# none is added: rename the newer of two classes after what tells it from the other.
TWICE: set[str] = set()


def public_classes(text):
    """Names of the classes that a module defines at its top level, without underscore."""
    return [
        node.name
        for node in ast.parse(text).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    ]


def names_that_stand_twice(texts):
    count = Counter(name for text in texts for name in public_classes(text))
    return {name for name, times in count.items() if times > 1}


@pytest.mark.costly
def test_no_public_class_has_the_name_of_another():
    texts = (path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py"))
    assert names_that_stand_twice(texts) <= TWICE


def test_a_name_that_stands_twice_is_found():
    texts = ["class Kind:\n    pass\n", "class Kind:\n    pass\nclass _Part:\n    pass\n"]
    assert names_that_stand_twice([*texts, "class _Part:\n    pass\n"]) == {"Kind"}
