"""The search for surface changes, part by part, on short drives with a known change."""

from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.find_surface_changes import (
    DEFAULT_CURVE,
    EXCLUDED_AROUND_S,
    LEAST_ROWS,
    MOST_ROWS,
    _ChangeTrial,
    _eliminate_changes,
    _refine_change_times,
    _thin_rows,
    build_regression_data,
    build_samples,
    find_surface_changes,
    fit_start_curves,
)
from adhesion_can.diagnosis.regression.model import EXCLUDED
from adhesion_can.physics.effects import effect_by_id
from tests.diagnosis.diagnosis_helpers import (
    C1,
    C2,
    C3,
    SyntheticDrive,
    build_table_drive,
    burckhardt,
)

CHANGE_S = 17.0
HUMIDITY = "relative_humidity_percent"
STD = 0.01
"""Noise of the adhesion, 1 % of the load."""


class ChangingDrive(SyntheticDrive):
    """The adhesion is 0.6 of what it was, from a time on."""

    def effort(self, axle, t):
        before = super().effort(axle, t)
        force = burckhardt(self.slip(axle, t)) * self.load(axle, t)
        return before - np.where(t < CHANGE_S, 0.0, 0.4 * force)


@pytest.fixture(scope="module")
def changing():
    return ChangingDrive(34.0, axles=2).build_drive_data(np.random.default_rng(1))


def test_a_change_is_found_where_it_is(changing):
    (found,) = find_surface_changes(changing, ())
    assert found == pytest.approx(CHANGE_S, abs=0.5)


def test_few_rows_and_tables_have_no_changes(changing):
    assert find_surface_changes(changing.select_rows(slice(0, LEAST_ROWS - 1)), ()) == []
    rng = np.random.default_rng(2)
    slip = 0.1 * rng.uniform(size=4000)
    adhesion = np.where(np.arange(4000) < 2000, 1.0, 0.5) * burckhardt(slip)
    table = build_table_drive(slip, adhesion, np.arange(4000) * 0.02)
    assert find_surface_changes(table, ()) == []


@pytest.mark.parametrize("start", [14.0, 16.0, 18.5, 20.0])
def test_a_time_moves_to_where_the_curves_part(changing, start):
    once = _refine_change_times(changing, [start])
    (twice,) = _refine_change_times(changing, once)
    assert twice == pytest.approx(CHANGE_S, abs=0.3)


def test_times_are_moved_within_their_own_half_of_the_way_to_the_next(changing):
    found = _refine_change_times(changing, [8.0, 16.0, 27.0])
    assert found == sorted(found)
    for time, low, high in zip(found, (4.0, 12.0, 21.5), (12.0, 21.5, 30.5), strict=True):
        assert low <= time < high
    assert found[1] == pytest.approx(CHANGE_S, abs=0.5)


@pytest.mark.parametrize(
    ("squares", "kept"),
    [
        ({(): 2.0, (1,): 1.1, (2,): 1.9, (1, 2): 1.0}, [1, 2]),
        ({(): 2.0, (1,): 1.03, (2,): 1.9, (1, 2): 1.0}, [1]),
        ({(): 1.05, (1,): 1.03, (2,): 1.02, (1, 2): 1.0}, []),
        ({(): 1.07, (1,): 1.03, (2,): 1.02, (1, 2): 1.0}, [2]),
        # What is needed beside another one may be needless without it.
        ({(): 1.0, (1,): 1.0, (2,): 1.0, (1, 2): 1.0}, []),
    ],
)
def test_the_least_important_change_goes_while_the_square_rises_by_less_than_4_percent(
    squares, kept
):
    trial = SimpleNamespace(mean_square=lambda times: squares[tuple(times)])
    assert _eliminate_changes(trial, [1, 2]) == kept


def test_a_trial_is_as_good_as_the_noise_with_the_change_and_far_from_it_without(changing):
    trial = _ChangeTrial(changing, [CHANGE_S], ())
    with_it, without = trial.mean_square([CHANGE_S]), trial.mean_square([])
    assert with_it == pytest.approx(STD**2, rel=0.25)
    assert without > 4.0 * with_it
    # Each segment's curve is fitted once, however often it is asked for.
    assert trial.mean_square([CHANGE_S]) == with_it


def test_an_effect_may_explain_a_change(changing):
    """Air that becomes dry at the same time: its linear effect takes the place of the change."""
    changing.covariates[HUMIDITY] = np.where(changing.t_s < CHANGE_S, 60.0, 30.0)
    candidates = (Candidate(effect_by_id("humidity")),)
    trial = _ChangeTrial(changing, [CHANGE_S], candidates)
    assert trial.mean_square([]) < 1.3 * trial.mean_square([CHANGE_S])
    del changing.covariates[HUMIDITY]


def test_rows_close_to_a_change_have_no_surface(changing):
    data = build_regression_data((changing, changing), [[10.0, CHANGE_S], [20.0]])
    assert data.surfaces == 5
    for part, times, first in zip(
        np.split(data.surface, 2), ([10.0, CHANGE_S], [20.0]), (0, 3), strict=True
    ):
        t = changing.t_s
        near = np.any([np.abs(t - time) < EXCLUDED_AROUND_S for time in times], axis=0)
        assert (part[near] == EXCLUDED).all()
        wanted = first + sum((t >= time).astype(int) for time in times)
        assert part[~near].tolist() == wanted[~near].tolist()


def test_curves_to_start_with_are_those_of_the_surfaces(changing):
    data = build_regression_data((changing,), [[CHANGE_S]])
    first, second = fit_start_curves(data).values
    assert first == pytest.approx([C1, np.log(C2), C3], abs=0.15)
    assert second[0] == pytest.approx(0.6 * C1, abs=0.03)
    slip = np.linspace(0.0, 0.1, 21)
    for theta, factor in ((first, 1.0), (second, 0.6)):
        found = burckhardt(slip, theta[0], np.exp(theta[1]), theta[2])
        assert found == pytest.approx(factor * burckhardt(slip), abs=0.01)


def test_a_surface_of_few_rows_starts_with_a_usual_curve(changing):
    data = build_regression_data((changing.select_rows(slice(0, 9)),), [[]])
    (theta,) = fit_start_curves(data).values
    c1, c2, c3 = DEFAULT_CURVE
    assert theta == pytest.approx([c1, np.log(c2), c3])


def test_thinned_rows_keep_their_order_and_number_at_most_twice_the_limit():
    many = build_table_drive(np.full(13_000, 0.01), np.full(13_000, 0.1), np.arange(13_000) * 0.01)
    assert len(_thin_rows(many)) == 6500
    assert MOST_ROWS <= len(_thin_rows(many)) < 2 * MOST_ROWS
    assert np.diff(_thin_rows(many).t_s) == pytest.approx(np.full(6499, 0.02))
    few = build_table_drive(np.full(500, 0.01), np.full(500, 0.1), np.arange(500) * 0.01)
    assert len(_thin_rows(few)) == 500


def test_rows_become_samples_in_any_order(changing):
    order = np.random.default_rng(3).permutation(len(changing))[:50]
    found, seen = build_samples(changing, order), changing.observe()
    assert found.t_us.tolist() == np.round(changing.t_s[order] * 1e6).tolist()
    assert found.axle.tolist() == changing.axle[order].tolist()
    for name in ("slip", "adhesion", "speed"):
        assert getattr(found, name).tolist() == getattr(seen, name)[order].tolist()
    assert len(build_samples(changing)) == len(changing)
