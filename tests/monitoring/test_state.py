"""What is known of a bus, against what was put on it."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import settings as given_settings
from hypothesis import strategies as st

from adhesion_can.bus.frame import Frame
from adhesion_can.config import load_configuration
from adhesion_can.monitoring.snapshot import MessageRole, MessageState
from adhesion_can.monitoring.state import MonitorState
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.status import Status
from tests.monitoring.recorded import DURATION_S, OWN, closed_loop
from tests.wire import CYCLES_MS, DB, REQUIRED, Bench, decoded, sealed, values

CAR = Path(__file__).resolve().parent.parent / "data" / "car.toml"


def state_after(frames, config=None):
    state = MonitorState(config or load_configuration())
    for frame in frames:
        state.feed(frame)
    return state


def by_name(snapshot):
    return {view.name: view for view in snapshot.messages}


@pytest.mark.costly
def test_rates_ages_and_states_of_a_bus_in_order():
    frames, _ = closed_loop()
    now_us = frames[-1].t_us + 3_000
    views = by_name(state_after(frames).snapshot(now_us))
    cycles_ms = CYCLES_MS | {"AdhesionSetpoint": 20, "AdhesionModel": 100, "AdhesionQuality": 100}
    for name, cycle_ms in cycles_ms.items():
        view = views[name]
        stamps = [f.t_us for f in frames if f.arbitration_id == view.frame_id]
        assert view.accepted == len(stamps), name
        assert view.age_us == now_us - stamps[-1]
        # A frame more or less in the time over which it is counted.
        assert view.rate == pytest.approx(1e3 / cycle_ms, abs=1.1), name
        assert view.state is MessageState.OK
        assert (view.lost, dict(view.rejected)) == (0, {})
    assert views["AxleSetpoint"].rate == pytest.approx(300, abs=7)
    assert {v.kind for v in views.values() if v.frame_id in OWN} == {MessageRole.OUTPUT}


def test_the_service_as_cantools_decodes_its_last_frames():
    frames, simulation = closed_loop()
    last = {f.arbitration_id: decoded(f) for f in frames}
    snapshot = state_after(frames).snapshot(frames[-1].t_us)
    service = snapshot.service
    assert service.status is Status.TRACKING is Status[str(last[0x201]["Status"])]
    assert service.mu_max == pytest.approx(last[0x201]["MuMax"])
    assert service.creep_speed == pytest.approx(last[0x201]["CreepSpeedSetpoint"])
    assert service.theta == pytest.approx([last[0x202][k] for k in ("C1", "C2", "C3")])
    assert service.lambda_m_std == pytest.approx(last[0x203]["LambdaMStd"])
    assert service.doubt is Doubt.NONE
    assert not service.is_silent
    six = decoded([f for f in frames if f.arbitration_id == 0x204][-1])
    assert snapshot.axles[5].lambda_m == pytest.approx(six["LambdaM_Ax6"])
    # The axles hold what the plant has.
    plant = simulation.plant
    for axle, slip in zip(snapshot.axles, plant.slip, strict=True):
        assert axle.slip == pytest.approx(slip, abs=2e-3)
        assert axle.adhesion == pytest.approx(
            plant.force[axle.axle - 1] / plant.load[axle.axle - 1], abs=0.02
        )
    assert len(snapshot.history) == pytest.approx(DURATION_S / 0.2, abs=6)
    assert {point.axle for point in snapshot.points} == set(range(1, 7))


@pytest.mark.parametrize(
    ("harm", "reason", "count"),
    [
        (lambda data: bytes([data[0] ^ 1]) + data[1:], "checksum", 4),
        (lambda data: data[:7], "length", 4),
    ],
)
def test_harmed_frames_are_counted_by_their_reason(harm, reason, count):
    frames = list(Bench().drive(0, 3_000_000))
    hit = [k for k, f in enumerate(frames) if f.arbitration_id == 0x101][100:300:50]
    for k in hit:
        frames[k] = frames[k]._replace(data=harm(frames[k].data))
    view = by_name(state_after(frames).snapshot(3_000_000))["WheelSpeeds1"]
    assert view.rejected == {reason: count}
    # The counter goes on past each of them.
    assert (view.lost, view.recent_faults) == (count, 2 * count)
    assert view.state is MessageState.FAULTY
    assert by_name(state_after(frames).snapshot(3_000_000))["WheelSpeeds2"].recent_faults == 0


@given_settings(max_examples=20)
@given(st.sets(st.integers(10, 250), max_size=20), st.sets(st.integers(10, 250), max_size=20))
def test_lost_and_repeated_frames_against_a_plain_count(lost, repeated):
    """One lost at a time is a gap of one; each repetition is rejected."""
    lost = {k for k in lost if not {k - 1, k - 2} & lost}
    repeated -= lost
    frames = [f for f in Bench().drive(0, 3_000_000) if f.arbitration_id == 0x111]
    bus = []
    for k, frame in enumerate(frames):
        if k not in lost:
            bus += [frame] * (2 if k in repeated else 1)
    view = by_name(state_after(bus).snapshot(bus[-1].t_us))["VehicleSpeed"]
    inside = [k for k in lost if k < len(frames) - 1]
    assert view.lost == len(inside)
    assert view.rejected.get("repeat", 0) == len([k for k in repeated if k < len(frames)])


def test_a_message_that_ends_is_silent_and_its_rate_falls_to_zero():
    frames = list(Bench().drive(0, 2_000_000))
    frames += Bench().drive(2_000_000, 6_000_000, names=("TractiveEffort1",))
    view = by_name(state_after(frames).snapshot(6_000_000))["VehicleSpeed"]
    assert view.state is MessageState.SILENT
    assert view.age_us == 4_020_000
    assert view.rate == 0.0
    never = by_name(state_after(frames).snapshot(6_000_000))["Environment"]
    assert (never.state, never.age_us, never.rate) == (MessageState.NEVER, None, None)
    # A bus that is silent as a whole tells by the time alone.
    quiet = by_name(state_after(frames).snapshot(20_000_000))["TractiveEffort1"]
    assert (quiet.state, quiet.rate) == (MessageState.SILENT, 0.0)


def test_faults_are_recent_for_ten_seconds():
    bench = Bench()
    frames = list(bench.drive(0, 1_000_000))
    frames[50] = frames[50]._replace(data=b"\xff" * 8)
    frames += bench.drive(1_000_000, 12_000_000)
    name = DB.get_message_by_frame_id(frames[50].arbitration_id).name
    view = by_name(state_after(frames).snapshot(12_000_000))[name]
    assert (view.recent_faults, view.state) == (0, MessageState.OK)
    assert sum(view.rejected.values()) == 1


def test_frames_of_other_ids_are_listed_and_bounded():
    others = [Frame(k * 1000, 0x700 + k % 3, b"\x00") for k in range(300)]
    others += [Frame(300_000, 0x18FEF100, b"\x00", is_extended=True)]
    others += [Frame(300_000, 0x7FF, b"", is_remote=True), Frame(300_000, 4, b"", is_error=True)]
    snapshot = state_after(others).snapshot(300_000)
    found = [v for v in snapshot.messages if v.kind is MessageRole.OTHER]
    assert [v.number for v in found] == ["700", "701", "702", "18FEF100"]
    assert [v.accepted for v in found] == [100, 100, 100, 1]
    assert snapshot.frames == 303
    many = [Frame(k, k, b"") for k in range(0x300, 0x300 + 1000)]
    assert len(state_after(many).snapshot(2000).messages) < 300


def test_demands_of_a_controller_are_checked_too():
    frames = list(Bench().drive(0, 200_000))
    for k in range(20):
        payload = sealed(0x301, values("EffortDemand1", EffortDemand_Ax1=1000.0), k % 15)
        if k == 7:
            payload = payload[:-1] + b"\x77"
        frames.append(Frame(k * 10_000, 0x301, payload))
    frames.sort(key=lambda frame: frame.t_us)
    view = by_name(state_after(frames).snapshot(200_000))["EffortDemand1"]
    assert (view.kind, view.accepted, view.rejected) == (MessageRole.OTHER, 19, {"checksum": 1})


def test_a_deviation_at_the_end_of_its_range_is_not_known():
    frames, _ = closed_loop()
    early = [f for f in frames if f.t_us <= 20_000]
    service = state_after(early).snapshot(20_000).service
    assert service.status in (Status.INIT, Status.LOW_EXCITATION)
    known = [x for x in (service.mu_max_std, service.lambda_m_std) if x is not None]
    assert all(x == math.inf for x in known)


def test_a_silent_service_is_told():
    frames, _ = closed_loop()
    cut_us = 4_000_000
    frames = [f for f in frames if f.t_us < cut_us or f.arbitration_id not in OWN]
    service = state_after(frames).snapshot(frames[-1].t_us).service
    assert service.is_silent
    assert cut_us - service.t_us <= 20_000


def test_stamps_that_run_backwards_are_clamped():
    frames = list(Bench().drive(0, 1_000_000))
    frames[200] = frames[200]._replace(t_us=10)
    snapshot = state_after(frames).snapshot(0)
    assert snapshot.t_us == frames[-1].t_us
    assert snapshot.frames == len(frames)


def test_a_long_hole_begins_new_samples():
    bench = Bench()
    frames = [*bench.drive(0, 500_000), *bench.drive(100_000_000, 100_500_000)]
    snapshot = state_after(frames).snapshot(100_500_000)
    assert min(point.t_us for point in snapshot.points) >= 100_000_000


def test_the_only_direction_of_the_efforts_until_both_came():
    bench = Bench()
    state = state_after(bench.drive(0, 600_000))
    assert state.snapshot(0).only_direction == "traction"
    for frame in bench.drive(600_000, 1_200_000, slip=-0.05, adhesion=-0.3):
        state.feed(frame)
    assert state.snapshot(0).only_direction is None
    assert state_after([]).snapshot(0).only_direction is None


def test_a_snapshot_changes_nothing():
    frames = list(Bench().drive(0, 600_000, names=(*REQUIRED, "AxleLoads1", "AxleLoads2")))
    watched, left = MonitorState(load_configuration()), MonitorState(load_configuration())
    for frame in frames:
        watched.feed(frame)
        left.feed(frame)
        watched.snapshot(frame.t_us + 5_000)
    assert watched.snapshot(700_000) == left.snapshot(700_000)


def test_a_vehicle_without_effort_shows_its_slips():
    config = load_configuration(CAR)
    plans = {m.plan.name: m.plan for m in config.messages}
    state = MonitorState(config)
    assert "tractive effort" in state.snapshot(0).missing
    db = config.database.db
    speed = db.get_message_by_name("SPEED")
    wheels = db.get_message_by_name("WHEEL_SPEEDS")
    zeros = {s.name: 0 for s in wheels.signals}
    kmh = {n: 55.0 for n in zeros if n.startswith("WHEEL_SPEED_")}
    state.feed(
        Frame(1000, wheels.frame_id, wheels.encode(zeros | kmh, strict=False), channel="can0")
    )
    zeros = {s.name: 0 for s in speed.signals}
    state.feed(
        Frame(2000, speed.frame_id, speed.encode(zeros | {"SPEED": 50.0}, strict=False), "can0")
    )
    snapshot = state.snapshot(3000)
    assert set(plans) == {"WHEEL_SPEEDS", "SPEED"}
    assert [axle.slip for axle in snapshot.axles] == pytest.approx([0.1] * 4, abs=0.01)
    assert all(axle.adhesion is None for axle in snapshot.axles)


def test_the_same_frames_give_the_same_snapshot():
    frames, _ = closed_loop()
    one, other = (state_after(frames[:3000]).snapshot(9_000_000) for _ in range(2))
    assert one == other
    assert replace(one, frames=0) != other


def test_a_speed_that_the_service_observes_is_no_missing_input(tmp_path):
    path = tmp_path / "my.toml"
    path.write_text("[observed_speed]\nenabled = true\n", encoding="utf-8")
    frames, _ = closed_loop()
    state = state_after(frames, load_configuration(path))
    snapshot = state.snapshot(frames[-1].t_us)
    assert snapshot.is_speed_observed
    assert (snapshot.missing, snapshot.speed, snapshot.points) == ((), None, ())
    assert not state_after(frames[:100]).snapshot(frames[99].t_us).is_speed_observed
