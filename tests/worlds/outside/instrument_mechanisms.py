"""Mechanisms of what measures the speeds of vehicle and wheels."""

import numpy as np

from tests.worlds.drive_profile import STEP_S
from tests.worlds.mechanism import Change, Scene
from tests.worlds.outside.registry import mechanism
from tests.worlds.outside.signals import leaky_sum, low_pass, oscillator, stretches

SPEED_ERROR = {"speed_error": "a law in the instrument of the vehicle's speed"}


@mechanism(
    sizes=(0.002, 0.004, 0.008), unit="change of scale from track bed to track bed",
    channel="position", same=SPEED_ERROR,
)  # fmt: skip
def radar_on_track_beds(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """A Doppler radar reads another angle's speed from wet slab than from ballast.

    Law: v' = v cos(α + δ) / cos α ≈ v (1 ± s/2), the angle's shift δ changing from stretch to
    stretch (means 90 m each) as the ground reflects more steeply or less.

    Literature: Skolnik, Introduction to Radar Systems, 2001, for the law of the angle; how far the
    ground shifts it is taken from that law: 0.5 degrees at 45 are 0.9 %. Sizes: 0.2 to 0.8 %.
    """
    profile = scene.profile
    slab = stretches(rng, profile.position, 90.0, 90.0)
    return Change(speed=profile.v * (1 + size * (slab - 0.5)))


@mechanism(sizes=(0.1, 0.2, 0.4), unit="s of the filter", same=SPEED_ERROR)
def tracking_filter(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """A receiver follows the speed by an α-β filter: right on ramps, wrong where they end.

    Law: v̂ and its slope â predicted each 10 ms, corrected by α and β = α²/(2 − α) of what was
    measured, α = 1 − e^(−10 ms/T): after each change of the acceleration v̂ overshoots.

    Literature: Benedict and Bordner, Synthesis of an optimal set of radar track-while-scan
    smoothing equations, IRE Transactions on Automatic Control, 1962. Sizes: T of 0.1 to 0.4 s.
    """
    v = scene.profile.v
    alpha = 1 - np.exp(-STEP_S / size)
    beta = alpha * alpha / (2 - alpha)
    shown = np.empty_like(v)
    speed, slope = float(v[0]), 0.0
    for row, true in enumerate(v):
        speed += slope * STEP_S
        miss = float(true) - speed
        speed += alpha * miss
        slope += beta / STEP_S * miss
        shown[row] = speed
    return Change(speed=shown)


@mechanism(
    sizes=(0.2, 0.5, 1.0), unit="s between two readings",
    same={
        "speed_delay": "a reading held for T is late by T/2 in the mean",
        "speed_error": "a law in the instrument of the vehicle's speed",
    },
)  # fmt: skip
def speed_hold(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """A receiver computes a new speed a few times in a second, and the bus repeats it.

    Law: v'(t) = v(T ⌊t/T⌋), a zero-order hold.

    Literature: Åström and Wittenmark, Computer-Controlled Systems, 1997. Sizes: 0.2 to 1 s, the
    rates of satellite receivers.
    """
    t = scene.profile.t
    return Change(speed=np.interp(size * np.floor(t / size + 1e-9), t, scene.profile.v))


@mechanism(
    sizes=(40.0, 16.0, 8.0), unit="pulses a turn",
    same={"wheel_speed_delay": "a period that is measured when it is over is late by half of it"},
)  # fmt: skip
def pulse_timing(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """A wheel sensor times whole pulses: at low speed its readings are old and few.

    Law: ω' = 2π m / (P T) over the last m whole pulses that fill a gate of 20 ms (M/T method).

    Literature: Ohmae, Matsuda, Kamiyama and Tachikawa, A microprocessor-controlled high-accuracy
    wide-range speed regulator for motor drives, IEEE Transactions on Industrial Electronics, 1982.
    Sizes: 40, 16 and 8 pulses a turn.
    """
    profile, pulses, omega = scene.profile, round(size), scene.omega
    shown = np.empty_like(omega)
    for axle in range(omega.shape[1]):
        angle = np.cumsum(omega[:, axle]) * STEP_S * pulses / (2 * np.pi) + 0.13 * axle
        counts = np.arange(np.floor(angle[0]), np.floor(angle[-1]) + 1)
        # Moment of every pulse, from the angle between two rows.
        when = np.interp(counts, angle, profile.t)
        last = np.clip(np.searchsorted(when, profile.t, side="right") - 1, 1, None)
        first = np.searchsorted(when, when[last] - 0.02, side="right") - 1
        first = np.clip(np.minimum(first, last - 1), 0, None)
        span = when[last] - when[first]
        speed = 2 * np.pi * (last - first) / pulses / np.maximum(span, 1e-6)
        shown[:, axle] = np.where(span > 1e-4, speed, omega[:, axle])
    return Change(wheel_speed=shown)


@mechanism(sizes=(0.03, 0.06, 0.12), unit="m/s of the coupler's swing at full effort",
           same=SPEED_ERROR)  # fmt: skip
def train_surge(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """The speed is measured on the first wagon, which surges behind its coupler.

    Law: v' = v − dx/dt, x the stretch of the coupler, an oscillator of 0.6 to 1.2 Hz and a damping
    of 0.08 under the locomotive's effort, dx/dt scaled to s at the drive's largest swing.

    Literature: Cole, Spiryagin, Wu and Sun, Modelling, simulation and applications of longitudinal
    train dynamics, Vehicle System Dynamics, 2017. Sizes: 0.03 to 0.12 m/s.
    """
    pull = scene.effort.sum(axis=1)
    stretch = oscillator(pull, rng.uniform(0.6, 1.2), 0.08)
    rate = np.gradient(stretch, STEP_S)
    return Change(speed=scene.profile.v - size * rate / np.abs(rate).max())


@mechanism(sizes=(0.3, 0.6, 1.2), unit="s of the filter", same=SPEED_ERROR | {
    "channel:gradient": "the error follows the gradient"})  # fmt: skip
def accelerometer_on_gradient(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """An accelerometer bridges the radar's noise and takes the gradient for acceleration.

    Law: dv'/dt = dv/dt + g i + (v − v')/T, so v' − v = g i behind a lag of T, times T; i is the
    gradient, its mean taken out by the device, and short ramps of the track added.

    Literature: Allotta, Colla and Malvezzi, Train position and speed estimation using wheel
    velocity measurements, Proceedings IMechE Part F, 2002. Sizes: T of 0.3 to 1.2 s.
    """
    profile = scene.profile
    slope = profile.gradient - profile.gradient.mean()
    return Change(speed=profile.v + leaky_sum(9.81 * slope, size))


@mechanism(sizes=(0.004, 0.008, 0.016), unit="slip of the axle at full braking",
           same=SPEED_ERROR)  # fmt: skip
def braked_reference_axle(scene: Scene, size: float, rng: np.random.Generator) -> Change:
    """The trailing axle that measures the speed is braked a little, and slips.

    Law: v' = v (1 − s b (1 + 3 b²)/4), b the braking share of the largest brake force, filtered in
    0.4 to 1 s like the brake pipe; in traction v' = v.

    Literature: Malvezzi, Allotta and Rinchi, Odometric estimation for automatic train protection
    and control systems, Vehicle System Dynamics, 2011. Sizes: 0.4 to 1.6 %.
    """
    total = low_pass(np.maximum(-scene.effort.sum(axis=1), 0), rng.uniform(0.4, 1.0))
    b = total / max(float(total.max()), 1.0)
    return Change(speed=scene.profile.v * (1 - size * b * (1 + 3 * b * b) / 4))


@mechanism(sizes=(0.5, 1.0, 2.0), unit="m of the window",
           same={"speed_delay": "a window of length L is late by L/(2v)"} | SPEED_ERROR
)  # fmt: skip
def spatial_filter_sensor(scene: Scene, size: float, _rng: np.random.Generator) -> Change:
    """An optical sensor correlates the pattern of the rail over a fixed length of it.

    Law: v'(t) = 2 L over the time that the last 2 L took; late by L/v, most at low speed.

    Literature: Ator, Image-velocity sensing with parallel-slit reticles, Journal of the Optical
    Society of America, 1963. Sizes: L of 0.5 to 2 m.
    """
    profile = scene.profile
    ago = np.interp(profile.position - 2 * size, profile.position, profile.t)
    span = np.maximum(profile.t - ago, STEP_S)
    return Change(speed=np.where(span > 2 * STEP_S, 2 * size / span, profile.v))
