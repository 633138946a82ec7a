"""What is said where nobody is heard, and what a bus is called."""

from argparse import Namespace

import pytest

from adhesion_can.cli.main import main
from adhesion_can.cli.silence import SilenceWatch, bus_name


def watch():
    said, now = [], [0.0]
    return SilenceWatch("nobody", said.append, clock=lambda: now[0]), said, now


def test_it_is_said_once_after_two_seconds():
    silence, said, now = watch()
    for now[0] in (10.0, 11.0, 11.9):
        silence.look(heard=False)
        assert said == []
    for now[0] in (12.0, 13.0, 30.0):
        silence.look(heard=False)
        assert said == ["nobody"]


def test_what_was_heard_is_never_missed_later():
    silence, said, now = watch()
    silence.look(heard=False)
    now[0] = 1.0
    silence.look(heard=True)
    now[0] = 100.0
    silence.look(heard=False)
    assert said == []


def test_a_bus_that_does_not_name_itself_bears_the_names_of_the_options():
    options = Namespace(interface="udp_multicast", channel="239.74.163.2")
    assert bus_name(options, "unknown") == "udp_multicast 239.74.163.2"
    assert bus_name(options, "socketcan channel 'vcan0'") == "socketcan channel 'vcan0'"
    assert bus_name(Namespace(), "unknown") == "unknown"


def test_run_says_what_it_listens_for_and_that_nothing_came(capsys):
    assert main(["run", "-i", "virtual", "-c", "silent", "--duration", "2.4"]) == 1
    said = capsys.readouterr().err
    assert said.count("nothing received on Virtual bus channel silent yet") == 1
    assert said.count("WheelSpeeds1 0x101") == 2
    assert "came in 2.4 s on Virtual bus channel silent: nothing was identified" in said


def test_monitor_in_lines_says_once_that_nothing_came(capsys):
    words = ["monitor", "-i", "virtual", "-c", "mute", "--plain", "--every", "0.5"]
    assert main([*words, "--duration", "4"]) == 0
    lines, said = capsys.readouterr()
    assert set(lines.splitlines()) == {"0.0 s  nothing received yet"}
    assert said.count("nothing received on Virtual bus channel mute yet: is this") == 1
    assert "does it carry WheelSpeeds1 0x101" in said


@pytest.mark.parametrize("closed", [True, False])
def test_a_closed_loop_that_nobody_answers_says_so(capsys, closed):
    words = ["simulate", "--scenario", "dry", "--duration", "2.3", "-i", "virtual", "-c", "alone2"]
    assert main(words + ["--closed-loop"] * closed) == 0
    out, err = capsys.readouterr()
    assert err.count("no service on Virtual bus channel alone2") == closed
    assert "frames of 2.3 s of 'dry'" in out


def test_simulate_says_what_it_wrote(tmp_path, capsys):
    log = tmp_path / "a.log"
    assert main(["simulate", "--scenario", "wet", "--duration", "1", "--log", str(log)]) == 0
    frames = len(log.read_text().splitlines())
    assert capsys.readouterr().out == f"{log}: {frames} frames of 1 s of 'wet'\n"
