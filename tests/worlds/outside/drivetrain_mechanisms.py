"""Mechanisms between the motor's torque, as a drive computes it, and the rim of the wheel."""

import numpy as np

from tests.worlds.drive_profile import RADIUS, STEP_S
from tests.worlds.mechanism import Change, Scene
from tests.worlds.outside.registry import mechanism
from tests.worlds.outside.signals import low_pass

RATED = 100e3
"""Rated effort of an axle, N."""
IN_EFFORT = {"effort_gain": "the gain of the effort is wrong"}


def largest(scene: Scene) -> float:
    """Effort that the drive reaches, N: its motors are built for this rail or for more."""
    return float(np.quantile(np.abs(scene.effort), 0.995))


@mechanism(
    sizes=(0.06, 0.12, 0.25), unit="error at the largest effort",
    channel="tractive_effort", same=IN_EFFORT,
)  # fmt: skip
def motor_saturation(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """The drive computes torque from current with a constant flux, but the iron saturates.

    Law: shown F' = F (1 + s (F / F_max)²), the first term of the saturation's series.

    Literature: Boldea and Nasar, The Induction Machine Handbook, 2001; Fitzgerald, Kingsley and
    Umans, Electric Machinery, 2002. Sizes: 6 to 25 % at the largest effort.
    """
    return Change(gain=1 + size * (scene.effort / largest(scene)) ** 2)


@mechanism(
    sizes=(0.06, 0.12, 0.25), unit="error at the highest speed",
    channel="speed",
    same={
        "effort_gain": "the gain of the effort is wrong",
        "speed_dependence": "no measurement here parts a factor of the effort from one of the "
        "adhesion when both follow the speed",
    },
)  # fmt: skip
def field_weakening(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """Above the base speed the flux model is wrong by more and more.

    Law: shown F' = F (1 ± s max(0, 1 − ω_b/ω) / (1 − ω_b/ω_max)), ω_b at 8 to 12 m/s.

    Literature: Vas, Sensorless Vector and Direct Torque Control, 1998; Leonhard, Control of
    Electrical Drives, 2001. Sizes: 6 to 25 % at the highest speed, either way.
    """
    base = rng.uniform(8.0, 12.0)
    sign = 1.0 if rng.random() < 0.5 else -1.0
    weak = np.maximum(0, 1 - base / scene.profile.v)
    top = max(float(weak.max()), 0.1)
    return Change(gain=1 + sign * size * (weak / top)[:, None])


@mechanism(
    sizes=(2e3, 4e3, 8e3), unit="N an axle at 20 m/s",
    same={"effort_bias": "a drag that the effort contains is a bias of the effort"},
)  # fmt: skip
def gearbox_churning(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """The motor also turns a gearbox in cold oil, and the effort at the rim does not contain it.

    Law: shown F' = F + d (v / 20 m/s) e^(−E / E_0), E the distance of churning since the start:
    the oil warms over 1 to 3 km.

    Literature: Changenet and Velex, A model for the prediction of churning losses in geared
    transmissions, Journal of Mechanical Design, 2007; Niemann and Winter, Maschinenelemente, Band
    2, 2003. Sizes: 2 to 8 kN an axle at 20 m/s with cold oil.
    """
    profile = scene.profile
    warm = np.exp(-np.maximum(profile.position, 0) / rng.uniform(1e3, 3e3))
    return Change(offset=(size * profile.v / 20 * warm)[:, None])


@mechanism(
    sizes=(0.03, 0.06, 0.12), unit="share of the power lost at the rated effort",
    same={
        **IN_EFFORT,
        "traction_braking_asymmetry": "losses that traction and braking see with opposite signs",
    },
)  # fmt: skip
def gear_mesh_loss(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """The gears lose power in their mesh, in traction and in braking, more at high torque.

    Law: shown F' = F (1 + s |F| / F_r · sign F): the motor gives more than the rim has in traction,
    and takes less than it has in braking.

    Literature: Höhn, Michaelis and Vollmer, Thermal rating of gear drives: balance between power
    loss and heat dissipation, AGMA, 1996; Niemann and Winter, Maschinenelemente, Band 2, 2003.
    Sizes: 3 to 12 % at the drive's largest effort, old drives at the upper end.
    """
    return Change(gain=1 + size * scene.effort / largest(scene))


@mechanism(sizes=(0.04, 0.08, 0.16), unit="swing of the torque", same={})
def torque_ripple(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """The sixth harmonic of the motor's torque is folded down by the bus's 10 ms.

    Law: shown F' = F (1 + s sin(6 p i φ)), φ the wheel's angle, i = 4 to 6 the gear's ratio, p = 2
    or 3 pole pairs.

    Literature: Jahns and Soong, Pulsating torque minimization techniques for permanent magnet AC
    motor drives: a review, IEEE Transactions on Industrial Electronics, 1996. Sizes: 4 to 16 %,
    six-step operation at the upper end.
    """
    turn = (1 + scene.profile.slip) * scene.profile.v[:, None] / RADIUS
    angle = np.cumsum(turn, axis=0) * STEP_S
    ratio = 6 * int(rng.integers(2, 4)) * rng.uniform(4, 6)
    return Change(gain=1 + size * np.sin(ratio * angle))


@mechanism(
    sizes=(0.05, 0.1, 0.2), unit="copper loss over power at 5 m/s and the largest effort",
    channel="tractive_effort", same=IN_EFFORT,
)  # fmt: skip
def dc_link_torque(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """Effort computed from the power of the DC link, which also heats the copper.

    Law: shown F' = (F v + R F²) / v = F (1 + s (F / F_max) · (5 m/s) / v): too much in traction,
    too little in braking, most at low speed.

    Literature: Leonhard, Control of Electrical Drives, 2001; Boldea and Nasar, The Induction
    Machine Handbook, 2001. Sizes: 5 to 20 % of the power at 5 m/s.
    """
    return Change(gain=1 + size * scene.effort / largest(scene) * (5 / scene.profile.v)[:, None])


@mechanism(
    sizes=(0.15, 0.3, 0.6), unit="s of the averaging",
    same={"effort_delay": "a mean over the last T is late by half of it"},
)  # fmt: skip
def effort_averaging(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """The drive sends the mean effort of its last control periods.

    Law: F'(t) = (1/T) ∫ F over the last T.

    Literature: Åström and Wittenmark, Computer-Controlled Systems, 1997. Sizes: 0.15 to 0.6 s, as
    energy meters and data recorders have it.
    """
    rows = round(size / STEP_S)
    total = np.cumsum(np.concatenate([np.repeat(scene.effort[:1], rows, axis=0), scene.effort]), 0)
    mean = (total[rows:] - total[:-rows]) / rows
    return Change(offset=mean - scene.effort)


@mechanism(sizes=(3e3, 6e3, 12e3), unit="N of the limit cycle", same={})
def slip_controller_dither(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """An adhesion control searches with torque steps; the message holds the demand before them.

    Law: the effort shown lacks a square wave of ± d and 0.8 to 2 Hz, low-passed in 50 ms, while
    the slip is above 2 %; the wheel's true torque has it.

    Literature: Park, Kim, Choi and Yamazaki, Modeling and control of adhesion force in railway
    rolling stocks, IEEE Control Systems Magazine, 2008; Ohishi and others, Anti-slip control of
    electric motor coaches based on disturbance observer, 1998. Sizes: 3 to 12 kN an axle.
    """
    profile = scene.profile
    wave = np.sign(np.sin(2 * np.pi * rng.uniform(0.8, 2.0) * profile.t))[:, None]
    active = low_pass((np.abs(profile.slip) > 0.02).astype(float), 0.3)
    return Change(offset=-size * low_pass(wave, 0.05) * active)
