"""A vehicle of another kind: a tram whose signals come every 50 ms, in km/h and kN."""

import numpy as np
import pytest

from adhesion_can.diagnosis.diagnose import diagnose
from adhesion_can.diagnosis.drive.from_traces import build_drive_data_from_traces
from adhesion_can.physics.readings import Role
from adhesion_can.sampling.traces import Trace
from tests.tram import LOW, VEHICLE, Tram

STEPS = {Role.VEHICLE_SPEED: 0.1 / 3.6, Role.TRACTIVE_EFFORT: 100.0, Role.WHEEL_SPEED: 0.05}
"""Steps of the signals: 0.1 km/h, 0.1 kN, 0.05 rad/s."""


def as_on_the_bus(tram, seed):
    """Traces of the tram in the steps of its bus."""
    return {
        (role, axle): Trace(trace.t_us, np.round(trace.value / STEPS[role]) * STEPS[role])
        for (role, axle), trace in tram.traces(seed).items()
    }


@pytest.mark.slow
def test_in_a_tram_in_which_nothing_is_hidden_nothing_is_found():
    """Four drives on dry and low adhesion, with the noise of the tram's own sensors."""
    for seed in range(4):
        tram = Tram(seconds=120.0, surfaces=(LOW,) if seed % 2 else Tram.surfaces)
        traces = as_on_the_bus(tram, seed)
        found = diagnose([build_drive_data_from_traces("tram", traces, VEHICLE, 1.0, 0.5)])
        assert found.verdict.value == "nothing_found", (seed, found.channel, found.causes)
