"""The bench's comparison of energies at equal utilisation."""

import importlib
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "tools" / "benchmarks"


@pytest.fixture(scope="module")
def energy_at():
    sys.path.insert(1, str(BENCHMARKS))
    try:
        return importlib.import_module("_pulling_goals").energy_at
    finally:
        sys.path.remove(str(BENCHMARKS))


FRONT = [(0.90, 0.02), (0.98, 0.06), (0.97, 0.30)]
"""A setting with little slip, one with more, and one far beyond the peak."""


@pytest.mark.parametrize(
    ("used", "energy"),
    [
        (0.94, 0.04),  # halfway between the first two
        (0.98, 0.06),
        (0.984, 0.06),  # half a percent is forgiven
        (0.99, None),
        (0.80, 0.02),  # more force for less energy counts too
    ],
)
def test_the_least_energy_with_which_a_rival_pulls_as_much(energy_at, used, energy):
    found = energy_at(used, FRONT)
    assert found == (None if energy is None else pytest.approx(energy))


def test_one_setting_alone_is_not_interpolated(energy_at):
    assert energy_at(0.9, [(0.8, 0.01)]) is None
