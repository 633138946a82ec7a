"""What the service says: one value object, and the messages that carry it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from cantools.database.can import Message

from adhesion_can.bus.codec import MessagePlan
from adhesion_can.bus.database import OUTPUT_MESSAGES, CanDatabase, e2e_data_id, load_database
from adhesion_can.bus.e2e import COUNTS, protect
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.roles import BoundMessage
from adhesion_can.errors import ConfigError, DatabaseError
from adhesion_can.physics.burckhardt import slip_at_share
from adhesion_can.physics.estimate import Estimate
from adhesion_can.service.states import Status

AXLE_FRAMES = 6
"""`AxleSetpoint` comes in six frames whatever the number of axles."""


@dataclass(frozen=True, slots=True)
class Setpoint:
    """Of one axle, or of all together: SI units; None is 'not available'."""

    mu_max: float | None = None
    lambda_m: float | None = None
    creep_speed: float | None = None


@dataclass(frozen=True, slots=True)
class Outputs:
    """All that the output messages say at a moment; None is 'not available'.

    Attributes:
        status: of the service.
        setpoint: of all axles together.
        axles: by axle, where it has one of its own.
        theta: (c1, c2, c3).
        mu_max_std: standard deviation of μ_max; inf where unknown.
        lambda_m_std: of λ_m.
        surface_age_s: since the last change of the surface.

    """

    status: Status = Status.INIT
    setpoint: Setpoint = field(default_factory=Setpoint)
    axles: Mapping[int, Setpoint] = field(default_factory=dict)
    theta: tuple[float, float, float] | None = None
    mu_max_std: float | None = None
    lambda_m_std: float | None = None
    surface_age_s: float | None = None


class Health(NamedTuple):
    """What `ServiceStatus` says."""

    rejected: int
    lost: int
    loop_time_p99_us: float | None


@lru_cache(maxsize=8)
def target_slip(theta: tuple[float, float, float], share: float, slip_max: float) -> float:
    """λ_target: the smallest λ with μ(λ) ≥ share · μ_max."""
    return slip_at_share(share, *theta, slip_max=slip_max)


def outputs_of(
    estimate: Estimate,
    status: Status,
    t_us: int,
    creep_per_slip: float,
    lambda_target: float,
    axles: tuple[int, ...],
) -> Outputs:
    """Outputs of an estimate.

    Args:
        estimate: present one.
        status: of the service.
        t_us: now.
        creep_per_slip: max(v, v_min), m/s.
        lambda_target: of the pooled curve.
        axles: that are heard.

    """

    def setpoint(mu_max: float, lambda_m: float) -> Setpoint:
        # An axle's own curve has the pooled shape: its target slip scales with its λ_m.
        scale = lambda_m / estimate.lambda_m if estimate.lambda_m else 0.0
        return Setpoint(mu_max, lambda_m, lambda_target * scale * creep_per_slip)

    pooled = (estimate.mu_max, estimate.lambda_m)
    return Outputs(
        status=status,
        setpoint=setpoint(*pooled),
        axles={axle: setpoint(*estimate.per_axle.get(axle, pooled)) for axle in axles},
        theta=estimate.theta,
        mu_max_std=estimate.mu_max_std,
        lambda_m_std=estimate.lambda_m_std,
        surface_age_s=max(t_us - estimate.surface_since_us, 0) / 1e6,
    )


class _Sender:
    """One output message: its plan, its counter and its protection."""

    def __init__(self, message: Message) -> None:
        self.plan = MessagePlan(message)
        self.cycle_us = int(message.cycle_time or 0) * 1000
        data_id = e2e_data_id(message)
        self._data_id = message.frame_id if data_id is None else data_id
        self._count = 0

    def frame(self, t_us: int, values: Mapping[str, float | None]) -> Frame:
        payload = self.plan.encode(values)
        protect(payload, self._data_id, self._count)
        self._count = (self._count + 1) % COUNTS
        return Frame(t_us, self.plan.frame_id, bytes(payload), is_extended=self.plan.is_extended)


def _require_signals(database: CanDatabase, own: CanDatabase) -> None:
    """DatabaseError where the user's output messages lack a signal or a cycle of ours."""
    for name in OUTPUT_MESSAGES:
        message = database.message(name)
        missing = {s.name for s in own.message(name).signals} - {s.name for s in message.signals}
        if missing:
            raise DatabaseError(
                f"{database.path.name}: {name}",
                f"no signal {', '.join(sorted(missing))}",
                "take the message over from our own database, or leave all output messages out",
            )
        if not message.cycle_time:
            raise DatabaseError(
                f"{database.path.name}: {name}", "its cycle is unknown", "state GenMsgCycleTime"
            )


class OutputMessages:
    """Composes the output messages; each keeps its counter.

    Args:
        database: the user's, taken where it holds the whole output set, else our own is.
        inputs: messages heard, whose ids the outputs must not share.

    Raises:
        ConfigError: an output has the id of an input.
        DatabaseError: the user's output messages lack a signal or a cycle.

    """

    def __init__(self, database: CanDatabase, inputs: tuple[BoundMessage, ...]) -> None:
        present = {message.name for message in database.db.messages}
        source = load_database()
        if present.issuperset(OUTPUT_MESSAGES):
            _require_signals(database, source)
            source = database
        self._senders = {name: _Sender(source.message(name)) for name in OUTPUT_MESSAGES}
        heard = {(m.plan.frame_id, m.plan.is_extended): m.plan.name for m in inputs}
        for name, sender in self._senders.items():
            key = (sender.plan.frame_id, sender.plan.is_extended)
            if key in heard:
                raise ConfigError(
                    f"{database.path.name}: {heard[key]}",
                    f"has the id {key[0]:#x} of our own {name}",
                    f"give a database that defines {', '.join(OUTPUT_MESSAGES)} with free ids",
                )
        self._composers: dict[str, Callable[[int, Outputs, Health], list[Frame]]] = {
            "AdhesionSetpoint": self._setpoint,
            "AdhesionModel": self._model,
            "AdhesionQuality": self._quality,
            "AxleSetpoint": self._axles,
            "ServiceStatus": self._health,
        }

    @property
    def cycles_us(self) -> dict[str, int]:
        """Cycle of each message, in the order in which they are due on ties: ascending id."""
        ordered = sorted(self._senders.items(), key=lambda item: item[1].plan.frame_id)
        return {name: sender.cycle_us for name, sender in ordered}

    @property
    def ids(self) -> frozenset[tuple[int, bool]]:
        """(id, extended) of every output."""
        return frozenset((s.plan.frame_id, s.plan.is_extended) for s in self._senders.values())

    def name_of(self, arbitration_id: int) -> str:
        """Name of the output with that id."""
        return next(n for n, s in self._senders.items() if s.plan.frame_id == arbitration_id)

    def compose(self, name: str, t_us: int, outputs: Outputs, health: Health) -> list[Frame]:
        """Frames of one message, stamped with its due time."""
        return self._composers[name](t_us, outputs, health)

    def _setpoint(self, t_us: int, outputs: Outputs, _: Health) -> list[Frame]:
        point = outputs.setpoint
        values = {
            "Status": float(outputs.status),
            "MuMax": point.mu_max,
            "LambdaM": point.lambda_m,
            "CreepSpeedSetpoint": point.creep_speed,
        }
        return [self._senders["AdhesionSetpoint"].frame(t_us, values)]

    def _model(self, t_us: int, outputs: Outputs, _: Health) -> list[Frame]:
        theta = outputs.theta or (None, None, None)
        values = dict(zip(("C1", "C2", "C3"), theta, strict=True))
        return [self._senders["AdhesionModel"].frame(t_us, values)]

    def _quality(self, t_us: int, outputs: Outputs, _: Health) -> list[Frame]:
        values = {
            "MuMaxStd": outputs.mu_max_std,
            "LambdaMStd": outputs.lambda_m_std,
            "SurfaceAge": outputs.surface_age_s,
        }
        return [self._senders["AdhesionQuality"].frame(t_us, values)]

    def _axles(self, t_us: int, outputs: Outputs, _: Health) -> list[Frame]:
        sender = self._senders["AxleSetpoint"]
        frames = []
        for axle in range(1, AXLE_FRAMES + 1):
            point = outputs.axles.get(axle, Setpoint())
            values = {
                "Axle": float(axle),
                f"MuMax_Ax{axle}": point.mu_max,
                f"LambdaM_Ax{axle}": point.lambda_m,
                f"CreepSpeedSetpoint_Ax{axle}": point.creep_speed,
            }
            frames.append(sender.frame(t_us, values))
        return frames

    def _health(self, t_us: int, outputs: Outputs, health: Health) -> list[Frame]:
        values = {
            "State": float(outputs.status),
            "FramesRejected": float(health.rejected),
            "FramesLost": float(health.lost),
            "LoopTimeP99": health.loop_time_p99_us,
        }
        return [self._senders["ServiceStatus"].frame(t_us, values)]
