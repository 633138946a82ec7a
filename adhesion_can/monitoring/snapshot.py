"""What is known of a bus at one time, as one frozen value; SI units."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, StrEnum, auto
from typing import Literal, NamedTuple

from adhesion_can.monitoring.latest_frames import LatestFrames, MessageKey
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status


class MessageRole(StrEnum):
    """Part of a message on the bus."""

    INPUT = "input"
    OUTPUT = "output"
    OTHER = "other"


class Origin(Enum):
    """Where the service's messages come from."""

    SENT = auto()
    """A service on the bus."""
    RECORDED = auto()
    """A service that was recorded with its bus."""
    ESTIMATED_HERE = auto()
    """A service of the monitor's own, whose messages are on no bus."""


class MessageState(StrEnum):
    """How a message comes: the first one that holds."""

    NEVER = "never"
    SILENT = "silent"
    FAULTY = "faulty"
    OK = "ok"


@dataclass(frozen=True, slots=True)
class MessageView:
    """One message of the bus.

    Attributes:
        name: Name in the database; '' where the database does not know the id.
        frame_id: Identifier of 11 or 29 bits.
        is_extended: Whether the identifier has 29 bits.
        kind: Part of the message.
        cycle_us: Cycle, µs; None where unknown.
        accepted: Number of accepted frames.
        rejected: Number of rejected frames by reason.
        lost: Number of frames lost by the counter.
        age_us: Time since the last accepted frame, µs; None before the first.
        rate: Accepted frames per second of late, 1/s; None where it is too early to know.
        recent_faults: Number of frames rejected or lost in the last ten seconds.
        state: How the message comes.

    """

    name: str
    frame_id: int
    is_extended: bool
    kind: MessageRole
    cycle_us: int | None
    accepted: int
    rejected: Mapping[str, int]
    lost: int
    age_us: int | None
    rate: float | None
    recent_faults: int
    state: MessageState

    @property
    def key(self) -> MessageKey:
        """Identifier, and whether it has 29 bits."""
        return self.frame_id, self.is_extended

    @property
    def number(self) -> str:
        """Identifier as people write it."""
        return f"{self.frame_id:08X}" if self.is_extended else f"{self.frame_id:03X}"


@dataclass(frozen=True, slots=True)
class AxleView:
    """One axle: what is measured and what the service wants; None means 'not available'.

    Attributes:
        axle: Number of the axle, from 1.
        slip: Slip ratio λ with its sign, median of the last 0.2 s.
        adhesion: Adhesion coefficient μ with its sign, likewise.
        creep_speed: Creep speed r·ω − v, m/s, likewise.
        mu_max: Largest adhesion coefficient, of this axle's setpoint.
        lambda_m: Slip ratio of the peak, likewise.
        creep_setpoint: Creep speed to control to, m/s, likewise.

    """

    axle: int
    slip: float | None = None
    adhesion: float | None = None
    creep_speed: float | None = None
    mu_max: float | None = None
    lambda_m: float | None = None
    creep_setpoint: float | None = None


DriveDirection = Literal["traction", "braking"]
"""Direction of an effort."""


class OperatingPoint(NamedTuple):
    """Sample of the curve, traction and braking folded onto each other.

    Attributes:
        t_us: Stamp, µs.
        axle: Number of the axle, from 1.
        slip: Size of the slip ratio.
        adhesion: Adhesion coefficient, positive where it acts along the slip.

    """

    t_us: int
    axle: int
    slip: float
    adhesion: float


class HistoryPoint(NamedTuple):
    """Setpoint at a time; None means 'not available', inf for a deviation that is not known.

    Attributes:
        t_us: Stamp, µs.
        status: Status of the service.
        mu_max: Largest adhesion coefficient.
        mu_max_std: Standard deviation of `mu_max`.
        lambda_m: Slip ratio of the peak.
        lambda_m_std: Standard deviation of `lambda_m`.

    """

    t_us: int
    status: Status
    mu_max: float | None
    mu_max_std: float | None
    lambda_m: float | None
    lambda_m_std: float | None


@dataclass(frozen=True, slots=True)
class ServiceView:
    """Latest contents of the service's messages; None means 'not available'.

    Attributes:
        t_us: Stamp of the latest `AdhesionSetpoint`, µs.
        status: Status.
        mu_max: Largest adhesion coefficient.
        mu_max_std: Standard deviation of `mu_max`; inf where it is at the end of its range.
        lambda_m: Slip ratio of the peak.
        lambda_m_std: Standard deviation of `lambda_m`; inf where it is at the end of its range.
        creep_speed: Creep speed to control to, m/s.
        theta: Curve parameters (c1, c2, c3).
        doubt: Condition that the residual depends on.
        objection: What the readings cannot be, where that is why nobody vouches for the peak.
        surface_age_s: Time since the rail last changed, s.
        rejected: Number of frames that the service rejected.
        lost: Number of frames that the service lost.
        loop_time_us: 99 % quantile of the time in which the service handles a frame, µs.
        is_silent: Whether no setpoint has come for more than three cycles.
        has_ended: Whether it is silent after a last setpoint of a service that ends: INIT, and
            every value 'not available'.

    """

    t_us: int
    status: Status = Status.INIT
    mu_max: float | None = None
    mu_max_std: float | None = None
    lambda_m: float | None = None
    lambda_m_std: float | None = None
    creep_speed: float | None = None
    theta: tuple[float, float, float] | None = None
    doubt: Doubt = Doubt.NOT_AVAILABLE
    objection: Objection = Objection.NONE
    surface_age_s: float | None = None
    rejected: int | None = None
    lost: int | None = None
    loop_time_us: float | None = None
    is_silent: bool = False
    has_ended: bool = False


@dataclass(frozen=True, slots=True)
class Transport:
    """How the frames come here.

    Attributes:
        name: Name of the bus or of the recording.
        origin: Where the service's messages come from.
        is_live: Whether it is a bus, and no recording.
        is_open: Whether the bus is open.
        paused: Whether the view, or the recording, stands still.
        speed: Speed of a recording, multiple of its own; inf: as fast as it goes.
        position_s: Time in the recording, s after its first frame.
        duration_s: Duration of the recording, s; None for a bus.
        is_at_end: Whether the recording is at its end.
        catching_up_s: Time that is being read up to, s after the first frame; None: none is.
        dropped: Number of frames dropped, as they came faster than they were looked at.
        recording: Name of the file that frames are recorded to; '' for none.
        recorded: Number of frames recorded to it.
        notes: Lines for the operator, the latest one last.

    """

    name: str = ""
    origin: Origin = Origin.SENT
    is_live: bool = True
    is_open: bool = True
    paused: bool = False
    speed: float = 1.0
    position_s: float = 0.0
    duration_s: float | None = None
    is_at_end: bool = False
    catching_up_s: float | None = None
    dropped: int = 0
    recording: str = ""
    recorded: int = 0
    notes: tuple[str, ...] = ()


class TruePeak(NamedTuple):
    """Peak of the curve where a simulation knows it.

    Attributes:
        surface: Name of the surface.
        mu_max: Largest adhesion coefficient.
        lambda_m: Slip ratio of the peak.

    """

    surface: str
    mu_max: float
    lambda_m: float


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything that is shown, at one time.

    Attributes:
        t_us: Time, µs.
        first_us: Stamp of the first frame, µs; None before it.
        frames: Number of frames.
        frame_rate: Frames per second of late, 1/s.
        messages: Messages, inputs first.
        latest: Latest frames by message.
        axles: Axles by number.
        points: Samples of the last five seconds.
        last_sample_us: Stamp of the latest sample, µs; None before the first.
        only_direction: Direction of all efforts so far; None before the first, or for both.
        speed: Vehicle speed, m/s; None where it is not available.
        is_speed_derived: Whether the vehicle speed is derived from the driven axles.
        is_speed_observed: Whether the service observes the vehicle speed by wheels and efforts.
        v_min: Vehicle speed below which there are no samples, m/s.
        missing: Inputs without a role, by name, without which there are no samples.
        service: Latest contents of the service's messages; None where none came.
        history: Setpoints of the last two minutes.
        remarks: Further sentences.
        true_peak: Peak where a simulation knows it.
        transport: How the frames come here.

    """

    t_us: int
    first_us: int | None = None
    frames: int = 0
    frame_rate: float = 0.0
    messages: tuple[MessageView, ...] = ()
    latest: Mapping[MessageKey, LatestFrames] = field(default_factory=dict)
    axles: tuple[AxleView, ...] = ()
    points: tuple[OperatingPoint, ...] = ()
    last_sample_us: int | None = None
    only_direction: DriveDirection | None = None
    speed: float | None = None
    is_speed_derived: bool = False
    is_speed_observed: bool = False
    v_min: float = 1.0
    missing: tuple[str, ...] = ()
    service: ServiceView | None = None
    history: tuple[HistoryPoint, ...] = ()
    remarks: tuple[str, ...] = ()
    true_peak: TruePeak | None = None
    transport: Transport = field(default_factory=Transport)

    @property
    def time_s(self) -> float:
        """Time since the first frame, s."""
        return 0.0 if self.first_us is None else (self.t_us - self.first_us) / 1e6
