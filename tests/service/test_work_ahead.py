"""Work done ahead of a due time changes nothing that is sent."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.protected_message import ProtectedMessage
from adhesion_can.config import load_configuration
from adhesion_can.estimation.registry import ESTIMATORS
from adhesion_can.physics.samples import Samples
from adhesion_can.recordings.candump import ReadReport
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.early_start import EarlyStart
from adhesion_can.service.estimation_loop import EstimationLoop, EstimatorFailure
from adhesion_can.service.inputs import FrameInputs
from adhesion_can.service.output_messages import SETPOINT
from adhesion_can.service.replay import replay
from adhesion_can.simulation.scenarios import SCENARIOS
from tests.service.test_column_replay import (
    SummingEstimator,
    run_core,
    simulated,
    spoiled,
    without_strays,
)
from tests.wire import CYCLES_MS, DBC, REQUIRED, Bench

CONFIG = load_configuration()


def with_work_ahead(items, core, rng, share, done):
    """The items, with work ahead after some of them, as a loop does that has nothing to do."""
    for item in items:
        yield item
        while rng.random() < share and core.work_ahead():
            done.append(core.now_us)


def run_both(items, make, seed=0, share=0.5):
    """Everything seen of a core that works ahead, and of one that does not; times of such work."""
    rng, done = np.random.default_rng(seed), []

    def ahead(core, *rest, **how):
        return replay(with_work_ahead(items, core, rng, share, done), core, *rest, **how)

    one, *a = run_core(lambda *x, **h: replay(items, *x, **h), CONFIG, make)
    other, *b = run_core(ahead, CONFIG, make)
    assert b[0] == a[0]
    assert b[1] == a[1]
    assert [len(samples) for samples in b[2]] == [len(samples) for samples in a[2]]
    assert other.counts == one.counts
    assert other.faults == one.faults
    assert other.dropped_samples == one.dropped_samples
    return done


@pytest.mark.costly
@settings(max_examples=5, derandomize=True, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0.1, 0.5, 0.95]))
def test_spoiled_drives_give_the_same_frames(seed, share):
    """Lost, late and repeated frames: what was done ahead is often in vain."""
    items = list(without_strays(spoiled(seed), ReadReport()))
    run_both(items, SummingEstimator, seed, share)


@pytest.mark.costly
@pytest.mark.parametrize("name", ["tracker", "rls", "ekf", "bank", "window"])
def test_every_estimator_gives_the_same_frames(name):
    items = simulated(SCENARIOS[2], 4.0)
    done = run_both(items, lambda: ESTIMATORS[name](CONFIG.estimators), share=0.9)
    assert len(done) > 100


@pytest.mark.costly
def test_the_default_estimator_gives_the_same_frames():
    assert len(run_both(simulated(SCENARIOS[3], 6.0), None, share=0.9)) > 100


class Counting(SummingEstimator):
    """Counts updates of all of its kind."""

    updated: list[int]

    def update(self, samples, now_us):
        self.updated.append(now_us)
        return super().update(samples, now_us)


def counting_core():
    class Own(Counting):
        updated: list[int] = []  # noqa: RUF012  one list for the estimator and its copies

    return ServiceCore(CONFIG, Own), Own.updated


def test_nothing_is_updated_at_a_due_time_that_was_prepared_for():
    core, updated = counting_core()
    # The optional messages of 200 ms are not waited for any more after 300 ms.
    settled_us = 400_000
    for frame in Bench().drive(0, 800_000):
        if core.next_due_us is not None and frame.t_us >= core.next_due_us:
            while core.work_ahead():
                pass
            before = len(updated)
            core.advance(core.next_due_us)
            if frame.t_us > settled_us:
                assert len(updated) == before
        core.feed(frame)
    assert len(updated) >= 40


def test_the_setpoint_is_not_composed_at_a_due_time_that_was_prepared_for(monkeypatch):
    core, _ = counting_core()
    drafted, draft = [], ProtectedMessage.draft

    def count(self, t_us, values):
        drafted.append(self.plan.name)
        return draft(self, t_us, values)

    monkeypatch.setattr(ProtectedMessage, "draft", count)
    prepared = 0
    for frame in Bench().drive(0, 800_000):
        if core.next_due_us is not None and frame.t_us >= core.next_due_us:
            while core.work_ahead():
                pass
            drafted.clear()
            sent = core.advance(core.next_due_us)
            # INIT has no numbers, and the first status after it is not the expected one.
            if frame.t_us > 600_000:
                assert SETPOINT not in drafted
                assert core.messages.ids_by_name[SETPOINT] in [one.arbitration_id for one in sent]
                prepared += 1
        core.feed(frame)
    assert prepared >= 8


def ready_core():
    """A core that has the setpoint of its next due time ready, and its bench."""
    core, _ = counting_core()
    bench = Bench()
    for frame in bench.drive(0, 700_000):
        core.feed(frame)
        if core.work_ahead() and frame.t_us > 600_000:
            return core, bench, core.next_due_us
    raise AssertionError("nothing was ready")


def without_inputs(core, monkeypatch):
    """No input can be read any more."""
    monkeypatch.setattr(FrameInputs, "snapshot", None)
    return core


def test_the_setpoint_goes_out_before_anything_is_computed(monkeypatch):
    core, _, due_us = ready_core()
    frames = without_inputs(core, monkeypatch).due_frames(due_us)
    assert next(frames).arbitration_id == core.messages.ids_by_name[SETPOINT]
    with pytest.raises(TypeError):
        next(frames)


def test_a_setpoint_that_was_ready_is_sent_once():
    core, _, due_us = ready_core()
    sent = [one.arbitration_id for one in core.advance(due_us)]
    assert sent.count(core.messages.ids_by_name[SETPOINT]) == 1


def feed_reading(core, bench, due_us):
    core.feed(bench.steady("VehicleSpeed", due_us - 1))


def feed_rejected(core, bench, due_us):
    core.feed(bench.steady("VehicleSpeed", due_us - 1)._replace(data=bytes(8)))


def second_sender(core, _, due_us):
    core.second_sender(due_us - 1)


def stop(core, _, due_us):
    core.stop(due_us - 1)


def restart(core, *_):
    core.restart()


@pytest.mark.parametrize(
    ("happens", "serves"),
    [
        (feed_rejected, True),
        (feed_reading, False),
        (second_sender, False),
        (stop, None),
        (restart, None),
    ],
)
def test_a_setpoint_that_is_ready_serves_if_nothing_came(monkeypatch, happens, serves):
    core, bench, due_us = ready_core()
    happens(core, bench, due_us)
    frames = without_inputs(core, monkeypatch).due_frames(due_us)
    if serves is None:
        assert list(frames) == []
    elif serves:
        assert next(frames).arbitration_id == core.messages.ids_by_name[SETPOINT]
    else:
        with pytest.raises(TypeError):
            next(frames)


def test_a_setpoint_that_is_ready_waits_for_its_due_time(monkeypatch):
    core, _, due_us = ready_core()
    assert core.advance(due_us - 1) == []
    assert next(without_inputs(core, monkeypatch).due_frames(due_us)).t_us == due_us


def test_between_its_due_times_no_setpoint_is_sent(tmp_path):
    """A user's database may send that of all axles less often than those of each."""
    text = DBC.read_text()
    cycle = 'BA_ "GenMsgCycleTime" BO_ 513 20;'
    assert cycle in text
    (tmp_path / "mine.dbc").write_text(text.replace(cycle, cycle.replace("20", "100")))
    config = load_configuration(dbc=tmp_path / "mine.dbc")
    seen = []
    for is_ahead in (False, True):
        core = ServiceCore(config, SummingEstimator)
        sent = []
        for frame in Bench().drive(0, 900_000):
            sent += core.feed(frame)
            while is_ahead and core.work_ahead():
                pass
        seen.append(sent)
    assert seen[0] == seen[1]


COMPLETING = ("VehicleSpeed", "WheelSpeeds1", "TractiveEffort1")


@pytest.mark.parametrize(("names", "times"), [(COMPLETING, 1), (["AxleLoads1"], 0)])
def test_an_update_is_made_anew_where_unexpected_readings_complete_a_sample(names, times):
    core, updated = counting_core()
    bench, tried = Bench(), 0
    for frame in bench.drive(0, 900_000):
        core.feed(frame)
        if core.work_ahead() and frame.t_us > 400_000:
            due_us, before = core.next_due_us, len(updated)
            for name in names:
                core.feed(bench.steady(name, due_us - 1))
            assert core.work_ahead()
            assert updated[before:] == [due_us] * times
            core.advance(due_us)
            assert updated[before:] == [due_us] * times
            tried += 1
    assert tried > 10


def around_due_times(bench, name, offset_us, rng):
    """A drive of four seconds in which a message comes around the due times, or shortly before."""
    others = [one for one in REQUIRED if one != name]
    frames = [bench.steady(name, 0), *bench.drive(3_000, 4_000_000, others)]
    cycle_us = CYCLES_MS[name] * 1000
    for t_us in range(cycle_us, 4_000_000, cycle_us):
        jitter = int(rng.integers(-150, 150))
        frames.append(bench.steady(name, t_us + offset_us + jitter))
    # Each message with its counters in order, as its sender sends it.
    return sorted(frames, key=lambda frame: frame.t_us)


def updates_of(frames):
    """Updates made at due times, and in all, by a core that works ahead whenever it can."""
    core, updated = counting_core()
    at_due = 0
    for frame in frames:
        if core.next_due_us is not None and frame.t_us >= core.next_due_us:
            before = len(updated)
            core.advance(core.next_due_us)
            # An optional message that was never sent is not waited for after 1.5 of its cycles.
            if frame.t_us > 1_600_000:
                at_due += len(updated) - before
        core.feed(frame)
        while core.work_ahead():
            pass
    return at_due, len(updated)


def test_a_message_around_the_due_times_is_not_waited_for():
    rng = np.random.default_rng(5)
    at_due, in_all = updates_of(around_due_times(Bench(), "WheelSpeeds1", 0, rng))
    assert at_due == 0
    assert in_all <= 210


def test_a_message_that_completes_samples_before_the_due_times_is_waited_for():
    rng = np.random.default_rng(6)
    at_due, in_all = updates_of(around_due_times(Bench(), "VehicleSpeed", -1_000, rng))
    assert at_due == 0
    # Tried without it after 1, 3, 7, .. due times.
    assert in_all <= 215


def test_what_was_in_vain_is_tried_more_and_more_seldom():
    early, tried = EarlyStart(), []
    for number in range(300):
        if early.allows(number):
            early.begin(number)
            assert not early.allows(number)
            tried.append(number)
        early.end(number, served=number > 280)
    assert tried == [0, 2, 6, 14, 30, 62, 126, 190, 254]


def test_what_served_is_tried_at_each_due_time():
    early = EarlyStart()
    for number in range(20):
        assert early.allows(number)
        early.begin(number)
        early.end(number, served=number != 10)
        if number == 10:
            assert not early.allows(11)
            early.end(11, served=False)
            break
    assert early.allows(12)


def test_before_the_first_input_there_is_nothing_to_do():
    assert not ServiceCore(CONFIG).work_ahead()


class WithGenerator(SummingEstimator):
    """Holds what cannot be copied."""

    def __init__(self):
        super().__init__()
        self.numbers = (number for number in range(3))


def test_an_estimator_that_cannot_be_copied_is_updated_at_its_due_times():
    items = list(Bench().drive(0, 600_000))
    assert run_both(items, WithGenerator, share=1.0 - 1e-9) == []


def test_a_failure_ahead_keeps_its_cause():
    class Failing:
        def update(self, samples, now_us):
            raise ValueError("no curve")

    loop = EstimationLoop(Failing)
    samples = Samples.from_rows([])
    loop.prepare(samples, 20_000)
    with pytest.raises(EstimatorFailure, match="no curve") as failure:
        loop.update(samples, 20_000)
    assert isinstance(failure.value.__cause__, ValueError)
