"""Columns for the eye: residual over a channel, measured against simulated, curve with data."""

from collections.abc import Sequence

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.regression.channel_splines import Channel, ChannelKind
from adhesion_can.diagnosis.regression.model import (
    EXCLUDED,
    Model,
    RegressionData,
    SegmentCurves,
    evaluate_model,
)
from adhesion_can.diagnosis.result import CurveData, Profile, SimulationPlot
from adhesion_can.physics import burckhardt
from adhesion_can.physics.channels import channel_unit
from adhesion_can.physics.effects import Effect, build_instruments

BINS = 24
WINDOW_S, RESTART_S = 20.0, 0.2
POINTS = 4000


def find_plotted_channel(
    data: RegressionData, effect: Effect, channels: Sequence[Channel]
) -> Channel | None:
    """The channel over which an effect is plotted; None where the data do not have it."""
    by_name = {channel.name: channel for channel in channels}
    for name in (effect.observability.channel, *effect.requires.covariates):
        channel = by_name.get(name) or _build_derived_channel(data, name)
        if channel is not None:
            return channel
    return None


def _build_derived_channel(data: RegressionData, name: str) -> Channel | None:
    """A channel that is plotted and never tested; None where there is none of that name."""
    seen = [drive.observe() for drive in data.drives]
    if name == "creep_speed":
        values = np.abs(np.concatenate([one.creep_speed for one in seen]))
        return Channel(name, channel_unit(name), ChannelKind.FACTOR, values)
    if name == "signed_slip":
        values = np.concatenate([one.slip for one in seen])
        return Channel(name, channel_unit(name), ChannelKind.OFFSET, values)
    return None


def build_profile(
    data: RegressionData, channel: Channel, before: Array, after: Array, change: Array, predicted: Array
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
    used = data.surface != EXCLUDED
    values = channel.values[used]
    sign = np.copysign(1.0, predicted[used]) if channel.kind is not ChannelKind.OFFSET else 1.0
    levels = np.unique(values)
    if len(levels) <= BINS:
        number = np.searchsorted(levels, values)
    else:
        edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)))
        number = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    # Rows of one second at one axle are no independent evidence: the error counts seconds.
    second = np.floor(data.column("t_s")[used]).astype(np.int64)
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
    fit_whitener = mean(change)[0]
    name = "place within the wave" if channel.period else channel.name
    return Profile(name, channel.unit, at, was, left, was_std, left_std, fit_whitener)


def build_simulation_plots(drive: DriveData, surface: int, plain: Model, extended: Model) -> list[SimulationPlot]:
    """The stretch of a recording in which the extension changes most, for the axle concerned.

    Args:
        course: every row of the recording.
        surface: number of the curve to use where the recording has several: the longest one's.
        plain: curves alone.
        extended: with effects.

    """
    if not len(drive) or drive.table:
        return []
    data = RegressionData((drive,), np.zeros(len(drive), dtype=np.int64), 1)
    before = evaluate_model(data, SegmentCurves(plain.curves.values[[surface]]), plain.active_effects)
    after = evaluate_model(data, SegmentCurves(extended.curves.values[[surface]]), extended.active_effects)
    change = np.abs(before.residual - after.residual)
    axles = np.unique(drive.axle)
    axle = int(max(axles, key=lambda i: float(np.mean(change[drive.axle == i] ** 2))))
    own = np.flatnonzero(drive.axle == axle)
    second = np.floor(drive.t_s[own] / (WINDOW_S / 2)).astype(np.int64)
    starts = np.unique(second)
    power = [float(np.sum(change[own][second == s] ** 2)) for s in starts]
    start_s = float(starts[int(np.argmax(power))]) * WINDOW_S / 2
    rows = own[(drive.t_s[own] >= start_s) & (drive.t_s[own] < start_s + WINDOW_S)]
    if len(rows) < 10:
        return []
    return [
        SimulationPlot(
            recording=drive.name,
            axle=axle,
            time_s=drive.t_s[rows] + drive.first_us / 1e6,
            wheel_speed=drive.kinematics(0.0, 0.0).wheel_speed[rows],
            simulated_before=simulate_wheel_speed(drive, rows, plain, surface),
            simulated_after=simulate_wheel_speed(drive, rows, extended, surface),
            adhesion=before.adhesion[rows],
            predicted_before=before.predicted[rows],
            predicted_after=after.predicted[rows],
            restart_s=RESTART_S,
        )
    ]


def simulate_wheel_speed(drive: DriveData, rows: np.ndarray, model: Model, surface: int) -> Array:
    """Wheel speed from measured effort and vehicle speed, rad/s: J dω/dt = r (F − μ(λ) N).

    Linearly implicit in ω, since the contact is stiff. Beyond the peak the wheel is unstable, and
    any simulation leaves the measurement there: so it begins anew from it at times.
    """
    instruments = build_instruments(model.active_effects)
    seen = drive.observe(instruments)
    data = RegressionData((drive,), np.zeros(len(drive), dtype=np.int64), 1)
    curves = SegmentCurves(model.curves.values[[surface]])
    at = evaluate_model(data, curves, model.active_effects)
    c1, log_c2, c3 = curves.values[0]
    c2 = float(np.exp(log_c2))
    radii = drive.radius * instruments.radius_factor(len(drive.radius))
    radius = float(radii[drive.axle[rows[0]] - 1])
    inertia = max(drive.inertia + instruments.inertia_error, 1.0)
    effort = drive.effort[rows] - instruments.effort_bias
    speed, load = seen.speed[rows], seen.load[rows]
    slip_correction, factor = (at.slip - seen.slip)[rows], at.factor[rows]
    true_slip = seen.slip[rows]
    t_s = drive.t_s[rows]
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
        inside = here + slip_correction[i]
        mu = factor[i] * float(burckhardt.adhesion(inside, c1, c2, c3))
        slope = factor[i] * float(burckhardt.adhesion_slope(inside, c1, c2, c3))
        stiff = max(slope, 0.0) * load[i] * radius / speed[i]
        gain = dt * radius / inertia
        omega += gain * (effort[i] - mu * load[i]) / (1.0 + gain * stiff)
        slip[i] = max(omega * radius / speed[i] - 1.0, -1.0)
    return np.asarray((1.0 + slip) * speed / radius)


def build_curve_data(data: RegressionData, number: int, extended: Model) -> CurveData | None:
    """Some rows of one surface, as they are and as the extension corrects them."""
    rows = np.flatnonzero(data.surface == number)
    if not len(rows):
        return None
    rows = rows[:: max(len(rows) // POINTS, 1)]
    plain = evaluate_model(data, extended.curves)
    after = evaluate_model(data, extended.curves, extended.active_effects)
    factor = np.where(np.abs(after.factor) > 1e-3, after.factor, np.nan)
    sign = np.copysign(1.0, plain.slip)
    turned = np.copysign(1.0, after.slip)
    return CurveData(
        np.abs(plain.slip)[rows],
        (plain.adhesion * sign)[rows],
        np.abs(after.slip)[rows],
        (after.adhesion / factor * turned)[rows],
    )
