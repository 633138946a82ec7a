"""Which rows decide and which are held out, on drives that have nothing but times."""

import numpy as np
import pytest

from adhesion_can.diagnosis.inference.split_hold_out import (
    choose_held_out_drives,
    held_blocks,
    number_blocks_of_drives,
    split_by_length,
    split_hold_out,
)

BLOCK_S = 4.0


class Drive:
    """Rows at times; two axles have the same ones."""

    def __init__(self, seconds, *, rows=None, begin_s=0.0, independent=False, pause_s=0.0):
        t_s = begin_s + np.arange(0.0, seconds, 0.1)
        self.t_s = np.tile(t_s + pause_s * (t_s > begin_s + seconds / 2), 2)
        self.driven_s = 0.0 if independent else seconds
        self.independent = independent
        self.rows = len(self.t_s) if rows is None else rows

    def __len__(self):
        return self.rows


def test_of_a_single_drive_every_third_pair_of_blocks_is_held_out():
    block = split_hold_out([Drive(60.0, begin_s=8.0)], [False], BLOCK_S)
    number = np.where(block < 0, -1 - block, block)
    assert number.tolist() == np.tile(np.arange(600) // 40, 2).tolist()
    assert sorted(set((-1 - block[block < 0]).tolist())) == [2, 3, 8, 9, 14]


def test_of_several_drives_every_third_block_is_and_of_a_short_one_every_second():
    drives = [Drive(60.0), Drive(44.0)]
    parts = np.split(split_hold_out(drives, [False, False], BLOCK_S), [len(drives[0])])
    held = [sorted(set((-1 - part[part < 0]).tolist())) for part in parts]
    # The second drive's blocks count on from the 15 of the first one.
    assert held == [[1, 4, 7, 10, 13], [15 + k for k in (1, 3, 5, 7, 9)]]
    assert [held_blocks(n) for n in (1, 2, 5)] == [2, 1, 1]


def test_drives_that_are_held_out_are_held_out_whole_and_nothing_else_is():
    drives = [Drive(60.0), Drive(60.0), Drive(8.0)]
    block = split_hold_out(drives, [False, True, False], BLOCK_S)
    first, second, third = np.split(block, np.cumsum([len(drive) for drive in drives])[:-1])
    assert first.min() >= 0
    assert third.min() >= 0
    assert sorted(set((-1 - second).tolist())) == list(range(15, 30))
    assert set(third.tolist()) == {30, 31}


def test_of_independent_points_none_is_held_out():
    assert split_hold_out([Drive(60.0, independent=True)], [False], BLOCK_S).min() >= 0
    assert split_hold_out([], [], BLOCK_S).tolist() == []


def test_pauses_are_no_blocks_and_numbers_go_on_from_drive_to_drive():
    drives = [Drive(16.0, pause_s=400.0), Drive(8.0, begin_s=100.0)]
    numbers = number_blocks_of_drives(drives, BLOCK_S)
    first, second = (sorted(set(one.tolist())) for one in numbers)
    assert first == list(range(len(first)))
    assert 4 <= len(first) <= 6
    assert second == [len(first), len(first) + 1]
    assert len(number_blocks_of_drives([Drive(0.0), *drives], BLOCK_S)[0]) == 0


@pytest.mark.parametrize(
    ("seconds", "held"),
    [
        ([60.0], [False]),
        ([60.0, 60.0], [True, False]),
        ([70.0, 60.0, 80.0], [False, True, False]),
        ([80.0, 60.0, 70.0, 79.0, 78.0, 77.0], [False, True, True, False, False, False]),
        # Of two of like length one is held out, though a third is much shorter.
        ([60.0, 58.0, 20.0], [False, True, False]),
        # One of them is as long as the other only: nothing would be left to decide on.
        ([100.0, 60.0], [False, False]),
    ],
)
def test_the_shortest_third_of_the_drives_of_like_length_is_held_out(seconds, held):
    assert choose_held_out_drives([Drive(one) for one in seconds], []) == held


def test_drives_with_few_rows_are_not_held_out_unless_the_user_says_so():
    few, many, more = Drive(60.0, rows=399), Drive(61.0), Drive(62.0)
    assert choose_held_out_drives([few, many, more], []) == [False, True, False]
    assert choose_held_out_drives([few, many, more], [few]) == [True, False, False]
    assert choose_held_out_drives([few, many], []) == [False, False]


@pytest.mark.parametrize(("other", "is_short"), [(45.0, False), (44.0, True)])
def test_a_drive_of_less_than_three_quarters_of_the_longest_is_short(other, is_short):
    drives = [Drive(60.0), Drive(other)]
    long, short = split_by_length(drives)
    assert short == ([drives[1]] if is_short else [])
    assert long == ([drives[0]] if is_short else drives)


def test_where_points_stand_alone_rows_count_as_length():
    points, drive = Drive(60.0, independent=True, rows=100), Drive(600.0, rows=120)
    assert split_by_length([points, drive]) == ([points, drive], [])
    points.rows = 80
    assert split_by_length([points, drive]) == ([drive], [points])
