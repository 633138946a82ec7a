"""Frames over time: every frame is counted once, however long the recording."""

import numpy as np
import pytest

from adhesion_can.bus.receiver_columns import ReceivedBlock
from adhesion_can.offline.fault_history import MOST_BINS, FaultHistory


@pytest.mark.parametrize("duration_s", [0.5, 7.2, 900.0, 9000.0])
@pytest.mark.parametrize("blocks", [1, 5])
def test_rates_hold_every_frame(duration_s, blocks):
    rng = np.random.default_rng(1)
    history, totals = FaultHistory(), {"accepted": 0, "rejected": 0, "lost": 0}
    stamps = np.sort(rng.integers(10**12, 10**12 + round(duration_s * 1e6), 3000))
    for t_us in np.array_split(stamps, blocks):
        kinds = rng.choice(3, len(t_us), p=(0.8, 0.1, 0.1))
        accepted, rejected = np.flatnonzero(kinds == 0), np.flatnonzero(kinds == 1)
        after_loss = accepted[::7]
        lost = np.arange(len(after_loss)) % 3 + 1
        received = ReceivedBlock(accepted=[accepted[::2], accepted[1::2]], rejected=[rejected])
        received.lost.append((after_loss, lost))
        history.add(t_us, received)
        for name, count in zip(totals, (len(accepted), len(rejected), lost.sum()), strict=True):
            totals[name] += int(count)
    t_s, rates = history.rates()
    assert len(t_s) <= MOST_BINS
    assert (np.diff(t_s) > 0).all()
    edges = np.append(np.arange(len(t_s)) * history.width_us, stamps[-1] - stamps[0]) / 1e6
    for name, count in totals.items():
        assert history.total(name) == count
        assert rates[name] @ np.diff(edges) == pytest.approx(count)


def test_the_end_of_a_recording_is_no_fall_of_the_rate():
    history = FaultHistory()
    t_us = np.arange(0, 10_050_000, 10_000)
    history.add(t_us, ReceivedBlock(accepted=[np.arange(len(t_us))]))
    _, rates = history.rates()
    np.testing.assert_allclose(rates["accepted"], 100.0, rtol=0.02)
