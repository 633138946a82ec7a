"""Library effects by other laws: another pivot, another function, the same mechanism.

Where a law has its own parameter its size is not that of the library's; names of parameters that
mean the same are the same.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.worlds.rail import Floats

Parameters = Mapping[str, float]


@dataclass(frozen=True)
class OtherLaw:
    """A law of an effect.

    Attributes:
        form: its name.
        name: of its size.
        limits: Lowest and highest size.

    """

    form: str
    name: str
    limits: tuple[float, float]


OTHER_LAWS: Mapping[str, OtherLaw] = {
    "speed_dependence": OtherLaw("kother", "fall", (0.0, 2.4)),
    "load_dependence": OtherLaw("linear", "slope", (-3.0e-6, 3.0e-6)),
    "falling_friction": OtherLaw("kraft", "rate", (0.0, 3.0)),
    "rail_cleaning": OtherLaw("geometric", "step", (-0.1, 0.15)),
    "adhesion_recovery": OtherLaw("saturating", "first_gain", (0.0, 1e-5)),
    "curve_creep": OtherLaw("flanging", "straight_lever", (0.0, 45.0)),
    "humidity": OtherLaw("exponential", "rate", (-0.012, 0.012)),
    "rail_temperature": OtherLaw("exponential", "rate", (-0.025, 0.025)),
    "sanding": OtherLaw("following", "gain", (-0.5, 2.0)),
    "slow_drift": OtherLaw("exponential", "growth", (-0.006, 0.006)),
    "traction_braking_asymmetry": OtherLaw("even", "gain", (-0.6, 1.0)),
}
"""The others are definitions: a radius, an inertia, a scale, a bias, a delay have one law each."""
SANDING_S = 0.7
"""Time after which sand has reached the contacts, s."""
HIGHEST_RECOVERY = 0.8
"""Share of the adhesion that slip work can win back at most."""
FLANGING_M = 150.0
"""Lateral creep grows no more where the flange touches, in curves tighter than this radius."""


def other_factor(state: Any, effect: str, form: str, p: Parameters) -> Floats | None:
    """Factor of the adhesion, (n, 6) or what broadcasts to it; None: no law of this module.

    Kother: 9 / (V + 42 km/h) + 0.116 over its value at 12 m/s. Kraft: 1 / (1 + B v_s). Others:
    linear in the load about 230 kN; (1 + g)^k about the middle of the vehicle; e^(k (RH − 75 %));
    e^(k (T − 8 degC)); sand that is followed; e^(k (t − 100 s)); asymmetry on both directions.
    """
    rows = (slice(None), None)
    match effect, form:
        case "speed_dependence", "kother":
            at_v, pivot = (9 / (3.6 * v + 42) + 0.116 for v in (state.v, 12.0))
            return (1 + p["fall"] * (at_v / pivot - 1))[rows]
        case "load_dependence", "linear":
            return np.asarray(1 - p["slope"] * (state.load - 230e3))
        case "falling_friction", "kraft":
            return np.asarray(1 / (1 + p["rate"] * np.abs(state.slip) * state.v[rows]))
        case "rail_cleaning", "geometric":
            return ((1 + p["step"]) ** (state.order - 3.5))[None, :]
        case "humidity", "exponential":
            return np.exp(p["rate"] * (state.humidity - 75))[rows]
        case "rail_temperature", "exponential":
            return np.exp(p["rate"] * (state.rail_temperature - 8))[rows]
        case "sanding", "following":
            return (1 + p["gain"] * followed(state.t, state.sanding))[rows]
        case "slow_drift", "exponential":
            return np.exp(p["growth"] * (state.t - 100))[rows]
        case "traction_braking_asymmetry", "even":
            half = np.sqrt(1 + p["gain"])
            return np.where(state.slip < 0, half, 1 / half)
        case _:
            return None


def followed(t: Floats, x: Floats) -> Floats:
    """A signal of steps behind a first-order lag of `SANDING_S`, begun at its first value."""
    keep = np.exp(-np.diff(t, prepend=t[0]) / SANDING_S)
    y = np.empty_like(x)
    last = float(x[0])
    for row, (now, k) in enumerate(zip(x, keep, strict=True)):
        last = float(now + k * (last - now))
        y[row] = last
    return y


def recovered_factor(form: str, p: Parameters, work: Floats) -> Floats:
    """Factor of adhesion that a slip work has won: linear in it, or saturating."""
    if form != "saturating":
        return 1 + p["gain"] * work
    won = -np.expm1(-p["first_gain"] * work / HIGHEST_RECOVERY)
    return np.asarray(1 + HIGHEST_RECOVERY * won)


def lateral_creep(form: str, p: Parameters, curvature: Floats) -> Floats:
    """Lateral creep ratio in a curve of a curvature, 1/m, (n,)."""
    bend = np.abs(curvature)
    if form != "flanging":
        return np.asarray(p["lever"] * bend)
    return np.asarray(p["straight_lever"] * bend / (1 + FLANGING_M * bend))
