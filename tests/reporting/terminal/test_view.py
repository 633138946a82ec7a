"""The view as a pure function: nothing cut at any size, golden text, what the words say."""

import io
import os
from dataclasses import replace
from math import inf
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import settings as given_settings
from hypothesis import strategies as st
from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from adhesion_can.bus.database import load_database
from adhesion_can.bus.frame import Frame
from adhesion_can.config import load_configuration
from adhesion_can.monitoring.latest_frames import FrameKeeper
from adhesion_can.monitoring.snapshot import (
    AxleView,
    MessageRole,
    MessageState,
    Origin,
    Transport,
    TruePeak,
)
from adhesion_can.monitoring.state import MonitorState
from adhesion_can.physics.burckhardt import adhesion
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import WORDINGS
from adhesion_can.physics.status import Status
from adhesion_can.reporting.terminal.boxes import boxed, padded, wrapped
from adhesion_can.reporting.terminal.canvas import Canvas, nice_ceiling
from adhesion_can.reporting.terminal.curve_panel import curve_band
from adhesion_can.reporting.terminal.tables import message_panel
from adhesion_can.reporting.terminal.view import MonitorView, ViewOptions, ViewPage, draw, last_row
from adhesion_can.reporting.terminal.words import STATUS_LETTERS, sentences
from tests.reporting.terminal.snapshots import (
    EMPTY,
    LAMBDA_M,
    MESSAGES,
    MU_MAX,
    NOW_US,
    ODD,
    PAYLOAD,
    RECORDING,
    THETA,
    message,
    service,
    snapshot,
)

GOLDEN = Path(__file__).parent / "golden"
SNAPSHOTS = {"full": snapshot(), "empty": EMPTY, "odd": ODD}


def text_of(lines):
    return "\n".join(line.plain.rstrip() for line in lines) + "\n"


def said(shown):
    return [sentence.plain for sentence in sentences(shown)]


@pytest.mark.parametrize("page", ViewPage)
@pytest.mark.parametrize("name", SNAPSHOTS)
@pytest.mark.parametrize("size", [(80, 24), (160, 50), (81, 24), (100, 30), (119, 70), (300, 90)])
def test_every_line_is_as_wide_as_asked_for(size, name, page):
    width, height = size
    options = ViewOptions(page=page, wanted="" if name != "odd" else "a")
    lines = draw(SNAPSHOTS[name], width, height, options)
    assert [cell_len(line.plain) for line in lines] == [width] * height
    assert not any("…" in line.plain or "\n" in line.plain for line in lines)


@pytest.mark.parametrize("name", SNAPSHOTS)
def test_no_width_is_one_too_narrow_for_its_columns(name):
    for width in range(80, 161):
        lines = draw(SNAPSHOTS[name], width, 24 + width % 20)
        assert {cell_len(line.plain) for line in lines} == {width}


@pytest.mark.parametrize("width", [80, 81, 85, 100])
def test_figures_of_the_service_too_long_for_a_line_go_on_in_the_next(width):
    """At 80 by 42 the curve of the full one was a cell too long, and counts grow over months."""
    months = service(theta=(0.4, 1234.56, 0.3), rejected=2**32 - 1, lost=2**32 - 1)
    for one in (service(), months):
        lines = draw(snapshot(service=one), width, 48, ViewOptions(keys=""))
        assert {cell_len(line.plain) for line in lines} == {width}
        assert all(word in text_of(lines) for word in ("c1 0.4000", "inputs", "own"))


@given_settings(max_examples=60)
@given(
    st.integers(1, 200), st.integers(2, 70), st.sampled_from(list(ViewPage)), st.sampled_from(
        list(SNAPSHOTS)
    ), st.booleans(),
)  # fmt: skip
def test_any_size_is_filled_and_no_more(width, height, page, name, keys):
    options = ViewOptions(page=page, keys=None if keys else "")
    lines = draw(SNAPSHOTS[name], width, height, options)
    assert [cell_len(line.plain) for line in lines] == [width] * height


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
def test_golden_text(size):
    """With ADHESION_CAN_WRITE_GOLDEN=1 the files are written anew, to be read by a person."""
    width, height = size
    drawn = text_of(draw(snapshot(), width, height))
    path = GOLDEN / f"overview_{width}x{height}.txt"
    if os.environ.get("ADHESION_CAN_WRITE_GOLDEN"):
        path.write_text(drawn, encoding="utf-8")
    assert drawn == path.read_text(encoding="utf-8")


def test_a_state_without_a_frame_can_be_shown():
    text = text_of(draw(MonitorState(load_configuration()).snapshot(0), 80, 24))
    assert "Nothing received yet: is this" in text
    assert "WheelSpeeds1      never" in text


def test_the_same_without_colour():
    """What colours say stands in words, letters and signs as well."""
    text = text_of(draw(snapshot(), 80, 24))
    assert "TRACKING: the peak is known" in text
    assert "x VehicleSpeed" in text
    assert "! TractiveEffort1" in text
    status_row = next(line for line in text.splitlines() if "TTTT" in line)
    assert set(status_row.split("│")[-2].strip()) == set("ilTCsF")
    wide = text_of(draw(snapshot(), 160, 50))
    for word in ("silent", "faulty: checksum", "never"):
        assert word in wide
    assert "faulty: checksum 123k order 2" in text_of(draw(snapshot(), 200, 50))


def test_trouble_stands_first_where_room_is_short():
    rows = text_of(message_panel(snapshot(), 39, 9)).splitlines()
    assert [row[1:].split()[1] for row in rows[2:5]] == [
        "VehicleSpeed", "TractiveEffort1", "AxleLoads2",
    ]  # fmt: skip
    assert "+6 more" in rows[7]


def test_a_filter_finds_names_and_numbers():
    for wanted, count in (("wheel", 2), ("0x18fe", 1), ("700", 1), ("zzz", 0), ("", 11)):
        rows = message_panel(snapshot(), 100, 20, wanted)
        text = text_of(rows)
        assert sum(view.number in text for view in MESSAGES) == count, wanted
    assert "no name or id contains this" in text_of(message_panel(snapshot(), 39, 9, "zzz"))


def test_the_selected_message_is_marked_and_in_sight():
    many = replace(snapshot(), messages=tuple(message(f"M{k}", k) for k in range(60)))
    for number in (0, 1, 30, 58, 59):
        options = ViewOptions(page=ViewPage.MESSAGES, selected=(number, False))
        text = text_of(draw(many, 80, 24, options))
        (row,) = (line for line in text.splitlines() if " >" in line)
        assert f" M{number} " in row
        assert "of 60 messages: arrow keys show the others" in text
    # One that the filter hides is not selected: the first that is shown is.
    options = ViewOptions(page=ViewPage.MESSAGES, selected=(1, False), wanted="M59")
    assert " >03B " in text_of(draw(many, 80, 24, options))


def signals_of(key, width=80, height=24, first_row=0, **changes):
    options = ViewOptions(page=ViewPage.SIGNALS, selected=key, first_row=first_row)
    return text_of(draw(snapshot(**changes), width, height, options))


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
def test_the_signals_of_a_message(size):
    text = signals_of((0x101, False), *size)
    assert "┌ WheelSpeeds1, id 101 " in text
    assert "8 bytes  98 1A 38 27 A7 1C 4D 05" in text
    assert "4 ms old; 100.0 accepted frames/s, 100 expected" in text
    assert "since the start: 6000 accepted, 0 rejected, 0 lost" in text
    (row,) = (line for line in text.splitlines() if "WheelSpeed_Ax1" in line)
    # 0x2738 steps of 0.002 rad/s.
    assert row.strip("│").split() == [
        "WheelSpeed_Ax1", "20.080", "rad/s", "10040", "4", "wheel_speed.1",
    ]  # fmt: skip
    (status,) = (
        line for line in signals_of((0x201, False), *size).splitlines() if "Status" in line
    )
    assert status.strip("│").split() == ["Status", "1", "1", "4", "TRACKING"]


def test_signals_say_what_is_wrong_with_a_frame():
    text = signals_of((0x132, False))
    assert "The service rejects the latest frame: checksum." in text
    assert "since the start: 6000 accepted, 123458 rejected (123456 checksum, 2 order)" in text
    assert "The database does not have this id: only the bytes are known." in signals_of(
        (0x700, False)
    )
    assert "No frame of this message has been received." in signals_of((0x141, False))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ("98", "The database says 8 bytes: nothing is decoded."),
        ("981A3827A71C4D05" * 2, "The database says 8 bytes: the first ones are decoded."),
        ("981AFFFFA71C4D05", "not available"),
        ("98FAA71CA71C4D05", "out of range"),  # a status of 15
    ],
)
def test_signals_of_odd_payloads(data, words):
    keeper = FrameKeeper(load_database().db.messages, ())
    keeper.add((0x201, False), Frame(1, 0x201, bytes.fromhex(data)), None)
    assert words in signals_of((0x201, False), latest=keeper.latest())


def test_many_signals_are_scrolled_to_the_last():
    options = ViewOptions(page=ViewPage.SIGNALS, selected=(0x204, False))
    frames = FrameKeeper(load_database().db.messages, ())
    for axle in (1, 2, 6):
        payload = bytes([0, axle << 4]) + PAYLOAD[2:]
        frames.add((0x204, False), Frame(NOW_US - 1000 * axle, 0x204, payload), None)
    shown = snapshot(
        messages=(message("AxleSetpoint", 0x204, MessageRole.OUTPUT),), latest=frames.latest()
    )
    last = last_row(shown, 80, 24, options)
    text = text_of(draw(shown, 80, 24, replace(options, first_row=last)))
    assert "CreepSpeedSetpoint_Ax6" in text
    # Each axle has its own frame behind it, and those that never came say so.
    rows = {row.strip("│").split()[0]: row for row in text.splitlines() if "MuMax_Ax" in row}
    rows |= {
        row.strip("│").split()[0]: row
        for row in text_of(draw(shown, 80, 24, options)).splitlines()
        if "MuMax_Ax" in row
    }
    assert rows["MuMax_Ax2"].strip("│").split()[-1] == "2"
    assert "not received yet" in rows["MuMax_Ax3"]
    assert text == text_of(draw(shown, 80, 24, replace(options, first_row=999)))


def test_the_help_explains_each_letter_and_sign_and_is_scrolled():
    options = ViewOptions(page=ViewPage.HELP)
    last = last_row(snapshot(), 80, 24, options)
    first = text_of(draw(snapshot(), 80, 24, options))
    text = first + text_of(draw(snapshot(), 80, 24, replace(options, first_row=last)))
    for status, letter in STATUS_LETTERS.items():
        assert f"{letter} {status.name}" in text
    for sign in (
        "░",
        "◆",
        "┊",
        "digits",
        "! ",
        "x ",
        "- ",
        "bad:",
        "age ms",
        "frames/s",
        "+9 more",
    ):
        assert sign in text
    assert "the monitor never sends." in text
    assert "lines 1 to 19 of" in first


def test_the_band_against_curves_drawn_by_the_deviations():
    """To first order: the spread of curves stretched by random errors of the peak."""
    import numpy as np

    rng = np.random.default_rng(3)
    slip = np.linspace(0.005, 0.2, 25)
    known = service(mu_max_std=0.004, lambda_m_std=0.002)
    heights = 1 + 0.004 / MU_MAX * rng.standard_normal((4000, 1))
    places = 1 + 0.002 / LAMBDA_M * rng.standard_normal((4000, 1))
    curves = heights * adhesion(slip / places, *THETA)
    assert curve_band(slip, known) == pytest.approx(1.96 * curves.std(axis=0), rel=0.08)
    assert curve_band(slip, service(mu_max_std=inf)) is None
    assert curve_band(slip, service(theta=None)) is None


def test_rich_prints_it_as_wide_as_the_console():
    console = Console(width=80, height=24, record=True, file=io.StringIO())
    console.print(MonitorView(snapshot(), ViewOptions(keys="")))
    text = console.export_text()
    assert len(text.splitlines()) == 24
    assert "adhesion over slip ratio" in text
    assert "q quit" not in text


# --- words


def test_more_creep_is_asked_for_below_the_peak():
    points = tuple(p for p in snapshot().points if p.slip < 0.03)
    shown = snapshot(
        points=points,
        service=service(status=Status.LOW_EXCITATION, mu_max_std=inf, lambda_m_std=inf),
    )
    assert any(
        "To find the peak, it needs more creep: slip reached 0.027 in the last 5 s, the peak is "
        f"expected near {LAMBDA_M:.3f}." in line
        for line in said(shown)
    )
    # A height that is known and a place that is not: beyond the peak is what lacks.
    shown = snapshot(service=service(status=Status.LOW_EXCITATION, lambda_m_std=inf))
    assert any("To find the peak, it needs more creep beyond" in line for line in said(shown))


@pytest.mark.parametrize(("only", "other"), [("traction", "brake"), ("braking", "pull")])
def test_one_direction_alone_leaves_the_instruments_in_doubt(only, other):
    """Samples beyond the peak are there: more creep would not help."""
    low = service(status=Status.LOW_EXCITATION, mu_max_std=0.05, lambda_m_std=0.01)
    words = (
        f"Only {only} so far, which shows no common error of speed or efforts: {other} or coast "
        "once, or state smaller errors in [instruments]."
    )
    assert any(words in line for line in said(snapshot(service=low, only_direction=only)))
    assert not any("[instruments]" in line for line in said(snapshot(service=low)))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"is_speed_derived": True}, "derived from driven axles"),
        ({"last_sample_us": 0, "speed": 0.4}, "the vehicle speed is below 1 m/s"),
        ({"last_sample_us": 0, "speed": None}, "the vehicle speed is not available"),
        ({"last_sample_us": None, "missing": ("tractive effort",)}, "no role gives tractive eff"),
        ({"last_sample_us": 0}, "wheel speeds and efforts"),
    ],
)
def test_why_there_is_little_to_learn_from(changes, words):
    shown = snapshot(service=service(status=Status.LOW_EXCITATION), **changes)
    assert any(words in line for line in said(shown))


def test_stale_input_names_what_is_silent():
    lines = said(snapshot(service=service(status=Status.STALE_INPUT)))
    assert "Silent: VehicleSpeed for 0.1 s." in lines
    assert lines[0].startswith("STALE_INPUT: a required input is silent")


@pytest.mark.parametrize("doubt", [Doubt.SHAPE, Doubt.SURROUNDINGS])
def test_a_doubt_is_a_sentence(doubt):
    lines = said(snapshot(service=service(doubt=doubt)))
    assert any(line.startswith("Doubt: ") and "run `diagnose`" in line for line in lines)
    assert not any("Doubt" in line for line in said(snapshot()))


@pytest.mark.parametrize("objection", list(WORDINGS))
def test_an_objection_is_a_sentence_in_place_of_a_call_for_creep(objection):
    vague = service(status=Status.LOW_EXCITATION)
    lines = said(snapshot(service=replace(vague, objection=objection)))
    assert any(WORDINGS[objection].what[4:] in line for line in lines)
    assert not any("it needs" in line.lower() for line in lines)
    assert any("it needs" in line.lower() for line in said(snapshot(service=vague)))


def test_who_estimates_and_where_nobody_does():
    here = Transport(origin=Origin.ESTIMATED_HERE)
    assert said(snapshot(transport=here))[0].startswith("TRACKING, estimated here: ")
    assert "No service on this bus" in said(snapshot(service=None))[0]
    recorded = Transport(is_live=False, origin=Origin.RECORDED)
    assert "No service in this recording" in said(snapshot(service=None, transport=recorded))[0]


def test_a_service_that_ended_is_not_one_that_was_cut_off():
    gone = {"is_silent": True, "t_us": NOW_US - 3_000_000}
    ended = service(status=Status.INIT, mu_max=None, has_ended=True, **gone)
    lines = said(snapshot(service=ended))
    assert lines[0].startswith("The service ended 3.0 s ago: it took back its setpoint.")
    assert not any("INIT" in line for line in lines)
    assert "did not sign off" in said(snapshot(service=service(**gone)))[0]


def test_catching_up_is_said_first_and_in_the_header():
    busy = replace(RECORDING, catching_up_s=120.0, position_s=84.2, paused=False)
    shown = snapshot(transport=busy)
    assert said(shown)[0].startswith("Catching up to 120 s (2:00): at 84 s (1:24)")
    assert "CATCHING UP" in draw(shown, 80, 24)[0].plain
    # Nothing is shown yet: nothing is wrong with the bus either.
    assert said(replace(EMPTY, transport=busy)) == [said(shown)[0]]


def test_letters_on_the_screen_are_explained_there():
    text = text_of(draw(snapshot(history=snapshot().history[60:200]), 80, 24))
    assert "T track" in text or "letters: key ?" in text
    wide = text_of(draw(snapshot(), 160, 50))
    for words in ("T track", "l low", "C change", "i init", "s stale", "F fault"):
        assert words in wide


def test_a_bus_that_is_down_and_a_service_that_is_gone_come_first():
    shown = snapshot(
        transport=Transport(is_open=False), service=service(is_silent=True, t_us=50_000_000)
    )
    assert said(shown)[0].startswith("The bus is down")
    assert "silent for 10.0 s" in said(shown)[1]
    assert "BUS DOWN" in draw(shown, 80, 24)[0].plain


def test_the_wrong_bus_is_asked_about():
    never = tuple(
        message(name, k, age_us=None, rate=None, state=MessageState.NEVER)
        for k, name in enumerate(("A", "B"))
    )
    assert any("No configured message received" in line for line in said(snapshot(messages=never)))


def test_how_many_axles_hold_the_setpoint():
    axles = tuple(AxleView(k, creep_speed=c) for k, c in enumerate((0.5, 0.52, 0.44, 0.9), 1))
    line = "Creep setpoint 0.500 m/s, slip 0.0500: 3 of 4 axles hold it; the others probe"
    assert any(text.startswith(line) for text in said(snapshot(axles=axles)))


def test_the_header_tells_how_the_frames_come():
    playing = replace(RECORDING, catching_up_s=None)
    header = draw(replace(snapshot(), transport=playing), 80, 24)[0].plain
    for word in ("REC", "PAUSED", "estimated here", "1234.5 of 3600.0 s", "max", "720/s"):
        assert word in header
    at_end = replace(playing, is_at_end=True, paused=False)
    assert " END " in draw(replace(snapshot(), transport=at_end), 80, 24)[0].plain


def test_truth_is_marked_where_it_is_known():
    shown = snapshot(true_peak=TruePeak("dry", MU_MAX, 0.12))
    text = text_of(draw(shown, 80, 24, ViewOptions(keys="")))
    assert "x truth" in text
    assert f"Truth: dry rail, mu_max {MU_MAX:.4f}" in text


# --- boxes and canvas


def test_a_line_that_is_too_wide_is_an_error_and_not_cut():
    with pytest.raises(ValueError, match="5 cells for 4"):
        padded("12345", 4)
    with pytest.raises(ValueError, match="2 lines for 1"):
        boxed("t", ["a", "b"], 20, 3)


@given(
    st.lists(st.text(st.sampled_from("ab -μ"), min_size=1, max_size=60), max_size=6),
    st.integers(25, 60), st.integers(1, 6),
)  # fmt: skip
def test_wrapping_keeps_every_word_or_counts_the_sentence(texts, width, height):
    texts = [text for text in texts if text.strip()]
    lines = wrapped([Text(text) for text in texts], width, height, "w")
    assert len(lines) <= height
    assert all(cell_len(line.plain) <= width for line in lines)
    joined = "".join("".join(line.plain.split()) for line in lines)
    whole = "".join("".join(text.split()) for text in texts)
    if "more:w" in joined or "sentences:w" in joined:
        assert whole.startswith(joined.split("(")[0])
    else:
        assert joined == whole


def test_dots_of_a_cell_by_their_numbers_in_unicode():
    canvas = Canvas(1, 1)
    canvas.dot(0.0, 0.0)
    assert canvas.rows()[0].plain == "⡀"  # dot 7
    canvas.dot(0.99, 0.99)
    assert canvas.rows()[0].plain == "⡈"  # dots 4 and 7
    canvas.dot(1.5, 0.5)
    canvas.dot(0.5, float("nan"))
    assert canvas.rows()[0].plain == "⡈"
    canvas.mark(0.5, 0.5, "1")
    canvas.mark(0.5, 0.5, "2")
    assert canvas.rows()[0].plain == "1"


def test_a_line_is_without_holes():
    canvas = Canvas(20, 5)
    canvas.line([0.0, 1.0], [0.0, 1.0])
    assert all(any(row.plain[x] != " " for row in canvas.rows()) for x in range(20))


@given(st.floats(1e-6, 1e6))
def test_an_axis_ends_at_a_round_number_not_far_above(value):
    end = nice_ceiling(value)
    assert value * 0.999 <= end <= 1.51 * value
