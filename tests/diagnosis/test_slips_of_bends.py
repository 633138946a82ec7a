"""Slips that are none of the contact make no shape of its curve."""

import numpy as np
import pytest

from adhesion_can import diagnose
from tests.seeds import first_quick


@pytest.mark.costly
@pytest.mark.parametrize("seed", first_quick(range(3)))
def test_no_shape_is_named_after_slips_that_have_no_force(seed, tmp_path):
    """In bends wheels run another way: beyond the 'peak' half of the forces are against the slip.

    A trolleybus had a peak of 0.0999 ± 0.0019 so, far below that of rubber on a road.
    """
    rng = np.random.default_rng(seed)
    time_s = np.arange(6000.0)
    slip = 0.006 * np.sin(time_s / 3.1) * np.abs(np.sin(time_s / 47.0))
    adhesion = 8.0 * slip + 0.01 * rng.standard_normal(6000)
    bend = np.sin(time_s / 29.0 + seed) > 0.8
    slip = np.where(bend, 0.03 * np.sin(time_s / 5.3), slip + 0.0005 * rng.standard_normal(6000))
    adhesion = np.where(bend, 0.02 * rng.standard_normal(6000), adhesion)
    path = tmp_path / "bus.csv"
    columns = np.column_stack([time_s, slip, adhesion])
    np.savetxt(path, columns, delimiter=",", header="time_s,slip,adhesion", comments="")
    found = diagnose(path)
    assert all(cause.effect != "curve_shape" for cause in found.causes), found.causes
