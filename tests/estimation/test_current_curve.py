"""The direction of the effort, for curves that differ between traction and braking."""

import numpy as np
import pytest

from adhesion_can.estimation.extended.current_curve import LatestConditions
from adhesion_can.physics.effects import Contact

AXLES = 6
STEP_S = 0.02


def follow(adhesion):
    """Signs after each of the readings; `adhesion` shape (n, axles)."""
    found, conditions = [], None
    for number, row in enumerate(adhesion):
        one = np.ones(AXLES)
        contact = Contact(
            slip=0 * one,
            creep_speed=0 * one,
            speed=10 * one,
            load=2e5 * one,
            time_s=number * STEP_S * one,
            axle=np.arange(1, AXLES + 1),
            place=np.arange(1, AXLES + 1),
            adhesion=row,
        )
        conditions = LatestConditions.update(contact, conditions)
        found.append(conditions.sign)
    return np.array(found)


@pytest.mark.parametrize("last", [1.0, -1.0])
def test_noise_while_coasting_does_not_turn_the_direction(last):
    """A minute of coasting after traction or braking, noise of 1 %, three seeds: never."""
    for seed in range(3):
        noise = 0.01 * np.random.default_rng(seed).standard_normal((3100, AXLES))
        noise[:100] += 0.2 * last
        assert (follow(noise) == last).all()


def test_the_direction_turns_within_a_quarter_of_a_second():
    pull = np.concatenate([np.full(100, 0.2), np.zeros(100), np.full(100, -0.1)])
    sign = follow(np.repeat(pull[:, None], AXLES, axis=1))
    assert (sign[:200] == 1).all()
    assert np.flatnonzero(sign < 0)[0] - 200 <= 0.25 / STEP_S
    assert (sign[213:] == -1).all()


def test_the_first_reading_says_its_direction():
    assert follow(np.full((1, AXLES), -0.1))[0] == -1
