"""Tables that cut nothing, whatever the width, and times that begin at 0."""

import io
import re

from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from adhesion_can.reporting.text import FittingTable
from adhesion_can.result_text import TimeScale

WORDS = st.from_regex(r"[a-z0-9.]{1,14}", fullmatch=True)


def printed(made, width):
    out = io.StringIO()
    Console(file=out, width=width, highlight=False).print(made)
    return out.getvalue()


@settings(max_examples=60)
@given(st.integers(1, 9).flatmap(
    lambda n: st.tuples(
        st.lists(WORDS, min_size=n, max_size=n),
        st.lists(st.lists(WORDS, min_size=n, max_size=n), min_size=1, max_size=4),
    )
), st.integers(40, 120))  # fmt: skip
def test_every_cell_stands_there_whole_at_any_width(content, width):
    columns, rows = content
    lines = printed(FittingTable("a title", columns, rows), width).splitlines()
    assert max(map(len, lines)) <= width
    words = re.split(r"\s+", " ".join(lines))
    for cell in (*columns, *(cell for row in rows for cell in row)):
        assert cell in words
    assert "…" not in " ".join(lines)


def test_what_fits_is_one_table_and_what_does_not_goes_on_below_with_its_first_column():
    columns = ("time s", *(f"column{i}" for i in range(8)))
    rows = [("0.0 .. 6.0", *("0.3729 ± 0.0003" for _ in range(8)))]
    assert printed(FittingTable("wide", columns, rows), 200).count("time s") == 1
    narrow = printed(FittingTable("wide", columns, rows), 80)
    assert narrow.count("time s") == narrow.count("0.0 .. 6.0") == 2
    assert narrow.count("wide") == 1


def test_times_count_from_the_first_stamp_and_the_heading_says_which_that_is():
    times = TimeScale.beginning_at(1_790_000_000_250_000)
    assert times.span(1_790_000_000_250_000, 1_790_000_006_250_000) == "0.0 .. 6.0"
    assert times.begin == "2026-09-21 14:13:20 UTC"
    assert times.note == ", time since 2026-09-21 14:13:20 UTC"
    recording = TimeScale.beginning_at(12_000_000)
    assert recording.span(12_000_000, 13_500_000) == "0.0 .. 1.5"
    assert recording.heading("a.log") == "Time 0 of a.log is 12 s on the recording's clock."
    first_cycle = TimeScale.beginning_at(20_000)
    assert first_cycle.span(20_000, 1_020_000) == "0.0 .. 1.0"
    assert first_cycle.begin == first_cycle.note == first_cycle.heading() == ""
