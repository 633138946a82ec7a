"""The mechanisms that a library may well have, in laws of the worlds' own: contact heat, load
transfer, gains of the effort, instruments of the speed, sand by axle, curving, blended brakes,
a wheel sensor's error once a turn.

Each draws its form and size and states the size that a diagnosis should find, in the parameters
that docs/diagnosis.md defines. Where the law is another one they hold to first order.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from tests.worlds.drive_profile import AXLES, STATIC_LOAD, STEP_S
from tests.worlds.mechanism import Change, Law, Scene
from tests.worlds.outside.contact_mechanisms import creep_speed
from tests.worlds.outside.signals import low_pass
from tests.worlds.outside.track_mechanisms import wheel_angle


@dataclass(frozen=True)
class Drawn:
    """A mechanism with its size.

    Attributes:
        form: Name of the law where there are several, else ''.
        parameters: Size as the effect's definition has it; 'axle' is the axle's number.
        law: what it does to a drive.

    """

    form: str
    parameters: Mapping[str, float]
    law: Law


Family = Callable[[np.random.Generator], Drawn]
FAMILIES: dict[str, Family] = {}


def family(draw: Family) -> Family:
    """Enter a family under the name of its function: the effect's id."""
    FAMILIES[draw.__name__] = draw
    return draw


FRICTION_LOST = 0.6
"""Share of the friction that heat can take."""
COUPLER_M, LINK_M, PIVOTS_M, WHEELBASE_M = 0.95, 0.46, 10.3, 3.8
"""Heights of coupler and traction link, distance of the bogies' pivots, wheelbase of a bogie."""


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is evenly distributed."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


@family
def contact_heating(rng: np.random.Generator) -> Drawn:
    """Friction falls with the slip work of the last seconds.

    Law: μ = μ0 (0.4 + 0.6 e^(−k W / 0.6)), dW/dt = |F λ v| − W/T, F with the friction that is
    left: hot steel keeps 0.4 of its friction. 'loss' is k in 1/J, the share lost per work at first;
    'time' is T in s.

    Literature: Tanvir, Temperature rise due to slip between wheel and rail, Wear, 1980; Ertz and
    Knothe, Wear, 2002. Sizes: losses of some 10 to 50 % at 50 to 150 kW of slip power.
    """
    k, memory = log_uniform(rng, 0.7e-6, 5e-6), rng.uniform(1.0, 3.5)

    def law(scene: Scene) -> Change:
        power = np.abs(scene.adhesion) * scene.profile.load * creep_speed(scene)
        power[scene.profile.t < 0] = 0.0
        factor = np.ones_like(power)
        work, keep = np.zeros(AXLES), np.exp(-STEP_S / memory)
        for row in range(1, len(power)):
            work = keep * work + memory * (1 - keep) * power[row] * factor[row - 1]
            factor[row] = 1 + FRICTION_LOST * np.expm1(-k * work / FRICTION_LOST)
        return Change(factor=factor)

    return Drawn("", {"loss": k, "time": memory}, law)


@family
def load_transfer(rng: np.random.Generator) -> Drawn:
    """Loads move with the effort while the frames show the static ones.

    Law: moments of the body on its two pivots, ΔN = −s F (h_c − h_l) / L shared by three axles, and
    of each bogie, ΔN = ∓ s F_b h_l / w at its outer axles: the leading ones are unloaded. 'size' is
    s, 1 for a coupler at 0.95 m, links at 0.46 m, pivots 10.3 m apart and a wheelbase of 3.8 m.

    Literature: Garg and Dukkipati, Dynamics of Railway Vehicle Systems, 1984; Spiryagin and others,
    Design and Simulation of Rail Vehicles, 2014. Sizes: 0.5 to 1.6, as heights differ from
    locomotive to locomotive.
    """
    size = log_uniform(rng, 0.5, 1.6)

    def law(scene: Scene) -> Change:
        static = np.broadcast_to(scene.vehicle.static_load, scene.adhesion.shape)
        effort = scene.adhesion * static
        # Places from the leading end: the first bogie is the one that leads.
        order = np.argsort(scene.vehicle.behind)
        bogies = effort[:, order].reshape(-1, 2, 3).sum(axis=2)
        body = bogies.sum(axis=1) * (COUPLER_M - LINK_M) / PIVOTS_M / 3
        moved = np.empty_like(effort)
        for bogie, sign in ((0, -1), (1, 1)):
            pitch = bogies[:, bogie] * LINK_M / WHEELBASE_M
            for place, arm in enumerate((-1, 0, 1)):
                moved[:, order[3 * bogie + place]] = size * (sign * body + arm * pitch)
        return Change(load_factor=(static + moved) / scene.profile.load, shown_load=static)

    return Drawn("", {"size": size}, law)


@family
def effort_gain(rng: np.random.Generator) -> Drawn:
    """The effort's gain is wrong: of one axle, in time, or with the heat of the motors.

    Law: 'axle': F' = (1 + g) F on one axle; 'time': F' = (1 + g t / 100 s) F; 'heat':
    F' = (1 + g H) F, dH/dt = ((F / 100 kN)² − H) / T for each axle, F its true effort. 'gain' is g,
    with heat that at 49 kN (0.2 of the static load); 'rate' g / 100 s, 'time' T in s.

    Literature: Krishnan and Bharadwaj, A review of parameter sensitivity and adaptation in indirect
    vector controlled induction motor drive systems, IEEE Transactions on Power Electronics, 1991:
    rotor resistance and magnets follow the heat. Sizes: 5 to 18 %.
    """
    form = str(rng.choice(("axle", "time", "heat")))
    sign = float(rng.choice((-1, 1)))
    gain, memory = sign * log_uniform(rng, 0.05, 0.18), rng.uniform(40, 80)
    axle = int(rng.integers(1, AXLES + 1))
    if form == "heat":
        gain *= 2.0

    def law(scene: Scene) -> Change:
        if form == "axle":
            factor = np.ones_like(scene.effort)
            factor[:, axle - 1] += gain
            return Change(gain=factor)
        if form == "time":
            return Change(gain=1 + gain * scene.profile.t[:, None] / 100)
        heat = low_pass(np.vstack([np.zeros(AXLES), (scene.effort / 100e3) ** 2]), memory)[1:]
        return Change(gain=1 + gain * heat)

    stated = {
        "axle": {"gain": gain, "axle": axle},
        "time": {"rate": gain / 100},
        "heat": {"gain": gain * (0.2 * STATIC_LOAD / 100e3) ** 2, "time": memory},
    }[form]
    return Drawn(form, stated, law)


@family
def speed_error(rng: np.random.Generator) -> Drawn:
    """The instrument of the vehicle's speed errs by a law.

    Law: 'step': v' = v (1 + e) from a moment on; 'pitch': v' = v cos(α + δ) / cos α with α = 45
    degrees and the tilt δ = −e F / ΣN, F the whole effort towards axle 1: v (1 + e F / ΣN) to
    first order;
    'offset': v' = v (1 + b κ), b m beside the middle of the track; 'low_pass': T dv'/dt + v' = v.
    'error' is e, 'offset' b in m, 'time' that moment or T in s.

    Literature: Skolnik, Introduction to Radar Systems, 2001 (the Doppler angle: 1 degree of tilt at
    45 is 1.7 %); Malvezzi, Allotta and Rinchi, Vehicle System Dynamics, 2011. Sizes: 0.3 to 4 %.
    """
    form = str(rng.choice(("step", "pitch", "offset", "low_pass")))
    sign = float(rng.choice((-1, 1)))
    draws = {
        "step": ("error", sign * log_uniform(rng, 0.005, 0.03)),
        "pitch": ("error", sign * log_uniform(rng, 0.015, 0.12)),
        "offset": ("offset", sign * log_uniform(rng, 0.7, 2.5)),
        "low_pass": ("time", log_uniform(rng, 0.15, 0.8)),
    }
    name, size = draws[form]
    moment = float(rng.uniform(60, 180))
    stated = {name: size, "time": moment} if form == "step" else {name: size}

    def law(scene: Scene) -> Change:
        profile = scene.profile
        if form == "step":
            return Change(speed=profile.v * (1 + size * (profile.t >= moment)))
        if form == "pitch":
            # The body tilts the other way when it is pushed the other way.
            along = 1.0 if scene.vehicle.forward else -1.0
            tilt = -size * along * scene.effort.sum(axis=1) / (AXLES * STATIC_LOAD)
            angle = np.pi / 4
            return Change(speed=profile.v * np.cos(angle + tilt) / np.cos(angle))
        if form == "offset":
            return Change(speed=profile.v * (1 + size * profile.curvature))
        return Change(speed=low_pass(profile.v, size))

    return Drawn(form, stated, law)


@family
def sanding(rng: np.random.Generator) -> Drawn:
    """Sand falls before some axles only, and what is left of it decays from axle to axle.

    Law: q = 1 at a sanded axle, q_i = d q_{i−1} behind it; factor = 1 + g q_i while sand is on,
    following in 0.4 s. 'gain' is g; pipes before the first axle of each bogie,
    of which 'axle' is the second one's number in the direction of travel.

    Literature: Lewis, Dwyer-Joyce and Lewis, Proceedings IMechE Part F, 2003; Arias-Cuevas and Li,
    Field investigations into the adhesion recovery in leaf-contaminated wheel-rail contacts with
    locomotive sanders, Proceedings IMechE Part F, 2011. Sizes: 15 to 80 % more adhesion.
    """
    gain, decay = log_uniform(rng, 0.15, 0.8), rng.uniform(0.1, 0.35)

    def law(scene: Scene) -> Change:
        order = np.argsort(scene.vehicle.behind)
        sand = low_pass(scene.profile.sanding, 0.4)
        factor, left = np.ones_like(scene.adhesion), 0.0
        for place, axle in enumerate(order):
            left = 1.0 if place in (0, 3) else decay * left
            factor[:, axle] += gain * left * sand
        return Change(factor=factor)

    return Drawn("axles", {"gain": gain, "axle": 4}, law)


@family
def curving_resistance(rng: np.random.Generator) -> Drawn:
    """The wheels drag in curves, and the motors' effort contains the drag.

    Law (Röckl): w = 0.65 m / (R − 55 m) for R of 300 m and more, F' = F + s w N along the travel.
    'size' is s: 1 for Röckl's stock with two axles in a rigid frame.

    Literature: Röckl's formula in Wende, Fahrdynamik des Schienenverkehrs, 2003. Sizes: 1.5 to 4
    for locomotives with stiff bogies of three axles on dry rail.
    """
    scale = log_uniform(rng, 1.5, 4.0)

    def law(scene: Scene) -> Change:
        bend = np.abs(scene.profile.curvature)
        drag = scale * 0.65 * bend / (1 - 55 * bend)
        return Change(offset=drag[:, None] * scene.profile.load)

    return Drawn("", {"size": scale}, law)


@family
def brake_blending(rng: np.random.Generator) -> Drawn:
    """Below a speed the friction brake takes over, and the motors' effort lacks its part.

    Law: in braking F' = F (1 − s · clip((v2 − v) / (v2 − 3 m/s), 0, 1)). 'fade' is v2 in m/s,
    'share' that of F at standstill if the line went on: s v2 / (v2 − 3 m/s).

    Literature: Wende, Fahrdynamik des Schienenverkehrs, 2003, for the fading of the electric
    brake and its blending. Sizes: 20 to 90 % of the force from v2 of 9 to 15 m/s on.
    """
    share, speed = rng.uniform(0.2, 0.9), rng.uniform(9.0, 15.0)

    def law(scene: Scene) -> Change:
        part = share * np.clip((speed - scene.profile.v) / (speed - 3.0), 0, 1)
        return Change(gain=np.where(scene.effort < 0, 1 - part[:, None], 1.0))

    return Drawn("", {"share": float(share * speed / (speed - 3.0)), "fade": float(speed)}, law)


@family
def wheel_once_per_turn(rng: np.random.Generator) -> Drawn:
    """A wheel sensor's ring sits beside the centre: its speed swings once a turn.

    Law: ω' = ω (1 + a cos(φ + φ0)) on one axle, φ its angle. 'amplitude' is a.

    Literature: Persson and Gustafsson, Event based sampling with application to vibration analysis
    in pneumatic tires, ICASSP, 2001, for the errors of toothed rings; Ohmae and others, 1982.
    Sizes: 0.2 to 1.2 %: 0.3 to 2 mm on a ring of 150 mm.
    """
    amplitude, phase = log_uniform(rng, 0.002, 0.012), rng.uniform(0, 2 * np.pi)
    axle = int(rng.integers(1, AXLES + 1))

    def law(scene: Scene) -> Change:
        factor = np.ones_like(scene.adhesion)
        factor[:, axle - 1] += amplitude * np.cos(wheel_angle(scene)[:, axle - 1] + phase)
        return Change(wheel_speed=scene.omega * factor)

    return Drawn("", {"amplitude": amplitude, "axle": axle}, law)
