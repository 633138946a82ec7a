"""Page of a calibration: radii with intervals, the coasting they come from, and what is left."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.calibration.coasting import CalibrationSettings, CoastingDrive, find_coasting
from adhesion_can.calibration.fit import Calibration
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.reporting.calibration import radius_columns, radius_rows
from adhesion_can.reporting.charts import (
    BLUE,
    GREY,
    ORANGE,
    Trace,
    axis,
    insert_gaps,
    panel_layout,
    place,
    runs,
    scatter,
    thinned,
    whiskers,
)
from adhesion_can.reporting.page import Figure, Items, Page, Table, Text
from adhesion_can.reporting.time_panels import line, span_line
from adhesion_can.result_text import TimeScale, beginnings

BEFORE, AFTER = ORANGE, BLUE
BLOCK_S = 1.0
"""Time over which residuals are averaged for the figure, s."""


@dataclass(frozen=True, slots=True)
class DrivePlot:
    """Coasting of one drive; n stamps of the vehicle speed, m axles.

    Attributes:
        name: Name of the recording.
        t_us: Stamps, µs, shape (n,).
        speed: Vehicle speed, m/s, shape (n,).
        used: Whether the axle's value is used, shape (n, m).
        before: Vehicle speed less rolling speed with the configured radii, m/s, shape (n, m).
        after: Vehicle speed less rolling speed with what was found, m/s, shape (n, m).

    """

    name: str
    t_us: NDArray[np.int64]
    speed: Array
    used: NDArray[np.bool_]
    before: Array
    after: Array


def plot_drives(
    drives: Sequence[CoastingDrive],
    names: Sequence[str],
    vehicle: Locomotive,
    settings: CalibrationSettings,
    result: Calibration,
) -> list[DrivePlot]:
    """Coasting of drives, with the residuals before and after a calibration.

    Args:
        drives: Signals of the drives.
        names: Names of their recordings.
        vehicle: Vehicle with the configured radii.
        settings: Definition of coasting.
        result: Calibration of these drives.

    """
    axles = [axle.axle for axle in result.axles]
    configured = np.array([axle.configured for axle in result.axles])
    calibrated = np.array([axle.ratio for axle in result.axles]) * configured
    offset = 0.0 if result.offset is None else result.offset.value
    plots = []
    for drive, name in zip(drives, names, strict=True):
        rows = find_coasting(drive, axles, vehicle, settings)
        late = rows.speed + result.delay_used_s * rows.acceleration
        before = rows.speed[:, None] - rows.rolling * configured
        after = late[:, None] - rows.rolling * calibrated - offset
        plots.append(DrivePlot(name, drive.speed.t_us, rows.speed, rows.used, before, after))
    return plots


def page(
    result: Calibration,
    plots: Sequence[DrivePlot],
    rim: Collection[int],
    notes: Sequence[str],
    provenance: Mapping[str, str],
) -> Page:
    """Build the page of a calibration.

    Args:
        result: Result of the calibration.
        plots: Coasting of the drives.
        rim: Axles whose wheel speed is sent as speed of the rim.
        notes: Speed errors, limits, assumptions and problems, one sentence each.
        provenance: Version, hashes and command by name.

    """
    known = [axle for axle in result.axles if axle.estimate is not None]
    largest = max(known, key=lambda axle: abs(axle.ratio - 1), default=None)
    verdict = [f"{len(known)} of {len(result.axles)} radii found."]
    if largest is not None:
        verdict.append(
            f"Largest change: axle {largest.axle}, {100 * (largest.ratio - 1):+.2f} %; without "
            f"correction the slip ratio is off by {abs(largest.ratio - 1):.4f}."
        )
    before, after = (_rms(plots, name) for name in ("before", "after"))
    verdict.append(
        f"Vehicle speed minus rolling speed while coasting: {before:.4f} m/s before, {after:.4f} "
        "m/s after calibration (RMS)."
    )
    note = "Intervals are 95 % intervals from Student's t over the blocks."
    table = Table(
        "Radii, ± standard error.", radius_columns(result), radius_rows(result, rim), note
    )
    axles = [axle.axle for axle in result.axles]
    coasting = [_coasting_figure(axles, drive) for drive in plots if len(drive.t_us)]
    left = [_residual_figure(axles, drive) for drive in plots if drive.used.any()]
    return Page(
        title="Wheel radii and errors of the vehicle speed",
        lead=f"Calibration from coasting in {', '.join(drive.name for drive in plots)}.",
        verdict=verdict,
        sections={
            "Radii": [table, _radius_figure(result)],
            "Limits and notes": [Items(notes)],
            "Coasting": coasting or [Text("There is no vehicle speed to show.")],
            "Residual": left or [Text("No axle coasts.")],
        },
        provenance=provenance,
        begin=beginnings(
            [(drive.name, int(drive.t_us[0]) if len(drive.t_us) else None) for drive in plots]
        ),
    )


def _rms(plots: Sequence[DrivePlot], name: str) -> float:
    parts = [getattr(drive, name)[drive.used] for drive in plots]
    values = np.concatenate([part[np.isfinite(part)] for part in parts])
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def _radius_figure(result: Calibration) -> Figure:
    """Change of each radius with its interval."""
    known = [(a, a.estimate) for a in result.axles if a.estimate is not None]
    change = [100 * (axle.ratio - 1) for axle, _ in known]
    reach = [100 * (q.interval[1] - q.value) / axle.configured for axle, q in known]
    names = [f"axle {axle.axle}" for axle, _ in known]
    bars = whiskers(reach, color=AFTER, thickness=1.6, width=5)
    marker = {"color": AFTER, "size": 9}
    points = scatter("markers", "radius found", change, names, error_x=bars, marker=marker)
    line = {"color": GREY, "width": 1.2, "dash": "dash"}
    ends = [-0.6, len(names) - 0.4]
    layout = {
        "xaxis": axis("change from the configured radius, %"),
        "yaxis": {"type": "category", "range": ends[::-1]},
        "shapes": [{"type": "line", "xref": "x", "yref": "y domain", "x0": 0, "x1": 0, "y0": 0,
                    "y1": 1, "line": line}],
    }  # fmt: skip
    caption = "Radii found, with 95 % intervals; the dashed line is the configured radius."
    return Figure(caption, [points], layout, 110 + 30 * len(names), "radii")


def _coasting_figure(axles: Sequence[int], drive: DrivePlot) -> Figure:
    """Vehicle speed, and the spans in which each axle coasts."""
    times = TimeScale.beginning_at(int(drive.t_us[0]))
    t_s = (drive.t_us - times.zero_us) / 1e6
    x, y = thinned(*insert_gaps(t_s, 3.6 * drive.speed))
    data = [line("vehicle speed", x, y, {"color": BEFORE, "width": 1.5}) | place(0)]
    for axle, used in zip(axles, drive.used.T, strict=True):
        style = {"color": AFTER, "width": 8}
        data.append(span_line(f"axle {axle}", runs(used), t_s, t_s, style) | place(1))
    axes: list[Trace] = [
        axis("speed<br>km/h", rangemode="tozero"),
        {"type": "category", "range": [len(axles) - 0.4, -0.6]},
    ]
    height = 280 + 24 * len(axles)
    layout = panel_layout(axes, "time, s", height, (130.0, 24.0 * len(axles)))
    caption = f"{drive.name}: vehicle speed, and the spans of coasting that are used."
    return Figure(caption, data, layout, height, "coasting")


def _residual_figure(axles: Sequence[int], drive: DrivePlot) -> Figure:
    """Vehicle speed less rolling speed, before and after, in means of a second."""
    times = TimeScale.beginning_at(int(drive.t_us[0]))
    second = ((drive.t_us - drive.t_us[0]) // round(BLOCK_S * 1e6)).astype(np.int64)
    begin_s = (int(drive.t_us[0]) - times.zero_us) / 1e6
    data: list[Trace] = []
    for name, colour, symbol, values in (
        ("before", BEFORE, "x", drive.before),
        ("after", AFTER, "circle", drive.after),
    ):
        xs, ys = [], []
        for column, used in zip(values.T, drive.used.T, strict=True):
            rows = used & np.isfinite(column)
            count = np.bincount(second[rows])
            some = count > 0
            mean = np.bincount(second[rows], column[rows])[some] / count[some]
            xs.append(begin_s + (np.flatnonzero(some) + 0.5) * BLOCK_S)
            ys.append(mean)
        marker = {"color": colour, "size": 5, "opacity": 0.6, "symbol": symbol}
        x, y = np.concatenate(xs), np.concatenate(ys)
        data.append(scatter("markers", name, x, y, marker=marker))
    layout = {
        "xaxis": axis("time, s"),
        "yaxis": axis("v − r·ω, m/s", zeroline=True, zerolinecolor=GREY),
    }
    caption = (
        f"{drive.name}: vehicle speed minus rolling speed of the {len(axles)} axles while they "
        "coast, averaged over 1 s, with the configured radii and with the calibrated ones."
    )
    return Figure(caption, data, layout, 340, "residual")
