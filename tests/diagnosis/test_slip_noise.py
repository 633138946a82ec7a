"""Noise of the slips of a table, against the noise that they were made with."""

import numpy as np
import pytest

from adhesion_can.diagnosis.regression.estimate_slip_noise import estimate_slip_noise
from adhesion_can.diagnosis.regression.whitening import ContiguousRuns

STEP_S = 0.02
SEEDS = range(6)


def true_contact(rows):
    """Slip, adhesion and speed of sweeps in both directions, with coasting between them."""
    time_s = np.arange(rows) * STEP_S
    phase = time_s % 20.0
    braking = -0.10 * np.sin(np.pi * phase / 4.0) ** 2
    traction = 0.05 * np.sin(np.pi * (phase - 8.0) / 6.0) ** 2
    slip = np.where(phase < 8.0, braking, np.where(phase < 14.0, traction, 0.0))
    size = np.abs(slip)
    adhesion = np.sign(slip) * ((1.0 - np.exp(-25.0 * size)) - 0.5 * size)
    speed = 18.0 + 6.0 * np.sin(time_s / 2.3) + 2.0 * np.sin(time_s / 0.7)
    return time_s, slip, adhesion, speed


def slope(slip):
    return 25.0 * np.exp(-25.0 * np.abs(slip)) - 0.5


def runs_of(rows):
    time_s = np.arange(rows) * STEP_S
    return ContiguousRuns.find(time_s, np.ones(rows), np.zeros(rows, dtype=bool))


@pytest.mark.parametrize("std", [3e-4, 1e-3, 3e-3])
def test_the_noise_of_the_slips_is_found(std):
    rows = 9000
    _, slip, adhesion, _ = true_contact(rows)
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        read = slip + std * rng.standard_normal(rows)
        size = np.abs(read)
        predicted = np.sign(read) * ((1.0 - np.exp(-25.0 * size)) - 0.5 * size)
        residual = adhesion + 0.005 * rng.standard_normal(rows) - predicted
        found = estimate_slip_noise(read, residual, slope(read), runs_of(rows), np.ones(rows, bool))
        assert found == pytest.approx(std, rel=0.12)


def test_exact_slips_have_none_however_quick_they_are():
    rows = 9000
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        slip = 0.05 * rng.standard_normal(rows)  # no two rows alike, and all of it true
        residual = 0.005 * rng.standard_normal(rows)
        assert not estimate_slip_noise(
            slip, residual, slope(slip), runs_of(rows), np.ones(rows, bool)
        )


def test_differences_do_not_reach_over_a_gap():
    rows = 1200
    time_s = np.arange(rows) * STEP_S + 100.0 * (np.arange(rows) // 3)
    runs = ContiguousRuns.find(time_s, np.ones(rows), np.zeros(rows, dtype=bool))
    noise = np.random.default_rng(1).standard_normal(rows)
    assert not estimate_slip_noise(noise, -noise, np.ones(rows), runs, np.ones(rows, bool))


def estimated(read, adhesion, *, rows=None, seed=1, noise=0.005, of_slope=slope):
    """Estimate from slips as read and a residual of the true curve at them."""
    rng = np.random.default_rng(seed)
    size = np.abs(read)
    predicted = np.sign(read) * ((1.0 - np.exp(-25.0 * size)) - 0.5 * size)
    residual = adhesion + noise * rng.standard_normal(len(read)) - predicted
    rows = np.ones(len(read), bool) if rows is None else rows
    return estimate_slip_noise(read, residual, of_slope(read), runs_of(len(read)), rows)


def test_rows_that_do_not_count_have_no_part_nor_has_a_difference_with_one_of_them():
    """Every tenth row reads wildly: six of ten differences of the third order do without it."""
    rows = 9000
    _, slip, adhesion, _ = true_contact(rows)
    read = slip + 1e-3 * np.random.default_rng(5).standard_normal(rows)
    wild = np.arange(rows) % 10 == 4
    spoilt = np.where(wild, read + 0.05 * (-1.0) ** np.arange(rows), read)
    assert estimated(spoilt, adhesion, rows=~wild) == pytest.approx(1e-3, rel=0.15)
    assert estimated(spoilt, adhesion) > 5e-3


def test_two_hundred_differences_are_enough():
    """Large noise is certain in so few of them."""
    _, slip, adhesion, _ = true_contact(1000)
    read = slip + 5e-3 * np.random.default_rng(6).standard_normal(1000)
    count = np.arange(1000) < 203
    assert estimated(read, adhesion, rows=count) == pytest.approx(5e-3, rel=0.35)
    assert estimated(read, adhesion, rows=np.arange(1000) < 202) == 0.0


def test_a_residual_that_grows_with_the_slip_is_no_noise_and_no_slope_shows_none():
    _, slip, adhesion, _ = true_contact(9000)
    noise = 1e-3 * np.random.default_rng(7).standard_normal(9000)
    read = slip + noise
    every = np.ones(9000, bool)
    assert estimate_slip_noise(read, 5.0 * noise, slope(read), runs_of(9000), every) == 0.0
    assert estimated(read, adhesion, of_slope=np.zeros_like) == 0.0


def test_the_noise_is_not_larger_than_the_differences_of_the_slips():
    """A residual ten times as large as the slope says: the slips move by a thousandth, no more."""
    noise = 1e-3 * np.random.default_rng(8).standard_normal(9000)
    steep = np.full(9000, 20.0)
    found = estimate_slip_noise(noise, -200.0 * noise, steep, runs_of(9000), np.ones(9000, bool))
    assert found == pytest.approx(1e-3, rel=0.05)


def test_what_is_three_standard_errors_of_a_sum_of_overlapping_differences_is_certain():
    """Of slips and residuals that have nothing in common 1 in 700 passes, by the normal law."""
    rng, every = np.random.default_rng(9), np.ones(400, bool)
    found = [
        estimate_slip_noise(
            1e-3 * rng.standard_normal(400), 1e-2 * rng.standard_normal(400), np.full(400, 20.0),
            runs_of(400), every,
        ) > 0.0
        for _ in range(1500)
    ]  # fmt: skip
    # Were overlapping differences taken as independent it would be 4 in 100.
    assert sum(found) < 15
