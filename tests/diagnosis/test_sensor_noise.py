"""The noise floor beside the noise that the sensors explain."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from adhesion_can.api.diagnosis import diagnose
from adhesion_can.diagnosis.result import Verdict
from tests.diagnosis.diagnosis_helpers import sweeps, write_table


def table(path, seed, *, rough=0.0):
    """Sweeps of creep with white noise of 0.003, on a rail whose adhesion varies along the way.

    It does so smoothly, at random every second, and no column says so.
    """
    rng = np.random.default_rng(seed)
    columns = sweeps(rng, rows=5000, std=0.003)
    seconds = np.arange(np.ceil(columns["time_s"][-1]) + 1)
    level = CubicSpline(seconds, rough * rng.standard_normal(len(seconds)))(columns["time_s"])
    columns["adhesion"] = columns["adhesion"] + level * np.sign(columns["slip"])
    return write_table(path, columns)


@pytest.mark.costly
def test_the_sensors_explain_white_noise(tmp_path):
    """Floor over sensors' noise within 7 % of 1, in five tables of five."""
    for seed in range(5):
        found = diagnose(table(tmp_path / "t.csv", seed))
        assert found.verdict is Verdict.NOTHING
        assert found.conclusive
        assert found.noise.sensors == pytest.approx(0.003, rel=0.07)
        assert found.noise.ratio == pytest.approx(1.0, abs=0.07)


@pytest.mark.costly
def test_what_the_sensors_do_not_explain_is_not_called_noise(tmp_path):
    for seed in range(5):
        found = diagnose(table(tmp_path / "t.csv", seed, rough=0.03))
        assert found.verdict is Verdict.UNEXPLAINED
        assert found.causes == ()
        assert found.noise.ratio > 5.0
        assert found.to_dict()["noise"]["ratio"] == found.noise.ratio
