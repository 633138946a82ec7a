"""Roles bound to the signals of a database, whatever their names: what the service receives."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from cantools.database.can import Message, Signal

from adhesion_can.bus.codec import MessagePlan, SignalPlan
from adhesion_can.bus.database import CanDatabase, cycle_us, e2e_data_id
from adhesion_can.bus.role_specs import ROLE_SPECS, known_units, to_si
from adhesion_can.bus.signal_columns import find_obstacle
from adhesion_can.errors import ConfigError
from adhesion_can.physics.readings import REQUIRED, Role, role_name

Protection = Literal["e2e-p01", "none"]
PROTECTIONS: tuple[Protection, ...] = ("e2e-p01", "none")


@dataclass(frozen=True, slots=True)
class SignalChoice:
    """A signal that a configuration names for a role; a field that is None comes from the database.

    Attributes:
        role: Meaning of the signal.
        axle: Number of the axle, 1.. for roles per axle, else 0.
        message: Name of the message.
        signal: Name of the signal in the message.
        channel: Name of the bus that carries the message; None: any.
        unit: Unit of the signal's values.
        factor: Factor on the value after the conversion of its unit; None: none is stated, 1.
        sign: Sign of the value, +1 or −1.
        offset: Zero error, subtracted last, in the role's SI unit.
        protection: E2E protection of the message.
        data_id: Data id of the protection, 0..65535.
        cycle_us: Cycle time of the message, µs.
        not_available: Whether a raw value of all ones means 'not available'.
        stuck_check: Whether a noisy signal that stops to change counts as not available.

    """

    role: Role
    axle: int
    message: str
    signal: str
    channel: str | None = None
    unit: str | None = None
    factor: float | None = None
    sign: int = 1
    offset: float = 0.0
    protection: Protection | None = None
    data_id: int | None = None
    cycle_us: int | None = None
    not_available: bool = True
    stuck_check: bool = True

    @property
    def name(self) -> str:
        """Role as configurations spell it: `wheel_speed.1`, `vehicle_speed`."""
        return role_name(self.role, self.axle)

    @property
    def used_factor(self) -> float:
        """Factor on the value after the conversion of its unit."""
        return 1.0 if self.factor is None else self.factor


@dataclass(frozen=True, slots=True)
class BoundSignal:
    """A received signal with its conversion to SI: value · scale − offset.

    Attributes:
        role: Meaning of the signal.
        axle: Number of the axle, 1.. for roles per axle, else 0.
        plan: Position and scaling of the signal in its message.
        scale: Factor from the signal's unit to the role's SI unit.
        offset: Zero error, in the role's SI unit.
        not_available: Raw value for 'not available'; None: the signal has none.
        at_rim: Whether a wheel speed is given as speed of the rim, which is divided by the
            configured radius.
        stuck_check: Whether a noisy signal that stops to change counts as not available.

    """

    role: Role
    axle: int
    plan: SignalPlan
    scale: float
    offset: float
    not_available: int | None
    at_rim: bool
    stuck_check: bool

    @property
    def name(self) -> str:
        """Role as configurations spell it: `wheel_speed.1`, `vehicle_speed`."""
        return role_name(self.role, self.axle)

    @property
    def resolution(self) -> float:
        """Step of one raw bit, SI; 0 for floating point."""
        return 0.0 if self.plan.is_float else abs(self.plan.scale * self.scale)


@dataclass(frozen=True)
class BoundMessage:
    """A received message, with its signals that have a role.

    Attributes:
        plan: Positions of all signals of the message.
        channel: Name of the bus that carries the message; None: any.
        signals: Signals with a role.
        data_id: Data id of the E2E protection, 0..65535; None: unprotected.
        cycle_us: Cycle time, µs; None where unknown.

    """

    plan: MessagePlan
    channel: str | None
    signals: tuple[BoundSignal, ...]
    data_id: int | None
    cycle_us: int | None

    @property
    def roles(self) -> frozenset[Role]:
        """Roles of the signals."""
        return frozenset(signal.role for signal in self.signals)


def packaged_choices() -> list[SignalChoice]:
    """Signals of the packaged message set with their roles."""
    signals = [(role, *spec.signal) for role, spec in ROLE_SPECS.items() if spec.signal]
    return [
        SignalChoice(role, axle, f"{message}{1 + (axle - 1) // 3}", f"{signal}_Ax{axle}")
        for role, message, signal in signals
        if role.per_axle
        for axle in range(1, 7)
    ] + [
        SignalChoice(role, 0, message, signal)
        for role, message, signal in signals
        if not role.per_axle
    ]


OPTIONAL_MESSAGES = frozenset({"AxleLoads1", "AxleLoads2", "Environment", "TrackGeometry"})
"""Messages of the packaged message set that a database may lack."""


def bind(
    choices: Iterable[SignalChoice],
    database: CanDatabase,
    wheel_radius: Sequence[float],
    where: str,
) -> tuple[BoundMessage, ...]:
    """Look every choice up in the database and group them by message.

    Args:
        choices: Roles with the signals that carry them.
        database: Database of the messages.
        wheel_radius: Wheel radius of each axle, m, for wheel speeds given at the rim.
        where: Name of the configuration, for errors.

    Raises:
        DatabaseError: A signal is not in the database.
        ConfigError: A unit, an axle or a protection does not fit, or a signal does not fit into
            its message.

    """
    groups: dict[tuple[str, str | None], list[tuple[SignalChoice, Message, Signal]]] = {}
    for choice in choices:
        if choice.axle > len(wheel_radius) and choice.role is not Role.CHANNEL:
            raise ConfigError(
                f"{where}: roles.{choice.name}",
                f"the vehicle has {len(wheel_radius)} axles",
                "add the axle under [vehicle] or remove the role",
            )
        message, signal = database.signal(choice.message, choice.signal, choice.name)
        groups.setdefault((choice.message, choice.channel), []).append((choice, message, signal))
    return tuple(_bind_message(rows, wheel_radius, where) for rows in groups.values())


def _bind_message(
    rows: Sequence[tuple[SignalChoice, Message, Signal]], radii: Sequence[float], where: str
) -> BoundMessage:
    message = rows[0][1]
    plan = MessagePlan(message)
    for choice, _, signal in rows:
        _require_decodable(choice, signal, message, where)
    signals = tuple(_bind_signal(choice, signal, plan, radii, where) for choice, _, signal in rows)
    choices = [choice for choice, _, _ in rows]
    data_id = _data_id(choices, message, where)
    if data_id is not None and plan.size < 2:
        raise ConfigError(
            f"{where}: roles.{choices[0].name}",
            f"{message.name} has {plan.size} byte, too few for checksum and counter",
            'write protection = "none"',
        )
    cycle = _agreed(choices, "cycle_us", where) or cycle_us(message) or 0
    return BoundMessage(
        plan=plan,
        channel=choices[0].channel,
        signals=signals,
        data_id=data_id,
        cycle_us=int(cycle) or None,
    )


def _data_id(choices: Sequence[SignalChoice], message: Message, where: str) -> int | None:
    """Data id of a message's protection, None: unprotected; what a role states comes first."""
    protection = _agreed(choices, "protection", where)
    stated: int | None = _agreed(choices, "data_id", where)
    if protection == "none":
        return None
    data_id = e2e_data_id(message) if stated is None else stated
    if data_id is None and protection == "e2e-p01":
        raise ConfigError(
            f"{where}: roles.{choices[0].name}",
            f"{message.name} has no attribute E2EDataId for its protection e2e-p01",
            'write data_id, or protection = "none"',
        )
    return data_id


def _require_decodable(choice: SignalChoice, signal: Signal, message: Message, where: str) -> None:
    # Databases are loaded with all their faults: those of other signals are no concern of ours.
    obstacle = find_obstacle(signal, message)
    if obstacle:
        raise ConfigError(
            f"{where}: roles.{choice.name}",
            f"{choice.message}.{choice.signal} cannot be decoded: {obstacle}",
            "correct the signal in the database, or map the role to another signal",
        )


def _bind_signal(
    choice: SignalChoice, signal: Signal, plan: MessagePlan, radii: Sequence[float], where: str
) -> BoundSignal:
    unit = choice.unit if choice.unit is not None else (signal.unit or "")
    radius = radii[choice.axle - 1] if choice.role.per_axle else None
    factor = to_si(choice.role, unit, radius)
    if factor is None:
        raise ConfigError(
            f"{where}: roles.{choice.name}",
            f"unit {unit!r} of {choice.message}.{choice.signal} does not measure {choice.role}",
            f"write one of {known_units(choice.role)}",
        )
    signal_plan = plan.signals[signal.name]
    return BoundSignal(
        role=choice.role,
        axle=choice.axle,
        plan=signal_plan,
        scale=factor * choice.used_factor * choice.sign,
        offset=choice.offset,
        not_available=signal_plan.not_available if choice.not_available else None,
        at_rim=to_si(choice.role, unit, None) is None,
        stuck_check=choice.stuck_check and choice.role in REQUIRED,
    )


def _agreed(choices: Sequence[SignalChoice], key: str, where: str) -> Any:
    """The one value that the roles of a message state for it; None where none does."""
    stated = {getattr(choice, key) for choice in choices} - {None}
    if len(stated) > 1:
        names = ", ".join(f"roles.{choice.name}" for choice in choices)
        word = "cycle_ms" if key == "cycle_us" else key
        raise ConfigError(
            f"{where}: {names}",
            f"message {choices[0].message} has different {word}",
            "write the same for all of its roles",
        )
    return stated.pop() if stated else None


def cycles_by_role(messages: Iterable[BoundMessage]) -> Mapping[Role, int]:
    """Cycle of each role, µs; the longest where several messages carry it."""
    cycles: dict[Role, int] = {}
    for message in messages:
        for role in message.roles:
            cycles[role] = max(cycles.get(role, 0), message.cycle_us or 0)
    return cycles


def resolutions_by_role(messages: Iterable[BoundMessage]) -> Mapping[Role, float]:
    """Step of one raw bit of each role, SI; the coarsest where several signals carry it."""
    steps: dict[Role, float] = {}
    for message in messages:
        for signal in message.signals:
            steps[signal.role] = max(steps.get(signal.role, 0.0), signal.resolution)
    return steps
