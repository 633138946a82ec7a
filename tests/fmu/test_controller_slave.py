"""The creep controller as a slave."""

from math import nan

import numpy as np
import pytest

from adhesion_can.config import load_configuration
from adhesion_can.control.frames import build_reference
from adhesion_can.control.inputs import Advice, Measurement
from adhesion_can.errors import InputError
from adhesion_can.fmu.controller import ControllerSlave
from adhesion_can.fmu.locomotive import LocomotiveSlave
from adhesion_can.fmu.service import ServiceSlave
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.status import Status
from tests.fmu.drives import coupled, starts, stepped

AXLES = range(1, 7)


@pytest.fixture(scope="module")
def config():
    return load_configuration()


def random_inputs(rng):
    """Readings and contents of the service's messages, some of them not available."""
    values = {f"wheel_speed_{axle}": rng.uniform(16, 20) for axle in AXLES}
    values |= {f"tractive_effort_{axle}": rng.uniform(0, 6e4) for axle in AXLES}
    values |= {f"axle_load_{axle}": rng.uniform(2.3e5, 2.5e5) for axle in AXLES}
    values |= {"vehicle_speed": rng.uniform(9.9, 10.1), "status": float(rng.integers(1, 3))}
    values |= {"lambda_m": 0.08, "lambda_m_std": 0.004, "c1": 0.4, "c2": 60.0, "c3": 0.3}
    values |= {"doubt": 0.0, "objection": 0.0, "wheel_speed_3": nan, "axle_load_2": nan}
    return values | {f"lambda_m_{axle}": 0.08 + 0.001 * axle for axle in AXLES}


def test_its_steps_are_those_of_the_controller(config):
    rng = np.random.default_rng(7)
    changes = {t_us: random_inputs(rng) for t_us in range(0, 600_000, 10_000)}
    found = stepped(ControllerSlave(config), changes, 600_000, 2000)
    reference, radius = build_reference(config), np.array(config.vehicle.wheel_radius)
    for t_us, values in changes.items():
        effort = np.array([values[f"tractive_effort_{axle}"] for axle in AXLES])
        load = np.array([values[f"axle_load_{axle}"] for axle in AXLES])
        load[1] = config.vehicle.loads(effort)[1]
        rim = radius * np.array([values[f"wheel_speed_{axle}"] for axle in AXLES])
        speed = values["vehicle_speed"] if t_us % 20_000 == 0 else None  # it comes each 20 ms
        advice = Advice(
            Status(int(values["status"])),
            Doubt.NONE,
            0.08,
            0.004,
            (0.4, 60.0, 0.3),
            {axle: 0.08 + 0.001 * axle for axle in AXLES},
        )
        expected = reference.step(Measurement(t_us / 1e6, speed, rim, effort, load), advice)
        for later_us in range(t_us + 2000, t_us + 10_001, 2000):
            got = [found[later_us][f"effort_demand_{axle}"] for axle in AXLES]
            assert got == expected.tolist(), later_us
    assert max(got) > 0.0


def test_without_a_speed_no_effort_is_demanded(config):
    found = stepped(ControllerSlave(config), {}, 100_000, 10_000)
    assert set(found[0].values()) == set(found[100_000].values()) == {0.0}


def test_with_locomotive_and_service_it_pulls(config):
    slaves = ServiceSlave(config), ControllerSlave(config), LocomotiveSlave(config)
    _, used = coupled(slaves, 3.0, scenario=1.0, duration=3.0)
    assert used > 0.15  # dry rail gives 0.37; the efforts rise for the first second


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"cycle": 0.0}, "cycle"),
        ({"cycle": 0.05}, "cycle_vehicle_speed"),
        ({"cycle_vehicle_speed": nan}, "cycle_vehicle_speed"),
    ],
)
def test_cycles_that_cannot_be_are_named(config, change, where):
    slave = ControllerSlave(config)
    with pytest.raises(InputError, match=f"^{where}: "):
        slave.setup({**starts(slave), **change}, 0)


def test_a_status_that_there_is_not_is_named(config):
    slave = ControllerSlave(config)
    slave.setup(starts(slave), 0)
    with pytest.raises(InputError, match="status: no item has the number 9; known: 0, 1"):
        slave.step(0, 2000, {**starts(slave), "status": 9.0})
