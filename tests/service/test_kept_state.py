"""What was learned survives the end of the process, whatever ends it; nothing wrong is taken."""

import json
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from math import inf

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.config import load_configuration
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.status import Status
from adhesion_can.service.kept_state import (
    MOST_SURFACES,
    KeptState,
    KeptSurface,
    StateError,
    _checksum,
    fingerprint,
    state_from_text,
    state_to_text,
    with_surfaces,
)
from adhesion_can.service.outputs import Outputs
from adhesion_can.service.state_keeper import StateKeeper

DRY, WET = (0.4, 60.0, 0.3), (0.25, 90.0, 0.2)
DAY_S, HOUR_US = 86_400.0, 3_600_000_000
NOW_US = 1_800_000_000_000_000
SENT = Outputs(
    status=Status.TRACKING,
    theta=DRY,
    mu_max_std=0.002,
    lambda_m_std=0.002,
    surface_age_s=3.0,
    doubt=Doubt.NONE,
)


def state_of(*surfaces):
    return KeptState("vehicle", tuple(KeptSurface(*one) for one in surfaces))


STATE = state_of((DRY, NOW_US - 3 * HOUR_US, NOW_US - 2 * HOUR_US), (WET, NOW_US - 9, NOW_US - 5))


def read(text, vehicle="vehicle", now_us=NOW_US, most_age_s=DAY_S):
    return state_from_text(text, vehicle, now_us, most_age_s)


# --- what is learned -----------------------------------------------------------------------------


def test_a_surface_is_kept_once_and_with_its_latest_curve():
    state = KeptState("vehicle")
    for cycle in range(100):
        curve = (0.4 + 1e-4 * cycle, 60.0, 0.3)
        sent = replace(SENT, theta=curve, surface_age_s=0.02 * cycle)
        state = state.with_outputs(NOW_US + 20_000 * cycle, sent)
    assert state.surfaces == (KeptSurface(curve, NOW_US, NOW_US + 99 * 20_000),)


def test_surfaces_follow_each_other_and_the_oldest_go():
    state = KeptState("vehicle")
    for number in range(MOST_SURFACES + 3):
        curve = (0.2 + 0.01 * number, 60.0, 0.3)
        sent = replace(SENT, theta=curve, surface_age_s=1.0)
        state = state.with_outputs(NOW_US + 10_000_000 * number, sent)
    assert [round(curve[0], 2) for curve in state.curves] == [
        round(0.2 + 0.01 * number, 2) for number in range(3, MOST_SURFACES + 3)
    ]


@pytest.mark.parametrize(
    "sent",
    [
        replace(SENT, status=Status.LOW_EXCITATION),
        replace(SENT, status=Status.STALE_INPUT),
        replace(SENT, doubt=Doubt(3)),
        replace(SENT, mu_max_std=inf),
        replace(SENT, lambda_m_std=None),
        replace(SENT, theta=None),
    ],
)
def test_nothing_is_learned_that_was_not_sent_with_confidence(sent):
    assert KeptState("vehicle").with_outputs(NOW_US, sent) == KeptState("vehicle")


def test_a_surface_in_doubt_is_forgotten_and_those_before_are_kept():
    state = KeptState("vehicle").with_outputs(NOW_US, SENT)
    later = replace(SENT, theta=WET, surface_age_s=2.0)
    state = state.with_outputs(NOW_US + 20_000_000, later)
    doubtful = replace(later, surface_age_s=3.0, doubt=Doubt(3))
    assert state.curves == (DRY, WET)
    assert state.with_outputs(NOW_US + 21_000_000, doubtful).curves == (DRY,)


# --- the file ------------------------------------------------------------------------------------


def test_what_is_written_is_read():
    assert read(state_to_text(STATE)) == STATE
    assert read(state_to_text(KeptState("vehicle"))) == KeptState("vehicle")


@settings(max_examples=300, deadline=None)
@given(place=st.integers(0, len(state_to_text(STATE)) - 1), letter=st.characters())
def test_no_damaged_letter_passes(place, letter):
    text = state_to_text(STATE)
    damaged = text[:place] + letter + text[place + 1 :]
    try:
        found = read(damaged)
    except StateError:
        return
    assert found == STATE  # white space, or another way to write the same number


PARTS = st.integers(0, len(state_to_text(STATE)) - 3).map(lambda n: state_to_text(STATE)[:n])


@settings(max_examples=100, deadline=None)
@given(st.one_of(st.text(), PARTS))
def test_any_other_text_and_any_part_is_refused(text):
    with pytest.raises(StateError):
        read(text)


def signed(**changes):
    """Text of a state with other contents and a checksum that fits."""
    document = {**json.loads(state_to_text(STATE)), **changes}
    document.pop("sha256")
    return json.dumps({**document, "sha256": _checksum(document)})


ONE = {"c1": 0.4, "c2": 60.0, "c3": 0.3, "since_us": 0, "seen_us": 0}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (signed(vehicle="other"), "another vehicle"),
        (signed(version=2), "version 2"),
        (signed(format="state"), "not a state file of adhesion-can"),
        (signed(surfaces=[{"c1": 1}]), "damaged"),
        (signed(surfaces=7), "damaged"),
        (signed(surfaces=[{"c1": -1, "c2": 1, "c3": 0, "since_us": 0, "seen_us": 0}]), "no curve"),
        (signed(surfaces=[ONE | {"c1": 1e9}]), "contact has"),
        (signed(surfaces=[ONE | {"c1": 10**400}]), "damaged"),
        (signed(surfaces=[ONE | {"since_us": inf}]), "damaged"),
        (signed(surfaces=[ONE | {"seen_us": 10**400}]), "no time"),
        (signed(surfaces=[ONE | {"seen_us": -(10**400)}]), "no time"),
        ("[" * 100_000, "not JSON"),
        (" " * (2 << 20), "too large"),
    ],
)
def test_the_reason_of_a_refusal_is_told(text, why):
    with pytest.raises(StateError, match=why):
        read(text)


def test_whatever_its_depth_a_text_is_refused():
    """Among them are the few depths that can be read and not be written again."""
    for depth in range(100, 1100):
        nested = "[" * depth + "]" * depth
        with pytest.raises(StateError):
            read(signed().replace('"surfaces": ', f'"more": {nested}, "surfaces": '))


def test_a_file_with_more_surfaces_gives_the_latest():
    many = [ONE | {"since_us": NOW_US + i, "seen_us": NOW_US + i} for i in range(20)]
    found = read(signed(surfaces=many))
    assert [one.since_us - NOW_US for one in found.surfaces] == [*range(12, 20)]
    assert len(found.surfaces) == MOST_SURFACES


def test_old_surfaces_are_left_out_and_an_old_state_is_refused():
    text = state_to_text(STATE)
    assert read(text, most_age_s=3600.0).curves == (WET,)
    with pytest.raises(StateError, match=r"too old: .* 240\.0 h ago"):
        read(text, now_us=NOW_US + 240 * HOUR_US)


def test_a_clock_that_was_set_back_refuses_nothing():
    assert read(state_to_text(STATE), now_us=NOW_US - 1000 * HOUR_US) == STATE


def test_another_vehicle_or_model_has_another_fingerprint():
    config = load_configuration()
    heavier = replace(config, vehicle=replace(config.vehicle, axle_load=(260e3,) * 6))
    assert fingerprint(config) == fingerprint(load_configuration())
    assert fingerprint(heavier) != fingerprint(config)


def test_a_service_knows_the_surfaces_and_a_search_begins_at_the_latest():
    config = with_surfaces(load_configuration(), STATE.curves)
    assert config.estimators.tracker.known_surfaces == (DRY, WET)
    assert config.estimators.evolution.theta0 == WET


# --- the keeper ----------------------------------------------------------------------------------


def test_the_file_is_written_once_an_interval_and_sooner_for_a_new_surface(tmp_path):
    path = tmp_path / "state.json"
    keeper = StateKeeper(path, KeptState("vehicle"), 10.0, print)
    written = []

    def drive(seconds, curve, begin_us, from_us):
        for t_us in range(from_us, from_us + round(seconds * 1e6), 20_000):
            sent = replace(SENT, theta=curve, surface_age_s=(t_us - begin_us) / 1e6)
            keeper.observe(t_us, sent)
            if keeper._handed_over_us == t_us:
                written.append((t_us - NOW_US) / 1e6)
        return from_us + round(seconds * 1e6)

    begin_us = drive(25.0, DRY, NOW_US, NOW_US)
    drive(5.0, WET, begin_us, begin_us)
    keeper.end()
    assert keeper.wait()
    assert written == [0.0, 10.0, 20.0, 25.0]
    assert read(path.read_text()).curves == (DRY, WET)


def test_a_disk_that_takes_nothing_is_told_once_and_does_no_harm(tmp_path):
    notices = []
    path = tmp_path / "gone" / "state.json"
    keeper = StateKeeper(path, KeptState("vehicle"), 1.0, notices.append)
    for cycle in range(1000):
        keeper.observe(NOW_US + 20_000 * cycle, SENT)
        if cycle == 500:
            deadline = time.monotonic() + 60.0
            while not notices and time.monotonic() < deadline:
                time.sleep(0.01)
            path.parent.mkdir()
    keeper.end()
    assert keeper.wait()
    assert sum("trying again" in line for line in notices) == 1
    assert "written again" in notices[-1]
    assert read(path.read_text()).curves == (DRY,)


def test_a_disk_that_stands_still_holds_neither_the_loop_nor_the_end_up(tmp_path, monkeypatch):
    may_go, notices, path = threading.Event(), [], tmp_path / "state.json"
    keeper = StateKeeper(path, KeptState("vehicle"), 1.0, notices.append)
    write = keeper._write

    def written_late(state):
        may_go.wait(60.0)
        write(state)

    monkeypatch.setattr(keeper, "_write", written_late)
    monkeypatch.setattr("adhesion_can.service.state_keeper.DISK_END_S", 0.01)
    for cycle in range(1000):
        keeper.observe(NOW_US + 20_000 * cycle, SENT)
    keeper.end()
    assert not keeper.wait()
    assert "not written before the service ended" in notices[0]
    may_go.set()
    monkeypatch.setattr("adhesion_can.service.state_keeper.DISK_END_S", 60.0)
    assert keeper.wait()
    assert read(path.read_text()) == keeper.state


WRITER = """
import sys, itertools
from pathlib import Path
from adhesion_can.service.kept_state import KeptState, KeptSurface, state_to_text
from adhesion_can.service.state_keeper import StateKeeper
keeper = StateKeeper(Path(sys.argv[1]), KeptState("vehicle"), 1.0, print)
print("ready", flush=True)
for n in itertools.count():
    surfaces = (KeptSurface((0.4, 60.0, 0.3), {now}, {now} + n),)
    keeper._write(KeptState("vehicle", surfaces * (1 + n % 7)))
"""


@pytest.mark.slow
def test_whoever_kills_the_process_finds_a_whole_file(tmp_path):
    path = tmp_path / "state.json"
    for number in range(0, 8, 2):
        code = WRITER.format(now=NOW_US)
        writer = subprocess.Popen(
            [sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE, text=True
        )
        assert writer.stdout.readline() == "ready\n"
        deadline = time.monotonic() + 60.0
        while not path.exists() and time.monotonic() < deadline:
            time.sleep(0.001)
        time.sleep(0.013 * number)
        writer.send_signal(signal.SIGKILL)
        writer.wait(60)
        writer.stdout.close()
        assert read(path.read_text()).curves[0] == DRY
