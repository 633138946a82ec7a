"""Columns for the eye: residual over a channel, measured against simulated, curve with data."""

from collections.abc import Sequence

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import Course
from adhesion_can.diagnosis.inference.channel_splines import Channel, Kind
from adhesion_can.diagnosis.regression.model import EXCLUDED, Model, Study, Theta, evaluate
from adhesion_can.diagnosis.result import CurveData, Picture, Profile
from adhesion_can.physics import burckhardt
from adhesion_can.physics.effects import build_instruments
from adhesion_can.physics.effects.curve_creep import ANGLE, CURVATURE

BINS = 24
WINDOW_S, RESTART_S = 20.0, 0.2
POINTS = 4000


def shown_channel(study: Study, name: str, channels: Sequence[Channel]) -> Channel | None:
    """A channel by name, also those that are only shown; None where the data do not have it."""
    for channel in channels:
        if channel.name == name:
            return channel
    seen = [course.observe() for course in study.courses]
    if name == CURVATURE:
        return next((channel for channel in channels if channel.name == ANGLE), None)
    if name == "creep_speed":
        creep = np.abs(np.concatenate([one.creep_speed for one in seen]))
        return Channel(name, "m/s", Kind.FACTOR, creep)
    if name == "signed_slip":
        return Channel(name, "1", Kind.OFFSET, np.concatenate([one.slip for one in seen]))
    return None


def profile_of(
    study: Study, channel: Channel, before: Array, after: Array, change: Array, predicted: Array
) -> Profile:
    """Mean residuals over bins of a channel.

    Args:
        study: see there.
        channel: over which.
        before: residual of the plain model, adhesion, shape (n,).
        after: of the extended one.
        change: of the prediction by the extension.
        predicted: adhesion, for the direction of the effort.

    """
    used = study.surface != EXCLUDED
    values = channel.values[used]
    sign = np.copysign(1.0, predicted[used]) if channel.kind is not Kind.OFFSET else 1.0
    levels = np.unique(values)
    if len(levels) <= BINS:
        number = np.searchsorted(levels, values)
    else:
        edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)))
        number = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    # Rows of one second at one axle are no independent evidence: the error counts seconds.
    second = np.floor(study.column("t_s")[used]).astype(np.int64)
    count = np.maximum(np.bincount(number), 1)
    kept = np.bincount(number) > 0

    def mean(column: Array) -> tuple[Array, Array]:
        signed = column[used] * sign
        middle = np.bincount(number, signed) / count
        spread = np.sqrt(np.bincount(number, (signed - middle[number]) ** 2) / count)
        seconds = np.array([max(len(np.unique(second[number == i])), 1) for i in range(len(count))])
        return middle[kept], (spread / np.sqrt(seconds))[kept]

    (was, was_std), (left, left_std) = mean(before), mean(after)
    at = (np.bincount(number, values) / count)[kept]
    fitted = mean(change)[0]
    name = "place within the wave" if channel.period else channel.name
    return Profile(name, channel.unit, at, was, left, was_std, left_std, fitted)


def pictures_of(course: Course, surface: int, plain: Model, extended: Model) -> list[Picture]:
    """The stretch of a recording in which the extension changes most, for the axle concerned.

    Args:
        course: every row of the recording.
        surface: number of the curve to use where the recording has several: the longest one's.
        plain: curves alone.
        extended: with effects.

    """
    if not len(course) or course.table:
        return []
    study = Study((course,), np.zeros(len(course), dtype=np.int64), 1)
    before = evaluate(study, Theta(plain.theta.values[[surface]]), plain.actives)
    after = evaluate(study, Theta(extended.theta.values[[surface]]), extended.actives)
    change = np.abs(before.residual - after.residual)
    axles = np.unique(course.axle)
    axle = int(max(axles, key=lambda i: float(np.mean(change[course.axle == i] ** 2))))
    own = np.flatnonzero(course.axle == axle)
    second = np.floor(course.t_s[own] / (WINDOW_S / 2)).astype(np.int64)
    starts = np.unique(second)
    power = [float(np.sum(change[own][second == s] ** 2)) for s in starts]
    start_s = float(starts[int(np.argmax(power))]) * WINDOW_S / 2
    rows = own[(course.t_s[own] >= start_s) & (course.t_s[own] < start_s + WINDOW_S)]
    if len(rows) < 10:
        return []
    return [
        Picture(
            recording=course.name,
            axle=axle,
            time_s=course.t_s[rows] + course.first_us / 1e6,
            wheel_speed=course.source(0.0, 0.0).wheel_speed[rows],
            simulated_before=simulated(course, rows, plain, surface),
            simulated_after=simulated(course, rows, extended, surface),
            adhesion=before.adhesion[rows],
            predicted_before=before.predicted[rows],
            predicted_after=after.predicted[rows],
            restart_s=RESTART_S,
        )
    ]


def simulated(course: Course, rows: np.ndarray, model: Model, surface: int) -> Array:
    """Wheel speed from measured effort and vehicle speed, rad/s: J dω/dt = r (F − μ(λ) N).

    Linearly implicit in ω, since the contact is stiff. Beyond the peak the wheel is unstable, and
    any simulation leaves the measurement there: so it begins anew from it at times.
    """
    instruments = build_instruments(model.actives)
    seen = course.observe(instruments)
    study = Study((course,), np.zeros(len(course), dtype=np.int64), 1)
    theta = Theta(model.theta.values[[surface]])
    at = evaluate(study, theta, model.actives)
    c1, log_c2, c3 = theta.values[0]
    c2 = float(np.exp(log_c2))
    radii = course.radius * instruments.radius_factor(len(course.radius))
    radius = float(radii[course.axle[rows[0]] - 1])
    inertia = max(course.inertia + instruments.inertia_error, 1.0)
    effort = course.effort[rows] - instruments.effort_bias
    speed, load = seen.speed[rows], seen.load[rows]
    shift, factor = (at.slip - seen.slip)[rows], at.factor[rows]
    true_slip = seen.slip[rows]
    t_s = course.t_s[rows]
    slip = np.empty(len(rows))
    restarted = t_s[0]
    slip[0] = true_slip[0]
    for i in range(1, len(rows)):
        dt = t_s[i] - t_s[i - 1]
        if t_s[i] - restarted >= RESTART_S or dt > 0.1:
            slip[i], restarted = true_slip[i], t_s[i]
            continue
        omega = (1.0 + slip[i - 1]) * speed[i - 1] / radius
        here = omega * radius / speed[i] - 1.0
        inside = here + shift[i]
        mu = factor[i] * float(burckhardt.adhesion(inside, c1, c2, c3))
        slope = factor[i] * float(burckhardt.adhesion_slope(inside, c1, c2, c3))
        stiff = max(slope, 0.0) * load[i] * radius / speed[i]
        gain = dt * radius / inertia
        omega += gain * (effort[i] - mu * load[i]) / (1.0 + gain * stiff)
        slip[i] = max(omega * radius / speed[i] - 1.0, -1.0)
    return np.asarray((1.0 + slip) * speed / radius)


def curve_data(study: Study, number: int, extended: Model) -> CurveData | None:
    """Some rows of one surface, as they are and as the extension corrects them."""
    rows = np.flatnonzero(study.surface == number)
    if not len(rows):
        return None
    rows = rows[:: max(len(rows) // POINTS, 1)]
    plain = evaluate(study, extended.theta)
    after = evaluate(study, extended.theta, extended.actives)
    factor = np.where(np.abs(after.factor) > 1e-3, after.factor, np.nan)
    sign = np.copysign(1.0, plain.slip)
    turned = np.copysign(1.0, after.slip)
    return CurveData(
        np.abs(plain.slip)[rows],
        (plain.adhesion * sign)[rows],
        np.abs(after.slip)[rows],
        (after.adhesion / factor * turned)[rows],
    )
