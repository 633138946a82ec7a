"""Of a force that was computed from the speed the diagnosis names no delay."""

import numpy as np
import pytest

from tests.diagnosis.diagnosis_helpers import burckhardt, diagnosed, write_table
from tests.sampling.test_derived_force import STEP_S, vehicle


@pytest.mark.costly
@pytest.mark.parametrize("seed", [1, 2])
def test_no_delay_is_named_where_the_force_is_the_speeds_derivative(tmp_path, seed):
    """A car in free braking, filmed: slip from the wheel, force and speed from one camera."""
    rng, t, v, rate = vehicle(seed, 2000)
    read = v + 0.01 * rng.standard_normal(len(t))
    slip = np.interp(
        rate / 2.0, burckhardt(np.linspace(-0.06, 0.06, 400)), np.linspace(-0.06, 0.06, 400)
    )
    wheel = np.interp(t - 0.1, t, (1.0 + slip) * v) + 0.01 * rng.standard_normal(len(t))
    columns = {
        "time_s": t,
        "slip": wheel / read - 1.0,
        "adhesion": np.gradient(read, STEP_S) / 2.0,
        "speed_mps": read,
    }
    answer = diagnosed(tmp_path, write_table(tmp_path / "t.csv", columns))
    assert answer.status == 0, answer.err
    assert not answer.named & {"speed_delay", "effort_delay", "wheel_speed_delay"}
    for effect in ("speed_delay", "effort_delay", "wheel_speed_delay"):
        assert "computed from the rate of change" in answer.untested[effect]
    assert "the force is computed from the speed" in answer.out
