"""A vehicle so slow that its contact follows the slip for longer than any signal is late."""

import numpy as np
import pytest

from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.effect_derivatives import compute_effect_jacobian
from adhesion_can.diagnosis.regression.model import Model, RegressionData
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.physics.curves import FAMILIES
from adhesion_can.physics.effects import known_effects
from tests.diagnosis.diagnosis_helpers import (
    C1,
    C2,
    C3,
    build_table_drive,
    burckhardt,
    diagnosed,
    write_table,
)
from tests.seeds import first_quick

STEP_S = 0.03


def robot(seed, length):
    """Columns of a robot at 0.1 m/s whose three wheels follow the slip over a length, m."""
    rng, rows = np.random.default_rng(seed), 700
    t = np.arange(rows) * STEP_S
    tables = []
    for axle in (1, 2, 3):
        speed = 0.09 + 0.03 * np.sin(t / 4.3 + axle)
        slip = 0.08 * (1.0 - np.cos(2.0 * np.pi * t / (2.1 + 0.2 * axle))) * np.sin(t / 3.7 + axle)
        felt = np.zeros(rows)
        for k in range(1, rows):
            share = 1.0 - np.exp(-speed[k] * STEP_S / length)
            felt[k] = felt[k - 1] + share * (slip[k] - felt[k - 1])
        tables.append(
            {
                "time_s": t,
                "axle": np.full(rows, axle),
                "slip": slip,
                "longitudinal_force_N": 30.0 * (burckhardt(felt) + 0.02 * rng.normal(size=rows)),
                "normal_load_N": np.full(rows, 30.0),
                "speed_mps": speed,
            }
        )
    return {name: np.concatenate([one[name] for one in tables]) for name in tables[0]}


@pytest.mark.costly
@pytest.mark.parametrize("seed", first_quick([1, 2]))
def test_a_lag_of_seconds_gets_an_answer(tmp_path, seed):
    answer = diagnosed(tmp_path, write_table(tmp_path / "t.csv", robot(seed, 0.3)))
    assert answer.status == 0, answer.err
    assert answer.verdict in {"named", "unexplained", "nothing_found"}


def test_a_derivative_beyond_the_range_of_a_parameter_is_an_error():
    """Both ends of its difference are one: 0 divided by 0 must not go on as a number."""
    t = np.arange(500) * STEP_S
    slip = 0.05 * (1.0 - np.cos(t))
    drive = build_table_drive(slip, burckhardt(slip), t, speed=10.0 + np.sin(t))
    data = RegressionData((drive,), np.zeros(len(drive), dtype=np.int64), 1)
    delay = Candidate(next(one for one in known_effects() if one.id == "speed_delay"), is_lag=True)
    curves = SegmentCurves(np.array([[C1, np.log(C2), C3]]), FAMILIES["burckhardt"])
    with pytest.raises(ValueError, match="speed_delay: delay 7 is out of range"):
        compute_effect_jacobian(data, Model(curves), delay, (7.0,))
