"""Work behind the loop: nothing waits, holes are whole and told, ends are bounded."""

import threading

import pytest

from adhesion_can.service.behind import Behind, done_within

PATIENCE_S = 60.0


class Worker:
    """Keeps what it is given; stands still while `may_go` is not set."""

    def __init__(self):
        self.done, self.told = [], []
        self.busy, self.may_go = threading.Event(), threading.Event()

    def work(self, items):
        self.busy.set()
        assert self.may_go.wait(PATIENCE_S)
        self.done += items

    def behind(self, capacity, **how):
        return Behind(
            "test", self.work, capacity=capacity,
            fills=lambda: self.told.append("full"), flows=self.told.append, **how,
        )  # fmt: skip


def test_everything_is_handled_in_order_and_the_end_is_told():
    worker = Worker()
    worker.may_go.set()
    behind = worker.behind(10_000, finish=worker.told.append, pause_s=0.01)
    assert all(behind.put(number) for number in range(5000))
    behind.end(5000)
    assert behind.wait(PATIENCE_S)
    assert worker.done == list(range(5001))
    assert worker.told == [False]
    assert behind.lost == 0


def test_a_failure_is_told_to_whoever_finishes():
    worker = Worker()
    behind = worker.behind(1, finish=worker.told.append)
    behind.end(failed=True)
    assert behind.wait(PATIENCE_S)
    assert worker.told == [True]


def test_what_there_is_no_room_for_is_one_hole_that_is_counted_and_told():
    worker = Worker()
    behind = worker.behind(4)
    behind.put(0)
    assert worker.busy.wait(PATIENCE_S)
    assert behind.has_room
    taken = [behind.put(number) for number in range(1, 8)]
    assert taken == [True] * 4 + [False] * 3
    assert not behind.has_room
    assert worker.told == ["full"]
    worker.may_go.set()
    while not behind.has_room:
        worker.busy.wait(0.001)
    assert behind.put(8)
    assert worker.told == ["full", 3]
    behind.end()
    assert behind.wait(PATIENCE_S)
    assert worker.done == [0, 1, 2, 3, 4, 8]
    assert behind.lost == 3


def test_an_end_that_is_not_reached_counts_what_is_left():
    worker = Worker()
    behind = worker.behind(4)
    behind.put(0)
    assert worker.busy.wait(PATIENCE_S)
    for number in range(1, 4):
        behind.put(number)
    behind.end()
    assert not behind.wait(0.0)
    assert behind.lost == 4
    worker.may_go.set()
    assert behind.wait(PATIENCE_S)


def test_what_may_never_end_is_given_up():
    never = threading.Event()
    assert not done_within(0.01, never.wait)
    never.set()
    assert done_within(PATIENCE_S, never.wait)


def test_an_error_of_what_may_never_end_is_raised():
    with pytest.raises(ZeroDivisionError):
        done_within(PATIENCE_S, lambda: 1 / 0)
