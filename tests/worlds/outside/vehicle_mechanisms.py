"""Mechanisms of loads, bogies and wheels."""

import numpy as np

from tests.worlds.drive_profile import AXLES
from tests.worlds.mechanism import Change, Scene
from tests.worlds.outside.registry import mechanism
from tests.worlds.outside.signals import leaky_sum, low_pass, oscillator, play

UNSEEN_LOAD = {"load_transfer": "loads that move with the effort while the frames do not show it"}
PITCH = np.array([-1.0, 0.0, 1.0, -1.0, 0.0, 1.0])
"""Load on the axles of each bogie as it pitches under traction, travelling forward."""


@mechanism(sizes=(5e3, 10e3, 20e3), unit="N of friction each way", same=UNSEEN_LOAD)
def air_spring_friction(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """Loads weighed by air springs stand still while guides and dampers stick.

    Law: shown load = play of 2 f around the true one, behind a filter of 0.8 s; the truth moves
    as it did.

    Literature: Berg, A non-linear rubber spring model for rail vehicle dynamics analysis, Vehicle
    System Dynamics, 1998, for the friction; Docquier, Fisette and Jeanmart, Multiphysic modelling
    of railway vehicles equipped with pneumatic suspensions, Vehicle System Dynamics, 2007. Sizes:
    2 to 8 % of the load of an axle.
    """
    return Change(shown_load=play(low_pass(scene.profile.load, 0.8), 2 * size))


@mechanism(sizes=(0.3, 0.6, 1.2), unit="share of an axle's effort", same=UNSEEN_LOAD)
def bogie_pitch(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """The bogie pitches as a mass on springs when the effort changes; the scales see its mean only.

    Law: ΔN = s x (y − ȳ), y the bogie's mean effort behind an oscillator of 1 to 2.5 Hz and a
    damping of 0.1, ȳ the same behind the weighing filter of 2 s; x = −1, 0, 1 along the bogie.

    Literature: Garg and Dukkipati, Dynamics of Railway Vehicle Systems, 1984; Spiryagin, Cole, Sun,
    McClanachan, Spiryagin and McSweeney, Design and Simulation of Rail Vehicles, 2014. Sizes: 30 to
    120 % of an axle's effort: three axles, 0.6 m above the rail, on 3.8 m make 50 %.
    """
    bogie = scene.effort.reshape(-1, 2, 3).mean(axis=2)
    moved = oscillator(bogie, rng.uniform(1.0, 2.5), 0.1) - low_pass(bogie, 2.0)
    lean = PITCH if scene.vehicle.forward else -PITCH
    moved = size * np.repeat(moved, 3, axis=1) * lean
    return Change(load_factor=np.maximum(1 + moved / scene.profile.load, 0.2))


@mechanism(sizes=(10e3, 20e3, 40e3), unit="N of attraction an axle", same={})
def eddy_brake_attraction(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """A linear eddy-current brake of one bogie pulls itself to the rail while the train brakes.

    Law: N grows by A / (1 + (v / v_c)²) on the three axles of one bogie in braking, v_c = 8 to
    15 m/s, following in 0.3 s; strain gauges above the magnet do not feel it.

    Literature: Wang and Chiueh, Analysis of eddy-current brakes for high speed railway, IEEE
    Transactions on Magnetics, 1998. Sizes: 10 to 40 kN of the magnets' normal force an axle.
    """
    brakes = low_pass((scene.adhesion.mean(axis=1) < -0.02).astype(float), 0.3)
    pull = size * brakes / (1 + (scene.profile.v / rng.uniform(8, 15)) ** 2)
    factor = np.ones_like(scene.adhesion)
    bogie = slice(0, 3) if rng.random() < 0.5 else slice(3, AXLES)
    factor[:, bogie] += pull[:, None] / scene.profile.load[:, bogie]
    return Change(load_factor=factor)


@mechanism(sizes=(0.002, 0.004, 0.008), unit="growth of the radius at 150 kW held", same={})
def tread_growth(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """Tyres grow with the heat of slip and brakes, and shrink again.

    Law: Δr/r = g W / (150 kW T) with dW/dt = P − W/T, P the slip power of the wheel and in braking
    12 % of the brake power as well, T = 30 to 80 s; radii are right when cold.

    Literature: Vernersson, Temperatures at railway tread braking, Part 1: modelling, Proceedings
    IMechE Part F, 2007. Sizes: 0.2 to 0.8 %; a tyre that is 150 K hotter has grown by 0.2 %, the
    larger ones are loosened or worn unevenly.
    """
    profile, memory = scene.profile, rng.uniform(30, 80)
    force = np.abs(scene.adhesion) * profile.load
    slip = force * np.abs(profile.slip) * profile.v[:, None]
    brake = np.where(scene.adhesion < 0, 0.12 * force * profile.v[:, None], 0.0)
    heat = leaky_sum(slip + brake, memory)
    return Change(rotation=1 / (1 + size * heat / (150e3 * memory)))


@mechanism(sizes=(0.004, 0.008, 0.016), unit="change of the rolling radius at 1/500 m", same={})
def rolling_radius_in_curves(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """Wheelsets shift sideways in curves and roll on other radii, bogie by bogie alike.

    Law: Δr/r = g · tanh(|κ| · 500 m) · (1, 0.2, −0.6) for the first, middle and last axle of each
    bogie in the direction of travel: the leading one climbs to the flange, the trailing one stands
    to the inside.

    Literature: Wickens, Fundamentals of Rail Vehicle Dynamics: Guidance and Stability, 2003;
    Polach, Characteristic parameters of nonlinear wheel/rail contact geometry, Vehicle System
    Dynamics, 2010. Sizes: 0.4 to 1.6 %: 10 mm of shift on a conicity of 0.25 to 1.
    """
    pattern = np.tile([1.0, 0.2, -0.6], 2)
    pattern = pattern if scene.vehicle.forward else pattern[::-1]
    bend = np.tanh(np.abs(scene.profile.curvature) * 500)[:, None]
    return Change(rotation=1 / (1 + size * bend * pattern))
