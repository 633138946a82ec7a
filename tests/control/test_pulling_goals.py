"""The bench's comparison of energies at equal utilisation."""

import importlib
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "tools" / "benchmarks"


@pytest.fixture(scope="module")
def goals():
    sys.path.insert(1, str(BENCHMARKS))
    try:
        return importlib.import_module("_pulling_goals")
    finally:
        sys.path.remove(str(BENCHMARKS))


FRONT = [(0.90, 0.02), (0.98, 0.06), (0.97, 0.30)]
"""A setting with little slip, one with more, and one far beyond the peak."""


@pytest.mark.parametrize(
    ("used", "energy"),
    [
        (0.94, 0.04),  # halfway between the first two
        (0.98, 0.06),
        (0.80, 0.02),  # more force for less energy counts too
    ],
)
def test_the_least_energy_with_which_a_controller_pulls_as_much(goals, used, energy):
    assert goals.energy_at(used, FRONT) == pytest.approx(energy)


def test_energies_are_compared_at_what_both_reach(goals):
    ours = [(0.96, 0.04), (0.99, 0.07)]
    assert goals.energies_at_equal(ours, FRONT) == pytest.approx((0.06, 0.06))
    assert goals.energies_at_equal(FRONT, ours) == pytest.approx((0.06, 0.06))


def test_where_one_pulls_more_at_all_its_settings_nothing_is_compared(goals):
    assert goals.energies_at_equal([(0.99, 0.07)], FRONT) is None
    assert goals.energies_at_equal(FRONT, [(0.5, 0.01)]) is None
    assert goals.energies_at_equal([(0.984, 0.07)], FRONT) == pytest.approx((0.07, 0.06))
