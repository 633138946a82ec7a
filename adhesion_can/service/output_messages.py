"""Composition of the output messages: outputs to protected frames."""

from collections.abc import Callable
from typing import NamedTuple

from adhesion_can.bus.database import (
    OUTPUT_MESSAGES,
    CanDatabase,
    cycle_us,
    database_with,
    load_database,
)
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.protected_message import ProtectedMessage
from adhesion_can.bus.roles import BoundMessage
from adhesion_can.errors import ConfigError, DatabaseError
from adhesion_can.service.output_layout import require_layout
from adhesion_can.service.outputs import Outputs, Setpoint

SETPOINT = "AdhesionSetpoint"
"""Name of the message that carries status and setpoint of all axles together."""
MODEL = "AdhesionModel"
"""Name of the message that carries the curve."""
QUALITY = "AdhesionQuality"
"""Name of the message that says how far the setpoints can be believed."""
OBJECTION, DOUBT = "Objection", "Doubt"
LATER_SIGNALS = {MODEL: OBJECTION, QUALITY: DOUBT}
"""Signals that a user's database may lack: those written before the signals came still serve."""
AXLE_FRAMES = 6
"""Number of frames of `AxleSetpoint` in a cycle, whatever the number of axles."""
AXLE_SIGNALS = {
    axle: ("Axle", f"MuMax_Ax{axle}", f"LambdaM_Ax{axle}", f"CreepSpeedSetpoint_Ax{axle}")
    for axle in range(1, AXLE_FRAMES + 1)
}
"""Signals of each of them: number of the axle, then those of `Setpoint` in its order."""
NO_SETPOINT = Setpoint()
"""Setpoint of an axle that has none."""


class Health(NamedTuple):
    """Contents of `ServiceStatus` beside the status.

    Attributes:
        rejected: Number of frames rejected since the service began.
        lost: Number of frames lost since the service began.
        loop_time_p99_us: 99 % quantile of the time to handle a frame, µs; None in a replay.

    """

    rejected: int
    lost: int
    loop_time_p99_us: float | None


def _require_signals(database: CanDatabase, packaged: CanDatabase) -> None:
    """Raise a DatabaseError where the user's output messages cannot carry what ours do."""
    for name in OUTPUT_MESSAGES:
        message = database.message(name)
        present = {s.name for s in message.signals}
        missing = {s.name for s in packaged.message(name).signals} - present
        missing.discard(LATER_SIGNALS.get(name, ""))
        if missing:
            raise DatabaseError(
                f"{database.path.name}: {name}",
                f"no signal {', '.join(sorted(missing))}",
                "copy the message from dbc/adhesion.dbc, or remove all output messages",
            )
        if cycle_us(message) is None:
            raise DatabaseError(
                f"{database.path.name}: {name}", "its cycle is unknown", "state GenMsgCycleTime"
            )
        require_layout(message, packaged.message(name), f"{database.path.name}: {name}")


class _Ahead(NamedTuple):
    """Setpoint of all axles, composed ahead of its due time.

    Attributes:
        outputs: Outputs that it carries.
        frame: The frame, which is not counted yet.

    """

    outputs: Outputs
    frame: Frame

    def serves(self, t_us: int, outputs: Outputs) -> bool:
        """Whether it carries these outputs, which are a value, at this due time, µs."""
        return self.outputs is outputs and self.frame.t_us == t_us


class OutputMessages:
    """Composes the frames of the output messages; each message has a counter of its own.

    Args:
        database: Database of the user. Its output messages are used where it defines all of them,
            else those of the package's own database.
        inputs: Input messages, whose ids the outputs must not share.

    Raises:
        ConfigError: An output has the id of an input.
        DatabaseError: The user's output messages lack a signal or a cycle, or cannot carry a value.

    """

    def __init__(self, database: CanDatabase, inputs: tuple[BoundMessage, ...]) -> None:
        source = database_with(OUTPUT_MESSAGES, database)
        if source is database:
            _require_signals(database, load_database())
        self._encoders = {name: ProtectedMessage(source.message(name)) for name in OUTPUT_MESSAGES}
        input_names = {(m.plan.frame_id, m.plan.is_extended): m.plan.name for m in inputs}
        for name, encoder in self._encoders.items():
            key = (encoder.plan.frame_id, encoder.plan.is_extended)
            if key in input_names:
                raise ConfigError(
                    f"{database.path.name}: {input_names[key]}",
                    f"has the id {key[0]:#x} of our own {name}",
                    f"give a database that defines {', '.join(OUTPUT_MESSAGES)} with free ids",
                )
        self.ids = frozenset(
            (message.plan.frame_id, message.plan.is_extended) for message in self._encoders.values()
        )
        """Id of every output message, and whether it has 29 bits."""
        self._ahead: _Ahead | None = None
        self._composers: dict[str, Callable[[int, Outputs, Callable[[], Health]], list[Frame]]] = {
            SETPOINT: self._setpoint,
            MODEL: self._model,
            QUALITY: self._quality,
            "AxleSetpoint": self._axles,
            "ServiceStatus": self._health,
        }

    @property
    def cycles_us(self) -> dict[str, int]:
        """Cycle of each message by its name, µs, in ascending order of the ids."""
        ordered = sorted(self._encoders.items(), key=lambda item: item[1].plan.frame_id)
        return {name: encoder.cycle_us for name, encoder in ordered}

    @property
    def cycles_by_id_us(self) -> dict[int, int]:
        """Cycle of each message by its id, µs."""
        return {message.plan.frame_id: message.cycle_us for message in self._encoders.values()}

    @property
    def sizes(self) -> dict[str, int]:
        """Length of each message by its name, bytes."""
        return {name: encoder.plan.size for name, encoder in self._encoders.items()}

    @property
    def ids_by_name(self) -> dict[str, int]:
        """Id of each message by its name."""
        return {name: encoder.plan.frame_id for name, encoder in self._encoders.items()}

    def find_name(self, arbitration_id: int) -> str:
        """Name of the output message with an id."""
        return next(
            name
            for name, encoder in self._encoders.items()
            if encoder.plan.frame_id == arbitration_id
        )

    def compose(
        self, name: str, t_us: int, outputs: Outputs, health: Callable[[], Health]
    ) -> list[Frame]:
        """Frames of one message at its due time, µs; `health` is asked by the one that shows it."""
        return self._composers[name](t_us, outputs, health)

    def prepare(self, t_us: int, outputs: Outputs) -> Frame:
        """Setpoint of all axles that is due at a time, µs, if it carries this: composed ahead.

        With these very outputs, `compose` gives the same object.
        """
        frame = self._encoders[SETPOINT].draft(t_us, _setpoint_values(outputs))
        self._ahead = _Ahead(outputs, frame)
        return frame

    def _setpoint(self, t_us: int, outputs: Outputs, _: object) -> list[Frame]:
        # One that was composed ahead of another due time has a count that is taken by now.
        ahead, self._ahead = self._ahead, None
        encoder = self._encoders[SETPOINT]
        if ahead is not None and ahead.serves(t_us, outputs):
            encoder.count()
            return [ahead.frame]
        return [encoder.frame(t_us, _setpoint_values(outputs))]

    def _model(self, t_us: int, outputs: Outputs, _: object) -> list[Frame]:
        theta = outputs.theta or (None, None, None)
        values = dict(zip(("C1", "C2", "C3"), theta, strict=True))
        encoder = self._encoders[MODEL]
        if OBJECTION in encoder.plan.signals:
            values[OBJECTION] = float(outputs.objection)
        return [encoder.frame(t_us, values)]

    def _quality(self, t_us: int, outputs: Outputs, _: object) -> list[Frame]:
        values: dict[str, float | None] = {
            "MuMaxStd": outputs.mu_max_std,
            "LambdaMStd": outputs.lambda_m_std,
            "SurfaceAge": outputs.surface_age_s,
        }
        encoder = self._encoders[QUALITY]
        if DOUBT in encoder.plan.signals:
            values[DOUBT] = float(outputs.doubt)
        return [encoder.frame(t_us, values)]

    def _axles(self, t_us: int, outputs: Outputs, _: object) -> list[Frame]:
        encoder = self._encoders["AxleSetpoint"]
        frames = []
        for axle, names in AXLE_SIGNALS.items():
            point = outputs.axles.get(axle, NO_SETPOINT)
            values = dict(zip(names, (float(axle), *point), strict=True))
            frames.append(encoder.frame(t_us, values))
        return frames

    def _health(self, t_us: int, outputs: Outputs, ask_health: Callable[[], Health]) -> list[Frame]:
        health = ask_health()
        values = {
            "State": float(outputs.status),
            "FramesRejected": float(health.rejected),
            "FramesLost": float(health.lost),
            "LoopTimeP99": health.loop_time_p99_us,
        }
        return [self._encoders["ServiceStatus"].frame(t_us, values)]


def _setpoint_values(outputs: Outputs) -> dict[str, float | None]:
    point = outputs.setpoint
    return {
        "Status": float(outputs.status),
        "MuMax": point.mu_max,
        "LambdaM": point.lambda_m,
        "CreepSpeedSetpoint": point.creep_speed,
    }
