"""What can be hidden in a drive, in formulas of the worlds' own.

Two halves: what happens in the contact (`contact`), and what stands between the truth and the bus
(`between`). Both serve twice: to make the drive, and to predict the measured data by the true
model.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import solve_banded

from tests.worlds.contact_laws import ContactLaw, make_law
from tests.worlds.drive_profile import AXLES, INERTIA, RADIUS, STEP_S
from tests.worlds.other_laws import lateral_creep, other_factor, recovered_factor
from tests.worlds.rail import Floats, Ints

Parameters = Mapping[str, float]


@dataclass(frozen=True)
class Hidden:
    """An effect with its size; `form` is '' where there is one form only."""

    effect: str
    form: str
    parameters: Parameters


@dataclass(frozen=True)
class State:
    """What the contact feels, true or as measured; n rows of 10 ms.

    Attributes:
        t: s since the recording began, (n,).
        v: m/s, (n,).
        slip: signed, (n, 6).
        load: N, (n, 6).
        position: Travelled distance of the leading axle, m; shape (n,).
        curvature: 1/m, (n,).
        humidity: %, (n,).
        rail_temperature: degC, (n,).
        sanding: 0 or 1, (n,).
        order: place of each axle in the direction of travel, (6,).
        behind: Distance of each axle behind the leading one, m; shape (6,).

    """

    t: Floats
    v: Floats
    slip: Floats
    load: Floats
    position: Floats
    curvature: Floats
    humidity: Floats
    rail_temperature: Floats
    sanding: Floats
    order: Ints
    behind: Floats


@dataclass(frozen=True)
class Contact:
    """How the curve is entered and what multiplies it; every array (n, 6).

    μ = factor · (curve(λ_c) + hump(λ_c)) · λ/λ_c with λ_c² = λ² + λ_y². The curve is Burckhardt's,
    or `law` at the speed (n, 1) and the loads.
    """

    slip: Floats
    lateral: Floats
    factor: Floats
    speed: Floats
    load: Floats
    hump: Parameters = field(default_factory=dict)
    law: ContactLaw | None = None

    def entered(self) -> tuple[Floats, Floats]:
        """λ_c and λ/λ_c."""
        whole = np.hypot(self.slip, self.lateral)
        return whole, np.divide(self.slip, whole, out=np.zeros_like(whole), where=whole > 0)

    def adhesion(self, c: Floats) -> Floats:
        """μ, (n, 6), of a curve (3,) or one a row (n, 3)."""
        whole, share = self.entered()
        if self.law is not None:
            height = self.law.adhesion(whole, self.speed, self.load)
            return self.factor * share * (height + self.second_hump(whole))
        c = c[:, None, :] if c.ndim == 2 else c
        height = c[..., 0] * -np.expm1(-c[..., 1] * whole) - c[..., 2] * whole
        return self.factor * share * (height + self.second_hump(whole))

    def second_hump(self, whole: Floats) -> Floats | float:
        """Second hump of the curve at λ_c."""
        if not self.hump:
            return 0.0
        x = (whole - self.hump["center"]) / self.hump["width"]
        return self.hump["height"] * np.exp(-0.5 * x * x)


def find(effects: Sequence[Hidden], name: str) -> Hidden | None:
    """The effect of a name, if it is among them."""
    return next((e for e in effects if e.effect == name), None)


def contact(state: State, effects: Sequence[Hidden], c: Floats) -> Contact:
    """The contact under the effects; `c` is (n, 3), for the work that cleans the rail."""
    slip, lateral = state.slip, np.zeros_like(state.slip)
    if e := find(effects, "creep_relaxation"):
        slip = _lagged(slip, state.v, e.parameters["length"])
    if e := find(effects, "curve_creep"):
        lateral = lateral + lateral_creep(e.form, e.parameters, state.curvature)[:, None]
    factor = np.ones_like(slip)
    for e in effects:
        factor = factor * _factor(state, e)
    hump, shape = find(effects, "out:hump"), find(effects, "curve_shape")
    now = Contact(
        slip,
        lateral,
        factor,
        state.v[:, None],
        state.load,
        hump.parameters if hump else {},
        make_law(shape.form, shape.parameters) if shape else None,
    )
    if e := find(effects, "adhesion_recovery"):
        now = _recovered(state, e, now, c)
    return now


def _factor(state: State, hidden: Hidden) -> Floats | float:
    p, rows = hidden.parameters, (slice(None), None)
    other = other_factor(state, hidden.effect, hidden.form, p)
    if other is not None:
        return other
    creep_speed = np.abs(state.slip) * state.v[rows]
    match hidden.effect:
        case "speed_dependence":
            at_v = (7.5 / (3.6 * state.v + 44) + 0.161) / (7.5 / 44 + 0.161)
            return (1 + p["share"] * (at_v - 1))[rows]
        case "load_dependence" if hidden.form == "power":
            return (state.load / 1e5) ** -p["exponent"]
        case "load_dependence":
            return 1 - p["c5"] * state.load**2
        case "falling_friction" if hidden.form == "polach":
            return np.asarray((1 - p["A"]) * np.exp(-p["B"] * creep_speed) + p["A"])
        case "falling_friction":
            return np.asarray(np.exp(-p["c4"] * creep_speed))
        case "rail_cleaning":
            return (1 + p["gain"] * (state.order - 1))[None, :]
        case "humidity":
            return (1 + p["slope"] * (state.humidity - 60))[rows]
        case "rail_temperature":
            return (1 + p["slope"] * (state.rail_temperature - 20))[rows]
        case "sanding":
            return (1 + p["gain"] * state.sanding)[rows]
        case "slow_drift":
            return (1 + p["rate"] * state.t)[rows]
        case "traction_braking_asymmetry":
            return np.where(state.slip < 0, 1 + p["gain"], 1.0)
        case "out:periodic":
            place = state.position[rows] - state.behind
            return 1 + p["amplitude"] * np.sin(2 * np.pi * place / p["length"] + p["phase"])
        case _:
            return 1.0


def _lagged(slip: Floats, v: Floats, length: float) -> Floats:
    """Implicit steps of (length/v) dλ'/dt + λ' = λ, all axles at once."""
    share = 1 - np.exp(-v * STEP_S / max(length, 1e-9))
    # λ'_k − (1 − share) λ'_{k−1} = share · mean λ over the step
    drive = slip.copy()
    drive[1:] = share[1:, None] * 0.5 * (slip[1:] + slip[:-1])
    band = np.ones((2, len(v)))
    band[1, :-1] = -(1 - share[1:])
    return np.asarray(solve_banded((1, 0), band, drive))


def _recovered(state: State, hidden: Hidden, now: Contact, c: Floats) -> Contact:
    """1 + gain · W with dW/dt = P − W/time; P contains the factor, so a few rounds."""
    p = hidden.parameters
    creep_speed = np.abs(state.slip) * state.v[:, None]
    bare = np.abs(now.adhesion(c)) * state.load * creep_speed
    bare[state.t < 0] = 0.0
    keep = np.exp(-STEP_S / p["time"])
    band = np.ones((2, len(state.t)))
    band[1, :-1] = -keep
    factor = np.ones_like(bare)
    for _ in range(12):
        power = bare * factor
        drive = np.zeros_like(power)
        drive[1:] = 0.5 * (power[1:] + power[:-1]) * p["time"] * (1 - keep)
        new = recovered_factor(hidden.form, p, solve_banded((1, 0), band, drive))
        done = np.max(np.abs(new - factor)) < 1e-5
        factor = new
        if done:
            break
    return replace(now, factor=now.factor * factor)


@dataclass(frozen=True)
class Between:
    """Between the truth and the bus: radii (6,), inertia, scale and delays, bias."""

    radius: Floats
    inertia: float
    scale: float
    speed_delay: float
    effort_delay: float
    bias: float
    saturation: float


def between(effects: Sequence[Hidden]) -> Between:
    """What the effects put between the truth and the bus."""

    def of(effect: str, name: str, none: float = 0.0) -> float:
        found = find(effects, effect)
        return found.parameters[name] if found else none

    radius = np.full(AXLES, RADIUS)
    for e in (e for e in effects if e.effect == "wheel_radius"):
        radius[int(e.parameters["axle"]) - 1] *= 1 + e.parameters["error"]
    return Between(
        radius=radius,
        inertia=INERTIA + of("wheelset_inertia", "error"),
        scale=1 + of("speed_scale", "error"),
        speed_delay=of("speed_delay", "delay"),
        effort_delay=of("effort_delay", "delay"),
        bias=of("effort_bias", "bias"),
        saturation=of("out:saturation", "limit", np.inf),
    )
