"""Sentences on a run of `fleet`."""

from argparse import Namespace

from adhesion_can.cli.fleet_summary import Summary, describe
from adhesion_can.fleet.work import Outcome

OPTIONS = Namespace(retry_failed=False)


def lines(*outcomes):
    summary = Summary(len(outcomes))
    for outcome in outcomes:
        summary.add(outcome)
    return describe(OPTIONS, summary, summary.failed, 10.0)


def test_one_of_a_thing_is_told_in_singular():
    one = Outcome("/a/1.log", "a", "x", None, None, 60.0)
    (said,) = lines(one)
    assert said.startswith("1 unit of 1 vehicle: 1 analysed in 10 s (0.0 h of recordings, 6 x")
    failed = Outcome("/b/2.log", "b", None, "read", "/b/2.log: it has no frames")
    said, failures, error = lines(one, failed)
    assert said.startswith("2 units of 2 vehicles: 2 analysed")
    assert failures.startswith("1 unit failed; the data set has the errors; --retry-failed")
    assert error == "  read: /b/2.log: it has no frames"


def test_names_of_one_recording_are_told_up_to_a_few():
    copies = [Outcome(f"/a/{k}.log", "a", "x", None, None) for k in range(7)]
    _, said = lines(*copies[:2])
    assert said == "the same recording under 2 names: /a/0.log, /a/1.log"
    _, said = lines(*copies)
    assert said.endswith("7 names: /a/0.log, /a/1.log, /a/2.log, /a/3.log, /a/4.log and 2 more")


def test_recordings_with_several_names_are_told_up_to_a_few():
    pairs = [Outcome(f"/{k % 2}/{k // 2}.log", "a", str(k // 2), None, None) for k in range(16)]
    _, *said = lines(*pairs)
    assert len(said) == 6
    assert said[-1] == "and 3 more recordings under several names: --json"
