"""Reliefs: their order and times, what the others take over, and what they show a filter."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.control.creep_controller import CreepController, Mode
from adhesion_can.control.reliefs import Reliefs, spread_effort
from adhesion_can.control.settings import ControlSettings, ReliefSettings
from adhesion_can.estimation.observed_speed.filter import ObservedSpeedFilter
from adhesion_can.physics.status import Status
from adhesion_can.physics.vehicle import Locomotive
from tests.control.driving import DRY, STEEP, constant, drive
from tests.control.test_creep_controller import DRY_PEAK, DRY_THETA, advice_for
from tests.seeds import first_quick
from tests.worlds.without_radar import STEP_S, Driving, Trains

ON = ReliefSettings(enabled=True)
LASTS_S = ON.free_s + 2 * ON.ramp_s
EFFORT = np.full(6, 50e3)


def play(reliefs, seconds, event=lambda _: (False, False, True), effort=EFFORT):
    """Rows of shares, and begins of reliefs as (time, axle)."""
    shares, begins, before = [], [], None
    for cycle in range(round(seconds / 0.01)):
        asked, changing, allowed = event(cycle * 0.01)
        shares.append(
            reliefs.step(cycle * 0.01, effort, asked=asked, changing=changing, allowed=allowed)
        )
        if reliefs.axle is not None and before is None:
            begins.append((cycle * 0.01, reliefs.axle))
        before = reliefs.axle
    return np.array(shares), begins


@pytest.mark.costly
@given(st.integers(0, 2**31), st.integers(2, 8))
def test_whatever_asks_never_two_axles_at_once_and_each_has_its_turn(seed, axles):
    rng = np.random.default_rng(seed)
    asks, changes, bars = rng.random((3, 200)) < rng.random((3, 1)) * [[0.3], [0.2], [0.9]]

    def event(time_s):
        second = int(time_s)
        # Excursions and other modes bar reliefs for some seconds, and not for ever.
        return asks[second], changes[second], not (bars[second] and second % 4)

    shares, begins = play(Reliefs(ON, axles), 200.0, event, np.full(axles, 50e3))
    assert ((shares < 1.0).sum(axis=1) <= 1).all()
    assert (np.abs(np.diff(shares, axis=0)) <= 0.01 / ON.ramp_s + 1e-9).all()
    for axle in range(1, axles + 1):
        own = [0.0, *(t for t, who in begins if who == axle)]
        # A period after the last relief, and at most three seconds in which none may begin.
        assert np.diff([*own, 200.0]).max() <= axles * (ON.period_s + LASTS_S + 3.02)
    assert all(b - a >= LASTS_S + ON.pause_s - 1e-6 for (a, _), (b, _) in pairwise(begins))
    order = [who for _, who in begins]
    assert all(len(set(order[k : k + axles])) == axles for k in range(len(order) - axles + 1))


def test_a_relief_lasts_as_long_as_the_filter_needs():
    shares, begins = play(Reliefs(ON, 6), 25.0)
    assert [axle for _, axle in begins] == [1]
    free_s = (shares[:, 0] < 1e-9).sum() * 0.01
    assert free_s == pytest.approx(ON.free_s, abs=0.02)


@pytest.mark.parametrize(("asked", "changing", "at_s"), [(True, False, 5.0), (False, True, 6.0)])
def test_the_filter_and_a_change_of_the_surface_call_a_relief_at_once(asked, changing, at_s):
    def event(time_s):
        now = 5.0 <= time_s < 5.5
        return asked and now, changing and now, True

    _, begins = play(Reliefs(ON, 6), 10.0, event)
    assert begins[0][0] == pytest.approx(at_s, abs=0.02)
    assert len(begins) == 1


def test_an_axle_without_effort_is_passed_over():
    effort = EFFORT * [0, 1, 1, 1, 1, 1]
    _, begins = play(Reliefs(ON, 6), 130.0, effort=effort)
    assert [axle for _, axle in begins] == [3, 5, 2, 4, 6, 3]


def test_reliefs_are_off_by_default():
    shares, begins = play(Reliefs(ControlSettings().reliefs, 6), 60.0, lambda _: (True, True, True))
    assert not begins
    assert (shares == 1.0).all()


@given(st.integers(0, 2**31))
def test_the_effort_is_conserved_as_far_as_adhesion_allows(seed):
    rng = np.random.default_rng(seed)
    largest = rng.uniform(10e3, 100e3, 6)
    effort = largest * rng.uniform(0.2, 1.0, 6)
    shares = np.ones(6)
    shares[rng.integers(6)] = rng.random()
    given = spread_effort(effort, shares, largest)
    relieved = shares < 1.0
    assert (given <= largest + 1e-6).all()
    assert given[relieved] == pytest.approx((effort * shares)[relieved])
    room = (largest - effort)[~relieved].sum()
    lost = (effort * (1.0 - shares)).sum()
    assert given.sum() == pytest.approx(effort.sum() - max(lost - room, 0.0))
    assert (given[~relieved] >= effort[~relieved] - 1e-6).all()


class Spy(CreepController):
    """Keeps what each step did: time, axles that are relieved and on an excursion, demands."""

    def __init__(self, **reliefs):
        settings = replace(ControlSettings(), reliefs=replace(ON, **reliefs))
        super().__init__(Locomotive(geometry=None), settings)
        self.seen = []

    def step(self, measured, advice):
        effort = super().step(measured, advice)
        self.seen.append((measured.time_s, self.relieved, self.excursion, effort.copy(), self.mode))
        return effort


@pytest.mark.costly
@pytest.mark.parametrize("trusted", first_quick([True, False]), ids=["hold", "search"])
def test_the_controller_relieves_axles_between_excursions_at_a_small_cost(trusted):
    advice = advice_for(DRY_THETA, DRY_PEAK) if trusted else None
    plain, _ = drive(constant(DRY), 25.0, advice=advice)
    spy = Spy(period_s=5.0)
    rows, _ = drive(constant(DRY), 25.0, advice=advice, controller=spy)
    assert {axle for _, axle, *_ in spy.seen if axle} >= {1, 3, 5}
    assert not any(relieved and excursion for _, relieved, excursion, *_ in spy.seen)
    assert spy.seen[-1][4] is (Mode.HOLD if trusted else Mode.SEARCH)
    late = rows[:, 0] > 3.0
    lost = 1.0 - rows[late, 1].mean() / plain[late, 1].mean()
    # An axle of six, 1.05 s of each 6.4 s: 2.7 %.
    assert 0.02 < lost < 0.035
    assert rows[late, 2].max() < 2.0
    for _, relieved, _, effort, _ in spy.seen:
        if relieved:
            assert np.delete(effort, relieved - 1).min() > 0.5 * effort.max()


@pytest.mark.costly
def test_a_change_of_the_surface_calls_a_relief_in_the_controller():
    def advice(time_s):
        status = Status.SURFACE_CHANGE if 10.0 <= time_s < 13.0 else Status.TRACKING
        return replace(advice_for(DRY_THETA, DRY_PEAK)(time_s), status=status)

    spy = Spy(period_s=1000.0)
    drive(lambda t: DRY if t < 10.0 else STEEP, 15.0, advice=advice, controller=spy)
    relieved = [time_s for time_s, axle, *_ in spy.seen if axle]
    assert relieved
    assert 11.0 <= relieved[0] < 12.6


class RelievedTrains(Trains):
    """Trains whose axles are relieved as `Reliefs` says."""

    def __init__(self, seeds, speeds, settings):
        super().__init__(seeds, speeds, Driving())
        self.reliefs = [Reliefs(settings, 6) for _ in seeds]
        self.begun = np.zeros(len(seeds), dtype=int)

    def _steer(self, wanted, peak):
        super()._steer(None, peak)
        asked = np.zeros(self.drives, dtype=bool) if wanted is None else wanted
        for drive_number, reliefs in enumerate(self.reliefs):
            before = reliefs.axle
            shares = reliefs.step(
                self.t, self.demand[drive_number], asked=bool(asked[drive_number]),
                changing=False, allowed=True,
            )  # fmt: skip
            self.begun[drive_number] += before is None and reliefs.axle is not None
            # The axles use less than the rail has, and others take over what one gives up.
            largest = 1.05 * self.demand[drive_number]
            self.demand[drive_number] = spread_effort(self.demand[drive_number], shares, largest)


@pytest.mark.costly
def test_reliefs_make_the_slip_known_on_trains_of_another_model():
    trains = RelievedTrains([401, 403], [20.0, 20.0], ON)
    observer = ObservedSpeedFilter(Locomotive(), None, 2)
    known, wanted = [], None
    for step in range(round(40.0 / STEP_S)):
        seen = trains.step(wanted)
        stated = observer.update(STEP_S, seen.wheel_speed, seen.effort, seen.load)
        if step % 5 == 4:
            wanted = stated.relief_wanted
            known.append(stated.known)
    assert (trains.begun >= 2).all()
    assert np.mean(known[-400:]) > 0.3
