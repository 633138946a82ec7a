"""Second set: mechanisms of what measures the speeds of vehicle and wheels."""

import numpy as np

from tests.worlds.drive_profile import AXLES, STEP_S
from tests.worlds.mechanism import Change, Scene
from tests.worlds.outside.instrument_mechanisms import SPEED_ERROR
from tests.worlds.outside.registry import mechanism
from tests.worlds.outside.signals import oscillator, rough_place, stretches
from tests.worlds.outside.track_mechanisms import wheel_angle


@mechanism(sizes=(3.0, 5.0, 8.0), unit="degrees of the joint", second=True)
def cardan_joint(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """The wheel's speed is measured at the gearbox, behind the joint of a cardan shaft.

    Law: ω' = ω cos β / (1 − sin² β cos² (i φ + φ_k)), φ the wheel's angle, i = 2 to 3 the ratio of
    the axle drive, φ_k of each axle's own.

    Literature: Seherr-Thoss, Schmelz and Aucktor, Universal Joints and Driveshafts, 2006. Sizes:
    3 degrees are a fluctuation of 0.0027, the limit in makers' tables; 5 and 8 where a second joint
    does not make up for the first.
    """
    bend = np.radians(size)
    turned = rng.uniform(2, 3) * wheel_angle(scene) + 2 * np.pi * rng.random(AXLES)
    ratio = np.cos(bend) / (1 - (np.sin(bend) * np.cos(turned)) ** 2)
    return Change(wheel_speed=scene.omega * ratio)


@mechanism(
    sizes=(0.02, 0.04, 0.08), unit="m/s standard deviation of the body's vertical speed",
    same=SPEED_ERROR, second=True,
)  # fmt: skip
def radar_heave(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """A radar with one beam takes the body's bounce for speed.

    Law: v' = v + ż tan α, the beam α = 40 to 55 degrees below the horizon; z a mass of 1 to 1.5 Hz
    and a damping of 0.2 on irregularities of 8 to 60 m wavelength, ż of a standard deviation s.

    Literature: Speed calibration and traceability for train-borne 24 GHz continuous-wave Doppler
    radar sensor, Sensors, 2020, for radars of one and two beams; Iwnicki (editor), Handbook of
    Railway Vehicle Dynamics, 2006. Sizes: 0.02 to 0.08 m/s: 4 to 15 mm at 1.2 Hz.
    """
    rough = rough_place(rng, scene.profile.position, (8.0, 60.0))
    rate = np.gradient(oscillator(rough, rng.uniform(1.0, 1.5), 0.2), STEP_S)
    lean = np.tan(np.radians(rng.uniform(40, 55)))
    return Change(speed=scene.profile.v + size * lean * rate / rate.std())


@mechanism(
    sizes=(0.01, 0.02, 0.04), unit="m/s² bias of the accelerometer", same=SPEED_ERROR, second=True
)
def satellite_outage(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """Under bridges and trees a receiver loses its satellites and integrates an accelerometer.

    Law: v' = v ± b (t − t_0) on covered stretches of 100 m in the mean, t_0 the moment of entry,
    120 m in the mean between them where v' = v.

    Literature: Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems,
    2008; Löffler and Bengtsson, Train localization during GNSS outages: a minimalist approach using
    track geometry and IMU sensor data, 2024, for outages of up to 30 s. Sizes: 1 to 4 mg, as of
    micromechanical accelerometers.
    """
    profile = scene.profile
    covered = stretches(rng, profile.position, 100.0, 120.0) > 0.5
    entry = np.maximum.accumulate(np.where(covered, -np.inf, profile.t))
    since = np.where(covered & np.isfinite(entry), profile.t - entry, 0.0)
    sign = 1.0 if rng.random() < 0.5 else -1.0
    return Change(speed=profile.v + sign * size * since)


@mechanism(sizes=(0.1, 0.5, 1.0), unit="km/h of a digit", same=SPEED_ERROR, second=True)
def coarse_speed(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """The speed comes from a recorder or a display, in coarse digits.

    Law: v' = q round(v/q).

    Literature: Widrow and Kollár, Quantization Noise, 2008; Federal Railroad Administration,
    Locomotive Event Recorders, Final Rule, 2005, for what records the speed. Sizes: digits of 0.1,
    0.5 and 1 km/h.
    """
    digit = size / 3.6
    return Change(speed=digit * np.round(scene.profile.v / digit))
