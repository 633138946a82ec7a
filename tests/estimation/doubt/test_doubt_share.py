"""The share of a drive that is doubted, and errors that all axles share, from whole drives."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.doubt.doubt_share import compute_doubt_share, pool_blocks
from adhesion_can.estimation.doubt.shared_errors import SharedError, estimate_shared_errors
from adhesion_can.physics.samples import Samples
from tests.estimation.doubt.doubt_helpers import AXLES, THETA, curve, make_samples

SECONDS = 48.0
SLIP_MAX = 0.5
OTHER = (0.25, 60.0, 0.2)


def made(seed, seconds=SECONDS, **hidden):
    return make_samples(np.random.default_rng(seed), seconds, **hidden)


def share(samples, **options):
    return compute_doubt_share(samples, THETA, AXLES, SLIP_MAX, **options)


def test_a_sound_drive_is_not_doubted_and_one_with_another_law_of_the_load_is():
    for seed in range(3):
        assert share(made(seed)) == 0.0
        assert share(made(seed, load_exponent=0.6)) == 1.0


@pytest.mark.parametrize(("seconds", "tested"), [(14.0, False), (16.0, True)])
def test_from_eight_blocks_on_there_is_an_answer(seconds, tested):
    assert (share(made(2, seconds)) is not None) is tested


def test_no_samples_have_no_answer():
    assert share(Samples.curve([], [])) is None
    # Slips beyond the model are no samples either.
    wild = made(2)
    assert share(replace(wild, slip=np.full(len(wild), 0.6))) is None


def test_a_change_of_the_surface_that_is_given_is_no_doubt():
    first, second = made(3, 24.0), made(4, 24.0, begin_s=24.0, theta=OTHER)
    both = Samples.concatenate([first, second])
    assert share(both, changes_us=[24_000_000]) == 0.0
    *_, (series, pooled) = pool_blocks(both, THETA, AXLES, SLIP_MAX, changes_us=[24_000_000])
    assert (len(series.blocks), len(series)) == (12, 24)
    slip = np.linspace(0.01, 0.1, 10)
    assert curve(slip, pooled.theta) == pytest.approx(curve(slip, OTHER), abs=0.006)


@pytest.mark.parametrize("start", [(0.3, 60.0, 0.1), (0.6, 20.0, 0.0)])
def test_any_start_leads_to_the_curve(start):
    *_, (_, pooled) = pool_blocks(made(5), start, AXLES, SLIP_MAX)
    slip = np.linspace(0.01, 0.1, 10)
    assert curve(slip, pooled.theta) == pytest.approx(curve(slip), abs=0.006)


# ------------------------------------------------------------------- errors that all axles share


def errors(samples):
    return estimate_shared_errors(samples, THETA, AXLES, SLIP_MAX)


@pytest.mark.parametrize(
    ("hidden", "speed", "effort"),
    [({}, 0.0, 0.0), ({"speed_scale": 0.004}, 0.004, 0.0), ({"effort_bias": -4e3}, 0.0, -4e3)],
)
def test_both_errors_are_found_within_what_is_stated(hidden, speed, effort):
    for seed in range(4):
        found = errors(made(10 + seed, **hidden))
        # A tenth of what is plausible before, and less.
        assert 0.0 < found.speed.std < 2e-3
        assert 0.0 < found.effort.std < 2e3
        assert abs(found.speed.value - speed) < 5.0 * found.speed.std
        assert abs(found.effort.value - effort) < 5.0 * found.effort.std


def test_braking_and_coasting_show_them_best():
    whole = made(20)
    both, pulling = errors(whole), errors(whole.select(whole.slip > 0.002))
    assert pulling.speed.std > 5.0 * both.speed.std
    assert pulling.effort.std > 3.0 * both.effort.std


def test_short_drives_and_those_with_more_than_shared_errors_have_none():
    assert errors(made(21, 14.0)) is None
    assert errors(Samples.curve([], [])) is None
    assert errors(made(22, load_exponent=0.6)) is None


def test_an_instrument_covers_what_was_found_with_its_error():
    assert SharedError(-3.0, 4.0).covering == 5.0
