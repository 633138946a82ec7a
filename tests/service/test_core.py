"""The core: when it sends, what it sends, and what never changes it."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.frame import Frame
from adhesion_can.config import load_configuration
from adhesion_can.errors import InputError
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status
from adhesion_can.service.core import ServiceCore
from tests.wire import DBC, INPUTS, REQUIRED, Bench, decoded, seal_ok, sealed, values

CONFIG = load_configuration()
CYCLES_US = {0x201: 20_000, 0x202: 100_000, 0x203: 100_000, 0x204: 20_000, 0x211: 1_000_000}
KNOWN = Estimate(
    c1=0.4,
    c2=60.0,
    c3=0.3,
    covariance=np.eye(3),
    mu_max=0.373,
    mu_max_std=0.001,
    lambda_m=0.073,
    lambda_m_std=0.002,
    noise_std=0.01,
    samples=500,
    identifiable=Identifiable(mu_max=True, lambda_m=True),
    surface_since_us=0,
)


class FixedEstimator:
    """An estimator that gives a fixed estimate, or raises a fixed exception."""

    def __init__(self, answer=KNOWN):
        self.answer = answer
        self.updates = 0

    def update(self, samples, now_us):
        self.updates += 1
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


def core_with(answer=KNOWN, configuration=CONFIG):
    estimator = FixedEstimator(answer)
    return ServiceCore(configuration, lambda: estimator), estimator


def run(core, frames):
    sent = []
    for frame in frames:
        sent += core.feed(frame)
    return sent


def last(frames, number, axle=None):
    chosen = [decoded(f) for f in frames if f.arbitration_id == number]
    if axle is not None:
        chosen = [d for d in chosen if d["Axle"] == axle]
    return chosen[-1]


def doubt(frames):
    return str(last(frames, 0x203)["Doubt"])


def status(frames):
    return str(last(frames, 0x201)["Status"])


def assert_not_available(frames):
    for frame in frames:
        if frame.arbitration_id != 0x211:
            assert all(str(v) == "not available" for v in list(decoded(frame).values())[3:])


# --- time


def test_messages_are_due_at_t0_plus_multiples_of_their_cycle_in_ascending_order():
    t0 = 1_234_567
    core, _ = core_with()
    sent = run(core, Bench().drive(t0, t0 + 2_000_001))
    assert [f.t_us for f in sent] == sorted(f.t_us for f in sent)
    for number, cycle in CYCLES_US.items():
        stamps = [f.t_us for f in sent if f.arbitration_id == number]
        expected = range(t0, t0 + 2_000_001, cycle)
        if number == 0x204:
            assert stamps == [t for t in expected for _ in range(6)]
        else:
            assert stamps == list(expected)
    for a, b in zip(sent, sent[1:], strict=False):
        assert (a.t_us, a.arbitration_id) <= (b.t_us, b.arbitration_id)
    axles = [decoded(f)["Axle"] for f in sent if f.arbitration_id == 0x204]
    assert axles[:12] == [1, 2, 3, 4, 5, 6] * 2


def test_every_output_is_sealed_and_counts_0_to_14_by_id():
    core, _ = core_with()
    sent = run(core, Bench().drive(0, 3_000_000))
    assert all(seal_ok(frame) for frame in sent)
    for number in CYCLES_US:
        counts = [f.data[1] & 0x0F for f in sent if f.arbitration_id == number]
        assert counts == [k % 15 for k in range(len(counts))]


def test_every_output_passes_autosar_e2e():
    import e2e.p01

    core, _ = core_with()
    for frame in run(core, Bench().drive(0, 1_100_000)):
        assert e2e.p01.e2e_p01_check(bytearray(frame.data), frame.arbitration_id)


def test_nothing_is_sent_before_the_first_accepted_input():
    core, _ = core_with(None)
    assert core.advance(10_000_000) == []
    assert core.feed(Frame(10_500_000, 0x7FF, b"12345678")) == []
    broken = bytearray(Bench().steady("VehicleSpeed", 0).data)
    broken[0] ^= 1
    assert core.feed(Frame(11_000_000, 0x111, bytes(broken))) == []
    first = core.feed(Bench().steady("VehicleSpeed", 12_000_000))
    assert {f.t_us for f in first} == {12_000_000}
    assert status(first) == "INIT"


def test_a_message_carries_what_was_stamped_before_it_and_not_at_it():
    core, _ = core_with()
    bench = Bench()
    run(core, bench.drive(0, 40_000))
    slow = core.feed(bench.steady("VehicleSpeed", 40_000, speed=20.0))
    later = core.advance(60_000)
    ratio = last(later, 0x201)["CreepSpeedSetpoint"] / last(slow, 0x201)["CreepSpeedSetpoint"]
    assert last(slow, 0x201)["CreepSpeedSetpoint"] == pytest.approx(0.0426 * 10, rel=0.25)
    assert ratio == pytest.approx(2.0, rel=0.01)


def test_a_frame_from_the_past_is_clamped_and_counted():
    core, _ = core_with()
    bench = Bench()
    run(core, bench.drive(0, 100_000))
    core.advance(120_000)
    assert core.counts.clamped == 0
    core.feed(bench.steady("WheelSpeeds1", 90_000))
    assert core.counts.clamped == 1
    assert core.now_us == 120_000


def test_going_back_in_time_changes_nothing():
    core, _ = core_with()
    run(core, Bench().drive(0, 100_000))
    assert core.advance(50_000) == []
    assert core.now_us == 90_000


@settings(max_examples=12)
@given(st.lists(st.integers(0, 1_200_000), max_size=30), st.randoms(use_true_random=False))
def test_advances_between_the_frames_change_no_byte(times, random):
    """Due messages come at their due time whoever brings the core there."""
    frames = list(Bench().drive(0, 500_000, slip=0.03 + 0.02 * random.random()))
    plain = ServiceCore(CONFIG)
    expected = [*run(plain, frames), *plain.advance(1_200_000)]
    nudged = ServiceCore(CONFIG)
    sent = []
    pending = sorted(times)
    for frame in frames:
        while pending and pending[0] <= frame.t_us:
            sent += nudged.advance(pending.pop(0))
        sent += nudged.feed(frame)
    for time in pending:
        sent += nudged.advance(time)
    sent += nudged.advance(1_200_000)
    assert sent == expected


def test_a_hole_in_time_starts_anew_instead_of_filling_it():
    core, estimator = core_with()
    bench = Bench()
    run(core, bench.drive(0, 200_000))
    estimator.answer = None
    assert core.advance(3_600_000_000) == []
    assert core.counts.restarts == 1
    again = run(core, bench.drive(3_600_000_000, 3_600_100_000))
    assert min(f.t_us for f in again) == 3_600_000_000
    assert str(decoded(again[0])["Status"]) == "INIT"


def test_a_hole_within_the_restart_time_is_filled():
    core, _ = core_with()
    run(core, Bench().drive(0, 100_000))
    sent = core.advance(30_000_000)
    assert len([f for f in sent if f.arbitration_id == 0x201]) == 1496


def test_a_service_that_stops_takes_back_every_message():
    core, estimator = core_with()
    bench = Bench()
    sent = run(core, bench.drive(0, 305_000))
    assert status(sent) == "TRACKING"
    end = core.stop(313_000)
    assert {frame.t_us for frame in end} == {313_000}
    numbers = [frame.arbitration_id for frame in end]
    assert numbers == [0x201, 0x202, 0x203, *[0x204] * 6, 0x211]
    setpoints = [f.data for f in [*sent, *end] if f.arbitration_id == 0x201]
    assert setpoints[-1][1] & 0xF == (setpoints[-2][1] & 0xF) + 1
    assert status(end) == "INIT"
    assert_not_available(end)
    assert core.next_due_us is None
    assert core.stop(400_000) == core.advance(10_000_000) == []
    assert core.counts.restarts == 0
    assert core.estimate is KNOWN
    # Whoever feeds it again, as the replay of two logs in one file, has a service that begins.
    estimator.answer = None
    again = run(core, bench.drive(20_000_000, 20_100_000))
    assert again[0].t_us == 20_000_000
    assert status(again) == "INIT"
    assert core.estimate is None


def test_another_stop_at_the_same_time_says_it_once_more():
    core, _ = core_with()
    run(core, Bench().drive(0, 105_000))
    first, second = core.stop(113_000), core.stop(113_000)
    assert [frame.arbitration_id for frame in second] == [frame.arbitration_id for frame in first]
    assert_not_available(second)
    counts = [frame.data[1] & 0xF for frame in (first[0], second[0])]
    assert counts[1] == counts[0] + 1


def test_a_service_that_began_anew_after_a_hole_takes_back_what_was_sent_before():
    core, _ = core_with()
    run(core, Bench().drive(0, 105_000))
    assert core.advance(100_000_000) == []
    assert core.counts.restarts == 1
    end = core.stop(100_000_000)
    assert status(end) == "INIT"
    assert_not_available(end)


def test_a_service_that_stops_before_any_input_sends_nothing():
    assert core_with()[0].stop(1_000_000) == []


# --- states


def test_init_sends_not_available():
    core, _ = core_with(None)
    sent = run(core, Bench().drive(0, 1_000_001))
    assert status(sent) == "INIT"
    assert_not_available(sent)


def test_init_becomes_tracking_with_the_first_estimate():
    core, estimator = core_with(None)
    bench = Bench()
    assert status(run(core, bench.drive(0, 100_000))) == "INIT"
    estimator.answer = KNOWN
    sent = run(core, bench.drive(100_000, 220_000))
    assert status(sent) == "TRACKING"
    point = last(sent, 0x201)
    assert point["MuMax"] == pytest.approx(0.373, abs=2e-5)
    assert point["LambdaM"] == pytest.approx(0.073, abs=1e-5)
    model = last(sent, 0x202)
    assert (model["C1"], model["C2"], model["C3"]) == pytest.approx((0.4, 60.0, 0.3), abs=0.005)
    quality = last(sent, 0x203)
    assert quality["MuMaxStd"] == pytest.approx(0.001, abs=1e-5)
    for axle in range(1, 7):
        assert last(sent, 0x204, axle)[f"MuMax_Ax{axle}"] == pytest.approx(0.373, abs=2e-5)


def test_the_creep_setpoint_is_where_the_curve_reaches_98_percent():
    core, _ = core_with()
    sent = run(core, Bench().drive(0, 100_000, speed=10.0))
    slip = last(sent, 0x201)["CreepSpeedSetpoint"] / 10.0
    curve = lambda x: 0.4 * (1 - math.exp(-60 * x)) - 0.3 * x  # noqa: E731
    peak = max(curve(x / 1e4) for x in range(2000))
    assert curve(slip) == pytest.approx(0.98 * peak, rel=2e-3)
    assert slip < 0.073


def test_below_v_min_the_creep_setpoint_stands_at_v_min():
    core, _ = core_with()
    sent = run(core, Bench().drive(0, 100_000, speed=0.2))
    slow = last(sent, 0x201)["CreepSpeedSetpoint"]
    core, _ = core_with()
    assert (
        slow == last(run(core, Bench().drive(0, 100_000, speed=1.0)), 0x201)["CreepSpeedSetpoint"]
    )


def test_an_unidentifiable_estimate_is_low_excitation_and_still_sent():
    vague = replace(
        KNOWN,
        mu_max_std=math.inf,
        lambda_m_std=math.inf,
        identifiable=Identifiable(mu_max=True, lambda_m=False),
    )
    core, _ = core_with(vague)
    sent = run(core, Bench().drive(0, 200_000))
    assert status(sent) == "LOW_EXCITATION"
    assert last(sent, 0x201)["MuMax"] == pytest.approx(0.373, abs=2e-5)
    # Saturated one below 'not available'.
    assert last(sent, 0x203)["MuMaxStd"] == pytest.approx(0.65534)


def test_without_samples_tracking_becomes_low_excitation():
    core, _ = core_with()
    bench = Bench()
    assert status(run(core, bench.drive(0, 500_000))) == "TRACKING"
    standing = run(core, bench.drive(500_000, 4_000_000, speed=0.0))
    assert status(standing) == "LOW_EXCITATION"
    assert status(run(core, bench.drive(4_000_000, 4_500_000))) == "TRACKING"


def test_a_changed_surface_is_shown_until_the_estimator_knows_it():
    core, estimator = core_with()
    bench = Bench()
    run(core, bench.drive(0, 500_000))
    estimator.answer = replace(KNOWN, change_probability=1.0, mu_max=0.2)
    assert status(run(core, bench.drive(500_000, 600_000))) == "SURFACE_CHANGE"
    estimator.answer = replace(KNOWN, mu_max=0.2)
    assert status(run(core, bench.drive(600_000, 700_000))) == "TRACKING"


def test_a_surface_change_is_not_shown_for_ever():
    core, estimator = core_with()
    bench = Bench()
    run(core, bench.drive(0, 100_000))
    estimator.answer = replace(
        KNOWN, change_probability=1.0, identifiable=Identifiable(mu_max=False, lambda_m=False)
    )
    assert status(run(core, bench.drive(100_000, 4_900_000))) == "SURFACE_CHANGE"
    assert status(run(core, bench.drive(4_900_000, 5_500_000))) == "LOW_EXCITATION"


@pytest.mark.parametrize("name", REQUIRED)
def test_each_required_input_goes_stale_after_three_cycles(name):
    core, _ = core_with()
    bench = Bench()
    assert status(run(core, bench.drive(0, 500_000))) == "TRACKING"
    others = [other for other in REQUIRED if other != name]
    sent = run(core, bench.drive(500_000, 700_000, names=others))
    cycle = 20_000 if name == "VehicleSpeed" else 10_000
    silent_since = 480_000 if name == "VehicleSpeed" else 490_000
    states = {f.t_us: str(decoded(f)["Status"]) for f in sent if f.arbitration_id == 0x201}
    for t_us, shown in states.items():
        expected = "STALE_INPUT" if t_us - silent_since > 3 * cycle else "TRACKING"
        assert shown == expected, t_us


def test_a_stale_service_holds_its_values_for_a_second_and_then_has_none():
    core, _ = core_with()
    run(core, Bench().drive(0, 500_000))
    sent = core.advance(2_500_000)
    points = {f.t_us: decoded(f) for f in sent if f.arbitration_id == 0x201}
    stale = [t for t, d in points.items() if str(d["Status"]) == "STALE_INPUT"]
    held = [t for t in stale if str(points[t]["MuMax"]) != "not available"]
    assert held == [t for t in stale if t < stale[0] + 1_000_000]
    assert {points[t]["MuMax"] for t in held} == {points[stale[0]]["MuMax"]}


def test_a_stale_service_recovers():
    core, _ = core_with()
    bench = Bench()
    run(core, bench.drive(0, 500_000))
    core.advance(1_500_000)
    assert status(run(core, bench.drive(1_500_000, 1_700_000))) == "TRACKING"


def test_stale_comes_before_init():
    core, _ = core_with(None)
    bench = Bench()
    assert status(run(core, bench.drive(0, 200_000, names=["VehicleSpeed"]))) == "STALE_INPUT"
    assert status(run(core, bench.drive(200_000, 400_000))) == "INIT"


def test_an_input_that_is_not_available_is_no_input():
    core, _ = core_with()
    bench = Bench()
    run(core, bench.drive(0, 500_000))
    rest = [n for n in REQUIRED if n != "VehicleSpeed"]
    sent = []
    for t in range(500_000, 700_000, 20_000):
        payload = bytearray(values("VehicleSpeed", VehicleSpeedSource=1, Direction=1))
        payload[2:4] = b"\xff\xff"
        sent += core.feed(Frame(t, 0x111, sealed(0x111, payload, bench.counts["VehicleSpeed"])))
        bench.counts["VehicleSpeed"] = (bench.counts["VehicleSpeed"] + 1) % 15
        sent += run(core, bench.drive(t, t + 20_000, names=rest))
    assert status(sent) == "STALE_INPUT"
    assert core.receiver.rejected == 0


@pytest.mark.parametrize(
    "answer",
    [
        ValueError("singular"),
        ZeroDivisionError(),
        replace(KNOWN, mu_max=math.nan),
        replace(KNOWN, c2=math.inf),
        replace(KNOWN, lambda_m_std=math.nan),
    ],
)
def test_a_failing_estimator_is_a_fault_with_no_value_and_is_replaced(answer):
    core, estimator = core_with()
    bench = Bench()
    run(core, bench.drive(0, 200_000))
    estimator.answer = answer
    sent = run(core, bench.drive(200_000, 300_000))
    assert status(sent) == "FAULT"
    assert str(last(sent, 0x201)["MuMax"]) == "not available"
    assert core.faults
    estimator.answer = None
    assert status(run(core, bench.drive(300_000, 1_400_000))) == "INIT"
    estimator.answer = KNOWN
    assert status(run(core, bench.drive(1_400_000, 1_500_000))) == "TRACKING"


def test_a_second_sender_is_a_fault_while_it_sends():
    core, _ = core_with()
    bench = Bench()
    run(core, bench.drive(0, 200_000))
    core.second_sender(200_000)
    assert status(run(core, bench.drive(200_000, 1_150_000))) == "FAULT"
    assert status(run(core, bench.drive(1_150_000, 1_300_000))) == "TRACKING"


def test_a_speed_from_driven_axles_is_at_most_low_excitation():
    core, _ = core_with()
    bench = Bench()
    assert status(run(core, bench.drive(0, 500_000))) == "TRACKING"
    sent = run(core, bench.drive(500_000, 1_000_000, source=4))
    assert status(sent) == "LOW_EXCITATION"
    assert last(sent, 0x203)["LambdaMStd"] == pytest.approx(0.65534)


@pytest.mark.parametrize("known", list(Doubt))
def test_each_doubt_goes_out_with_its_number_and_leaves_the_other_signals_alone(known):
    core, _ = core_with(replace(KNOWN, doubt=known))
    sent = [f for f in run(core, Bench().drive(0, 200_000)) if f.arbitration_id == 0x203]
    assert sent[-1].data[1] >> 4 == known
    assert core.outputs.doubt is known
    plain, _ = core_with(replace(KNOWN, doubt=Doubt.NONE))
    other = [f for f in run(plain, Bench().drive(0, 200_000)) if f.arbitration_id == 0x203]
    assert sent[-1].data[2:] == other[-1].data[2:]
    assert seal_ok(sent[-1])


@pytest.mark.parametrize("known", list(Objection))
def test_each_objection_goes_out_with_its_number_and_leaves_the_curve_alone(known):
    sent, plain = (
        [
            f
            for f in run(core_with(replace(KNOWN, objection=one))[0], Bench().drive(0, 200_000))
            if f.arbitration_id == 0x202
        ]
        for one in (known, Objection.NONE)
    )
    assert sent[-1].data[1] >> 4 == known
    assert sent[-1].data[2:] == plain[-1].data[2:]
    assert seal_ok(sent[-1])


def test_without_an_estimate_or_with_one_that_looks_for_none_doubt_is_not_available():
    core, estimator = core_with(None)
    bench = Bench()
    sent = run(core, bench.drive(0, 200_000))
    assert (status(sent), doubt(sent)) == ("INIT", "not available")
    estimator.answer = KNOWN
    sent = run(core, bench.drive(200_000, 400_000))
    assert (status(sent), doubt(sent)) == ("TRACKING", "not available")
    estimator.answer = replace(KNOWN, doubt=Doubt.NONE)
    assert doubt(run(core, bench.drive(400_000, 600_000))) == "none"


def test_a_fault_takes_the_doubt_away():
    core, estimator = core_with(replace(KNOWN, doubt=Doubt.SPEED))
    bench = Bench()
    assert doubt(run(core, bench.drive(0, 200_000))) == "speed"
    estimator.answer = ValueError("singular")
    sent = run(core, bench.drive(200_000, 400_000))
    assert (status(sent), doubt(sent)) == ("FAULT", "not available")


def test_a_stale_service_holds_the_doubt_as_long_as_the_values():
    core, _ = core_with(replace(KNOWN, doubt=Doubt.AXLE_LOAD))
    run(core, Bench().drive(0, 500_000))
    sent = core.advance(2_500_000)
    doubts = {f.t_us: str(decoded(f)["Doubt"]) for f in sent if f.arbitration_id == 0x203}
    stds = {f.t_us: str(decoded(f)["MuMaxStd"]) for f in sent if f.arbitration_id == 0x203}
    assert set(doubts.values()) == {"axle load", "not available"}
    for t_us, shown in doubts.items():
        assert (shown == "not available") is (stds[t_us] == "not available"), t_us


def test_a_speed_from_driven_axles_leaves_the_doubt_as_the_estimate_has_it():
    core, _ = core_with(replace(KNOWN, doubt=Doubt.DIRECTION))
    sent = run(core, Bench().drive(0, 500_000, source=4))
    assert (status(sent), doubt(sent)) == ("LOW_EXCITATION", "direction of effort")


def test_an_estimate_from_driven_axles_is_not_taken_over_by_radar():
    core = ServiceCore(CONFIG)
    bench = Bench()
    run(core, bench.drive(0, 2_000_000, source=4))
    assert core.estimate.samples > 500
    run(core, bench.drive(2_000_000, 2_100_000, source=1))
    assert core.estimate.samples < 100


# --- what never moves it


def faulty(kind, frame):
    """A frame that the contract rejects, made from a good one that was just accepted."""
    name = next(n for n, number in INPUTS.items() if number == frame.arbitration_id)
    count = frame.data[1] & 0x0F
    if kind == "checksum":
        return frame._replace(data=bytes([frame.data[0] ^ 0x55]) + frame.data[1:])
    if kind == "length":
        return frame._replace(data=frame.data[:5])
    if kind == "range":
        payload = values("VehicleSpeed", VehicleSpeed=30.0, VehicleSpeedSource=9)
        return Frame(frame.t_us, 0x111, sealed(0x111, payload, count))
    if kind == "repeat":
        return frame
    wild = Bench().steady(name, frame.t_us, speed=30.0, slip=0.4)
    return wild._replace(data=sealed(frame.arbitration_id, wild.data, (count + 7) % 15))


@cache
def clean_second():
    """Frames of 0.66 s without a fault, and the answers to them."""
    good = list(Bench().drive(0, 660_000))
    return good, run(ServiceCore(CONFIG), good)


@settings(max_examples=12)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 290),
            st.sampled_from(["checksum", "length", "range", "repeat", "order"]),
        ),
        min_size=1,
        max_size=25,
        unique_by=lambda item: item[0],
    )
)
def test_rejected_frames_are_counted_and_move_no_byte_of_the_setpoints(faults):
    good, clean = clean_second()
    core, sent = ServiceCore(CONFIG), []
    where = dict(faults)
    for i, frame in enumerate(good):
        sent += core.feed(frame)
        if i in where:
            sent += core.feed(faulty(where[i], frame))
    assert core.receiver.rejected == len(faults)
    assert core.receiver.lost == 0
    assert [f for f in sent if f.arbitration_id != 0x211] == [
        f for f in clean if f.arbitration_id != 0x211
    ]
    assert core.messages.ids == {(number, False) for number in CYCLES_US}


def test_service_status_counts_rejected_and_lost_frames():
    core, _ = core_with()
    frames = list(Bench().drive(0, 1_100_000))
    lost = [f for f in frames if f.arbitration_id == 0x101][40:42]
    broken = [f for f in frames if f.arbitration_id == 0x121][50]
    sent = []
    for frame in frames:
        if frame in lost:
            continue
        if frame is broken:
            frame = frame._replace(data=b"\0" + frame.data[1:])
        sent += core.feed(frame)
    health = last(sent, 0x211)
    assert health["FramesRejected"] == 1
    assert health["FramesLost"] == 2 + 1  # the broken one is missing in its count as well
    assert str(health["LoopTimeP99"]) == "not available"


def test_lost_frames_cost_their_samples_and_make_no_wrong_ones():
    slips = {}
    for lost in (range(0), range(400_000, 420_000)):
        seen = []
        core = ServiceCore(CONFIG, FixedEstimator, on_samples=seen.append)
        drive = Bench().drive(0, 1_000_000)
        run(core, [f for f in drive if not (f.arbitration_id == 0x101 and f.t_us in lost)])
        slips[len(lost)] = np.concatenate([samples.slip for samples in seen])
    assert len(slips[0]) - len(slips[20_000]) == 2 * 3
    assert slips[20_000] == pytest.approx(np.full(len(slips[20_000]), 0.05), abs=2e-4)


ANY_FRAME = st.builds(
    Frame,
    t_us=st.one_of(st.integers(0, 1_200_000), st.integers(0, 2**52)),
    arbitration_id=st.one_of(
        st.sampled_from([*INPUTS.values(), *CYCLES_US]), st.integers(0, 2**29 - 1)
    ),
    data=st.binary(max_size=64),
    is_extended=st.booleans(),
    is_fd=st.booleans(),
    is_remote=st.booleans(),
    is_error=st.booleans(),
)
ANY_SEALED = st.builds(
    lambda t, name, payload, count: Frame(t, INPUTS[name], sealed(INPUTS[name], payload, count)),
    st.integers(0, 1_200_000),
    st.sampled_from(sorted(INPUTS)),
    st.binary(min_size=8, max_size=8),
    st.integers(0, 15),
)


def assert_only_numbers(frames):
    for frame in frames:
        assert seal_ok(frame)
        for value in decoded(frame).values():
            assert not isinstance(value, float) or math.isfinite(value)


@settings(max_examples=40)
@given(st.lists(st.one_of(ANY_FRAME, ANY_SEALED), max_size=60))
def test_arbitrary_frames_raise_nothing_and_put_no_nan_on_the_bus(frames):
    assert_only_numbers(run(ServiceCore(CONFIG), frames))


@pytest.mark.slow
@settings(max_examples=1500)
@given(st.lists(st.one_of(ANY_FRAME, ANY_SEALED), max_size=300))
def test_arbitrary_frames_at_length(frames):
    assert_only_numbers(run(ServiceCore(CONFIG), frames))


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_arbitrary_but_sealed_drives_put_no_nan_on_the_bus(seed):
    """Payloads of noise, rightly counted and sealed, at their cycles: the estimator sees it all."""
    rng = np.random.default_rng(seed)
    counts = dict.fromkeys(INPUTS, 0)
    core = ServiceCore(CONFIG)
    sent = []
    for t in range(0, 800_000, 10_000):
        for name in REQUIRED:
            if name == "VehicleSpeed" and t % 20_000:
                continue
            payload = bytearray(rng.bytes(8))
            if name == "VehicleSpeed":
                payload[4] = rng.integers(0, 5) | rng.integers(0, 4) << 4
            sent += core.feed(Frame(t, INPUTS[name], sealed(INPUTS[name], payload, counts[name])))
            counts[name] = (counts[name] + 1) % 15
    assert_only_numbers(sent)
    assert core.receiver.rejected == 0


# --- vehicles


def test_axles_without_signals_have_no_setpoint(tmp_path):
    path = tmp_path / "four.toml"
    path.write_text("[vehicle]\naxles = 4\n")
    core = ServiceCore(load_configuration(path), FixedEstimator)
    sent = run(core, Bench().drive(0, 100_000))
    assert last(sent, 0x204, 4)["MuMax_Ax4"] == pytest.approx(0.373, abs=2e-5)
    assert str(last(sent, 0x204, 5)["MuMax_Ax5"]) == "not available"
    assert str(last(sent, 0x204, 6)["CreepSpeedSetpoint_Ax6"]) == "not available"


def test_numbers_saturate_one_below_not_available(tmp_path):
    path = tmp_path / "unwatched.toml"
    path.write_text("[plausibility]\nenabled = false\n")  # a ceiling would hold such a peak back
    huge = replace(KNOWN, c1=9.0, c2=900.0, c3=9.0, mu_max=5.0, lambda_m=0.9, surface_since_us=0)
    core, _ = core_with(huge, load_configuration(path))
    sent = run(core, Bench().drive(0, 100_001))
    point, model = last(sent, 0x201), last(sent, 0x202)
    assert point["MuMax"] == pytest.approx(65534 * 2e-5)
    assert point["LambdaM"] == pytest.approx(0.65534)
    assert (model["C1"], model["C2"], model["C3"]) == pytest.approx((6.5534, 655.34, 6.5534))


def test_loads_from_the_bus_take_away_the_doubt_about_them():
    wide, narrow = ServiceCore(CONFIG), ServiceCore(CONFIG)
    rng = np.random.default_rng(3)
    names = (*REQUIRED, "AxleLoads1", "AxleLoads2")
    for core, received in ((wide, REQUIRED), (narrow, names)):
        bench = Bench()
        for t in range(0, 2_000_000, 20_000):
            slip = float(rng.uniform(0.01, 0.15))
            adhesion = 0.4 * (1 - math.exp(-60 * slip)) - 0.3 * slip
            run(
                core,
                bench.drive(
                    t,
                    t + 20_000,
                    names=[
                        n for n in received if t % 200_000 == 0 or not n.startswith("AxleLoads")
                    ],
                    slip=slip,
                    adhesion=adhesion,
                ),
            )
    assert wide.estimate.mu_max_std > 0.02 * 0.3 > narrow.estimate.mu_max_std
    assert Status.INIT == 0


# --- databases of the user's own


def with_dbc(tmp_path, *changes):
    text = DBC.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "mine.dbc").write_text(text)
    return load_configuration(None, tmp_path / "mine.dbc")


def test_outputs_take_ids_and_cycles_of_the_users_database(tmp_path):
    config = with_dbc(
        tmp_path,
        (" 513 ", " 1537 "),
        ('BA_ "GenMsgCycleTime" BO_ 1537 20;', 'BA_ "GenMsgCycleTime" BO_ 1537 50;'),
    )
    rows = []
    core = ServiceCore(config, FixedEstimator, on_setpoint=lambda t, _: rows.append(t))
    sent = run(core, Bench().drive(0, 500_001))
    stamps = [f.t_us for f in sent if f.arbitration_id == 0x601]
    assert stamps == rows == list(range(0, 500_001, 50_000))
    assert not [f for f in sent if f.arbitration_id == 0x201]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('BA_ "GenMsgCycleTime" BO_ 513 20;', "", "AdhesionSetpoint: its cycle is unknown"),
        (" LambdaM ", " LambdaOpt ", "AdhesionSetpoint: no signal LambdaM"),
        (" MuMaxStd ", " MuStd ", "AdhesionQuality: no signal MuMaxStd"),
        ("BO_ 513 20;", "BO_ 513 -20;", "AdhesionSetpoint: its cycle is unknown"),
        ("MuMax : 16|16@1+ (2E-005,0)", "MuMax : 16|16@1+ (0,0)", "MuMax has the factor 0"),
        ("MuMax : 16|16@1+", "MuMax : 16|7@1+", "MuMax cannot say 'not available'"),
        ("Setpoint : 48|16@1+", "Setpoint : 56|16@1+", "Setpoint: reaches beyond the 8 bytes"),
        ("AdhesionSetpoint: 8", "AdhesionSetpoint: 1", "no room for checksum and counter"),
        ("MuMax : 16|16@1+", "MuMax : 8|16@1+", "MuMax overlaps the checksum or counter"),
        ("MuMax : 16|16@1+", "MuMax : 8|16@0+", "MuMax overlaps the checksum or counter"),
        ("LambdaM : 32|16@1+", "LambdaM : 40|16@1+", "LambdaM and CreepSpeedSetpoint share"),
        ("Ax3 m3 : 16|16@1+", "Ax3 m3 : 24|16@1+", "MuMax_Ax3 and LambdaM_Ax3 share bits"),
        ("Status : 12|4@1+", "Status : 12|2@1+", "Status cannot carry 4"),
        ("Axle M : 12|4@1+", "Axle M : 12|2@1+", "Axle cannot carry 4"),
        (
            "_Ax1 m1 : 16|",
            "_Ax1 m9 : 16|",
            "Ax1 is multiplexed differently.*write SG_ MuMax_Ax1 m1$",
        ),
        ("_Ax1 m1 : 16|", "_Ax1 : 16|", "MuMax_Ax1 is multiplexed differently from the one"),
        (" Status : 12|4", " Status M : 12|4", "Status is multiplexed.*write SG_ Status$"),
        (
            "Alive : 8|4@1+",
            "Alive : 60|4@1+",
            "Alive has another position than the one that is sent; start it at bit 8",
        ),
        (
            "Crc : 0|8@1+ (1,0)",
            "Crc : 0|8@1+ (2,0)",
            "Crc has another position than the one that is sent; start it at bit 0",
        ),
        (
            "Crc : 0|8@1+ (1,0)",
            "Crc : 0|8@1- (1,0)",
            "Crc has another position than the one that is sent",
        ),
    ],
)
def test_output_messages_that_lack_something_are_refused(tmp_path, old, new, words):
    with pytest.raises(InputError, match=words):
        ServiceCore(with_dbc(tmp_path, (old, new)), FixedEstimator)


DOUBT_LINE = ' SG_ Doubt : 12|4@1+ (1,0) [0|15] "-" DRIVE,LOCO\n'
DOUBTFUL = replace(KNOWN, doubt=Doubt.SPEED, objection=Objection.SPEED_JUMP)


def without_signal(name, number):
    """Changes that take a signal out of the packaged database."""
    own = (f" SG_ {name} ", f" {number} {name} ")
    lines = DBC.read_text().splitlines(keepends=True)
    return ((line, "") for line in lines if any(text in line for text in own))


@pytest.mark.parametrize(
    ("name", "number"), [("Doubt", 0x203), ("Objection", 0x202)], ids=["doubt", "objection"]
)
def test_a_database_from_before_a_signal_keeps_working_with_its_bits_zero(tmp_path, name, number):
    config = with_dbc(tmp_path, *without_signal(name, number))
    old, new = ServiceCore(config, lambda: FixedEstimator(DOUBTFUL)), core_with(DOUBTFUL)[0]
    frames = list(Bench().drive(0, 500_001))
    by_old, by_new = run(old, frames), run(new, frames)
    assert len(by_old) == len(by_new)
    for one, other in zip(by_old, by_new, strict=True):
        if one.arbitration_id == number:
            assert seal_ok(one)
            assert (one.data[1] >> 4, one.data[2:]) == (0, other.data[2:])
        else:
            assert one == other
    assert doubt(by_new) == "speed"
    assert str(last(by_new, 0x202)["Objection"]) == "speed jump"


@pytest.mark.parametrize(
    ("layout", "works"),
    [
        ("12|4@1+ (1,0)", True),
        ("15|4@0+ (1,0)", True),  # the same bits in Motorola's order
        ("12|3@1+ (1,0)", False),
        ("12|4@1- (1,0)", False),
        ("12|4@1+ (1,1)", False),
        ("12|4@1+ (2,0)", False),
    ],
)
def test_a_doubt_of_the_users_own_must_carry_every_number(tmp_path, layout, works):
    config = with_dbc(tmp_path, (DOUBT_LINE, DOUBT_LINE.replace("12|4@1+ (1,0)", layout)))
    make = lambda: FixedEstimator(replace(KNOWN, doubt=Doubt.SURROUNDINGS))  # noqa: E731
    if works:
        sent = run(ServiceCore(config, make), Bench().drive(0, 200_000))
        assert doubt(sent) == "surroundings"
    else:
        with pytest.raises(InputError, match="AdhesionQuality: its signal Doubt cannot carry"):
            ServiceCore(config, make)


def test_a_database_without_outputs_gets_ours_unless_an_input_has_their_id(tmp_path):
    names = ("AdhesionSetpoint", "Setpoint")
    core = ServiceCore(with_dbc(tmp_path, names), FixedEstimator)
    assert (0x201, False) in core.messages.ids
    clash = with_dbc(tmp_path, names, (" 529 ", " 530 "), (" 257 ", " 529 "))
    with pytest.raises(InputError, match="has the id 0x211 of our own ServiceStatus"):
        ServiceCore(clash, FixedEstimator)
