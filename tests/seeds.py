"""Values of a test of which the first ones run each time and the others among the slow tests."""

import pytest


def first_quick(values, quick=1):
    """Parameters of a test.

    Args:
        values: Seeds, or other values.
        quick: Number of values that are no slow ones.

    """
    first, others = list(values)[:quick], list(values)[quick:]
    return [*first, *(pytest.param(value, marks=pytest.mark.slow) for value in others)]
