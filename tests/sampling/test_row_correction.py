"""Errors by laws are removed from rows of measured values; angles of wheels by hand."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from adhesion_can.physics.instrument_laws import Need, Quantity, ReadingError
from adhesion_can.physics.instruments import PERFECT
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.equations import Measured
from adhesion_can.sampling.instrument_errors import RowCorrection, WheelAngles, is_whole

T_US = np.array([1_000_000, 1_010_000, 1_500_000])
N = len(T_US)


@dataclass(frozen=True)
class Law:
    """A relative error that is one value of the situation, times a size."""

    quantity: Quantity
    name: str
    size: float = 0.1
    needs: frozenset = frozenset()
    covariates: tuple = ()

    def error(self, situation, _lags):
        known = getattr(situation, self.name, None)
        return ReadingError(self.size * (situation.channel(self.name) if known is None else known))


def rows(**changes):
    columns = {name: np.linspace(1.0, 2.0, N) * 10.0 for name in Measured._fields}
    return Measured(**{**columns, "axle": np.array([1, 2, 1]), **changes})


def corrected(*laws, begin=None, travel=None, efforts=None, angle=None, **covariates):
    correction = RowCorrection(replace(PERFECT, laws=laws), Locomotive())
    if begin is not None:
        correction.begin(begin)
        correction.begin(begin + 77)  # the first one counts
    travel = np.ones(N) if travel is None else travel
    return correction.correct(T_US, rows(), travel, efforts, angle, covariates)


@pytest.mark.parametrize(
    ("quantity", "name"),
    [(Quantity.EFFORT, "effort"), (Quantity.LOAD, "load"), (Quantity.SPEED, "speed"),
     (Quantity.WHEEL_SPEED, "wheel_speed")],
)  # fmt: skip
def test_a_reading_loses_its_own_error_and_the_others_stay(quantity, name):
    """By the number of the axle: 10 % at axle 1, 20 % at axle 2."""
    found, given = corrected(Law(quantity, "axle")), rows()
    for column in Measured._fields:
        divided = column in {name, *({"wheel_accel"} if name == "wheel_speed" else ())}
        wanted = getattr(given, column) / ([1.1, 1.2, 1.1] if divided else 1.0)
        assert getattr(found, column) == pytest.approx(wanted), column


@pytest.mark.parametrize(
    ("begin", "seconds"), [(None, [0.0, 0.01, 0.5]), (400_000, [0.6, 0.61, 1.1])]
)
def test_time_counts_from_the_first_wheel_speed_or_else_from_the_first_row(begin, seconds):
    found = corrected(Law(Quantity.SPEED, "time_s"), begin=begin)
    assert found.speed == pytest.approx(rows().speed / (1.0 + 0.1 * np.array(seconds)))


def test_travel_angles_and_covariates_are_those_of_the_rows():
    travel, angle = np.array([1.0, -1.0, 1.0]), np.array([3.0, 1.0, 2.0])
    found = corrected(Law(Quantity.EFFORT, "travel"), travel=travel)
    assert found.effort == pytest.approx(rows().effort / (1.0 + 0.1 * travel))
    found = corrected(Law(Quantity.LOAD, "wheel_angle"), angle=angle)
    assert found.load == pytest.approx(rows().load / (1.0 + 0.1 * angle))
    found = corrected(Law(Quantity.LOAD, "dew"), dew=angle)
    assert found.load == pytest.approx(rows().load / (1.0 + 0.1 * angle))
    assert np.isnan(corrected(Law(Quantity.LOAD, "dew")).load).all()
    efforts = np.arange(18.0).reshape(3, 6)
    found = corrected(Law(Quantity.SPEED, "total_effort", 0.01), efforts=efforts)
    assert found.speed == pytest.approx(rows().speed / (1.0 + 0.01 * efforts.sum(axis=1)))


def test_it_says_what_the_laws_need():
    laws = (
        Law(Quantity.LOAD, "axle", needs=frozenset({Need.EFFORTS})),
        Law(Quantity.LOAD, "dew", covariates=("dew",)),
    )
    found = RowCorrection(replace(PERFECT, laws=laws), Locomotive())
    assert (found.needs_efforts, found.needs_angle) == (True, False)
    assert tuple(found.covariates) == ("dew",)
    turning = Law(Quantity.LOAD, "wheel_angle", needs=frozenset({Need.WHEEL_ANGLE}))
    found = RowCorrection(replace(PERFECT, laws=(turning,)), Locomotive())
    assert (found.needs_efforts, found.needs_angle) == (False, True)


@pytest.mark.parametrize("size", [1, 2, 5, 40])
def test_a_wheel_turns_by_the_mean_of_two_speeds_in_any_division_into_blocks(size):
    rng = np.random.default_rng(6)
    t_us, speed = np.cumsum(rng.integers(1000, 30_000, 40)), rng.uniform(5.0, 20.0, 40)
    wanted = [0.0]
    for k in range(1, 40):
        wanted.append(wanted[-1] + (t_us[k] - t_us[k - 1]) / 1e6 * (speed[k] + speed[k - 1]) / 2)
    angles, found, other = WheelAngles(), [], []
    for first in range(0, 40, size):
        block = slice(first, first + size)
        found += angles.turn(3, t_us[block], speed[block]).tolist()
        other += angles.turn(4, t_us[block], 2.0 * speed[block]).tolist()
    assert found == pytest.approx(wanted, rel=1e-12, abs=1e-12)
    assert other == pytest.approx([2.0 * angle for angle in wanted], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        ({}, True), ({"speed": 1.0}, True), ({"speed": 0.99}, False), ({"load": 0.0}, False),
        ({"load": -1.0}, False), ({"load": 1e-6}, True), ({"effort": -10.0}, True),
        *(({name: np.nan}, False)
          for name in ("wheel_speed", "wheel_accel", "speed", "effort", "load")),
        ({"wheel_accel": np.inf}, False), ({"effort": -np.inf}, False),
        ({"transfer_std": np.nan}, True),
    ],
)  # fmt: skip
def test_rows_are_whole_where_all_is_known_fast_enough_and_loaded(change, wanted):
    given = rows(**{name: np.array([value, 10.0, 10.0]) for name, value in change.items()})
    assert is_whole(given, v_min=1.0).tolist() == [wanted, True, True]
