"""History of a drive in bins: nothing that was sent is left out, and its size is bounded."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.normal_quantiles import NORMAL_95
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.status import Status
from adhesion_can.reporting.charts import band, domains, runs
from adhesion_can.reporting.drive.history import DOUBTS, MOST_BINS, HistoryRecorder
from adhesion_can.reporting.drive.recorder import DriveRecorder
from adhesion_can.reporting.drive.surfaces import A_BIN, MOST_CLOUDS, SLIP_BINS
from adhesion_can.service.outputs import Outputs, Setpoint

CYCLE_US = 20_000


def outputs(mu_max=0.3, std=0.01, *, status=Status.TRACKING, doubt=Doubt.NONE, age=1.0, speed=10.0):
    known = mu_max is not None
    return Outputs(
        status=status,
        setpoint=Setpoint(mu_max, 0.05 if known else None, 0.5 if known else None),
        theta=(0.4, 60.0, 0.3) if known else None,
        mu_max_std=std if known else None,
        lambda_m_std=std if known else None,
        surface_age_s=age if known else None,
        doubt=doubt,
        speed=speed,
    )


def record(rows):
    recorder = HistoryRecorder()
    for number, row in enumerate(rows):
        recorder.add(number * CYCLE_US, row)
    return recorder


@pytest.mark.parametrize("count", [1, 7, MOST_BINS, 3 * MOST_BINS + 17])
def test_bins_hold_the_extremes_and_every_count(count):
    rng = np.random.default_rng(count)
    values = rng.uniform(0.1, 0.5, count)
    states = rng.integers(0, len(Status), count)
    doubts = rng.integers(0, len(DOUBTS), count)
    rows = [
        outputs(v, status=Status(s), doubt=DOUBTS[d])
        for v, s, d in zip(values, states, doubts, strict=True)
    ]
    found = record(rows).result()
    assert len(found) <= MOST_BINS
    assert found.lowest[:, 0].min() == values.min()
    assert found.highest[:, 0].max() == values.max()
    np.testing.assert_array_equal(found.statuses.sum(0), np.bincount(states, minlength=6))
    np.testing.assert_array_equal(found.doubts.sum(0), np.bincount(doubts, minlength=10))
    # Each setpoint lies in the bin whose stamps surround it, within its extremes.
    number = np.searchsorted(found.first_us, np.arange(count) * CYCLE_US, side="right") - 1
    assert (found.lowest[number, 0] <= values).all()
    assert (values <= found.highest[number, 0]).all()
    np.testing.assert_allclose(found.upper[:, 0], found.highest[:, 0] + NORMAL_95 * 0.01)


def test_what_is_not_available_is_a_gap_and_what_has_no_bound_reaches_everywhere():
    found = record([outputs(None), outputs(0.3, np.inf), outputs(0.3)]).result()
    assert np.isnan(found.lowest[0, 0])
    assert np.isnan(found.lower[0]).all()
    assert found.lower[1].tolist() == [0.0, 0.0]
    assert found.upper[1].tolist() == [1.0, 1.0]
    assert found.lower[2, 0] == pytest.approx(0.3 - NORMAL_95 * 0.01)


@given(st.lists(st.integers(1, 400_000), min_size=1, max_size=300))
def test_distance_is_the_integral_of_the_speed(steps_us):
    recorder = HistoryRecorder()
    for t_us in np.cumsum([0, *steps_us]).tolist():
        recorder.add(t_us, outputs(speed=2.0 + t_us / 1e6))
    end_s = sum(steps_us) / 1e6
    assert recorder.distance == pytest.approx(2.0 * end_s + end_s**2 / 2)


def test_over_a_hole_and_without_a_speed_no_distance_is_made_up():
    recorder = HistoryRecorder()
    for t_us, speed in ((0, 10.0), (1_000_000, 10.0), (9_000_000, 10.0), (9_500_000, None),
                        (10_000_000, 10.0)):  # fmt: skip
        recorder.add(t_us, outputs(speed=speed))
    assert recorder.distance == pytest.approx(10.0)


def samples(t_us, slip, adhesion):
    return Samples.curve(np.asarray(slip), np.asarray(adhesion), np.asarray(t_us, dtype=np.int64))


def drive(begins_s, end_s, delay_s=0.4, corrected_s=None):
    """A drive whose surfaces begin at these times and are told somewhat later."""
    recorder = DriveRecorder(0.25)
    for t_us in range(0, round(end_s * 1e6), CYCLE_US):
        told = [b for b in begins_s if b == 0 or t_us / 1e6 >= b + delay_s]
        begin = told[-1]
        if corrected_s and len(told) > 1 and t_us / 1e6 < begin + delay_s + 0.1:
            begin = corrected_s
        recorder.add(t_us, outputs(age=t_us / 1e6 - begin))
        at = np.arange(4) * 5000 + t_us
        surface = sum(t_us / 1e6 >= b for b in begins_s)
        recorder.add_samples(samples(at, np.full(4, 0.01), np.full(4, 0.1 * surface)))
    return recorder.result()


def test_samples_go_to_the_surface_on_which_they_were_taken_though_it_is_told_later():
    found = drive([0.0, 10.0, 21.0], 30.0).surfaces
    assert [s.from_us for s in found] == [0, 10_000_000, 21_000_000]
    assert [s.to_us for s in found][:2] == [10_000_000, 21_000_000]
    for number, surface in enumerate(found, start=1):
        assert set(surface.cloud.adhesion.tolist()) == {0.1 * number}
    assert sum(s.cloud.total for s in found) == 4 * 1500


def test_a_change_that_is_dated_anew_is_one_surface():
    found = drive([0.0, 10.0], 20.0, corrected_s=8.0).surfaces
    assert [s.from_us for s in found] == [0, 10_000_000]


def test_a_cloud_is_bounded_and_holds_rare_slips():
    recorder = DriveRecorder(0.25)
    rng = np.random.default_rng(2)
    for t_us in range(0, 40_000_000, CYCLE_US):
        recorder.add(t_us, outputs(age=t_us / 1e6))
        slip = rng.normal(0.02, 0.004, 12)
        if t_us == 7_000_000:
            slip[0] = 0.2
        recorder.add_samples(samples(np.full(12, t_us), slip, slip))
    (surface,) = recorder.result().surfaces
    assert surface.cloud.total == 24_000
    assert len(surface.cloud.slip) <= A_BIN * (SLIP_BINS + 1)
    assert 0.2 in surface.cloud.slip


@pytest.mark.costly
def test_samples_of_few_surfaces_are_kept_and_all_surfaces_are_listed():
    found = drive([0.0, *np.arange(5.0, 305.0, 5.0)], 310.0).surfaces
    assert len(found) == 61
    assert sum(s.cloud is not None for s in found) <= MOST_CLOUDS


def test_changes_are_logged_with_their_time_and_counted():
    recorder = DriveRecorder(0.25)
    for number in range(100):
        doubt = Doubt.SPEED if number >= 80 else Doubt.NONE
        status = Status.INIT if number < 10 else Status.TRACKING
        recorder.add(number * CYCLE_US, outputs(status=status, doubt=doubt))
    found = recorder.result()
    states = [(c.t_us // CYCLE_US, c.status, c.doubt) for c in found.changes]
    assert states == [
        (0, Status.INIT, Doubt.NONE), (10, Status.TRACKING, Doubt.NONE),
        (80, Status.TRACKING, Doubt.SPEED),
    ]  # fmt: skip
    assert found.change_count == 3


def test_a_band_is_cut_where_an_end_is_missing():
    x = np.arange(5.0)
    lower = np.array([0, 0, np.nan, 1, 1.0])
    bx, by = band(x, lower, lower + 2)
    gap = np.flatnonzero(np.isnan(bx))
    assert gap.tolist() == [4]
    assert by[:4].tolist() == [2, 2, 0, 0]
    assert by[5:].tolist() == [3, 3, 1, 1]


@given(st.lists(st.booleans(), max_size=30))
def test_runs_cover_what_is_true(values):
    rows = np.array(values, dtype=bool)
    covered = [k for first, end in runs(rows) for k in range(first, end)]
    assert covered == np.flatnonzero(rows).tolist()


@given(st.lists(st.floats(0.5, 5.0), min_size=1, max_size=6))
def test_panels_fill_the_figure_without_overlap(weights):
    places = domains(len(weights), 600, 20, weights)
    assert places[0][1] == pytest.approx(1.0)
    assert places[-1][0] == pytest.approx(0.0, abs=1e-9)
    heights = [top - bottom for bottom, top in places]
    assert heights[0] / heights[-1] == pytest.approx(weights[0] / weights[-1])
    assert all(below[1] < above[0] for above, below in zip(places[:-1], places[1:], strict=True))
