"""The bar of long work: when it comes, what it says, and that it changes no result."""

import numpy as np
import pytest

from adhesion_can.cli import bars, reading
from adhesion_can.cli.bars import Bar
from adhesion_can.cli.main import main
from tests.wire import Bench


@pytest.fixture(autouse=True)
def nothing_said():
    yield
    Bar.wanted = None


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(bars, "monotonic", lambda: now[0])
    return now


def test_in_a_pipe_lines_come_every_two_seconds_where_asked(clock, capsys):
    Bar.wanted = True
    one = Bar("reading")
    for clock[0], share in ((101.0, 0.1), (102.0, 0.25), (103.0, 0.3), (104.5, 0.5)):
        one.update(share)
    one.close()
    assert capsys.readouterr().err == "reading: 25 %, 6 s left\nreading: 50 %, 4 s left\n"


@pytest.mark.parametrize("wanted", [None, False])
def test_in_a_pipe_nothing_comes_unasked(clock, capsys, wanted):
    Bar.wanted = wanted
    one = Bar("reading")
    clock[0] = 200.0
    one.update(0.5)
    assert capsys.readouterr() == ("", "")


def test_blocks_are_given_in_parts_that_are_the_whole(monkeypatch):
    """All rows once and in order, shares that rise to 1; the work's time sets the size."""
    monkeypatch.setattr(reading, "FIRST_ROWS", 7)
    from adhesion_can.bus.block import Block

    block = Block.from_frames(list(Bench().drive(0, 1_000_000)), ())
    seen, shares = [], []
    for part, share in reading._parts(block):
        seen.append(part.t_us)
        shares.append(share)
    assert len(seen) > 3
    assert np.array_equal(np.concatenate(seen), block.t_us)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.costly
def test_the_answers_are_the_same_with_a_bar(tmp_path, monkeypatch):
    log, found = tmp_path / "a.log", []
    assert (
        main(["simulate", "--scenario", "dry-wet-dry", "--duration", "4", "--log", str(log)]) == 0
    )
    monkeypatch.setattr(reading, "FIRST_ROWS", 311)
    for option in ("--progress", "--no-progress"):
        out = tmp_path / f"{option}.log"
        assert main(["replay", str(log), "--frames", str(out), option]) == 0
        found.append(out.read_bytes())
    assert found[0] == found[1]
