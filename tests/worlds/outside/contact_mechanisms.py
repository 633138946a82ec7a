"""Mechanisms in the contact of wheel and rail."""

import numpy as np

from tests.worlds.drive_profile import STEP_S
from tests.worlds.mechanism import Change, Scene
from tests.worlds.outside.registry import mechanism
from tests.worlds.outside.signals import leaky_sum, low_pass, play
from tests.worlds.rail import Floats

PRESSURE = 0.7e9
"""Mean pressure of a Hertz contact of a locomotive's wheel, Pa."""
LENGTH = 0.012
"""Length of that contact, m."""
EFFUSIVITY = 13.4e3
"""Thermal effusivity of steel, sqrt(k ρ c), J/(m² K s^½)."""
SHAPE = {
    "curve_shape": "at a speed that hardly changes, a factor in the creep speed is another curve",
    "channel:creep_speed": "a factor in the creep speed",
}


def creep_speed(scene: Scene) -> Floats:
    """|λ| v of each axle, m/s, (n, 6)."""
    return np.abs(scene.profile.slip) * scene.profile.v[:, None]


@mechanism(
    sizes=(0.15, 0.35, 0.7),
    unit="share of the friction lost at 300 K",
    channel="slip",
    same={
        "falling_friction": "the fall of friction with the creep speed is this heat",
        "contact_heating": "friction that falls with the heat of the contact, without its memory",
        **SHAPE,
    },
)
def flash_temperature(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """Friction falls with the flash temperature of the contact.

    Law: θ = (2/√π) · ½ μ p v_s · √(2a/v) / √(kρc) for a fast moving band of the length 2a, of whose
    heat ½ μ p v_s goes into each body; μ = μ0 (1 − s θ / 300 K), solved for μ.

    Literature: Ertz and Knothe, A comparison of analytical and numerical methods for the
    calculation of temperatures in wheel/rail contact, Wear, 2002; Ertz and Bucher, Improved creep
    force model for wheel/rail contact considering roughness and temperature, Vehicle System
    Dynamics, 2002. Sizes: 300 K are usual beyond the peak; losses of 15 to 70 %,
    as from iron that softens to a third body of oxide.
    """
    flux = 0.5 * np.abs(scene.adhesion) * PRESSURE * creep_speed(scene)
    stay = np.sqrt(LENGTH / scene.profile.v)[:, None]
    bare = 2 / np.sqrt(np.pi) * flux * stay / EFFUSIVITY
    return Change(factor=1 / (1 + size * bare / 300))


@mechanism(
    sizes=(0.3, 0.6, 1.0),
    unit="film thickness over roughness at 10 m/s",
    channel="speed",
    same={"speed_dependence": "adhesion that falls with the speed at the same slip is this film"},
)
def water_film(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """A film of water carries part of the load and thickens with the speed.

    Law: h/σ = Λ (v / 10 m/s)^0.67 (N / 245 kN)^−0.067 (Hamrock and Dowson's exponents); the
    asperities carry the share e^(−h/σ) of the load, and they alone make the friction.

    Literature: Chen, Ban, Ishida and Nakahara, Adhesion between rail and wheel under water
    lubricated contact, Wear, 2002; Hamrock and Dowson, Isothermal elastohydrodynamic lubrication of
    point contacts, 1977. Sizes: Λ of 0.3 to 1, from rough to smooth rails.
    """
    speed, load = scene.profile.v[:, None] / 10, scene.profile.load / 245e3
    film = size * speed**0.67 * load**-0.067
    return Change(factor=np.exp(size - film))


@mechanism(
    sizes=(0.02, 0.04, 0.08),
    unit="b of the law, in adhesion a factor e",
    channel="slip",
    same={"falling_friction": "its steady state falls with the creep speed", **SHAPE},
)
def rate_and_state(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """Friction that remembers over how long a slip its asperities are renewed.

    Law: μ/μ0 = 1 + a ln(V/V0) + b ln(V0 θ / D), dθ/dt = 1 − V θ / D with the creep speed V above
    1 cm/s, V0 = 0.3 m/s, a = b/3 and D from 0.1 to 1 m of the third body's layer.

    Literature: Dieterich, Modeling of rock friction: 1. Experimental results and constitutive
    equations, Journal of Geophysical Research, 1979; Ruina, Slip instability and state variable
    friction laws, Journal of Geophysical Research, 1983. Sizes: b over μ0 of 0.02 to 0.08.
    """
    distance = float(np.exp(rng.uniform(np.log(0.1), np.log(1.0))))
    speed = np.maximum(creep_speed(scene), 0.01)
    age = np.empty_like(speed)
    age[0] = distance / speed[0]
    for row in range(1, len(speed)):
        rest = distance / speed[row]
        age[row] = rest + (age[row - 1] - rest) * np.exp(-STEP_S / rest)
    direct = size / 3 * np.log(speed / 0.3)
    return Change(factor=1 + direct + size * np.log(0.3 * age / distance))


@mechanism(
    sizes=(0.002, 0.004, 0.008),
    unit="clearance of the slip",
    channel="slip_rate",
)
def slip_hysteresis(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """Rising slip and falling slip go through different branches, at any pace.

    Law: the contact follows the slip through a clearance (play operator): λ_c stays s/2 behind the
    slip whichever way it moves, however slowly; no lag in time or distance. Below a slip of 0.01
    the loop closes as tanh(|λ| / 0.01): a wheel that rolls freely has no force.

    Literature: Six, Meierhofer, Müller and Dietmaier, Physical processes in wheel-rail contact and
    its implications on vehicle-track interaction, Vehicle System Dynamics, 2015, for the loops of
    measured creep curves; Brokate and Sprekels, Hysteresis and Phase Transitions, 1996, for the
    operator. Sizes: loops 0.002 to 0.008 wide in slip.
    """
    slip = scene.profile.slip
    behind = play(slip, size) - slip
    return Change(slip=slip + behind * np.tanh(np.abs(slip) / 0.01))


@mechanism(
    sizes=(0.03, 0.06, 0.12),
    unit="share lost at 100 kW of the axle ahead",
    same={},
)
def heat_of_axle_ahead(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """The rail is still warm, and its film torn, from the slip of the axle ahead.

    Law: factor = 1 − s P_ahead(t − d/v) / 100 kW · e^(−d / (v T)), d the distance to the axle
    ahead, P = |F λ v| its slip power, T = 1.5 to 4 s; no part on the leading axle.

    Literature: Voltr and Lata, Transient wheel-rail adhesion characteristics under the cleaning
    effect of sliding, Vehicle System Dynamics, 2015; Tanvir, Temperature rise due to slip between
    wheel and rail, Wear, 1980. Sizes: 3 to 12 % at 100 kW, of which an
    axle in these drives makes half to all.
    """
    profile = scene.profile
    memory = rng.uniform(1.5, 4.0)
    power = np.abs(scene.adhesion) * profile.load * creep_speed(scene)
    order = np.argsort(scene.vehicle.behind)
    lost = np.zeros_like(power)
    for ahead, axle in zip(order[:-1], order[1:], strict=True):
        gap = scene.vehicle.behind[axle] - scene.vehicle.behind[ahead]
        late = gap / profile.v
        then = np.interp(profile.t - late, profile.t, power[:, ahead])
        lost[:, axle] = then / 100e3 * np.exp(-late / memory)
    return Change(factor=np.maximum(1 - size * lost, 0.3))


@mechanism(
    sizes=(0.2, 0.4, 0.6),
    unit="share of the friction lost in the minimum",
    channel="slip",
    same={
        "falling_friction": "the falling branch of the law is friction that falls with creep speed",
        **SHAPE,
    },
)
def stribeck_minimum(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """Friction falls to a minimum and rises again with the creep speed: mixed lubrication.

    Law: factor = 1 − s · 4 u / (1 + u)², u = v_s / v_m, with the minimum at v_m = 0.4 to 1.0 m/s.

    Literature: Popovici, Friction in wheel-rail contacts, thesis, University of Twente, 2010, for
    Stribeck curves of wheel and rail; the form in u is the simplest with one minimum. Sizes: 20 to
    60 % of the friction lost.
    """
    u = creep_speed(scene) / rng.uniform(0.4, 1.0)
    return Change(factor=1 - size * 4 * u / (1 + u) ** 2)


@mechanism(
    sizes=(0.1, 0.2, 0.4),
    unit="share of the friction lost in full dew",
    channel="humidity",
    same={
        "humidity": "the moisture of the air makes the film",
        "rail_temperature": "a colder rail is wetter at the same air",
        "channel:rail_temperature": "a colder rail is wetter at the same air",
    },
)
def dew(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """A rail below the dew point of the air is wet, one well above it is not.

    Law: dew point T_d = b γ / (a − γ) with γ = ln(RH) + a T / (b + T), a = 17.62, b = 243.1 degC
    (Magnus); factor = 1 − s / (1 + e^((T_rail − T_d − T_0) / 2 K)), moisture following in 10 s.
    T_0 is the drive's median, else most drives would be all wet or all dry.

    Literature: White and others, Effect of the presence of moisture at the wheel-rail interface
    during dew and damp conditions, Proceedings IMechE Part F, 2018; WMO, Guide to Meteorological
    Instruments, for Magnus' constants. Sizes: a film costs 10 to 40 %.
    """
    profile, (a, b) = scene.profile, (17.62, 243.1)
    air = profile.ambient_temperature
    gamma = np.log(profile.humidity / 100) + a * air / (b + air)
    excess = profile.rail_temperature - b * gamma / (a - gamma)
    wet = low_pass(1 / (1 + np.exp((excess - np.median(excess)) / 2)), 10.0)
    return Change(factor=1 - size * wet[:, None])


@mechanism(
    sizes=(0.08, 0.16, 0.32),
    unit="largest share of the friction lost",
    channel="time",
)
def shower(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """A short shower: a little water with oxides is slippery, more washes them off.

    Law: factor = 1 − s u e^(1 − u), u = (t − t0) / T from t0 on, T = 8 to 20 s, once in 100 s.

    Literature: Beagley and Pritchard, Wheel/rail adhesion: the overriding influence of water, Wear,
    1975. Sizes: 8 to 32 % at the worst moment.
    """
    t, last = scene.profile.t, scene.profile.t[-1]
    factor = np.ones_like(t)
    begin = rng.uniform(0.1, 0.4) * min(last, 100.0)
    while begin < last:
        u = np.maximum(t - begin, 0) / rng.uniform(8, 20)
        factor *= 1 - size * u * np.exp(1 - u)
        begin += rng.uniform(70, 130)
    return Change(factor=factor[:, None])


@mechanism(
    sizes=(0.15, 0.3, 0.6),
    unit="share gained under the sander",
    same={},
)
def automatic_sander(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """The slip protection sands before one axle for itself; no message says so.

    Law: while the slip of axle k exceeds a threshold (0.4 to 0.6 of its largest) sand falls, for
    3 s at least; factor = 1 + s q for axle k and those behind it, halved from axle to axle, q
    following in 0.5 s.

    Literature: Lewis, Dwyer-Joyce and Lewis, Disc machine study of contact isolation during railway
    track sanding, Proceedings IMechE Part F, 2003; Arias-Cuevas, Low adhesion in the wheel-rail
    contact, thesis, TU Delft, 2010. Sizes: 15 to 60 % more adhesion.
    """
    order = np.argsort(scene.vehicle.behind)
    place = int(rng.integers(0, 4))
    slip = np.abs(scene.profile.slip[:, order[place]])
    over = slip > rng.uniform(0.4, 0.6) * slip.max()
    recent = leaky_sum(over.astype(float), 1e6)
    rows = round(3 / STEP_S)
    before = np.concatenate([np.zeros(rows), recent[:-rows]])
    sand = low_pass((recent - before > 0.5 * STEP_S).astype(float), 0.5)
    factor = np.ones_like(scene.adhesion)
    for behind, axle in enumerate(order[place:]):
        factor[:, axle] += size * 0.5**behind * sand
    return Change(factor=factor)
