"""A long drive over joints: its level alternates, about an estimate that knows the mean."""

import numpy as np
import pytest

from adhesion_can.estimation.doubt.estimator import DoubtingTracker
from adhesion_can.estimation.tracker.tracker import Tracker
from tests.estimation.doubt.doubt_helpers import AXLES, in_seconds
from tests.estimation.doubt.test_level_scatter import MU_MAX, drive


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [range(2), range(2, 7)])
def test_a_long_drive_over_joints_is_not_tracked_with_a_wrong_peak(seeds):
    """After 64 blocks one holds more than a joint: their means no longer show the level's."""
    wrong, tracked = [], []
    for seed in seeds:
        samples, t, level = drive(seed, 150.0, amplitude=0.09)
        estimator = DoubtingTracker(Tracker(), AXLES)
        for part in in_seconds(samples, 0.25):
            estimate = estimator.update(part, int(part.t_us[-1]) + 1)
            now_s = part.t_us[-1] * 1e-6
            if estimate is None or now_s < 20.0:
                continue
            true = MU_MAX * level[np.searchsorted(t, now_s - 1e-6)]
            off = abs(estimate.mu_max - true)
            tracked.append(estimate.identifiable.both)
            wrong.append(off > 3 * estimate.mu_max_std and off > 0.02 * true)
    wrong, tracked = np.array(wrong), np.array(tracked)
    assert (wrong & tracked).mean() <= 0.01
