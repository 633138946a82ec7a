"""Clocks that step, drift, jump and stand still: stamps come to this host's time all the same."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.frame import to_us
from adhesion_can.config import load_configuration
from adhesion_can.recordings.python_can_messages import from_message, to_message
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.live import LiveService
from adhesion_can.service.reconnecting_bus import ReconnectingBus
from adhesion_can.service.stamp_clock import FRAMES, STEP_US, TOLERANCE_US, StampClock
from tests.service.test_core import FixedEstimator
from tests.wire import Bench, decoded

CONFIG = load_configuration()
CYCLE_US = 2_300


def arrivals(rng, frames):
    """True times of frames and those of their receipt, µs; now and then this host is late."""
    sent = np.arange(frames) * CYCLE_US + rng.integers(0, 500, frames)
    late = rng.integers(30, 300, frames) + np.where(rng.random(frames) < 0.02, 8_000, 0)
    return sent, sent + late


def mapped(stamps, received, **options):
    clock = StampClock(**options)
    pairs = zip(stamps, received, strict=True)
    return clock, np.array(
        [clock.to_host(int(s), int(r), int(r) - CYCLE_US, awaited=True) for s, r in pairs]
    )


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    offset_us=st.integers(-(10**15), 10**15),
    step_us=st.integers(-(10**10), 10**10).filter(lambda step: abs(step) > 2 * STEP_US),
)
def test_a_step_is_over_after_a_few_frames(seed, offset_us, step_us):
    sent, received = arrivals(np.random.default_rng(seed), 400)
    stamps = sent + offset_us + np.where(np.arange(400) >= 200, step_us, 0)
    notices = []
    clock, times = mapped(stamps, received, notify=notices.append)
    assert (times <= received).all()
    error = times - sent
    settled = np.r_[2 * FRAMES : 200, 200 + 3 * FRAMES : 400]
    # A first frame of which this host was late, or the way through the driver.
    assert np.abs(error[settled]).max() <= TOLERANCE_US + 8_500
    assert np.median(np.abs(error[settled])) <= TOLERANCE_US + 500
    assert clock.steps == 1
    assert sum("clock was set" in line for line in notices) == 1


def test_stamps_of_the_wall_clock_stay_as_they_are():
    sent, received = arrivals(np.random.default_rng(1), 2000)
    clock, times = mapped(sent, received)
    assert (times == sent).all()
    assert clock.offset_us == clock.steps == 0


@pytest.mark.parametrize("rate", [500e-6, -500e-6])
def test_a_clock_that_is_set_slowly_is_followed_without_a_step(rate):
    sent, received = arrivals(np.random.default_rng(2), 40_000)
    clock, times = mapped(sent + np.round(rate * sent), received)
    assert np.abs(times - sent).max() <= TOLERANCE_US + 500
    assert clock.steps == 0
    assert clock.usable


@pytest.mark.parametrize("wrong", [5_000_000, -5_000_000])
def test_one_wrong_stamp_moves_nothing(wrong):
    sent, received = arrivals(np.random.default_rng(3), 400)
    stamps = sent.copy()
    stamps[200] += wrong
    clock, times = mapped(stamps, received)
    assert (np.delete(times, 200) == np.delete(sent, 200)).all()
    assert times[200] <= received[200]
    assert clock.offset_us == 0


@pytest.mark.parametrize("how", ["stand still", "jump"])
def test_stamps_that_tell_nothing_are_replaced_by_the_arrival(how):
    rng = np.random.default_rng(4)
    sent, received = arrivals(rng, 4000)
    spells = np.repeat(rng.integers(-(10**7), 10**7, 4000 // 20), 20)
    stamps = np.full(4000, 7) if how == "stand still" else sent + spells
    notices = []
    clock, times = mapped(stamps, received, notify=notices.append)
    assert not clock.usable
    assert (times[1000:] == received[1000:]).all()
    assert sum("using arrival times" in line for line in notices) == 1


def test_frames_that_waited_in_a_queue_say_nothing_of_the_clock():
    """After three seconds in which this process was stopped, frames have their own times."""
    sent, _ = arrivals(np.random.default_rng(5), 1300)
    first, *waited = map(int, sent)
    clock = StampClock()
    assert clock.to_host(first, first, first, awaited=True) == first
    times = [clock.to_host(one, waited[-1], first, awaited=False) for one in waited]
    assert times == waited


def test_in_a_flood_a_clock_that_was_set_back_is_told_by_what_is_too_old():
    """Nothing is waited for, and yet nothing waits for longer than some frames."""
    sent, _ = arrivals(np.random.default_rng(6), 400)
    clock = StampClock()
    times = []
    for number, one in enumerate(map(int, sent)):
        set_us = -3_000_000 if number >= 200 else 0
        times.append(clock.to_host(one + set_us, one + 300, one - 5_000, awaited=False))
    error = np.array(times) - sent
    assert (error[:200] == 0).all()
    assert np.abs(error[200:]).max() <= 5_000 + STEP_US
    assert np.abs(error[200 + FRAMES :]).max() <= 5_000 + TOLERANCE_US
    assert clock.steps == 1


class SetBus:
    """Frames of a drive at their times; the clock that stamps them is set at one of these."""

    channel_info = "set"

    def __init__(self, frames, set_at_us, by_us):
        self.frames, self.set_at_us, self.by_us = list(frames), set_at_us, by_us
        self.now_us = 0
        self.sent = []

    def clock(self):
        return self.now_us

    def recv(self, timeout):
        latest_us = self.now_us + round((timeout or 0.0) * 1e6)
        if not self.frames or self.frames[0].t_us > latest_us:
            self.now_us = latest_us
            return None
        frame = self.frames.pop(0)
        self.now_us = max(self.now_us, frame.t_us)
        late_us = self.by_us if frame.t_us >= self.set_at_us else 0
        return to_message(frame._replace(t_us=frame.t_us + late_us))

    def send(self, message, timeout=None):
        self.sent.append((self.now_us, to_us(message.timestamp), message))

    def set_filters(self, filters):
        pass

    def shutdown(self):
        pass


@pytest.mark.parametrize("by_s", [-3.0, 2.0, -3600.0, 3600.0])
def test_setpoints_keep_their_cycle_when_the_clock_is_set(by_s):
    start_us = 10_000_000_000
    frames = [f._replace(t_us=f.t_us + start_us) for f in Bench().drive(0, 6_000_000)]
    bus = SetBus(frames, start_us + 3_000_000, round(by_s * 1e6))
    bus.now_us = start_us
    core = ServiceCore(CONFIG, FixedEstimator)
    service = LiveService(core, ReconnectingBus(lambda: bus, ()), clock=bus.clock)
    while bus.frames:
        service._step()
    setpoints = [(at, due, m) for at, due, m in bus.sent if m.arbitration_id == 0x201]
    assert len(setpoints) >= 299
    assert max(at - due for at, due, _ in setpoints) <= 2_500
    assert {later - due for (_, due, _), (_, later, _) in pairwise(setpoints)} == {20_000}
    assert all(15_000 < b - a < 25_000 for (a, _, _), (b, _, _) in pairwise(setpoints))
    statuses = {str(decoded(from_message(m))["Status"]) for _, _, m in setpoints[20:]}
    assert statuses == {"TRACKING"}
    assert service.stamps.steps == 1


@pytest.mark.parametrize("waited_us", [50_000, 900_000])
def test_a_first_frame_that_waited_for_the_service_is_as_old_as_its_stamp_says(waited_us):
    """What passed while the service began is read at once; then frames are awaited."""
    notices = []
    clock = StampClock(notices.append)
    sent = np.arange(400) * CYCLE_US
    received = np.maximum(sent + 100, waited_us + 40 * np.arange(400))
    times = [
        clock.to_host(int(s), int(r), 0, awaited=bool(r == s + 100))
        for s, r in zip(sent, received, strict=True)
    ]
    assert times == sent.tolist()
    assert notices == []
    assert clock.steps == 0


def test_a_first_frame_of_a_clock_that_is_a_little_behind_is_corrected_by_those_awaited():
    clock = StampClock()
    sent = np.arange(100) * CYCLE_US
    stamps = sent - 400_000
    times = [
        clock.to_host(int(s), int(t) + 100, int(t) - CYCLE_US, awaited=k > 3)
        for k, (s, t) in enumerate(zip(stamps, sent, strict=True))
    ]
    assert np.abs(np.array(times[4 + 2 * FRAMES :]) - sent[4 + 2 * FRAMES :]).max() <= TOLERANCE_US
