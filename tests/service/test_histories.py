"""Runs with faults, judged from the record of the bus; and the judge itself, by flawed records."""

from dataclasses import replace
from pathlib import Path

import pytest

from adhesion_can.config import load_configuration
from tests.histories.checker import check
from tests.histories.faults import KINDS, QUANTITIES, Fault, S, draw
from tests.histories.play import estimator_of, judge, play
from tests.histories.simulated_bus import Record, SimulatedBus
from tests.histories.traffic import START_US
from tests.seeds import first_quick
from tests.service.test_core import status
from tests.wire import sealed

DOCS = Path(__file__).resolve().parents[2] / "docs"
LARGEST = [(name, kind.sizes[-1]) for name, kind in KINDS.items()]
SMALLEST = [(name, kind.sizes[0]) for name, kind in KINDS.items() if len(kind.sizes) > 1]


@pytest.mark.costly
@pytest.mark.parametrize(("name", "size"), first_quick(LARGEST + SMALLEST, len(LARGEST)))
def test_each_fault_alone(name, size):
    kind = KINDS[name]
    from_us = 0 if kind.at_start else 2 * S
    until_us = from_us + max(round(min(kind.longest_s, 3.0) * S), 1)
    target = kind.targets[sum(map(ord, name)) % len(kind.targets)] if kind.targets else ""
    assert judge(1, 14 * S, (Fault(name, from_us, until_us, target, size),)) == []


BLINDED = [
    pytest.param(target, size, id=f"{target}-{size:g}")
    for target in QUANTITIES
    for size in KINDS["blinded"].sizes
]


@pytest.mark.costly
@pytest.mark.parametrize(("target", "size"), BLINDED)
def test_never_tracking_while_blind(target, size):
    """All sensors of a quantity stand at an end of their range, in valid frames, for 4 s."""
    assert judge(1, 12 * S, (Fault("blinded", 3 * S, 7 * S, target, size),)) == []


def test_the_checker_sees_tracking_while_blind():
    """An estimator that is sure of itself whatever comes, and samples that are all of a vehicle at
    rest: of the inputs that came none could be used."""
    faults = (Fault("blinded", 2 * S, 6 * S, "VehicleSpeed"),)
    record = play(1, 8 * S, faults)
    assert rules(record, faults, 8 * S) == set()

    def change(outputs):
        for place, (at_us, frame) in enumerate(outputs):
            if frame.arbitration_id == 0x201 and START_US + 5 * S < at_us < START_US + 6 * S:
                tracking = frame.data[:1] + bytes([0x10 | frame.data[1] & 0xF]) + frame.data[2:]
                with_data(outputs, place, sealed(0x201, tracking, frame.data[1] & 0xF))
        return outputs

    assert "blind" in rules(flawed(record, change), faults, 8 * S)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_faults_together(seed):
    assert judge(seed, 20 * S, draw(seed, 20 * S, per_minute=12.0), estimator_of(seed)) == []


def test_time_passes_in_the_shortest_sleep():
    """A pause of 2e-10 s is left of a rounded sum of seconds: who waits for it waited for ever."""
    bus = SimulatedBus(iter(()), (), START_US + S)
    bus.sleep(2e-10)
    assert bus.now_us == START_US + 1


@pytest.mark.costly
def test_a_first_frame_with_an_early_stamp_ends_the_silence():
    """The bus is away, its clock is set back: the first frame is stamped 50 ms before it came."""
    faults = (
        Fault("bus_down", 5_147_893, 6_245_244, ""),
        Fault("clock_set", 5_191_448, 5_191_449, "", -0.05),
    )
    assert judge(1070, 15 * S, faults) == []


@pytest.mark.costly
@pytest.mark.parametrize("target", KINDS["frozen"].targets)
def test_a_frozen_message_is_stale_and_told(target):
    """It was lively for long enough that everybody can tell, the checker too."""
    faults = (Fault("frozen", 13 * S, 16 * S, target),)
    record = play(5, 20 * S, faults)
    assert check(record, faults, START_US, START_US + 20 * S) == []
    told = [line for line in record.notices if "is stuck" in line]
    assert len(told) == (1 if target == "VehicleSpeed" else 3)
    assert len([line for line in record.notices if "is no longer stuck" in line]) == len(told)


@pytest.mark.costly
def test_the_checker_sees_a_frozen_message_that_is_taken_for_a_measurement(monkeypatch):
    config = load_configuration()
    choices = tuple(replace(choice, stuck_check=False) for choice in config.choices)
    monkeypatch.setattr("tests.histories.play.CONFIG", replace(config, choices=choices))
    found = judge(5, 20 * S, (Fault("frozen", 13 * S, 16 * S, "VehicleSpeed"),))
    # Rules of the record and, since the replay still judges what is stuck, of the log.
    assert {one.rule for one in found} == {"stale", "blind", "replay"}


@pytest.mark.parametrize("step_s", [3600.0, 1.0, -1.0, -3600.0])
def test_a_clock_that_is_set_while_the_service_stands_still_makes_nothing_fresh(step_s):
    """What waited for 3 s has stamps that say nothing; a message is silent when it goes on."""
    faults = (
        Fault("stopped", 2_043_905, 5_223_826, ""),
        Fault("clock_set", 2_428_470, 2_428_471, "", step_s),
        Fault("silent", 4_610_535, 5_474_068, "TractiveEffort2"),
    )
    assert judge(311207, 10 * S, faults) == []


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("part", range(40))
def test_a_thousand_histories(part):
    failed = {}
    for seed in range(1000 + 25 * part, 1025 + 25 * part):
        faults = draw(seed, 15 * S, per_minute=15.0)
        if found := judge(seed, 15 * S, faults, estimator_of(seed)):
            failed[seed] = found[0]
    assert failed == {}


# --- the judge -----------------------------------------------------------------------------------

CALM = 6 * S


@pytest.fixture(scope="module")
def calm():
    return play(1, CALM, ())


@pytest.fixture(scope="module")
def silence():
    faults = (Fault("silent", 2 * S, 4 * S, "VehicleSpeed"),)
    return faults, play(1, CALM, faults)


def rules(record, faults=(), duration_us=CALM):
    return {one.rule for one in check(record, faults, START_US, START_US + duration_us)}


def flawed(record, change):
    """Record with other outputs: `change` gets their list."""
    return Record(record.inputs, change(list(record.outputs)), record.log, record.notices)


def setpoint(outputs, number=100):
    """Place of a setpoint among the outputs."""
    return [k for k, (_, frame) in enumerate(outputs) if frame.arbitration_id == 0x201][number]


def with_data(outputs, place, data):
    at_us, frame = outputs[place]
    outputs[place] = at_us, replace_data(frame, data)
    return outputs


def replace_data(frame, data):
    return frame._replace(data=data)


def test_a_run_without_faults_breaks_no_rule(calm):
    assert rules(calm) == set()


def test_a_wrong_checksum_is_seen(calm):
    def change(outputs):
        place = setpoint(outputs)
        data = outputs[place][1].data
        return with_data(outputs, place, bytes([data[0] ^ 1]) + data[1:])

    assert "checksum" in rules(flawed(calm, change))


def test_a_repeated_count_is_seen(calm):
    def change(outputs):
        place = setpoint(outputs)
        data = outputs[place][1].data
        return with_data(outputs, place, sealed(0x201, data, (data[1] & 0xF) - 1))

    assert "counter" in rules(flawed(calm, change))


def test_a_missing_a_late_and_a_shifted_setpoint_are_seen(calm):
    def missing(outputs):
        del outputs[setpoint(outputs)]
        return outputs

    def late(outputs):
        place = setpoint(outputs)
        outputs[place] = outputs[place][0] + 4_000, outputs[place][1]
        return outputs

    def shifted(outputs):
        place = setpoint(outputs)
        at_us, frame = outputs[place]
        outputs[place] = at_us, frame._replace(t_us=frame.t_us - 1_000)
        return outputs

    assert {"gap", "counter"} <= rules(flawed(calm, missing))
    assert "late" in rules(flawed(calm, late))
    assert "grid" in rules(flawed(calm, shifted))


def test_a_service_that_falls_silent_where_the_machine_is_slow_is_seen(calm):
    def silent(outputs):
        first = setpoint(outputs)
        return outputs[:first] + [(t, f) for t, f in outputs[first:] if t > outputs[first][0] + S]

    slow = Fault("slow", 2 * S, 4 * S, "", 0.004)
    stopped = replace(slow, kind="stopped")
    assert "gap" in rules(flawed(calm, silent), (slow,))
    assert "gap" not in rules(flawed(calm, silent), (slow, stopped))


@pytest.mark.parametrize(("turn_s", "least"), [(0.0023, 0.99), (0.003, 0.9), (0.02, 0.0)])
def test_where_the_machine_is_slow_setpoints_go_on_and_it_is_told(turn_s, least):
    faults = (Fault("slow", 2 * S, 8 * S, "", turn_s),)
    record = play(3, 10 * S, faults)
    assert check(record, faults, START_US, START_US + 10 * S) == []
    sent = [f for _, f in record.outputs if f.arbitration_id == 0x201]
    assert len(sent) > 0.98 * 500
    slow = [f for f in sent if 2 * S < f.t_us - START_US < 8 * S]
    assert sum(status([f]) == "TRACKING" for f in slow) >= least * len(slow)
    assert sum("dropping the oldest" in line for line in record.notices) == 1


def test_a_burst_is_seen(calm):
    def change(outputs):
        first = setpoint(outputs)
        own = [k for k, (_, f) in enumerate(outputs) if f.arbitration_id == 0x201 and k >= first]
        for place in own[:12]:
            outputs[place] = outputs[own[12]][0], outputs[place][1]
        return outputs

    assert "burst" in rules(flawed(calm, change))


def test_confidence_in_a_stale_input_is_seen(silence):
    faults, record = silence
    assert rules(record, faults) == set()

    def change(outputs):
        for place, (at_us, frame) in enumerate(outputs):
            if frame.arbitration_id == 0x201 and START_US + 3 * S < at_us < START_US + 4 * S:
                data = frame.data
                tracking = data[:1] + bytes([0x10 | data[1] & 0xF]) + data[2:]
                with_data(outputs, place, sealed(0x201, tracking, data[1] & 0xF))
        return outputs

    assert "stale" in rules(flawed(record, change), faults)


def test_numbers_held_for_too_long_or_out_of_range_are_seen(silence, calm):
    faults, record = silence

    def held(outputs):
        for place, (at_us, frame) in enumerate(outputs):
            if frame.arbitration_id == 0x201 and START_US + 3.5 * S < at_us < START_US + 4 * S:
                data = frame.data[:2] + b"\x10\x27\x10\x27\x10\x27"
                with_data(outputs, place, sealed(0x201, data, frame.data[1] & 0xF))
        return outputs

    def zero(outputs):
        place = setpoint(outputs)
        data = outputs[place][1].data
        return with_data(outputs, place, sealed(0x201, data[:2] + bytes(6), data[1] & 0xF))

    assert "held" in rules(flawed(record, held), faults)
    assert "range" in rules(flawed(calm, zero))


def test_a_fault_without_another_sender_is_seen(calm):
    def change(outputs):
        place = setpoint(outputs)
        data = outputs[place][1].data
        data = data[:1] + bytes([0x50 | data[1] & 0xF]) + 6 * b"\xff"
        return with_data(outputs, place, sealed(0x201, data, data[1] & 0xF))

    assert "no second service" in rules(flawed(calm, change))


def test_a_service_that_never_comes_back_is_seen(calm):
    def change(outputs):
        for place, (_, frame) in enumerate(outputs):
            if frame.arbitration_id == 0x201:
                data = frame.data[:1] + bytes([frame.data[1] & 0xF]) + 6 * b"\xff"
                with_data(outputs, place, sealed(0x201, data, frame.data[1] & 0xF))
        return outputs

    assert "recovery" in rules(flawed(calm, change))


def test_a_log_that_replays_to_other_bytes_is_seen(calm):
    place = next(k for k, line in enumerate(calm.log) if " 201#" in line and k > 500)
    line = calm.log[place]
    log = [*calm.log[:place], line[:-3] + ("0" if line[-3] != "0" else "1") + line[-2:]]
    changed = Record(calm.inputs, calm.outputs, [*log, *calm.log[place + 1 :]], calm.notices)
    assert "replay" in rules(changed)


def test_every_kind_has_its_row_in_the_table_of_reactions():
    text = (DOCS / "operation.md").read_text(encoding="utf-8")
    lines = text.partition("\n## Faults\n")[2].partition("\n## ")[0].splitlines()
    rows = [line.split("`")[1] for line in lines if line.startswith("| `")]
    assert rows == list(KINDS)
