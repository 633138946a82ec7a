"""Why samples do not show the peak: coasting, small slips, noise, few samples."""

import numpy as np
import pytest

from adhesion_can.estimation.batch_fit import identify
from adhesion_can.estimation.batch_result import NOT_SHOWN, peak_cells
from adhesion_can.physics.samples import Samples

DRY = (0.40, 60.0, 0.30)


def samples_of(slip_max, noise=0.005, count=2000):
    """Points of the dry curve, whose peak is 0.373 at 0.073, up to a slip."""
    rng = np.random.default_rng(5)
    slip = rng.uniform(0.0, slip_max, count)
    c1, c2, c3 = DRY
    mu = c1 * -np.expm1(-c2 * slip) - c3 * slip + noise * rng.standard_normal(count)
    t_us = np.arange(count) * 10_000
    return Samples.curve(slip, mu, t_us)


@pytest.mark.parametrize(("samples", "why"), [
    (samples_of(0.0003), "the vehicle coasts"),
    (samples_of(0.02), "and still rises; drive to larger slips"),
    (samples_of(0.2, count=12), "12 samples, fewer than 20"),
    (samples_of(0.2, noise=1.5), "an error of an instrument looks the same"),
], ids=["coasting", "small slips", "few", "noise"])  # fmt: skip
def test_the_reason_is_that_of_the_samples(samples, why):
    (segment,) = identify(samples).segments
    assert segment.missing.clause.startswith("the peak is not in the data: ")
    assert why in segment.missing.clause
    assert segment.missing.by_noise == ("instrument" in why)
    assert peak_cells(segment.estimate) == (NOT_SHOWN, NOT_SHOWN)


def with_adhesion(samples, adhesion):
    return Samples.curve(samples.slip, adhesion, samples.t_us)


def test_a_reversed_sign_is_no_coasting():
    found = samples_of(0.2)
    (segment,) = identify(with_adhesion(found, -found.adhesion)).segments
    assert "the adhesion is opposite to the slip, -0.3" in segment.missing.clause
    assert "check the signs of effort and speeds" in segment.missing.clause
    assert "coasts" not in segment.missing.clause


@pytest.mark.parametrize("seed", range(5))
def test_large_adhesions_of_both_signs_are_no_coasting(seed):
    """As a wrong inertia gives them: the mean is small, the values are not."""
    found = samples_of(0.2)
    noise = 24.0 * np.random.default_rng(seed).standard_normal(len(found))
    (segment,) = identify(with_adhesion(found, noise)).segments
    assert "coasts" not in segment.missing.clause
    assert "opposite" not in segment.missing.clause


def test_the_height_may_be_shown_and_the_place_not():
    """Slips to 0.08 are enough for the height of a peak at 0.073."""
    (segment,) = identify(samples_of(0.08, noise=0.02)).segments
    assert segment.missing.clause.startswith("lambda_m is not in the data: ")
    assert "not far enough beyond the largest adhesion" in segment.missing.clause
    height, place = peak_cells(segment.estimate)
    assert ("±" in height, place) == (True, NOT_SHOWN)


def test_nothing_is_missing_where_the_peak_is_shown():
    result = identify(samples_of(0.2))
    assert result.segments[0].missing.clause == ""
    assert result.to_dict()["segments"][0]["missing"] is None
    assert "±" in peak_cells(result.segments[0].estimate)[1]
