"""A core that changes its model while it runs: when it may, and always to the same bytes."""

from dataclasses import replace
from functools import cache

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.api.simulation import simulate
from adhesion_can.bus.frame import Frame
from adhesion_can.config import load_configuration
from adhesion_can.errors import ConfigError
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.effects import ActiveEffect, effect_by_id
from adhesion_can.physics.readings import Reading, Role, SpeedSource
from adhesion_can.physics.status import Status
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.correcting_core import WARM_US, CorrectingCore
from adhesion_can.service.model_changes import ModelChange
from tests.service.test_model_changes import model_of
from tests.wire import decoded

CONFIG = load_configuration()


@cache
def drive():
    """Frames of a drive whose vehicle speed reads 1 % low."""
    return tuple(simulate("wet", 6.0, seed=3, effects={"speed_scale": -0.01}).frames)


def start_us():
    return drive()[0].t_us


def play(core, frames=None, *, ahead=False):
    """What a core sends; `ahead` does the work that it may do before its due times."""
    sent = []
    for frame in drive() if frames is None else frames:
        while ahead and core.has_work_ahead and core.work_ahead():
            pass
        sent += core.feed(frame)
    return sent


class Noted:
    """A core that notes its statuses and which models took over."""

    def __init__(self, *changes, frames=None, configuration=CONFIG):
        self.statuses, self.taken = {}, []
        begin = (frames or drive())[0].t_us
        self.core = CorrectingCore(
            configuration,
            [ModelChange(begin + round(1e6 * at_s), model) for at_s, model in changes],
            lambda t_us, model: self.taken.append(((t_us - begin) / 1e6, model)),
            on_setpoint=lambda t_us, outputs: self.statuses.update(
                {(t_us - begin) / 1e6: outputs.status}
            ),
        )
        self.sent = play(self.core, frames)


@pytest.mark.costly
def test_without_a_change_it_is_the_core():
    assert play(CorrectingCore(CONFIG), ahead=True) == play(ServiceCore(CONFIG))


@pytest.mark.costly
def test_a_model_takes_over_after_its_time_and_stays():
    model = model_of(-0.01)
    noted = Noted((3.0, model))
    ((at_s, taken),) = noted.taken
    assert at_s >= 3.0
    assert taken is model is noted.core.model
    assert noted.core.model_beside is None
    before = play(ServiceCore(CONFIG), [f for f in drive() if f.t_us < start_us() + 3_000_000])
    assert noted.sent[: len(before)] == before
    assert noted.sent != play(ServiceCore(CONFIG))


@pytest.mark.costly
@settings(max_examples=2, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 5_900_000), st.sampled_from([None, -0.01, 0.004])), max_size=3
    )
)
def test_the_same_changes_give_the_same_bytes_however_it_is_driven(changes):
    known = [
        ModelChange(start_us() + at_us, None if size is None else model_of(size))
        for at_us, size in changes
    ]
    reference = play(CorrectingCore(CONFIG, known))
    assert play(CorrectingCore(CONFIG, known), ahead=True) == reference
    late = CorrectingCore(CONFIG)
    sent, waiting = [], sorted(known, key=lambda one: one.t_us)
    for frame in drive():
        # As they come live: shortly before, at a time that the core gives.
        while waiting and waiting[0].t_us <= max(late.next_change_us(), frame.t_us):
            late.change_model(waiting.pop(0))
        sent += late.feed(frame)
    assert sent == reference


@pytest.mark.costly
def test_the_plain_estimator_comes_back_at_once_and_vouches_for_nothing():
    noted = Noted((4.0, None), configuration=replace(CONFIG, model=model_of(-0.01)))
    assert noted.taken == [(4.0, None)]
    assert noted.statuses[3.98] is Status.TRACKING
    fresh = [status for t_s, status in noted.statuses.items() if 4.0 <= t_s < 4.1]
    assert Status.TRACKING not in fresh
    assert noted.core.model is None


@pytest.mark.costly
def test_a_known_model_waits_until_the_drive_does_not_feel_it():
    """A model that moves the peak by many standard deviations does not replace a known one."""
    far = model_of(0.05, variance=1e-10)
    noted = Noted((4.0, far))
    assert noted.statuses[3.98] is Status.TRACKING
    if noted.taken:
        ((at_s, _),) = noted.taken
        assert noted.statuses[round(at_s - 0.02, 3)] is not Status.TRACKING
    else:
        assert noted.core.model_beside is far


def test_beside_one_that_vouches_for_nothing_it_takes_over_when_it_is_warm():
    """At a constant low effort neither knows the peak."""
    frames = simulate("dry", 1.0, seed=1).frames
    still = [frame for frame in frames if frame.t_us - frames[0].t_us < 200_000]
    core = CorrectingCore(CONFIG, [ModelChange(still[-1].t_us, model_of())])
    play(core, still)
    seconds = []
    core._on_model = lambda t_us, _: seconds.append((t_us - still[-1].t_us) / 1e6)
    t_us = still[-1].t_us
    while not seconds and t_us < still[-1].t_us + 2 * WARM_US:
        t_us += 20_000
        core.advance(t_us)
    assert seconds == [pytest.approx(WARM_US / 1e6, abs=0.05)]


def test_after_a_hole_the_model_takes_over():
    frames = drive()
    cut = [f for f in frames if f.t_us < start_us() + 4_000_000]
    far = model_of(0.05, variance=1e-10)
    core = CorrectingCore(CONFIG, [ModelChange(start_us() + 3_900_000, far)])
    play(core, cut)
    assert core.model_beside is far
    hole_us = round(core.restart_us) + 1_000_000
    core.feed(cut[0]._replace(t_us=cut[-1].t_us + hole_us))
    assert core.model is far
    assert core.model_beside is None


def test_rejected_frames_are_counted_on():
    """Frames that are damaged after another model has taken over are in the status message."""
    noted = Noted((3.0, model_of(-0.01)))
    (at_s, _), *_ = noted.taken
    last = drive()[-1]
    damaged = last._replace(data=bytes([last.data[0] ^ 0xFF]) + last.data[1:])
    later = [damaged._replace(t_us=last.t_us + 1000 * n) for n in range(5)]
    sent = play(noted.core, later) + noted.core.advance(last.t_us + 1_100_000)
    status = [decoded(frame) for frame in sent if frame.arbitration_id == 0x211][-1]
    assert at_s < 6.0
    assert status["FramesRejected"] == noted.core.receiver.rejected >= 5


def test_a_model_that_needs_what_is_not_there_is_refused():
    effect = ActiveEffect(effect_by_id("rail_temperature"), (0.001,))
    needy = ExtendedModel((0.3, 60.0, 0.3), effects=(effect,), covariances=(None,))
    blind = tuple(one for one in CONFIG.choices if one.role is not Role.RAIL_TEMPERATURE)
    core = CorrectingCore(replace(CONFIG, choices=blind))
    with pytest.raises(ConfigError, match="role"):
        core.change_model(ModelChange(0, needy))
    assert isinstance(core.feed(Frame(0, 0x7FF, b"")), list)


@pytest.mark.costly
def test_a_model_that_is_in_use_is_not_begun_again():
    model = model_of(-0.01)
    config = replace(CONFIG, model=model)
    noted = Noted((3.0, model), configuration=config)
    assert noted.taken == []
    assert noted.sent == play(ServiceCore(config))


@pytest.mark.costly
@pytest.mark.parametrize("model", [None, model_of(-0.01)])
def test_fault_is_held_for_its_whole_time_whichever_model_is_in_use(model):
    """A second sender, 0.2 s before a change and after it; the drive would be in TRACKING."""
    start = replace(CONFIG, model=model_of(0.004) if model is None else None)
    for fault_s in (2.9, 3.05):
        seen = {}
        core = CorrectingCore(
            start,
            [ModelChange(start_us() + 3_000_000, model)],
            on_setpoint=lambda t_us, outputs, seen=seen: seen.update({t_us: outputs.status}),
        )
        fault_us = start_us() + round(1e6 * fault_s)
        play(core, [frame for frame in drive() if frame.t_us < fault_us])
        core.second_sender(fault_us)
        play(core, [frame for frame in drive() if frame.t_us >= fault_us])
        held = {status for t_us, status in seen.items() if fault_us < t_us < fault_us + 1_000_000}
        assert held == {Status.FAULT}
        assert core.model == model
        later = [status for t_us, status in seen.items() if t_us > fault_us + 2_000_000]
        assert Status.FAULT not in later


@pytest.mark.costly
@pytest.mark.parametrize(
    "changes", [[(3.0, model_of(-0.01))], [(0.5, model_of(-0.01)), (3.0, None)]]
)
def test_a_source_of_the_speed_that_was_said_once_holds_with_another_model(changes):
    """Where it says that driven axles show the speed, nothing is ever TRACKING."""
    begin, statuses = start_us(), []
    core = CorrectingCore(
        CONFIG,
        [ModelChange(begin + round(1e6 * at_s), model) for at_s, model in changes],
        on_setpoint=lambda _, outputs: statuses.append(outputs.status),
    )
    accept, said = core.receiver.accept, []

    def once(frame):
        found = accept(frame)
        if not isinstance(found, list) or all(one.role is not Role.SPEED_SOURCE for one in found):
            return found
        kept = [one for one in found if one.role is not Role.SPEED_SOURCE]
        if not said:
            said.append(Reading(frame.t_us, Role.SPEED_SOURCE, 0, SpeedSource.DRIVEN_AXLES))
            kept += said
        return kept

    core.receiver.accept = once
    play(core)
    assert core.speed_derived
    assert Status.TRACKING not in statuses
    assert Status.LOW_EXCITATION in statuses
