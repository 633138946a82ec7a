"""Contacts that are not Burckhardt's: curves computed by others, and Polach's formulas.

Every law is a friction coefficient that falls with the creep speed w = s v, times a saturation:

    adhesion = μ(w) · φ(k s / μ(w)),    μ(w) = μ0 ((1 − A) e^(−B w) + A),    k = (Q0 / Q)^(1/3).

μ(w) and the saturation are Polach's (Wear 258 (2005) 992-1000). The slope at zero creep is
Kalker's: it goes with the contact area over the load, and by Hertz the area grows with Q^(2/3).
A curve that is known at one speed v0 and load Q0 alone gives μ(w) by its tail, where φ is 1, and
then φ point by point; so it is met exactly at (v0, Q0), and has a stated value at all others.
"""

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from tests.worlds.fitted_curve import project
from tests.worlds.rail import Floats

FILE = Path(__file__).with_name("data") / "contact_curves.csv"
FILE_SPEED, FILE_LOAD = 10.0, 213.4e3
"""Speed, m/s, and load of a wheelset, N, of the curves in the file."""
TAIL = 0.1
"""Slip from which the curves of the file are taken as sliding altogether."""
MODELS: Mapping[str, str] = {
    "extended": "contact_extended",
    "fastsim": "fastsim_modified",
    "coulomb": "contact_original",
    "fastsim-coulomb": "fastsim_original",
}
"""Models of the file by the name of the law."""
POLACH: Mapping[str, Mapping[str, float]] = {
    "polach-dry": {"kA": 1.0, "kS": 0.4, "mu0": 0.55, "A": 0.4, "B": 0.6},
    "polach-wet": {"kA": 0.3, "kS": 0.1, "mu0": 0.30, "A": 0.4, "B": 0.2},
}
"""Polach 2005, table of typical parameters for dry and wet rails; B in s/m."""
NAMES = (*MODELS, *POLACH)
KALKER_SLOPE = 231.0
"""Slope at zero creep of `contact_original`, which has no layer and no roughness: Kalker's."""


@dataclass(frozen=True)
class ContactLaw:
    """Adhesion by slip, speed and load.

    Attributes:
        mu0: Friction coefficient at rest.
        A: Friction coefficient at endless creep speed over that at rest.
        B: Fall of the friction coefficient, s/m.
        stiffness: Factor of the slope at zero creep.
        saturation: φ as a function of k s / μ(w), not negative.

    """

    mu0: float
    A: float
    B: float
    stiffness: float
    saturation: Callable[[Floats], Floats]

    def friction(self, creep_speed: Floats) -> Floats:
        """Friction coefficient at a creep speed, m/s."""
        return self.mu0 * ((1 - self.A) * np.exp(-self.B * creep_speed) + self.A)

    def adhesion(self, slip: Floats, speed: Floats, load: Floats) -> Floats:
        """Adhesion at slips that are not negative; all broadcast.

        Args:
            slip: Slip ratio, 0 or more.
            speed: Vehicle speed, m/s.
            load: Load of the wheelset, N.

        """
        mu = self.friction(slip * speed)
        stiffness = self.stiffness * np.cbrt(FILE_LOAD / load)
        return np.asarray(mu * self.saturation(stiffness * slip / mu))

    @property
    def falls(self) -> bool:
        """Whether there is a peak: beyond it friction falls with the creep speed."""
        return self.A < 1 and self.B > 0

    def peak(self, speed: float, load: float) -> tuple[float, float]:
        """Largest adhesion up to a slip of 0.5, and the slip that it stands at."""
        slip = np.geomspace(1e-4, 0.5, 4000)
        height = self.adhesion(slip, np.array(speed), np.array(load))
        at = int(np.argmax(height))
        return float(height[at]), float(slip[at])


def make_law(name: str, parameters: Mapping[str, float]) -> ContactLaw:
    """A law by its name and the numbers that `draw_parameters` draws."""
    p = parameters
    if name in POLACH:
        return ContactLaw(p["mu0"], p["A"], p["B"], p["stiffness"], _polach(p["kA"], p["kS"]))
    mu0, share, fall, saturation = _decomposed(MODELS[name])
    return ContactLaw(mu0 * p["level"], share, fall, p["stiffness"], saturation)


def draw_parameters(rng: np.random.Generator, name: str) -> dict[str, float]:
    """Numbers of a law: those of the literature, or of the file, moved a little."""
    if name not in POLACH:
        return {"level": rng.uniform(0.75, 1.2), "stiffness": rng.uniform(0.7, 1.3)}
    p = POLACH[name]
    reduced = rng.uniform(0.8, 1.2)
    return {
        "kA": p["kA"] * min(reduced, 1 / p["kA"]),
        "kS": p["kS"] * reduced,
        "mu0": p["mu0"] * rng.uniform(0.8, 1.1),
        "A": p["A"] * rng.uniform(0.85, 1.2),
        "B": p["B"] * rng.uniform(0.7, 1.3),
        "stiffness": rng.uniform(0.85, 1.15),
    }


def nearest_burckhardt(law: ContactLaw, speed: float, load: float) -> Floats:
    """c1, c2, c3 of the least squares about a law, slips even from 0 to 0.25; shape (3,)."""
    slip = np.linspace(0.0005, 0.25, 400)
    height = law.adhesion(slip, np.array(speed), np.array(load))
    return project(slip, np.ones_like(slip), height, np.ones_like(slip))


def _polach(adhesion_share: float, slip_share: float) -> Callable[[Floats], Floats]:
    """φ of Polach: ε is a quarter of π times Kalker's slope over the friction coefficient."""

    def saturation(x: Floats) -> Floats:
        gradient = np.pi / 4 * KALKER_SLOPE * x
        area, sliding = adhesion_share * gradient, slip_share * gradient
        return np.asarray(2 / np.pi * (area / (1 + area * area) + np.arctan(sliding)))

    return saturation


@cache
def _decomposed(model: str) -> tuple[float, float, float, Callable[[Floats], Floats]]:
    """μ0, A, B and φ of a curve of the file; φ is a monotone cubic, and level beyond its end."""
    slip, adhesion = file_curve(model)
    creep_speed = FILE_SPEED * slip
    tail = slip >= TAIL

    def friction(p: Floats) -> Floats:
        return np.asarray(p[0] * ((1 - p[1]) * np.exp(-p[2] * creep_speed) + p[1]))

    mu0, share, fall = _friction_of(friction, adhesion, tail)
    mu = friction(np.array([mu0, share, fall]))
    x, height = np.append(0.0, slip / mu), np.append(0.0, adhesion / mu)
    cubic = PchipInterpolator(x, height)
    return mu0, share, fall, lambda at: np.asarray(cubic(np.minimum(at, x[-1])))


def _friction_of(
    friction: Callable[[Floats], Floats], adhesion: Floats, tail: Floats
) -> tuple[float, float, float]:
    """μ0, A and B by the tail; a tail that is level is Coulomb's friction, A = 1."""
    if np.ptp(adhesion[tail]) < 1e-3:
        return float(adhesion[tail].mean()), 1.0, 0.0
    found = least_squares(
        lambda p: (friction(p) - adhesion)[tail],
        [adhesion.max(), 0.4, 0.6],
        bounds=([0, 0, 0], [1, 1, 5]),
        x_scale=[0.1, 0.1, 0.1],
        ftol=1e-12,
        xtol=1e-12,
    )
    mu0, share, fall = (float(x) for x in found.x)
    return mu0, share, fall


@cache
def file_curve(model: str) -> tuple[Floats, Floats]:
    """Slip and adhesion of a model in the file, ascending in slip; shape (30,) each."""
    with FILE.open() as file:
        rows = [r for r in csv.DictReader(file) if r["model"] == model]
    points = np.array([[float(r["slip"]), float(r["adhesion"])] for r in rows])
    return points[:, 0], points[:, 1]
