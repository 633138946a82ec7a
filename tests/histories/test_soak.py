"""The command tools/soak: what it tells at its end, or when it is stopped."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tools.soak import Found, OneService, Record, Soak, judge_histories, run, tell

ROOT = Path(__file__).resolve().parents[2]
LOADED = """
from tools.soak import ROOT, loaded_code
for path in loaded_code():
    print(path.relative_to(ROOT))
"""
DAY = Soak(24.0, 6.0, 1)


@pytest.mark.parametrize(
    ("broken", "memory", "is_missed"),
    [(0, [360.0, 361.0, 359.0], False), (1, [360.0, 360.0], True), (0, [360.0, 362, 360], True)],
)
def test_the_figures_beside_their_targets(broken, memory, is_missed, capsys):
    assert tell(DAY, Found(1440, broken, memory), is_stopped=False) is is_missed
    told = capsys.readouterr().out
    assert f"of 1440 histories of 60 s, those in which a rule was broken: {broken}" in told
    assert f"growth after its first hour, when it had 360.0 MiB: {max(memory) - 360:+.2f}" in told
    assert "STOPPED" not in told


def test_one_that_is_stopped_says_of_how_much_its_figures_are(capsys):
    assert not tell(DAY, Found(90, 0, [360.0]), is_stopped=True)
    told = capsys.readouterr().out
    assert "STOPPED before the end, after 1.50 h of histories, 1 h of one service" in told
    assert "of 90 histories" in told
    assert "growth" not in told  # nothing is known of it after one hour


def end_at_once(*_):
    """A service that crashes."""
    os._exit(3)


@pytest.mark.costly
def test_a_service_that_crashed_is_no_end(monkeypatch):
    monkeypatch.setattr("tools.soak.watch_memory", end_at_once)
    with pytest.raises(ChildProcessError, match="after 0 h, with exit code 3"):
        OneService(DAY).wait(Found())


@pytest.mark.costly
def test_a_crash_is_told_beside_the_figures_of_the_histories(monkeypatch, capsys):
    def judge(*arguments):
        found = arguments[2]
        found.histories, found.broken = 60, 0

    monkeypatch.setattr("tools.soak.watch_memory", end_at_once)
    monkeypatch.setattr("tools.soak.judge_histories", judge)
    assert run(DAY, 1, Record(None, 6.0), with_memory=True) == 1
    told = capsys.readouterr().out
    assert "of 60 histories of 60 s" in told
    assert "CRASHED: the one service ended after 0 h, with exit code 3" in told


def test_what_was_judged_before_is_not_judged_again(monkeypatch, tmp_path, capsys):
    path, judged = tmp_path / "record.jsonl", []

    def play(_, tasks, __):
        for seed, _ in tasks:
            judged.append(seed)
            yield 0, (seed, ["a rule"] if seed == 3 else [], ())
            if seed == 4:
                raise KeyboardInterrupt

    monkeypatch.setattr("tools.soak.results_as_done", play)
    monkeypatch.setattr("tools.soak.hash_of_code", lambda: "one")
    tenth = Soak(0.1, 6.0, 1)
    with pytest.raises(KeyboardInterrupt):
        judge_histories(tenth, 1, Found(), Record(path, 6.0))
    found = Found()
    judge_histories(tenth, 1, found, Record(path, 6.0))
    assert judged == [1, 2, 3, 4, 5, 6]
    assert (found.histories, found.broken) == (6, 1)
    assert "4 of 6 were judged before" in capsys.readouterr().out
    # Another rate of faults, another code: all of them again.
    assert not Record(path, 5.0).broken
    monkeypatch.setattr("tools.soak.hash_of_code", lambda: "another")
    assert not Record(path, 6.0).broken


WAITING = """
import signal, sys, time
from tools.processes import results_as_done
if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        for number, _ in results_as_done(time.sleep, [0.0, 600.0, 600.0, 600.0], 2):
            print("done", number, flush=True)
            {within}
    except KeyboardInterrupt:
        print("stopped", flush=True)
"""


@pytest.mark.costly
@pytest.mark.parametrize(
    "within", ["pass", "time.sleep(600.0)"], ids=["while it waits", "in the caller's loop"]
)
def test_processes_end_with_the_command_that_began_them(within, tmp_path):
    script = tmp_path / "waiting.py"
    script.write_text(WAITING.format(within=within))
    began = time.monotonic()
    with subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    ) as process:  # fmt: skip
        assert process.stdout.readline() == "done 0\n"
        process.send_signal(signal.SIGTERM)
        # The end of the pipe: all who could write to it are gone.
        assert process.stdout.read() == "stopped\n"
        assert process.wait() == 0
    assert time.monotonic() - began < 500


@pytest.mark.costly
def test_the_record_holds_for_what_a_history_loads():
    """In a process of its own, since the tests load everything."""
    told = subprocess.run(
        [sys.executable, "-c", LOADED], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    assert "adhesion_can/service/core.py" in told
    assert "tests/histories/checker.py" in told
    assert not [name for name in told if name.startswith("adhesion_can/diagnosis/")]
