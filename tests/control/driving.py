"""A controller in a world of wheelsets: what it reaches."""

import numpy as np

from adhesion_can.control.creep_controller import CreepController
from adhesion_can.control.inputs import Advice, Measurement
from adhesion_can.physics.vehicle import Locomotive
from tests.worlds.traction import LOAD, STEP_S, Wheelsets, burckhardt, tangent

DRY, WET, GREASY = burckhardt(0.4, 60, 0.3), burckhardt(0.27, 45, 0.22), burckhardt(0.15, 40, 0.12)
STEEP, FLAT = burckhardt(0.40, 200, 0.30), burckhardt(0.10, 15, 0.02)
OTHER = tangent(0.3, 0.05, 0.5)
SURFACES = {
    "dry": DRY, "wet": WET, "greasy": GREASY, "steep": STEEP, "flat": FLAT, "other form": OTHER,
}  # fmt: skip
GRID = np.linspace(0.001, 0.6, 6000)


def peak_of(curve):
    """Height and place of a curve's peak, by looking at all of it."""
    values = curve(GRID)
    return float(values.max()), float(GRID[values.argmax()])


def constant(curves):
    return lambda _: curves


def drive(curves, seconds, *, advice=None, controller=None, seed=1, spoil=None, **world):
    """Rows of (time, share of the force, largest slip over its peak's), and the controller.

    Args:
        curves: Function of time: one curve for all axles, or a list.
        seconds: Time to drive, s.
        advice: Function of time; None: the service says nothing.
        spoil: Function of (cycle, speed, rim) that gives them as they are received.

    """
    plant = Wheelsets(curves, seed=seed, **world)
    axles = len(plant.rim)
    vehicle = Locomotive((0.625,) * axles, (LOAD,) * axles, geometry=None)
    controller = controller or CreepController(vehicle)
    demand, rows, peaks = np.zeros(axles), [], {}
    for cycle in range(round(seconds / STEP_S)):
        plant.step(demand)
        speed, rim, effort = plant.measured()
        if spoil is not None:
            speed, rim = spoil(cycle, speed, rim)
        measured = Measurement(plant.t_s, speed, rim, effort, plant.load)
        demand = controller.step(measured, advice(plant.t_s) if advice else Advice())
        under = curves(plant.t_s)
        under = [under] * axles if callable(under) else under
        for curve in under:
            if curve not in peaks:
                peaks[curve] = peak_of(curve)
        tops = np.array([peaks[curve] for curve in under])
        share = (plant.used * plant.load).sum() / (tops[:, 0] * plant.load).sum()
        rows.append((plant.t_s, share, (plant.slip / tops[:, 1]).max()))
    return np.array(rows), controller
