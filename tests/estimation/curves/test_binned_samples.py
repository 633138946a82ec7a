"""Sums of samples by bins."""

import numpy as np
import pytest

from adhesion_can.estimation.curves.binned_samples import (
    ADHESION,
    COUNT,
    EMPTY,
    SLIP,
    BinnedSamples,
    join_binned,
)
from tests.estimation.curves.family_helpers import burckhardt, make_samples


def binned(samples):
    return BinnedSamples.from_samples(samples, 0.01)


@pytest.mark.parametrize("seed", range(3))
def test_parts_add_up_to_the_whole(seed):
    samples = make_samples(burckhardt(), np.random.default_rng(seed), 20.0)
    first = np.arange(len(samples)) < 1234
    parts = (binned(samples.select(first)), EMPTY, binned(samples.select(~first)))
    whole, joined = binned(samples), join_binned(parts)
    np.testing.assert_array_equal(joined.place, whole.place)
    np.testing.assert_allclose(joined.sums, whole.sums, rtol=1e-12)


def test_means_of_a_bin_are_those_of_its_samples():
    samples = make_samples(burckhardt(), np.random.default_rng(1), 20.0, slip_std=0.0)
    found = binned(samples)
    assert found.sums[COUNT].sum() == len(samples)
    assert found.sums[SLIP].sum() / len(samples) == pytest.approx(np.abs(samples.slip).mean())
    signed = np.sign(samples.slip) * samples.adhesion
    assert found.sums[ADHESION].sum() / len(samples) == pytest.approx(signed.mean())


def test_nothing_joined_is_nothing():
    assert join_binned((EMPTY, EMPTY)).sums.shape == EMPTY.sums.shape
