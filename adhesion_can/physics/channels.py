"""The catalogue of channels: every quantity on which adhesion may depend, under its one name.

Samples, extended models, sample tables, plots and sentences take names, units and labels from here.
A sample table may have further numeric columns: they are covariates under their own names, without
a unit.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto

from adhesion_can.physics.readings import Role


class ChannelOrigin(Enum):
    """Where the values of a channel come from."""

    CONTACT = auto()
    """Wheel speed, vehicle speed, effort and load: known at every sample."""
    COVARIATE = auto()
    """A signal of its own, known where its role is mapped."""


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """Name, unit, label and origin of a channel.

    Attributes:
        name: Name in samples, models and reports, such as 'rail_temperature_degC'.
        unit: SI unit as in reports, '1' for a ratio, '' for a state without a unit.
        label: Name in sentences and on axes, such as 'rail temperature'.
        origin: Origin of the values.
        role: Role of the signal on the bus that carries the channel; None for a derived quantity.
        column: Name of the column in a sample table; '' where a sample table has none.
        contact: Name of the attribute of `Contact` with the values; '' for a covariate and for what
            a contact does not have.
        steps: Whether the value holds until the next reading, and is not interpolated between two.

    """

    name: str
    unit: str
    label: str
    origin: ChannelOrigin = ChannelOrigin.CONTACT
    role: Role | None = None
    column: str = ""
    contact: str = ""
    steps: bool = False


FEW_VALUES = 6
"""Values up to which a channel of the user's counts as a state: it has steps, and holds."""


@dataclass(frozen=True, slots=True)
class UserChannel:
    """Channel that the user brought: a column of a table, or a signal under `[channels]`.

    Attributes:
        name: Name of the column, or that in the configuration.
        unit: Unit as in reports; '' where none is stated.
        label: Name in sentences; '' for `name`.

    """

    name: str
    unit: str = ""
    label: str = ""


def _covariate(name: str, unit: str, label: str, role: Role, *, steps: bool = False) -> ChannelInfo:
    return ChannelInfo(name, unit, label, ChannelOrigin.COVARIATE, role, column=name, steps=steps)


CHANNELS: tuple[ChannelInfo, ...] = (
    ChannelInfo("slip", "1", "slip ratio", column="slip", contact="slip"),
    ChannelInfo("signed_slip", "1", "slip ratio with its sign", column="slip"),
    ChannelInfo("slip_rate", "1/s", "rate of change of the slip"),
    ChannelInfo("creep_speed", "m/s", "creep speed", contact="creep_speed"),
    ChannelInfo(
        "speed", "m/s", "vehicle speed", role=Role.VEHICLE_SPEED, column="speed_mps",
        contact="speed",
    ),
    ChannelInfo(
        "tractive_effort", "N", "tractive effort", role=Role.TRACTIVE_EFFORT,
        column="longitudinal_force_N",
    ),
    ChannelInfo(
        "axle_load", "N", "axle load", role=Role.AXLE_LOAD, column="normal_load_N", contact="load"
    ),
    ChannelInfo("axle", "1", "number of the axle", column="axle", contact="axle"),
    ChannelInfo("time", "s", "time", column="time_s", contact="time_s"),
    ChannelInfo("position", "m", "position along the rail"),
    _covariate(
        "ambient_temperature_degC", "degC", "ambient temperature", Role.AMBIENT_TEMPERATURE
    ),
    _covariate("rail_temperature_degC", "degC", "rail temperature", Role.RAIL_TEMPERATURE),
    _covariate("relative_humidity_percent", "%", "relative humidity", Role.HUMIDITY),
    _covariate("sanding_active", "", "sanding", Role.SANDING, steps=True),
    _covariate("rain", "", "rain", Role.RAIN, steps=True),
    _covariate("gradient", "m/m", "gradient", Role.GRADIENT),
    _covariate("curvature_per_m", "1/m", "curvature", Role.CURVATURE),
)  # fmt: skip
"""All channels: those of the contact, then the covariates in the order of their roles."""

CHANNEL_BY_NAME: Mapping[str, ChannelInfo] = {channel.name: channel for channel in CHANNELS}

COVARIATES: Mapping[Role, str] = {
    channel.role: channel.name
    for channel in CHANNELS
    if channel.origin is ChannelOrigin.COVARIATE and channel.role is not None
}
"""Name of the covariate that a role carries."""


def channel_unit(name: str) -> str:
    """Unit of a channel; '' for a column of a sample table that the catalogue does not have."""
    channel = CHANNEL_BY_NAME.get(name)
    return "" if channel is None else channel.unit


def channel_label(name: str) -> str:
    """Label of a channel; a column that the catalogue does not have keeps its name."""
    channel = CHANNEL_BY_NAME.get(name)
    return name if channel is None else channel.label


def model_channel(name: str) -> str:
    """Name of a channel in an extended model: its attribute of `Contact`, or the covariate.

    '' for a channel that a contact does not have: an estimator online has no value of it.
    """
    channel = CHANNEL_BY_NAME.get(name)
    if channel is None or channel.origin is ChannelOrigin.COVARIATE:
        return name
    return channel.contact
