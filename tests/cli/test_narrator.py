"""Lines for the operator: what is told, as text and as JSON, and how much at most."""

import io
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.cli.main import main
from adhesion_can.cli.narrator import BURST, LINES_PER_S, Narrator
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status
from adhesion_can.service.outputs import Outputs, Setpoint


class Clock:
    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s


def told(form="json"):
    file, clock = io.StringIO(), Clock()
    return Narrator(file, form, clock), file, clock


def lines(file):
    return [json.loads(line) for line in file.getvalue().splitlines()]


def test_every_line_of_json_is_an_object_with_time_level_and_message():
    narrator, file, _ = told()
    narrator.print("listening on vcan0")
    narrator.warn('a line\nin two, with "quotes" and μ')
    point = Setpoint(mu_max=0.3, lambda_m=0.07)
    outputs = Outputs(Status.TRACKING, point, mu_max_std=0.001, lambda_m_std=0.002)
    narrator.print_setpoint(2_500_000, outputs)
    first, second, third = lines(file)
    assert (first["level"], first["message"]) == ("INFO", "listening on vcan0")
    assert (second["level"], second["message"]) == (
        "WARNING",
        'a line\nin two, with "quotes" and μ',
    )
    assert third["status"] == "TRACKING"
    assert (third["bus_time_s"], third["mu_max"], third["lambda_m"]) == (2.5, 0.3, 0.07)
    assert all(one["time"].startswith("20") for one in (first, second, third))


def test_a_fault_is_an_error_and_stale_input_a_warning():
    narrator, file, _ = told()
    for k, status in enumerate((Status.INIT, Status.STALE_INPUT, Status.FAULT)):
        narrator.print_setpoint(k, Outputs(status))
    assert [one["level"] for one in lines(file)] == ["INFO", "WARNING", "ERROR"]


def test_what_is_not_available_is_null():
    narrator, file, _ = told()
    narrator.print_setpoint(0, Outputs(Status.INIT))
    assert lines(file)[0]["mu_max"] is None


def test_text_stays_text():
    narrator, file, _ = told("text")
    narrator.print("listening on vcan0")
    assert file.getvalue() == "listening on vcan0\n"


def test_times_in_text_begin_at_0_and_their_date_is_said_once():
    narrator, file, _ = told("text")
    for seconds, status in enumerate((Status.INIT, Status.LOW_EXCITATION, Status.TRACKING)):
        outputs = Outputs(status, doubt=Doubt.TIME if seconds == 2 else Doubt.NONE)
        narrator.print_setpoint(1_795_720_780_880_000 + seconds * 1_000_000, outputs)
    first, *others = file.getvalue().splitlines()
    assert first == "times in s since 2026-11-26 19:19:40 UTC"
    assert [line.split()[0] for line in others] == ["0.00", "1.00", "2.00", "2.00"]


def test_stamps_that_are_no_dates_begin_at_0_too():
    narrator, file, _ = told("text")
    narrator.print_setpoint(2_500_000, Outputs(Status.INIT))
    first, second = file.getvalue().splitlines()
    assert first == "times in s since 2.5 s on the recording's clock"
    assert second.startswith("0.00 INIT")


def test_json_keeps_the_stamps_of_the_bus():
    narrator, file, _ = told()
    narrator.print_setpoint(1_795_720_780_880_000, Outputs(Status.INIT))
    (line,) = lines(file)
    assert line["bus_time_s"] == 1795720780.88
    assert line["message"].startswith("1795720780.88 INIT")


def test_a_flood_is_cut_and_what_was_left_out_is_counted():
    narrator, file, clock = told()
    for _ in range(1000):
        narrator.warn("again")
    assert len(lines(file)) == BURST
    clock.now_s += 1.0
    narrator.warn("after")
    assert lines(file)[-1]["lines_left_out"] == 1000 - BURST
    assert lines(file)[-1]["message"] == f"after ({1000 - BURST} lines dropped before)"
    narrator.warn("and on")
    assert "lines_left_out" not in lines(file)[-1]


def test_a_status_that_flickers_leaves_room_for_other_lines():
    narrator, file, clock = told()
    for k in range(500):
        clock.now_s += 0.02
        narrator.print_setpoint(20_000 * k, Outputs(list(Status)[k % 2], doubt=list(Doubt)[k % 3]))
    for said in ("the bus is gone", "the bus is back"):
        narrator.warn(said)
        assert lines(file)[-1]["message"] == said


def test_where_the_stream_takes_nothing_lines_are_counted_and_the_status_waits():
    file, clock, takes = io.StringIO(), Clock(), [False]
    narrator = Narrator(file, "json", clock, is_taken=lambda: takes[0])
    for _ in range(3):
        narrator.warn("lost")
    narrator.print_setpoint(0, Outputs(Status.FAULT))
    assert lines(file) == []
    takes[0] = True
    narrator.print_setpoint(20_000, Outputs(Status.FAULT))
    (line,) = lines(file)
    assert (line["status"], line["lines_left_out"]) == ("FAULT", 3)


@given(st.lists(st.tuples(st.sampled_from(Status), st.sampled_from(Doubt)), max_size=400))
def test_the_last_status_and_doubt_are_told_however_they_flicker(states):
    narrator, file, clock = told()
    t_us, began_s = 0, clock.now_s
    steady = states[-1:] * 100
    for status, doubt in [*states, *steady]:
        clock.now_s += 0.02
        t_us += 20_000
        narrator.print_setpoint(t_us, Outputs(status, doubt=doubt))
    found = lines(file)
    assert len(found) <= BURST + math.ceil((clock.now_s - began_s) * LINES_PER_S)
    if states:
        assert [one["status"] for one in found if "status" in one][-1] == states[-1][0].name
        last = next((d for _, d in reversed(states) if d is not Doubt.NOT_AVAILABLE), Doubt.NONE)
        known = ["NONE"] + [one["doubt"] for one in found if "doubt" in one]
        if states[-1][1] is not Doubt.NOT_AVAILABLE:
            assert known[-1] == last.name


@pytest.mark.usefixtures("restored_signals")
def test_run_writes_json(capfd):
    words = ["run", "-i", "virtual", "-c", "narrated", "--duration", "0.1", "--log-format", "json"]
    assert main(words) == 1
    found = [json.loads(line) for line in capfd.readouterr().err.splitlines()]
    assert "listening on" in found[0]["message"]
    assert "frames received" in found[-2]["message"]
    assert "nothing was identified" in found[-1]["message"]


def test_another_format_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["run", "-i", "virtual", "-c", "x", "--log-format", "xml"])
    assert "known: text, json" in capsys.readouterr().err


def test_an_observed_speed_is_named_and_a_relief_makes_slips_known_again():
    narrator, file, _ = told()
    point = Setpoint(mu_max=0.3, lambda_m=0.07)
    for k, objection in enumerate((Objection.NO_RELIEF, Objection.NONE)):
        outputs = Outputs(Status.TRACKING, point, objection=objection, speed_observed=True)
        narrator.print_setpoint(k, outputs)
    status, missing, known = lines(file)
    assert status["speed_source"] == "observed"
    assert "speed observed" in status["message"]
    assert missing["message"].endswith("relieve one axle for a second")
    assert known["message"].endswith("the slips are known again")
    narrator, file, _ = told()
    narrator.print_setpoint(0, Outputs(Status.TRACKING, point))
    assert "speed_source" not in lines(file)[0]
    assert "observed" not in lines(file)[0]["message"]
