"""Data for the tests of the public interface."""

import numpy as np

import adhesion_can
from adhesion_can.simulation.scenarios import surface_by_name
from tests.diagnosis.diagnosis_helpers import sweeps, write_table

WET = surface_by_name("wet")


def drive_file(path):
    """Ten seconds on a wet surface, as candump text."""
    return adhesion_can.simulate("wet", 10.0).write(path)


def humid_table(path):
    """Sweeps of creep as a table; adhesion falls by 0.4 % for each percent of humidity."""
    rng = np.random.default_rng(1)
    columns = sweeps(rng)
    humidity = 60.0 + 25.0 * np.sin(2 * np.pi * columns["time_s"] / 61.0)
    columns["adhesion"] = columns["adhesion"] * (1.0 - 0.004 * (humidity - 60.0))
    return write_table(path, columns | {"relative_humidity_percent": humidity})
