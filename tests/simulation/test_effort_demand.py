"""The simulated locomotive follows the efforts that a creep controller outside demands."""

import numpy as np
import pytest

from adhesion_can.bus.database import load_database
from adhesion_can.bus.protected_message import ProtectedMessage
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

DATABASE = load_database()


def simulation(*, obey=True, axles=6):
    vehicle = Locomotive() if axles == 6 else Locomotive((0.6,) * axles, (2e5,) * axles,
                                                         geometry=None)  # fmt: skip
    return Simulation(RunSettings(scenario_by_name("dry"), 10.0, vehicle=vehicle, obey=obey),
                      DATABASE)  # fmt: skip


class Controller:
    """Sends the same efforts again and again."""

    def __init__(self):
        self.messages = [
            ProtectedMessage(DATABASE.message(f"EffortDemand{number}")) for number in (1, 2)
        ]

    def frames(self, t_us, efforts):
        for message in self.messages:
            names = [name for name in message.plan.signals if name.startswith("Effort")]
            yield message.frame(t_us, {name: efforts[int(name[-1]) - 1] for name in names})


def run(sim, controller, efforts, seconds):
    for step in range(round(seconds / 0.002)):
        if step % 5 == 0:
            for frame in controller.frames(sim.now_us, efforts):
                sim.receive(frame)
        sim.step()
    return sim.plant.force


EFFORTS = (10e3, 20e3, 30e3, 25e3, 15e3, 5e3)


def test_each_axle_gives_the_effort_that_is_demanded_of_it():
    force = run(simulation(), Controller(), EFFORTS, 1.0)
    assert force == pytest.approx(EFFORTS, rel=0.02)


def test_without_demands_for_three_cycles_the_motors_give_nothing():
    sim, controller = simulation(), Controller()
    run(sim, controller, EFFORTS, 1.0)
    for _ in range(30):
        sim.step()
    assert np.abs(sim._drive.effort).max() < 0.02 * max(EFFORTS)


def test_what_is_not_available_demands_nothing_of_that_axle():
    sim = simulation()
    force = run(sim, Controller(), (10e3, None, 30e3, 25e3, 15e3, 5e3), 1.0)
    assert abs(force[1]) < 100.0
    assert force[2] == pytest.approx(30e3, rel=0.02)


def test_a_demand_beyond_the_motor_is_limited():
    sim = simulation()
    run(sim, Controller(), (200e3,) * 6, 0.2)
    assert sim._drive.effort.max() <= sim.settings.drive.effort_max


def test_damaged_demands_are_as_if_they_had_not_come():
    sim, controller = simulation(), Controller()
    run(sim, controller, EFFORTS, 0.5)
    for step in range(100):
        if step % 5 == 0:
            for frame in controller.frames(sim.now_us, (0.0,) * 6):
                sim.receive(frame._replace(data=bytes([frame.data[0] ^ 0xFF, *frame.data[1:]])))
        sim.step()
    assert np.abs(sim._drive.effort).max() < 0.02 * max(EFFORTS)  # stale by now, not followed


def test_a_drive_that_obeys_nobody_does_not_follow():
    left_alone, demanded = simulation(obey=False), simulation(obey=False)
    run(demanded, Controller(), (0.0,) * 6, 1.0)
    for _ in range(500):
        left_alone.step()
    assert np.array_equal(demanded.plant.wheel_speed, left_alone.plant.wheel_speed)


def test_a_vehicle_with_four_axles_takes_its_four():
    force = run(simulation(axles=4), Controller(), EFFORTS, 1.0)
    assert force == pytest.approx(EFFORTS[:4], rel=0.02)
