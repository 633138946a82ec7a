"""Samples in front of an estimator get the observed speed, or are left out where it is unknown."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.observed_speed.axle_rows import AxleRows
from adhesion_can.estimation.observed_speed.estimator import ObservedSpeedEstimator
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings
from adhesion_can.estimation.observed_speed.speed_observer import (
    ObservedBlock,
    SpeedObserver,
    with_speed,
)
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.samples import NO_SAMPLES, Sample, Samples
from adhesion_can.physics.vehicle import Locomotive
from tests.estimation.observed_speed.straight_drive import LOAD

CYCLE_US = 10_000
SPEED, SLIP, ADHESION = 15.0, 0.006, 0.12


def row_of(t_us, slips, adhesion=ADHESION, speed=SPEED, reference=1.01):
    """Samples of all axles at a stamp, against a reference speed that is off."""
    adhesion = np.broadcast_to(adhesion, (6,))
    other = reference * speed
    return Samples.from_rows(
        Sample(
            t_us, axle, speed * (1 + slip) / other - 1, float(used),
            speed * (1 + slip) - other, other, LOAD, slip_var=1e-8, speed_us=t_us,
        )
        for axle, (slip, used) in enumerate(zip(slips, adhesion, strict=True), 1)
    )  # fmt: skip


class Kept:
    """An estimator that keeps its samples, and whose estimate numbers them."""

    doubt = Doubt.NONE
    lambda_m = 0.05

    def __init__(self):
        self.parts = [NO_SAMPLES]

    def update(self, samples, now_us):
        self.parts.append(samples)
        count = sum(map(len, self.parts))
        if not count:
            return None
        return Estimate(
            c1=0.4, c2=60.0, c3=0.3, covariance=np.eye(3), mu_max=0.3, mu_max_std=0.001,
            lambda_m=self.lambda_m, lambda_m_std=0.002, noise_std=0.01, samples=count,
            identifiable=Identifiable(mu_max=True, lambda_m=True), surface_since_us=0,
            change_probability=0.9, doubt=self.doubt,
        )  # fmt: skip


class Drive:
    """A drive at a constant speed whose samples go to the estimator; an axle may be relieved."""

    def __init__(self, seed=0, *, gnss=False):
        self.gnss, self.gnss_us = gnss, 0
        self.error = 0.0
        """Error of the speed by satellites, m/s."""
        self.rng = np.random.default_rng(seed)
        self.estimator = ObservedSpeedEstimator(
            Kept, Locomotive(), ObservedSpeedSettings(), CYCLE_US, largest_std=0.3, tests_curve=True
        )
        self.t_us = 0
        self.ramp = np.ones(6)
        self.used = []

    def run(self, duration_s, relieved=None, lost=()):
        for _ in range(round(duration_s * 1e6 / CYCLE_US)):
            goal = np.ones(6)
            if relieved is not None:
                goal[relieved] = 0.0
            self.ramp += np.clip(goal - self.ramp, -0.07, 0.07)
            slips = SLIP * self.ramp**3 + self.rng.normal(0, 1e-4, 6)
            adhesion = ADHESION * self.ramp + self.rng.normal(0, 0.01, 6)
            samples = row_of(self.t_us, slips, adhesion, reference=1 + 0.02 * self.rng.random())
            samples = samples.select(~np.isin(samples.axle, lost))
            if self.gnss and self.t_us % 1_000_000 == 0:
                self.gnss_us, self.seen = self.t_us, SPEED + self.error + self.rng.normal(0, 0.02)
            if self.gnss:
                samples = with_aids(
                    samples, gnss_speed_mps=self.seen, gnss_speed_us=self.gnss_us, other=1.0
                )
            estimate = self.estimator.update(samples, self.t_us + CYCLE_US)
            self.used.append(self.estimator.used)
            self.t_us += CYCLE_US
        return estimate

    def relieve(self, axle):
        self.run(1.0, relieved=axle)
        return self.run(1.0)


@pytest.fixture(scope="module")
def known():
    """A drive whose slips three reliefs have shown."""
    drive = Drive()
    drive.run(2.0)
    for axle in (0, 2, 4):
        estimate = drive.relieve(axle)
    return drive, estimate


def test_without_a_relief_the_estimate_has_an_objection_and_is_not_identifiable():
    drive = Drive()
    estimate = drive.run(2.0)
    assert estimate.objection is Objection.NO_RELIEF
    assert not estimate.identifiable.mu_max
    assert not estimate.identifiable.lambda_m
    assert np.isinf(estimate.lambda_m_std)
    assert estimate.change_probability == 0.0
    assert estimate.samples > 1000


def test_the_first_known_slips_begin_a_new_estimate(known):
    drive, estimate = known
    assert estimate.objection is Objection.NONE
    assert estimate.identifiable.both
    assert estimate.change_probability == 0.9
    # Nothing of the first two seconds is in it.
    assert estimate.samples == sum(len(one) for one in drive.estimator.inner.parts)
    assert drive.estimator.inner.parts[1].t_us[0] > 2_000_000


def test_the_errors_of_the_slips_are_in_the_standard_deviation_of_their_peak(known):
    _, estimate = known
    assert 0.002 < estimate.lambda_m_std < np.hypot(0.002, 0.002)
    assert estimate.mu_max_std == 0.001


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        *(("doubt", one) for one in Doubt if one not in (Doubt.NONE, Doubt.SHAPE)),
        ("lambda_m", 0.0067),
    ],
)
def test_a_peak_is_not_identifiable_if_untested_doubted_or_at_slips_like_their_errors(
    known, attribute, value
):
    drive = deepcopy(known[0])
    setattr(drive.estimator.inner, attribute, value)
    estimate = drive.run(0.1)
    assert estimate.objection is Objection.NONE
    assert not estimate.identifiable.mu_max
    assert not estimate.identifiable.lambda_m
    assert np.isinf(estimate.mu_max_std)
    assert np.isinf(estimate.lambda_m_std)


def test_a_curve_of_another_shape_may_have_a_known_peak(known):
    drive = deepcopy(known[0])
    drive.estimator.inner.doubt = Doubt.SHAPE
    assert drive.run(0.1).identifiable.both


def test_samples_have_the_observed_speed_and_their_slips_are_right(known):
    drive, estimate = known
    samples = Samples.concatenate(drive.used[-50:])
    pulling = samples.adhesion > 0.5 * ADHESION
    assert estimate.observed_speed == pytest.approx(SPEED, rel=0.002)
    assert np.abs(samples.speed / SPEED - 1).max() < 0.002
    assert np.sqrt(np.mean((samples.slip[pulling] - SLIP) ** 2)) < 0.002
    assert np.allclose(samples.creep_speed, samples.slip * samples.speed)
    assert np.all(np.diff(samples.t_us) >= 0)
    # All samples come, each once.
    assert len(samples) == pytest.approx(300, abs=60)
    assert len(np.unique(10 * samples.t_us + samples.axle)) == len(samples)


@pytest.mark.costly
def test_an_old_relief_leaves_the_estimate_as_it_was(known):
    drive = deepcopy(known[0])
    before = len(drive.estimator.inner.parts)
    estimate = drive.run(27.0)
    assert estimate.objection is Objection.NO_RELIEF
    count = sum(map(len, drive.estimator.inner.parts))
    drive.run(1.0)
    assert sum(map(len, drive.estimator.inner.parts)) == count > before


def test_a_copy_goes_its_own_way(known):
    drive = deepcopy(known[0])
    state = drive.rng.bit_generator.state
    copied = deepcopy(drive.estimator)
    drive.run(1.5, relieved=1)
    twin = deepcopy(drive)
    twin.estimator, twin.t_us, twin.used = copied, drive.t_us - 1_500_000, []
    twin.ramp = np.ones(6)
    twin.rng.bit_generator.state = state
    twin.run(1.5, relieved=1)
    assert twin.used[-1].equals(drive.used[-1])
    assert twin.estimator.update(NO_SAMPLES, 0).observed_speed == (
        drive.estimator.update(NO_SAMPLES, 0).observed_speed
    )


def test_a_copy_that_is_dropped_leaves_nothing_behind():
    """Work ahead of a due time is done on a copy, which is dropped where more samples come."""
    drive = Drive()
    drive.run(2.0)
    dropped = deepcopy(drive)
    for axle in (0, 2, 4):
        first, second = dropped.relieve(axle), drive.relieve(axle)
    assert first.objection is Objection.NONE
    assert second.samples == first.samples


def test_a_short_gap_is_bridged_and_a_longer_one_starts_again(known):
    drive = deepcopy(known[0])
    drive.run(0.08, lost=(3,))
    assert drive.run(0.5).objection is Objection.NONE
    drive.run(0.3, lost=(3,))
    assert drive.run(0.5).objection is Objection.NO_RELIEF


@pytest.mark.parametrize("lost", [(3,), (1, 2, 3, 4, 5, 6)])
def test_without_samples_of_an_axle_the_speed_is_not_known_and_nothing_piles_up(known, lost):
    drive = deepcopy(known[0])
    estimate = drive.run(3.0, lost=lost)
    assert estimate.objection is Objection.NO_RELIEF
    assert estimate.observed_speed is None
    assert not estimate.identifiable.mu_max
    observer = drive.estimator._observer
    assert len(observer._waiting) <= 6 * 101
    assert max(map(len, observer._rows._waiting)) <= 101
    # It comes back, and the next relief counts.
    assert drive.run(1.0).observed_speed == pytest.approx(SPEED, rel=0.02)
    for axle in (1, 3, 5):
        estimate = drive.relieve(axle)
    assert estimate.objection is Objection.NONE


@pytest.mark.parametrize("cycle_us", [10_000, 60_000, 150_000])
def test_one_lost_row_is_bridged_however_seldom_they_come(cycle_us):
    observer = SpeedObserver(Locomotive(), ObservedSpeedSettings(), cycle_us)
    rows = [k * cycle_us for k in range(60) if k != 40]
    for t_us in rows:
        observer.add(row_of(t_us, [SLIP] * 6))
        observer.expire(t_us + 2 * cycle_us)
        if t_us == 39 * cycle_us:
            before = observer._filter
    assert observer.block is not None
    assert observer._filter is before


def test_rows_pair_the_samples_of_one_cycle():
    rows = AxleRows(6, CYCLE_US)
    slips = np.arange(6) / 1000
    later = replace(row_of(20_000, slips), t_us=np.array([20_000] * 3 + [24_000] * 3))
    assert rows.add(row_of(10_000, slips).select(np.arange(3))) == []
    # Of axles 4 to 6 the samples of that cycle are lost.
    (row,) = rows.add(later)
    assert row.t_us == 22_000
    assert row.rim == pytest.approx(SPEED * (1 + slips))
    assert row.adhesion == pytest.approx([ADHESION] * 6)
    assert rows.add(row_of(31_000, slips).select(np.arange(5))) == []


def with_aids(samples, **columns):
    """Samples with the same value at each, by the names of the covariates."""
    more = {name: np.full(len(samples), float(value)) for name, value in columns.items()}
    return replace(samples, covariates={**samples.covariates, **more})


def test_a_reading_by_satellites_counts_once():
    rows = AxleRows(6, CYCLE_US)

    def add(t_us, **columns):
        (row,) = rows.add(with_aids(row_of(t_us, [SLIP] * 6), **columns))
        return row.gnss, row.acceleration

    known = {"acceleration_mps2": 0.2, "acceleration_us": 5_000}
    assert add(10_000) == pytest.approx((np.nan, np.nan), nan_ok=True)
    assert add(20_000, **known) == pytest.approx((np.nan, 0.2), nan_ok=True)
    more = {"gnss_speed_mps": 14.9, "gnss_speed_us": 25_000}
    assert add(30_000, **known, **more) == pytest.approx((14.9, np.nan), nan_ok=True)
    assert add(40_000, **known, **more) == pytest.approx((np.nan, np.nan), nan_ok=True)
    # The same value at a later stamp is a reading of its own.
    more["gnss_speed_us"] = 1_025_000
    assert add(50_000, **more)[0] == 14.9
    assert np.isnan(add(60_000)[0])
    assert add(70_000, **more)[0] == 14.9


def test_of_a_row_the_axle_with_the_latest_reading_counts():
    rows = AxleRows(6, CYCLE_US)
    samples = with_aids(row_of(10_000, [SLIP] * 6), gnss_speed_mps=14.9, gnss_speed_us=5_000)
    samples.covariates["gnss_speed_mps"][3], samples.covariates["gnss_speed_us"][3] = 14.8, 9_000
    samples.covariates["gnss_speed_mps"][4], samples.covariates["gnss_speed_us"][4] = np.nan, np.nan
    (row,) = rows.add(samples)
    assert row.gnss == 14.8


def test_a_speed_by_satellites_shows_the_slips_without_a_relief():
    """Once the drive has coasted, which shows the radii."""
    drive = Drive(gnss=True)
    assert drive.run(2.0).objection is Objection.RADII_UNCERTAIN
    drive.run(5.0, relieved=list(range(6)))
    estimate = drive.run(3.0)
    assert estimate.objection is Objection.NONE
    used = Samples.concatenate(drive.used[-100:])
    assert used.covariates.keys() == {"other"}
    assert used.speed.mean() == pytest.approx(SPEED, rel=0.002)
    assert np.abs(used.slip.mean() - SLIP) < 0.002
    # It ends: what it has shown holds for some seconds, then a relief is missing.
    drive.gnss = False
    assert drive.run(8.0).objection is Objection.NO_RELIEF


@pytest.mark.parametrize("shown", [0.0, 0.8, 1.1 * SPEED, 60.0])
def test_a_speed_by_satellites_that_cannot_be_is_not_used(shown):
    """A receiver without a fix sends 0, or what it likes."""
    drive = Drive(gnss=True)
    drive.run(2.0)
    drive.run(5.0, relieved=list(range(6)))
    assert drive.run(3.0).objection is Objection.NONE
    drive.error = shown - SPEED
    estimate = drive.run(4.0)
    assert estimate.observed_speed == pytest.approx(SPEED, rel=0.005)
    assert drive.run(4.0).objection is Objection.NO_RELIEF
    # The receiver has its fix again.
    drive.error = 0.0
    assert drive.run(1.5).objection is not Objection.NO_RELIEF


def test_a_speed_between_two_blocks():
    factor = np.array([1.0, 1.001, 1.0, 1.0, 1.0, 1.0])
    before = ObservedBlock(0, 15.0, 4e-6, factor, 0.001, Objection.NONE)
    block = ObservedBlock(50_000, 15.1, 4e-6, factor, 0.001, Objection.NONE)
    found = with_speed(row_of(10_000, [0.006] * 6), before, block)
    assert found.speed == pytest.approx([15.02] * 6)
    rim = 15.0 * 1.006
    assert found.slip[0] == pytest.approx(rim / 15.02 - 1)
    assert found.slip[1] == pytest.approx(1.001 * rim / 15.02 - 1)
    assert found.slip_common_var == pytest.approx([4e-6 / 15.02**2] * 6)
    assert found.slip_var == pytest.approx([1e-8 * (1.01 * 15.0 / 15.02) ** 2] * 6)
    assert found.speed_us.tolist() == [50_000] * 6
    assert found.speed_share == pytest.approx([0.2] * 6)


def test_samples_before_the_first_block_are_left_out():
    observer = SpeedObserver(Locomotive(), ObservedSpeedSettings(), CYCLE_US)
    found = []
    for k in range(12):
        found += observer.add(row_of(k * CYCLE_US, [SLIP] * 6))
    samples = Samples.concatenate([one.samples for one in found])
    # Blocks of five rows: the middle of the first is at 20 ms, that of the second at 70 ms.
    assert sorted(set(samples.t_us.tolist())) == [30_000, 40_000, 50_000, 60_000, 70_000]
    assert not any(one.is_known for one in found)
