"""Mechanisms of the track: what a place does to every axle that runs over it."""

import numpy as np

from tests.worlds.drive_profile import AXLES, RADIUS, STEP_S
from tests.worlds.mechanism import Change, Scene
from tests.worlds.outside.registry import mechanism
from tests.worlds.outside.signals import oscillator, rough_place, stretches
from tests.worlds.rail import Floats


def places(scene: Scene) -> Floats:
    """Place on the track of each axle, m, (n, 6)."""
    return np.asarray(scene.profile.position[:, None] - scene.vehicle.behind)


@mechanism(
    sizes=(0.1, 0.2, 0.4),
    unit="share of the friction lost on leaves",
    channel="position",
)
def leaf_patches(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """Patches of crushed leaves, some tens of metres long.

    Law: along the track a Markov process of two states, rail (mean 80 m) and leaf film (mean 25 m);
    factor = 1 − s on the film, for each axle as it comes there.

    Literature: Cann, The leaves on the line problem: a study of leaf residue film formation and
    lubricity under laboratory test conditions, Tribology Letters, 2006; Olofsson and Sundvall,
    Influence of leaf, humidity and applied lubrication on friction in the wheel-rail contact,
    Proceedings IMechE Part F, 2004. Sizes: 10 to 40 % lost.
    """
    return Change(factor=1 - size * stretches(rng, places(scene), 25.0, 80.0))


@mechanism(
    sizes=(0.12, 0.25, 0.5),
    unit="first dip of the load",
    channel="position",
)
def rail_joints(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """A dipped joint every 25 m unloads the wheel, which then rings out.

    Law: N/N0 = 1 − s e^(−x / 2 m) cos(2π x / 2.5 m), x behind the last joint.

    Literature: Jenkins, Stephenson, Clayton, Morland and Lyon, The effect of track and vehicle
    parameters on wheel/rail vertical dynamic forces, Railway Engineering Journal, 1974. Sizes:
    P2 forces of 12 to 50 % of the static load.
    """
    x = np.mod(places(scene) + rng.uniform(0, 25), 25.0)
    return Change(load_factor=1 - size * np.exp(-x / 2) * np.cos(2 * np.pi * x / 2.5))


@mechanism(
    sizes=(0.08, 0.16, 0.3),
    unit="share of the adhesion lost at 15 m/s",
    channel="position",
)
def corrugation(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """On corrugated stretches the load swings far above what a bus samples: adhesion is lost.

    Law: the swing of the load grows with v² up to the contact's resonance, and the loss with its
    square: factor = 1 − 2 s u / (1 + u), u = (v / 15 m/s)⁴, on stretches of 60 m in 200 m.

    Literature: Grassie and Kalousek, Rail corrugation: characteristics, causes and treatments,
    Proceedings IMechE Part F, 1993; Knothe and Groß-Thebing, Short wavelength rail corrugation and
    non-steady-state contact mechanics, Vehicle System Dynamics, 2008. Sizes: 8 to 30 %.
    """
    u = (scene.profile.v[:, None] / 15) ** 4
    swing = 2 * u / (1 + u)
    return Change(factor=1 - size * swing * stretches(rng, places(scene), 60.0, 140.0))


@mechanism(
    sizes=(0.05, 0.1, 0.2),
    unit="standard deviation of the load's change",
    channel="position",
)
def bounce(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """The vehicle bounces on the track's irregularities; loads of 5 Hz are filtered and late.

    Law: N/N0 = 1 + s z, z the stretch of the spring under a mass of 1.4 Hz and a damping of 0.15
    on irregularities of 3 to 30 m wavelength, scaled to variance 1; one bogie after the other.

    Literature: Iwnicki (editor), Handbook of Railway Vehicle Dynamics, 2006; Garg and Dukkipati,
    Dynamics of Railway Vehicle Systems, 1984. Sizes: 5 to 20 % of the load.
    """
    centre = places(scene).reshape(-1, 2, 3).mean(axis=2)
    rough = rough_place(rng, centre, (3.0, 30.0))
    swing = rough - oscillator(rough, 1.4, 0.15)
    swing /= swing.std()
    return Change(load_factor=1 + np.clip(size * np.repeat(swing, 3, axis=1), -0.6, 0.6))


@mechanism(
    sizes=(0.1, 0.2, 0.4),
    unit="share of the friction lost at the lubricator",
    channel="curvature",
    same={"channel:position": "the film lies in places"},
)
def flange_lubricator(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """Grease of a wayside lubricator before sharp curves gets on the head of the rail.

    Law: factor = 1 − s e^(−x/L), x the distance behind the entry of a curve below 700 m of radius,
    L = 60 to 150 m, on straight track as in the curve.

    Literature: Eadie, Santoro and Powell, Local control of noise and vibration with KELTRACK
    friction modifier and Protector trackside application, Journal of Sound and Vibration, 2003;
    Lewis and Olofsson (editors), Wheel-Rail Interface Handbook, 2009. Sizes: 10 to 40 %.
    """
    profile = scene.profile
    sharp = np.abs(profile.curvature) > 1 / 700
    entries = profile.position[np.flatnonzero(sharp[1:] & ~sharp[:-1]) + 1]
    # Where the line has no sharp curve in this drive, its first curve has the lubricator.
    if len(entries) == 0:
        bends = np.flatnonzero(np.abs(profile.curvature) > 0.5 * np.abs(profile.curvature).max())
        entries = profile.position[bends[:1]]
    x = places(scene)
    since = np.searchsorted(entries, x, side="right") - 1
    behind = np.where(since < 0, np.inf, x - entries[np.maximum(since, 0)])
    return Change(factor=1 - size * np.exp(-behind / rng.uniform(60, 150)))


@mechanism(
    sizes=(0.1, 0.2, 0.4),
    unit="swing of the load at 15 m/s",
)
def polygonal_wheel(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """A wheelset out of round with three to five corners on two axles.

    Law: N/N0 = 1 + s (v / 15 m/s)² / (1 + (v/25 m/s)²) cos(p φ + φ0), φ the angle of the wheel.

    Literature: Johansson and Andersson, Out-of-round railway wheels: a study of wheel
    polygonalization through simulation of three-dimensional wheel-rail interaction and wear,
    Vehicle System Dynamics, 2005; Nielsen and Johansson, Out-of-round railway wheels: a literature
    survey, Proceedings IMechE Part F, 2000. Sizes: 10 to 40 % of the load.
    """
    angle, v = wheel_angle(scene), scene.profile.v
    grown = size * (v / 15) ** 2 / (1 + (v / 25) ** 2)
    factor = np.ones_like(angle)
    for axle in rng.choice(AXLES, 2, replace=False):
        corners, phase = int(rng.integers(3, 6)), rng.uniform(0, 2 * np.pi)
        factor[:, axle] += grown * np.cos(corners * angle[:, axle] + phase)
    return Change(load_factor=np.maximum(factor, 0.1))


@mechanism(
    sizes=(0.3, 0.6, 1.0),
    unit="share of the load gone above the flat",
)
def wheel_flat(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """A flat of some centimetres on one axle: unloading, then an impact, once a turn.

    Law: over 0.15 of a turn the load falls by s, over the next 0.10 it is higher by 0.75 s, both as
    half sines; the wheel's own springs keep the rest of the impact from the contact's mean.

    Literature: Newton and Clark, An investigation into the dynamic effects on the track of
    wheelflats on railway vehicles, Journal of Mechanical Engineering Science, 1979. Sizes: 30 to
    100 % of the load for 50 to 100 mm.
    """
    axle = int(rng.integers(AXLES))
    turn = np.mod(wheel_angle(scene)[:, axle] / (2 * np.pi) + rng.random(), 1.0)
    falls = np.where(turn < 0.15, np.sin(np.pi * turn / 0.15), 0.0)
    after = (turn - 0.15) / 0.10
    rises = np.where((after > 0) & (after < 1), np.sin(np.pi * after), 0.0)
    factor = np.ones_like(scene.adhesion)
    factor[:, axle] += size * (0.75 * rises - falls)
    return Change(load_factor=np.maximum(factor, 0.0))


def wheel_angle(scene: Scene) -> Floats:
    """Angle of each wheel, rad, (n, 6)."""
    turn = (1 + scene.profile.slip) * scene.profile.v[:, None] / RADIUS
    return np.asarray(np.cumsum(turn, axis=0) * STEP_S)
