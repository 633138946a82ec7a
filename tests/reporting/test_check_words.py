"""Words of a check: what several axles share is one line, and the last line does not repeat it."""

from pathlib import Path
from types import SimpleNamespace

from adhesion_can.reporting.check_words import WRONG, group_axles
from adhesion_can.reporting.next_steps.after_recording import after_check
from adhesion_can.reporting.next_steps.next_step import Typed

REACHES = "the adhesion reaches {}: check the axle load"


def test_what_is_said_of_every_axle_is_one_line_with_the_range_of_its_figure():
    own = [f"axle {axle}: {REACHES.format(mu)}" for axle, mu in enumerate((14.8, 9, 21.5), start=1)]
    lines = ["frames are late", own[0], "axle 3: no sample could be formed", *own[1:]]
    assert group_axles(lines) == [
        "frames are late",
        f"axles 1 to 3: {REACHES.format('9 to 21.5')}",
        "axle 3: no sample could be formed",
    ]


def test_axles_with_gaps_are_listed_and_equal_lines_stay_as_they_are():
    assert group_axles([f"axle {axle}: stuck" for axle in (2, 4, 6)]) == ["axles 2, 4, 6: stuck"]
    assert group_axles(["plain", "plain"]) == ["plain", "plain"]


def test_where_several_figures_differ_those_of_the_first_axle_are_given():
    lines = [f"axle {axle}: {2 * axle} to {3 * axle} N is measured" for axle in (1, 2)]
    assert group_axles(lines) == ["axles 1 to 2 (figures of axle 1): 2 to 3 N is measured"]


def test_the_last_line_counts_faults_once_and_does_not_repeat_them():
    failures = [f"axle {axle}: {REACHES.format(axle)}" for axle in range(1, 5)]
    result = SimpleNamespace(failures=failures, misfit=None, fit=None)
    typed = Typed(inputs=(Path("a.log"),))
    assert WRONG.lines([result]) == [f"axles 1 to 4: {REACHES.format('1 to 4')}"]
    assert after_check([result], typed).line == (
        "The data are not usable yet. Next: fix this fault, then adhesion-can check a.log"
    )
    result.failures.append("no frames")
    assert "fix these 2 faults" in after_check([result], typed).line
