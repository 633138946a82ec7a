"""Plot data: residual over a channel, measured against simulated signals, curve with its data."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.plot_result import (
    CurveData,
    PlotData,
    PredictionPlot,
    Profile,
    SimulationPlot,
)
from adhesion_can.diagnosis.regression.channel_splines import Channel, ChannelKind
from adhesion_can.diagnosis.regression.model import (
    EXCLUDED,
    EvaluatedModel,
    Model,
    RegressionData,
    evaluate_model,
)
from adhesion_can.diagnosis.regression.segment_curves import BURCKHARDT
from adhesion_can.physics.curves import Conditions
from adhesion_can.physics.effects import Effect, build_instruments

BINS = 24
"""Number of bins of a profile."""
WINDOW_S, RESTART_S = 20.0, 0.2
"""Length of a simulated span, and time between restarts of the simulation, s."""
LEAST_ROWS = 10
"""Rows without which a span is not plotted."""
LARGEST_STEP_S = 0.1
"""A longer step restarts the simulation, s."""
POINTS, SHAPE_POINTS = 4000, 201
"""Rows of a surface that are plotted, and points of a curve of another family."""


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
    if name == "creep_speed":
        return Channel(name, ChannelKind.FACTOR, np.abs(data.observed("creep_speed")))
    if name == "signed_slip":
        return Channel(name, ChannelKind.OFFSET, data.observed("slip"))
    return None


def build_profile(
    data: RegressionData,
    channel: Channel,
    before: Array,
    after: Array,
    change: Array,
    predicted: Array,
) -> Profile:
    """Mean residuals over bins of a channel.

    Args:
        data: Rows of all drives.
        channel: Channel over which the residuals are averaged.
        before: Residual of the plain model, adhesion; shape (n,).
        after: Residual of the extended model, adhesion; shape (n,).
        change: Change of the prediction by the extension, adhesion; shape (n,).
        predicted: Predicted adhesion, which gives the direction of the effort; shape (n,).

    """
    used = data.surface != EXCLUDED
    values = channel.values[used]
    sign = np.copysign(1.0, predicted[used]) if channel.kind is not ChannelKind.OFFSET else 1.0
    number = _number_bins(values)
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

    (mean_before, before_std), (mean_after, after_std) = mean(before), mean(after)
    middle = (np.bincount(number, values) / count)[kept]
    mean_change = mean(change)[0]
    name = "place within the wave" if channel.period else channel.name
    return Profile(
        name, channel.unit, middle, mean_before, mean_after, before_std, after_std, mean_change
    )


def _number_bins(values: Array) -> NDArray[np.int64]:
    """Bin number of each value: one bin a level, or quantiles where there are many; shape (n,)."""
    levels = np.unique(values)
    if len(levels) <= BINS:
        return np.searchsorted(levels, values)
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)))
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)


def build_plots(
    data: RegressionData,
    drive: DriveData,
    surface: int,
    plain: Model,
    extended: Model,
    *,
    with_simulations: bool,
) -> PlotData:
    """Everything that is drawn of the longest segment.

    Args:
        data: Rows of all drives.
        drive: Every row of the recording with the segment.
        surface: Number of the segment's surface.
        plain: Model without effects.
        extended: Model with effects.
        with_simulations: Whether signals are simulated, of a recording.

    """
    return PlotData(
        build_simulation_plots(drive, surface, plain, extended) if with_simulations else (),
        build_prediction_plot(data, plain, extended),
        build_curve_data(data, surface, extended),
    )


def build_simulation_plots(
    drive: DriveData, surface: int, plain: Model, extended: Model
) -> tuple[SimulationPlot, ...]:
    """Measured against simulated signals, for the axle and span that the extension changes most.

    Args:
        drive: Every row of the recording.
        surface: Number of the surface whose curve is used.
        plain: Model without effects.
        extended: Model with effects.

    """
    if not len(drive) or drive.table:
        return ()
    before = _evaluate_drive(drive, plain, surface)
    after = _evaluate_drive(drive, extended, surface)
    change = np.abs(before.residual - after.residual)
    axles = np.unique(drive.axle)
    axle = int(max(axles, key=lambda i: float(np.mean(change[drive.axle == i] ** 2))))
    rows_of_axle = np.flatnonzero(drive.axle == axle)
    window = np.floor(drive.t_s[rows_of_axle] / (WINDOW_S / 2)).astype(np.int64)
    windows = np.unique(window)
    power = [float(np.sum(change[rows_of_axle][window == w] ** 2)) for w in windows]
    start_s = float(windows[int(np.argmax(power))]) * WINDOW_S / 2
    rows = rows_of_axle[
        (drive.t_s[rows_of_axle] >= start_s) & (drive.t_s[rows_of_axle] < start_s + WINDOW_S)
    ]
    if len(rows) < LEAST_ROWS:
        return ()
    return (
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
        ),
    )


def _evaluate_drive(drive: DriveData, model: Model, surface: int) -> EvaluatedModel:
    """A model with the curve of one surface, evaluated on every row of a drive."""
    data = RegressionData((drive,), np.zeros(len(drive), dtype=np.int64), 1)
    return evaluate_model(data, model.curves.select(surface), model.active_effects)


def build_prediction_plot(
    data: RegressionData, plain: Model, extended: Model
) -> PredictionPlot | None:
    """Measured against predicted adhesion of sample tables, which have no wheel speed to simulate.

    Args:
        data: Rows of all drives.
        plain: Model without effects.
        extended: Model with effects.

    Returns:
        Rows evenly spaced; None where the data are recordings, or no row is used.

    """
    rows = np.flatnonzero(data.surface != EXCLUDED)
    if not len(rows) or not all(drive.table for drive in data.drives):
        return None
    before = evaluate_model(data, plain.curves, plain.active_effects)
    after = evaluate_model(data, extended.curves, extended.active_effects)
    shown = rows[:: -(-len(rows) // POINTS)]
    return PredictionPlot(
        before.adhesion[shown], before.predicted[shown], after.predicted[shown], len(rows)
    )


def simulate_wheel_speed(
    drive: DriveData, rows: NDArray[np.int64], model: Model, surface: int
) -> Array:
    """Simulate the wheel speed from measured effort and vehicle speed: J dω/dt = r (F − μ(λ) N).

    The step is linearly implicit in ω (Rosenbrock, Comput. J. 5 (1963)), since the contact is
    stiff. Beyond the peak the wheel is unstable, and any simulation diverges from the measurement:
    so it restarts from it every `RESTART_S`.

    Args:
        drive: Every row of the recording.
        rows: Indices of consecutive rows of one axle, shape (m,).
        model: Model with effects or without.
        surface: Number of the surface whose curve is used.

    Returns:
        Wheel speed, rad/s; shape (m,).

    """
    instruments = build_instruments(model.active_effects)
    observed = drive.observe(instruments)
    evaluation = _evaluate_drive(drive, model, surface)
    family, values = model.curves.family, model.curves.parameters[surface]
    radii = drive.radius * instruments.radius_factor(len(drive.radius))
    radius = float(radii[drive.axle[rows[0]] - 1])
    inertia = max(drive.inertia + instruments.inertia_error, 1.0)
    effort = drive.correct_effort(instruments)[rows]
    speed, load = observed.speed[rows], observed.load[rows]
    slip_change = (evaluation.slip - observed.slip)[rows]
    factor = (evaluation.factor / observed.force_gain)[rows]
    measured_slip = observed.slip[rows]
    t_s = drive.t_s[rows]
    slip = np.empty(len(rows))
    restarted = t_s[0]
    slip[0] = measured_slip[0]
    for i in range(1, len(rows)):
        dt = t_s[i] - t_s[i - 1]
        if t_s[i] - restarted >= RESTART_S or dt > LARGEST_STEP_S:
            slip[i], restarted = measured_slip[i], t_s[i]
            continue
        omega = (1.0 + slip[i - 1]) * speed[i - 1] / radius
        contact_slip = omega * radius / speed[i] - 1.0 + slip_change[i]
        at = Conditions(speed[i], load[i])
        mu = factor[i] * float(family.adhesion(contact_slip, values, at))
        slope = factor[i] * float(family.slope(contact_slip, values, at))
        stiffness = max(slope, 0.0) * load[i] * radius / speed[i]
        gain = dt * radius / inertia
        omega += gain * (effort[i] - mu * load[i]) / (1.0 + gain * stiffness)
        slip[i] = max(omega * radius / speed[i] - 1.0, -1.0)
    return np.asarray((1.0 + slip) * speed / radius)


def build_curve_data(data: RegressionData, surface: int, extended: Model) -> CurveData | None:
    """Some rows of one surface, as measured and with the effects removed; None: it has no rows.

    Args:
        data: Rows of all drives.
        surface: Number of the surface.
        extended: Model with effects.

    """
    rows = np.flatnonzero(data.surface == surface)
    if not len(rows):
        return None
    rows = rows[:: max(len(rows) // POINTS, 1)]
    plain = evaluate_model(data, extended.curves)
    after = evaluate_model(data, extended.curves, extended.active_effects)
    factor = np.where(np.abs(after.factor) > 1e-3, after.factor, np.nan)
    sign = np.copysign(1.0, plain.slip)
    corrected_sign = np.copysign(1.0, after.slip)
    shape = None
    if extended.curves.family is not BURCKHARDT:
        slip = np.linspace(0.0, float(np.abs(after.slip[rows]).max()), SHAPE_POINTS)
        here = after.conditions.select(rows)
        speed, load = float(np.mean(here.speed)), float(np.mean(here.load))
        values = extended.curves.parameters[surface]
        curve = extended.curves.family.adhesion(slip, values, Conditions(speed, load))
        shape = np.stack([slip, curve])
    return CurveData(
        np.abs(plain.slip)[rows],
        (plain.adhesion * sign)[rows],
        np.abs(after.slip)[rows],
        (after.adhesion / factor * corrected_sign)[rows],
        shape,
    )
