"""Errors of the vehicle speed that last for seconds: generalised least squares, and a drive."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.doubt.blocks import BlockError, BlockSums
from adhesion_can.estimation.doubt.directions import SPEED_SCALE
from adhesion_can.estimation.doubt.estimator import DoubtingTracker
from adhesion_can.estimation.doubt.rows import RowBuilder
from adhesion_can.estimation.doubt.settings import InstrumentUncertainty
from adhesion_can.estimation.doubt.slip_basis import SIZE
from adhesion_can.estimation.doubt.speed_wander import SpeedWander
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.physics.doubt import Doubt
from tests.estimation.doubt.doubt_helpers import (
    AXLES,
    DIRECTIONS,
    LAMBDA_M,
    MU_MAX,
    NAMES,
    NOISE,
    THETA,
    is_wrong,
    make_samples,
    run,
)
from tests.seeds import first_quick

PLACE = SIZE + NAMES.index(SPEED_SCALE)
STD = 0.002
"""Standard deviation of the error in the drives, relative."""


def rows_of(slip_var=0.0):
    samples = make_samples(np.random.default_rng(1), 2.0, speed_scale=0.004)
    samples = replace(samples, slip_var=np.full(len(samples), slip_var))
    return RowBuilder(DIRECTIONS, AXLES).build(samples, THETA, NOISE)


@pytest.mark.parametrize("std", [1e-4, 0.002, 0.1])
def test_the_sums_are_those_of_the_whole_covariance(std):
    """Of independent errors and of one that all rows share, inverted as a dense matrix."""
    rows = rows_of()
    shared = rows.columns[:, PLACE]
    weights = np.linalg.inv(np.diag(1.0 / rows.weight) + std**2 * np.outer(shared, shared))
    found = BlockSums.from_rows(rows, error=BlockError(PLACE, std**2))
    assert found.gram == pytest.approx(rows.columns.T @ weights @ rows.columns, rel=1e-6, abs=1e-3)
    assert found.score == pytest.approx(rows.columns.T @ weights @ rows.response, rel=1e-6)
    level = rows.level
    assert found.level_noise == pytest.approx(level @ weights @ level, rel=1e-6)


def test_a_shared_error_without_a_size_changes_nothing():
    rows = rows_of(1e-6)
    plain = BlockSums.from_rows(rows)
    found = BlockSums.from_rows(rows, error=BlockError(PLACE, 1e-16))
    for name in ("gram", "dilution", "score", "level_noise", "curve_square"):
        assert getattr(found, name) == pytest.approx(getattr(plain, name), rel=1e-6, abs=1e-3)


def test_errors_of_the_slips_dilute_what_is_left_of_a_column():
    """As a column is projected, so are the errors of its slips; never more than before."""
    rows = rows_of(1e-6)
    plain = BlockSums.from_rows(rows)
    found = BlockSums.from_rows(rows, error=BlockError(PLACE, STD**2))
    share = plain.gram[:, PLACE] / (plain.gram[PLACE, PLACE] + 1.0 / STD**2)
    left = np.eye(len(share)) - np.outer(share, np.eye(len(share))[PLACE])
    assert found.dilution == pytest.approx(left @ plain.dilution @ left.T, rel=1e-6, abs=1e-3)
    assert np.linalg.eigvalsh(found.dilution).min() > -1e-6 * np.trace(plain.dilution)
    assert found.dilution[PLACE, PLACE] < plain.dilution[PLACE, PLACE]


def test_the_square_along_the_level_is_that_of_the_error_alone():
    rows, rng = rows_of(), np.random.default_rng(2)
    drawn = STD * rng.standard_normal(4000)
    along = rows.weight * rows.level @ rows.columns[:, PLACE]
    wanted = np.mean((drawn * along) ** 2)
    assert BlockError(PLACE, STD**2).level_square(rows) == pytest.approx(wanted, rel=0.1)


def test_what_a_shared_error_takes_from_the_level_depends_on_no_unit_of_the_weights():
    """Also where all weights are small: few rows, or much noise."""
    rows, scale = rows_of(), 1e-9
    faint = rows._replace(weight=scale * rows.weight, level_noise=scale * rows.level_noise)
    found = [
        BlockSums.from_rows(each, error=BlockError(PLACE, variance)).level_noise / each.level_noise
        for each, variance in ((rows, STD**2), (faint, STD**2 / scale))
    ]
    assert found[1] == pytest.approx(found[0], rel=1e-9)
    assert found[0] < 0.97


@pytest.mark.parametrize(("block_s", "times"), [(0.5, 20.0), (4.0, 2.5), (10.0, 1.0), (16.0, 1.0)])
def test_an_error_that_outlasts_a_block_counts_as_more(block_s, times):
    assert SpeedWander(PLACE, STD).add_block(rows_of(), block_s) == pytest.approx(
        (PLACE, times * STD**2)
    )


def test_the_inflation_is_that_of_the_levels_variance_over_all_blocks():
    """A second block with a quarter of the weights adds 1/4 of the noise, and 1/16 of the error."""
    rows, wander = rows_of(), SpeedWander(PLACE, STD)
    faint = rows._replace(weight=rows.weight / 4.0, level_noise=rows.level_noise / 4.0)
    assert not wander.acts
    error = wander.add_block(rows, 10.0)
    noise, square = rows.level_noise, error.level_square(rows)
    assert wander.inflation == pytest.approx(1.0 + square / noise)
    wander.add_block(faint, 10.0)
    assert wander.acts
    assert wander.inflation == pytest.approx(1.0 + (1.0 + 1.0 / 16.0) * square / (1.25 * noise))
    for _ in range(40):
        wander.add_block(faint, 10.0)
    assert wander.inflation == pytest.approx(1.0 + square / noise / 4.0)


def test_without_a_size_there_is_no_error_and_no_inflation():
    wander = SpeedWander(PLACE, 0.0)
    assert wander.add_block(rows_of(), 1.0) is None
    assert (wander.acts, wander.inflation) == (False, 1.0)


def test_wheels_that_do_not_slip_tell_nothing_and_break_nothing():
    """As on a bench without noise that coasts: the curve's level has no rows at all."""
    samples = make_samples(np.random.default_rng(1), 10.0)
    still = replace(samples, slip=np.zeros(len(samples)), adhesion=np.zeros(len(samples)))
    tracker, found = driven(still, STD)
    assert tracker._monitor.inflation == 1.0
    plain = driven(still, 0.0)[1]
    assert [one.mu_max_std for one in found] == pytest.approx(
        [one.mu_max_std for one in plain], rel=1e-3
    )


def wandering(seed, seconds=60.0):
    """A drive whose vehicle speed has another error each 3 to 7 s."""
    rng = np.random.default_rng(seed)
    samples = make_samples(rng, seconds)
    ends = np.cumsum(rng.uniform(3.0, 7.0, round(seconds / 3.0)))
    errors = STD * rng.standard_normal(len(ends) + 1)
    own = errors[np.searchsorted(ends, samples.t_us * 1e-6)]
    return replace(samples, slip=(1.0 + samples.slip) / (1.0 + own) - 1.0)


def driven(samples, wander_std):
    """A tracker that doubts itself after a drive, and its estimates from 20 s on."""
    instruments = InstrumentUncertainty(speed_wander_std=wander_std)
    tracker = DoubtingTracker(Tracker(), AXLES, None, instruments)
    return tracker, run(tracker, samples)[-200:]


@pytest.fixture(scope="module")
def monitors():
    """Monitors of the same drive without and with a stated wander."""
    return [driven(wandering(1), std)[0]._monitor for std in (0.0, STD)]


@pytest.mark.costly
def test_the_tracker_is_told_of_what_the_wander_does_to_the_level(monitors):
    plain, wanders = monitors
    assert plain.inflation == plain.assessment.lasting.beyond_chance
    # Blocks alone show less of it than noise does, once it is part of their weights.
    assert wanders.assessment.lasting.beyond_chance < plain.inflation < wanders.inflation


@pytest.mark.costly
def test_the_error_of_the_level_is_the_distance_from_the_curve_of_all_samples(monitors):
    plain, wanders = monitors
    assert plain.level_error(MU_MAX) == 0.0
    peak_of_all = wanders.assessment.plain
    share = peak_of_all.mu_max_std / peak_of_all.mu_max
    assert wanders.level_error(peak_of_all.mu_max) == pytest.approx(share)
    assert wanders.level_error(0.9 * peak_of_all.mu_max) == pytest.approx(1 / 9, rel=0.01)


@pytest.mark.costly
@pytest.mark.parametrize("seed", first_quick(range(20)))
def test_a_stated_wander_is_no_doubt_and_no_change_and_the_peak_is_known_better(seed):
    """Else the same errors inflate all variances. In 20 drives each of this holds in all."""
    samples = wandering(seed)
    (_, found), (_, plain) = driven(samples, STD), driven(samples, 0.0)
    assert len({one.surface_since_us for one in found}) == 1
    assert np.mean([one.doubt is Doubt.NONE for one in found]) > 0.9
    assert not any(map(is_wrong, found))
    ratio = [own.lambda_m_std / other.lambda_m_std for own, other in zip(found, plain, strict=True)]
    assert np.median(ratio) < 0.6
    last = found[-1]
    assert abs(last.mu_max - MU_MAX) < 4 * last.mu_max_std
    assert abs(last.lambda_m - LAMBDA_M) < 4 * last.lambda_m_std
