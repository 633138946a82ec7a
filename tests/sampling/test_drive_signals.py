"""Signals over time: extremes stay at their own stamps, gaps stay, and the size is bounded."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.drive_signals import CHUNK, MOST_SPANS, SLIP, WIDTH_US, DriveSignals

SIGNAL = ("wheel_speed", 1)


def collected(t_us, values, chunk, most_spans=MOST_SPANS):
    signals = DriveSignals(most_spans)
    for first in range(0, len(t_us), chunk):
        part = slice(first, first + chunk)
        signals.add({SIGNAL: (t_us[part], values[part])})
    return signals


@pytest.mark.parametrize("chunk", [1000, CHUNK + 1, 10**6])
def test_every_span_keeps_its_extremes_at_their_own_stamps(chunk):
    t_us = 1_790_000_000_000_000 + np.arange(60_000, dtype=np.int64) * 10_000
    values = np.random.default_rng(1).standard_normal(len(t_us))
    values[12_345], values[54_321] = 50.0, -50.0
    signals = collected(t_us, values, chunk)
    found = signals.series()[SIGNAL]
    assert len(found.t_us) <= 2 * MOST_SPANS
    # What is drawn was measured.
    np.testing.assert_array_equal(found.values, values[(found.t_us - t_us[0]) // 10_000])
    assert t_us[12_345] in found.t_us
    assert (found.lowest, found.highest) == (-50.0, 50.0)
    span, kept = ((t - t_us[0]) // signals.width_us for t in (t_us, found.t_us))
    for number in np.unique(span):
        own = values[span == number]
        drawn = found.values[kept == number]
        assert (drawn.min(), drawn.max()) == (own.min(), own.max())
    assert (found.readings, found.not_available) == (60_000, 0)


def test_a_short_drive_loses_nothing():
    t_us = np.arange(500, dtype=np.int64) * WIDTH_US
    values = np.sin(t_us / 1e6)
    found = collected(t_us, values, 7).series()[SIGNAL]
    np.testing.assert_array_equal(found.t_us, t_us)
    np.testing.assert_array_equal(found.values, values)


@given(st.lists(st.sampled_from([0.0, 1.0, -2.0, np.nan]), min_size=1, max_size=300))
def test_what_is_not_available_leaves_a_gap_in_its_span(values):
    t_us = np.arange(len(values), dtype=np.int64) * WIDTH_US
    signals = collected(t_us, np.array(values), 50, most_spans=8)
    found = signals.series()[SIGNAL]
    assert len(found.t_us) <= 3 * 8
    missing, kept = np.isnan(values), np.isnan(found.values)
    spans = np.unique(t_us[missing] // signals.width_us)
    assert np.unique(found.t_us[kept] // signals.width_us).tolist() == spans.tolist()
    assert found.not_available == missing.sum()


def test_slips_go_to_their_axles():
    t_us = np.arange(12, dtype=np.int64) * 100_000
    samples = Samples.curve(np.linspace(0.0, 0.11, 12), np.zeros(12), t_us)
    signals = DriveSignals()
    signals.add_samples(samples)
    found = signals.series()
    assert list(found) == [(SLIP, axle) for axle in np.unique(samples.axle).tolist()]
    assert sum(one.readings for one in found.values()) == 12


def test_a_signal_that_is_never_available_has_no_range():
    signals = collected(np.array([0, 10_000]), np.array([np.nan, np.nan]), 2)
    found = signals.series()[SIGNAL]
    assert np.isnan([found.lowest, found.highest]).all()
    assert found.not_available == 2
