"""Data that carry no verdict, and what they do not identify, with the numbers that decide."""

from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.diagnosis.inference.insufficient_data import (
    describe_insufficient_data,
    find_untestable,
)
from tests.diagnosis.diagnosis_helpers import burckhardt


class Drive:
    """Rows with slips from 0 on, and the adhesion of a curve."""

    def __init__(self, rows, *, independent=False, table=True, top=0.1, factor=1.0, axles=1):
        self.independent, self.table, self.name = independent, table, "a"
        slip = np.linspace(0.0, top, rows)
        self.slip, self.adhesion = slip, factor * burckhardt(slip)
        self.axle = np.arange(rows) % axles + 1
        self.t_s = np.arange(rows) // axles * 0.02
        self.radius = np.full(axles, 0.6)

    def __len__(self):
        return len(self.slip)

    def observe(self, *_):
        return SimpleNamespace(slip=self.slip, adhesion=self.adhesion)


def blocks(decide, hold, number=12):
    """Block numbers of rows that decide and of rows that are held out."""
    return np.concatenate([np.arange(decide) % number, -1 - np.arange(hold) % number])


@pytest.mark.parametrize(
    ("decide", "hold", "words"),
    [
        (400, 100, ""),
        (399, 100, "399 usable rows to decide on: at least 400"),
        (400, 99, "99 usable rows to hold out: at least 100"),
        (400, 0, "0 usable rows to hold out"),
    ],
)
def test_a_drive_needs_400_rows_that_decide_and_100_to_hold_out(decide, hold, words):
    found = describe_insufficient_data([Drive(decide + hold)], blocks(decide, hold))
    assert found.startswith(words)
    assert bool(found) == bool(words)


@pytest.mark.parametrize(
    ("decide", "hold", "words"),
    [
        (60, 0, ""),
        (60, 15, ""),
        (59, 0, "59 usable rows to decide on: at least 60"),
        (60, 14, "14 usable rows to hold out: at least 15"),
    ],
)
def test_points_need_60_and_are_held_out_in_turn_where_no_other_data_are(decide, hold, words):
    drive = Drive(decide + hold, independent=True)
    found = describe_insufficient_data([drive], blocks(decide, hold))
    assert found.startswith(words)
    assert bool(found) == bool(words)
    # Points beside a series are rows of the series.
    both = [Drive(200, independent=True), Drive(199)]
    assert "at least 400" in describe_insufficient_data(both, blocks(399, 0))


@pytest.mark.parametrize(("number", "enough"), [(8, False), (9, True)])
def test_a_drive_needs_nine_blocks_of_time(number, enough):
    block = np.where(np.arange(600) < 450, np.arange(600) % number, -1)
    block[450:] = -1 - (number - 1)
    block[:450] = np.arange(450) % (number - 1)
    found = describe_insufficient_data([Drive(600)], block)
    assert (found == "") == enough
    if not enough:
        assert "8 blocks of time; at least 9" in found


def test_slip_and_adhesion_must_vary():
    assert "the slip hardly varies" in describe_insufficient_data(
        [Drive(600, top=0.004)], blocks(400, 200)
    )
    # Nine tenths of the range count.
    assert describe_insufficient_data([Drive(600, top=0.0046)], blocks(400, 200)) == ""
    low = Drive(600, factor=0.02)
    assert "the adhesion hardly varies" in describe_insufficient_data([low], blocks(400, 200))


def named(drives):
    return {one.what: one.why for one in find_untestable(drives)}


@pytest.mark.parametrize(("rows", "percent"), [(60, "8.3 %"), (500, "1.0 %")])
def test_what_so_many_points_cannot_tell_from_chance(rows, percent):
    """An RMSE lower by x takes 2 n x off twice the log likelihood: 10 for 500 / n %."""
    (what,) = named([Drive(rows, independent=True)])
    assert percent in what
    assert named([Drive(rows)]) == {}


def coasting(share, *, axles=1, seconds=4):
    """A recording of which a share of the rows of its third second coast, at the last axle."""
    drive = Drive(50 * seconds * axles, table=False, axles=axles)
    drive.adhesion = np.full(len(drive), 0.1)
    own = np.flatnonzero((drive.axle == axles) & (np.floor(drive.t_s + 1e-9) == 2.0))
    drive.adhesion[own[: round(share * len(own))]] = -0.004
    return drive


@pytest.mark.parametrize("axles", [1, 3])
@pytest.mark.parametrize(
    ("share", "known"), [(0.0, False), (0.2, False), (0.24, True), (1.0, True)]
)
def test_coasting_is_a_fifth_of_some_second_of_an_axle(share, known, axles):
    found = named([coasting(share, axles=axles)])
    assert ("wheel against ground speed in a" in found) is not known


def test_axles_without_a_row_are_named_in_recordings():
    drive = coasting(1.0, axles=2)
    drive.radius = np.full(4, 0.6)
    assert list(named([drive])) == ["axle 3 in a", "axle 4 in a"]
