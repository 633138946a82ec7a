"""Second set: mechanisms in the contact of wheel and rail, and of a wheelset that swings in it."""

import numpy as np

from tests.worlds.drive_profile import AXLES, RADIUS
from tests.worlds.mechanism import Change, Scene
from tests.worlds.outside.registry import mechanism
from tests.worlds.outside.track_mechanisms import places, wheel_angle
from tests.worlds.rail import Floats, curve, peak

HALF_TRACK = 0.75
"""Half the distance of the contact points on the two rails, m."""
MEAN_CURVE = {"curve_shape": "the mean over the swing is another curve of the measured creep"}


@mechanism(
    sizes=(0.15, 0.3, 0.6),
    unit="share of the friction lost on the wet arc",
    second=True,
)
def puddle_on_the_wheel(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """Wheels pick up a puddle of friction modifier on an arc of the tread and carry it along.

    Law: factor = 1 − s p_k e^(−x/L) max(0, cos(φ − φ_0)), x the distance rolled since the
    applicator, φ − φ_0 the wheel's turn since it rolled through the puddle, L = 80 to 250 m and
    p_k = 0.7^k for the k-th axle there, as each leaves less; applicators every 300 to 600 m.

    Literature: Rahmani, Gutsulyak, Stanlake, Stoeber and Green, Carrydown of liquid friction
    modifier, Proceedings IMechE Part F, 2022: a liquid goes down the track on the wheels, and on a
    straight none is found some 200 m behind the applicator. Sizes: friction modifiers are made for
    a friction of 0.3 to 0.4, a wet puddle is below that: 15 to 60 % lost.
    """
    place, angle = places(scene), wheel_angle(scene)
    starts = _applicators(rng, float(scene.profile.position[-1]))
    length = rng.uniform(80, 250)
    factor = np.ones_like(place)
    for rank, axle in enumerate(np.argsort(scene.vehicle.behind)):
        x, phi = place[:, axle], angle[:, axle]
        last = np.searchsorted(starts, x, side="right") - 1
        start = starts[np.maximum(last, 0)]
        turned = phi - np.interp(start, x, phi)
        left = np.where(last < 0, 0.0, 0.7**rank * np.exp(-np.maximum(x - start, 0) / length))
        factor[:, axle] -= size * left * np.maximum(np.cos(turned), 0)
    return Change(factor=factor)


def _applicators(rng: np.random.Generator, last: float) -> Floats:
    """Places of the applicators up to a place, m; the first one soon after the beginning."""
    found = [float(rng.uniform(30, 120))]
    while found[-1] < last:
        found.append(found[-1] + float(rng.uniform(300, 600)))
    return np.array(found)


@mechanism(
    sizes=(0.1, 0.2, 0.4),
    unit="share of friction above that of a run-in wheel, at the beginning",
    channel="position",
    second=True,
)
def freshly_turned_wheels(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """Two wheelsets come from the lathe: their grooves grip until they are rolled flat.

    Law: factor = 1 + s e^(−x/L) on two axles, x the distance rolled, L = 300 to 1500 m: 80 to 400
    turns.

    Literature: Lundmark, Höglund and Prakash, Running-in behaviour of rail and wheel contacting
    surfaces, International Conference on Tribology, Parma, 2006; Blau, On the nature of running-in,
    Tribology International, 2005. Sizes: 10 to 40 % more friction than after running-in.
    """
    rolled = np.maximum(scene.profile.position, 0)
    factor = np.ones_like(scene.adhesion)
    axles = rng.choice(AXLES, 2, replace=False)
    factor[:, axles] += (size * np.exp(-rolled / rng.uniform(300, 1500)))[:, None]
    return Change(factor=factor)


@mechanism(
    sizes=(0.002, 0.004, 0.008),
    unit="m of the bogie's lateral swing",
    channel="position",
    same=MEAN_CURVE,
    second=True,
)
def bogie_hunting(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """A stiff bogie hunts: the two wheels of an axle creep against each other, and sideways.

    Law: y = s sin(k x + φ) at the bogie's middle, ψ = dy/dx; an axle d before it stands at
    y_w = y + d ψ, its wheels have the creeps λ ± δ, δ = γ y_w/r + b dψ/dx, and both the lateral one
    ν = d dψ/dx; it gives ½ Σ μ(ρ) (λ ± δ)/ρ, ρ² = (λ ± δ)² + ν². The bogie's moments balance for
    k² = γ/(r b) / (1 + mean(d²)/b²), Klingel's wave where d is 0; b = 0.75 m, conicity γ = 0.2 to
    0.5, as of worn wheels.

    Literature: Klingel, Über den Lauf der Eisenbahnwagen auf gerader Bahn, 1883; Antali, Stepan and
    Hogan, Kinematic oscillations of railway wheelsets, Multibody System Dynamics, 2015; Wickens,
    Fundamentals of Rail Vehicle Dynamics, 2003, for the stiff bogie. Sizes: 2 to 8 mm, at which the
    flanges touch.
    """
    conicity = rng.uniform(0.2, 0.5)
    at = places(scene).reshape(-1, 2, 3)
    middle = at.mean(axis=2, keepdims=True)
    ahead = at - middle
    stiff = 1 + float(np.mean(ahead[0, 0] ** 2)) / HALF_TRACK**2
    wave = np.sqrt(conicity / (RADIUS * HALF_TRACK) / stiff)
    phase = wave * middle + 2 * np.pi * rng.random((2, 1))
    swing, yaw = size * np.sin(phase), size * wave * np.cos(phase)
    yaw_rate = -(wave**2) * swing
    opposed = conicity * (swing + ahead * yaw) / RADIUS + HALF_TRACK * yaw_rate
    sideways = ahead * yaw_rate
    creeps = (opposed.reshape(-1, AXLES), sideways.reshape(-1, AXLES))
    return Change(factor=_shared(scene, *creeps))


def _shared(scene: Scene, opposed: Floats, sideways: Floats) -> Floats:
    """Force along the rail of two wheels with opposed and lateral creep, over that without."""
    total = np.zeros_like(opposed)
    for sign in (1, -1):
        along = scene.profile.slip + sign * opposed
        whole = np.hypot(along, sideways)
        force = curve(scene.curves, whole)
        total += 0.5 * force * along / np.maximum(whole, 1e-30)
    return _over(total, curve(scene.curves, scene.profile.slip))


def _over(force: Floats, bare: Floats) -> Floats:
    """Quotient, and 1 where there is no force."""
    return np.where(bare == 0, 1.0, force / np.where(bare == 0, 1.0, bare))


@mechanism(
    sizes=(0.7, 1.0, 1.3),
    unit="swing over the creep",
    channel="slip",
    same=MEAN_CURVE,
    second=True,
)
def torsional_chatter(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """Beyond the peak the two wheels swing against each other, faster than the bus samples.

    Law: factor = ⟨μ(λ + a cos θ)⟩ / μ(λ) over a swing, a = s λ · clip((|λ| − λ_m) / 0.03, 0, 1),
    λ_m the peak's creep: where friction falls with creep, the swing is fed until a wheel sticks
    for a moment, which it does at a = λ.

    Literature: Dybala, Fridrichovský and Kalivoda, The individual drive of a wheelset and the
    problematics of its electromechanical phenomena, 2024, for swings that loosen press fits. Sizes:
    0.7 to 1.3 of the creep, around the amplitude at which a wheel sticks.
    """
    slip = scene.profile.slip
    peaks = {tuple(c): peak(c)[1] for c in np.unique(scene.curves, axis=0)}
    onset = np.array([peaks[tuple(c)] for c in scene.curves])[:, None]
    swing = size * slip * np.clip((np.abs(slip) - onset) / 0.03, 0, 1)
    angles = (np.arange(16) + 0.5) * np.pi / 16
    mean = np.mean([curve(scene.curves, slip + swing * np.cos(a)) for a in angles], axis=0)
    return Change(factor=_over(mean, curve(scene.curves, slip)))
