"""Signals of a drive: a panel a role over time, and their table."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.config import Configuration
from adhesion_can.physics.channels import CHANNELS
from adhesion_can.physics.readings import Role, role_name
from adhesion_can.reporting.charts import DARK, MAX_STEPS, Trace, insert_gaps
from adhesion_can.reporting.page import Table
from adhesion_can.reporting.time_panels import Panel, axle_style, line
from adhesion_can.sampling.drive_signals import SLIP, DriveSignals, SignalSeries

SIGNAL_COLUMNS = ("signal", "unit", "readings", "lowest", "highest")
ROLE_LABELS: Mapping[str, str] = {
    **{channel.role: channel.label for channel in CHANNELS if channel.role is not None},
    Role.WHEEL_SPEED: "wheel speed",
    Role.SPEED_SOURCE: "vehicle speed source",
    Role.DIRECTION: "direction",
    SLIP: "slip ratio",
}
"""Name of a quantity in headings."""
HELD = frozenset(
    {Role.SPEED_SOURCE, Role.DIRECTION, *(channel.role for channel in CHANNELS if channel.steps)}
)
"""Roles whose value holds until the next reading."""


@dataclass(frozen=True, slots=True)
class _Shown:
    """How a role is drawn: unit of its panel, factor from SI to it, height of the panel in px."""

    unit: str
    factor: float
    height: float


@dataclass(frozen=True, slots=True)
class _Times:
    """Stamp of time 0, and width of the spans to which the signals are thinned; µs."""

    zero_us: int
    width_us: int


_UNITS = {"N": ("kN", 1e-3), "m/m": ("‰", 1e3), "1/m": ("1/km", 1e3)}
"""Unit of a panel and factor, by the unit of the channel; the others stay."""
_HEIGHTS = {SLIP: 130.0, Role.TRACTIVE_EFFORT: 130.0, Role.AXLE_LOAD: 100.0}


def _shown(role: str, unit: str = "") -> _Shown:
    shown_unit, factor = _UNITS.get(unit, (unit, 1.0))
    usual = 40.0 if role in HELD else 70.0
    return _Shown(shown_unit, factor, _HEIGHTS.get(role, usual))


_SHOWN: Mapping[str, _Shown] = {
    SLIP: _shown(SLIP),
    # A channel without a role is no signal; the vehicle speed is drawn with the wheels'.
    **{
        channel.role: _shown(channel.role, channel.unit)
        for channel in CHANNELS
        if channel.role not in (None, Role.VEHICLE_SPEED)
    },
    Role.SPEED_SOURCE: _shown(Role.SPEED_SOURCE),
    Role.DIRECTION: _shown(Role.DIRECTION),
}
"""The roles with a panel of their own, from the top to the bottom."""


_ORDER = (Role.WHEEL_SPEED, Role.VEHICLE_SPEED, *_SHOWN, Role.CHANNEL)
"""Roles in the order of their panels, for the table."""


@dataclass(frozen=True, slots=True)
class SignalPanels:
    """Panels of the signals of a drive, and what is said of them.

    Attributes:
        panels: Panels: speeds, slip, effort, load, surroundings.
        caption: How to read them, sentences.

    """

    panels: Sequence[Panel]
    caption: str

    @classmethod
    def none(cls) -> "SignalPanels":
        """No panel: no signals were collected."""
        return cls((), "not collected.")


def signal_panels(signals: DriveSignals, config: Configuration, zero_us: int) -> SignalPanels:
    """Panels of a drive.

    Args:
        signals: Signals of the drive.
        config: Radii of the wheels, and the user's channels.
        zero_us: Stamp of time 0, µs.

    """
    by_role: dict[str, dict[int, SignalSeries]] = defaultdict(dict)
    for (role, axle), series in sorted(signals.series().items()):
        if np.isfinite(series.lowest):
            by_role[role][axle] = series
    times = _Times(zero_us, signals.width_us)
    panels, constant = [], []
    speeds = list(_speed_traces(by_role, config, times))
    if speeds:
        panels.append(Panel("speed of the vehicle and of the rims r·ω, m/s", speeds, {}, 150.0))
    for role, shown in _SHOWN.items():
        by_axle = by_role.get(role, {})
        label, unit = ROLE_LABELS[role], shown.unit
        if by_axle and not any(signal.highest > signal.lowest for signal in by_axle.values()):
            values = sorted({f"{signal.lowest * shown.factor:.4g}" for signal in by_axle.values()})
            constant.append(f"{label} {' and '.join(values)} {unit}".strip())
        elif by_axle:
            panels.append(
                Panel(f"{label}, {unit}" if unit else label,
                      [_trace(role, axle, signal, shown, times)
                       for axle, signal in by_axle.items()],
                      {"dtick": 1.0} if role in HELD else {}, shown.height)
            )  # fmt: skip
    for number, series in by_role.get(Role.CHANNEL, {}).items():
        channel = config.channels[number - 1]
        title = f"{channel.label or channel.name}, {channel.unit}".strip(", ")
        x, y = _points(series, times)
        panels.append(Panel(title, [line(channel.name, x, y, axle_style(1))], {}, 70.0))
    return SignalPanels(panels, _caption(signals, constant))


def _caption(signals: DriveSignals, constant: Sequence[str]) -> str:
    dense = any(len(series.t_us) < series.readings for series in signals.series().values())
    text = (
        f"Thinned to spans of {signals.width_us / 1e6:g} s; extremes are kept. "
        if dense
        else "Every reading is drawn. "
    )
    text += "The cursor shows the drawn reading that is nearest to its time."
    if constant:
        text += f" Without a panel, since they do not change: {', '.join(constant)}."
    return text


def _speed_traces(
    by_role: Mapping[str, Mapping[int, SignalSeries]], config: Configuration, times: _Times
) -> Iterator[Trace]:
    """Speeds of the rims with the configured radii, and the vehicle's on top."""
    radii = config.vehicle.wheel_radius
    for axle, series in by_role.get(Role.WHEEL_SPEED, {}).items():
        x, y = _points(series, times)
        yield line(f"axle {axle}", x, radii[axle - 1] * y, axle_style(axle))
    vehicle = by_role.get(Role.VEHICLE_SPEED, {}).get(0)
    if vehicle is not None:
        yield line("vehicle", *_points(vehicle, times), {"color": DARK, "width": 1.6})


def _trace(role: str, axle: int, series: SignalSeries, shown: _Shown, times: _Times) -> Trace:
    x, y = _points(series, times, hold=role in HELD)
    name = f"axle {axle}" if axle else ROLE_LABELS[role]
    return line(name, x, shown.factor * y, axle_style(axle or 1), hold=role in HELD)


def _points(series: SignalSeries, times: _Times, *, hold: bool = False) -> tuple[Array, Array]:
    """Times since time 0, s, and values of a series, with its gaps."""
    t_s = (series.t_us - times.zero_us) / 1e6
    if hold or len(t_s) < 2:
        return t_s, series.values
    # Readings that are kept of two spans next to each other are less than two widths apart.
    longest_s = max(2.0 * times.width_us / 1e6, MAX_STEPS * float(np.median(np.diff(t_s))))
    x, y = insert_gaps(t_s, series.values, longest=longest_s)
    return x, y


def signal_table(signals: DriveSignals, config: Configuration, name: str = "") -> Table:
    """Table of the signals: unit, number of readings and range.

    Args:
        signals: Signals of the drive.
        config: Units of the signals.
        name: Name of the recording, where a page has several.

    """
    rows = []
    order = {role: number for number, role in enumerate(_ORDER)}
    by_signal = signals.series()
    for role, axle in sorted(by_signal, key=lambda signal: (order[signal[0]], signal[1])):
        series = by_signal[role, axle]
        known = np.isfinite(series.lowest)
        rows.append(
            (
                _signal_name(role, axle, config),
                "" if role == SLIP else config.signal_unit(Role(role), axle),
                str(series.readings),
                f"{series.lowest:.6g}" if known else "-",
                f"{series.highest:.6g}" if known else "-",
            )
        )
    caption = f"Signals{f' of {name}' if name else ''}: unit, number of readings, and range."
    return Table(caption, SIGNAL_COLUMNS, rows)


def _signal_name(role: str, axle: int, config: Configuration) -> str:
    if role == SLIP:
        return f"{SLIP}.{axle}"
    return config.channels[axle - 1].name if role == Role.CHANNEL else role_name(Role(role), axle)
