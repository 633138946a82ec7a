"""Values of a test of which the first ones run each time and the others among the slow tests."""

import pytest


def first_quick(values, quick=1):
    """Parameters of a test.

    Args:
        values: Seeds, or other values; a tuple has the values of several names.
        quick: Number of values that are no slow ones.

    """
    first, others = list(values)[:quick], list(values)[quick:]
    return [*first, *(slow(value) for value in others)]


def slow(value):
    """A parameter of a slow test."""
    values = value if isinstance(value, tuple) else (value,)
    return pytest.param(*values, marks=pytest.mark.slow)
