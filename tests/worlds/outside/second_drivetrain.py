"""Second set: mechanisms of motors, their supply and brakes, which the shown effort misses."""

import numpy as np

from tests.worlds.drive_profile import AXLES, STEP_S
from tests.worlds.mechanism import Change, Scene
from tests.worlds.outside.drivetrain_mechanisms import IN_EFFORT, RATED
from tests.worlds.outside.registry import mechanism


@mechanism(sizes=(0.25, 0.5, 1.0), unit="share of the bogie's mean in the message", second=True)
def one_inverter_a_bogie(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """Three motors hang on one inverter, which knows their sum and not what each of them does.

    Law: shown F'_k = (1 − s) F_k + s F̄, F̄ the mean of the three axles of the bogie.

    Literature: Kouadria and Azaiz, Artificial neural networks direct torque control of single
    inverter feed two induction motors, Journal Européen des Systèmes Automatisés, 2021, for the
    average control of motors in parallel. Sizes: 1 where the sum is shared out evenly, 0.25 and 0.5
    where a model of the motors tells a part of the difference.
    """
    bogies = scene.effort.reshape(-1, 2, 3)
    mean = np.broadcast_to(bogies.mean(axis=2, keepdims=True), bogies.shape)
    return Change(offset=size * (mean.reshape(-1, AXLES) - scene.effort))


@mechanism(sizes=(0.04, 0.08, 0.16), unit="swing of the motor's torque", second=True)
def broken_rotor_bar(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """A motor with broken rotor bars swings at twice its slip frequency; its message has the mean.

    Law: shown F' = F (1 − s sin θ) on one axle, dθ/dt = 2 · 2π f_r |F| / F_r, f_r = 0.6 to 1.2 Hz
    the rotor's frequency at the rated effort.

    Literature: Thomson and Fenger, Current signature analysis to detect induction motor faults,
    IEEE Industry Applications Magazine, 2001; Bellini, Filippetti, Franceschini, Tassoni and
    Kliman, Quantitative evaluation of induction motor broken bars by means of electrical signature
    analysis, IEEE Transactions on Industry Applications, 2001: side bands of n/N of the current.
    Sizes: n/N for two, four and eight bars of fifty.
    """
    axle = int(rng.integers(AXLES))
    frequency = rng.uniform(0.6, 1.2) * np.abs(scene.effort[:, axle]) / RATED
    angle = 2 * np.pi * (2 * np.cumsum(frequency) * STEP_S + rng.random())
    gain = np.ones_like(scene.effort)
    gain[:, axle] -= size * np.sin(angle)
    return Change(gain=gain)


@mechanism(
    sizes=(0.04, 0.08, 0.16), unit="sag of the voltage at the largest power", same=IN_EFFORT,
    second=True,
)  # fmt: skip
def line_voltage_sag(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """The line's voltage sags under the locomotive's power, and the torque with its square.

    Law: shown F' = F / (1 − u)², u = s P / P_max, P = v ΣF: computed for the nominal voltage; a
    brake that feeds back raises the voltage.

    Literature: Steimel, Electric Traction: Motive Power and Energy Supply, 2008; Frederick and
    Dubey, AC motor traction drives: a status review, Sadhana, 1997, for weak supplies; EN 50163,
    Railway applications: supply voltages of traction systems, 2004. Sizes: 4 to 16 %; the standard
    lets 25 kV fall to 19 kV.
    """
    power = scene.profile.v * scene.effort.sum(axis=1)
    sag = size * power / max(float(np.abs(power).max()), 1.0)
    return Change(gain=(1 - sag[:, None]) ** -2)


@mechanism(
    sizes=(6e3, 12e3, 24e3), unit="N of drag at standstill",
    same={"effort_bias": "a drag that the effort contains is a bias of the effort"}, second=True,
)  # fmt: skip
def dragging_brake_block(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """The cast-iron blocks of one axle do not come off the tread.

    Law (Karwatzki): shown F' = F + D on one axle, D = s (V + 100) / (5 V + 100), V in km/h: the
    blocks' friction falls with the speed, and the motor overcomes it.

    Literature: Koffman, Adhesion and friction in rail traction, Journal of the Institution of
    Locomotive Engineers, 1948; Wende, Fahrdynamik des Schienenverkehrs, 2003, for the formula.
    Sizes: 6 to 24 kN at standstill, 3 to 12 kN at 10 m/s: a tenth to a half of a full application.
    """
    kmh = 3.6 * scene.profile.v
    offset = np.zeros_like(scene.effort)
    offset[:, int(rng.integers(AXLES))] = size * (kmh + 100) / (5 * kmh + 100)
    return Change(offset=offset)
