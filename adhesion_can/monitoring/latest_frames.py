"""The latest frame of every message, and its signals: value, unit, raw value and age.

Frames are kept as they came, whether the service's checks accept them or not. They are decoded
where somebody looks at them.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from cantools.database.can import Message

from adhesion_can.bus.codec import MessagePlan, SignalPlan
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.rejection import Rejection
from adhesion_can.bus.roles import SignalChoice
from adhesion_can.physics.readings import role_name

MessageKey = tuple[int, bool]
"""Identifier of a message, and whether it has 29 bits."""
MOST_IDS = 512
"""Largest number of ids whose latest frames are kept."""
MOST_SELECTIONS = 256
"""Largest number of multiplexer values of a message whose latest frames are kept."""


@dataclass(frozen=True, slots=True)
class SignalView:
    """One signal of a message as it last came.

    Attributes:
        name: Name of the signal.
        unit: Unit of the value; '' for none.
        role: Role that the configuration maps to the signal; '' for none.
        value: Value in the unit; None: not available, or not received yet.
        digits: Number of decimals that the signal resolves; None: as many as a float has.
        choice: Name of the value in the database; '' for none.
        raw: Raw value; None before the first.
        age_us: Time since the frame that carried it, µs; None before the first.
        is_in_range: Whether the value lies within the range of the database.

    """

    name: str
    unit: str
    role: str
    value: float | None = None
    digits: int | None = None
    choice: str = ""
    raw: int | None = None
    age_us: int | None = None
    is_in_range: bool = True


class MessageLayout:
    """What the database and the configuration say about a message.

    Args:
        message: Message of the database.
        roles: Roles of its signals, by name.

    """

    def __init__(self, message: Message, roles: Mapping[str, str]) -> None:
        self.plan = MessagePlan(message)
        """Positions and scales of the signals."""
        self._signals = {signal.name: signal for signal in message.signals}
        self._roles = roles
        self._selectors = sorted({selector for selector, _ in self.plan.multiplexed.values()})

    def selection(self, frame: Frame) -> tuple[int, ...]:
        """Multiplexer values of a payload; () where the message has no multiplexer."""
        if not self._selectors:
            return ()
        little, big = self._words(frame)
        plans = (self.plan.signals[name] for name in self._selectors)
        return tuple(plan.raw(big if plan.big_endian else little) for plan in plans)

    def signals(self, frames: Iterable[Frame], t_us: int) -> tuple[SignalView, ...]:
        """Signals of the latest frames at a time, in the order of the database.

        Args:
            frames: Latest frame of each selection of the multiplexer, the latest one last.
            t_us: Time, µs.

        """
        newest_first = list(reversed(list(frames)))
        return tuple(self._view(name, newest_first, t_us) for name in self.plan.signals)

    def _words(self, frame: Frame) -> tuple[int, int]:
        data = frame.data[: self.plan.size].ljust(self.plan.size, b"\0")
        return int.from_bytes(data, "little"), int.from_bytes(data, "big")

    def _view(self, name: str, newest_first: Iterable[Frame], t_us: int) -> SignalView:
        plan = self.plan.signals[name]
        database = self._signals[name]
        choices: Mapping[int, object] = database.choices or {}
        unit, role = database.unit or "", self._roles.get(name, "")
        for frame in newest_first:
            little, big = self._words(frame)
            if len(frame.data) < self.plan.size or not self.plan.present(name, little, big):
                continue
            raw = plan.raw(big if plan.big_endian else little)
            known = raw != plan.not_available
            value = plan.value(raw) if known else None
            return SignalView(
                name, unit, role, value, _digits(plan),
                choice=str(choices.get(raw, "")),
                raw=raw,
                age_us=max(t_us - frame.t_us, 0),
                is_in_range=value is None or plan.in_range(value),
            )  # fmt: skip
        return SignalView(name, unit, role)


def _digits(plan: SignalPlan) -> int | None:
    """Decimals of a value that is a whole number of steps."""
    if plan.is_float:
        return None
    return max(len(f"{x:.9f}".rstrip("0").partition(".")[2]) for x in (plan.scale, plan.offset))


@dataclass(frozen=True, slots=True)
class LatestFrames:
    """Latest frames of one message.

    Attributes:
        layout: What the database says about it; None: it does not have the id.
        frames: Latest frame of each selection of its multiplexer, the latest one last.
        rejection: Reason for which the service rejects the latest one; None: it does not.

    """

    layout: MessageLayout | None = field(compare=False)
    frames: tuple[Frame, ...]
    rejection: Rejection | None

    @property
    def latest(self) -> Frame:
        """The latest frame of all."""
        return self.frames[-1]

    def signals(self, t_us: int) -> tuple[SignalView, ...]:
        """Signals at a time, µs; () where the database does not have the id."""
        return () if self.layout is None else self.layout.signals(self.frames, t_us)


class FrameKeeper:
    """Keeps the latest frames of every message.

    Args:
        messages: Messages of the database by identifier; of several the last one counts.
        choices: Signals that the configuration maps to roles.

    """

    def __init__(self, messages: Iterable[Message], choices: Iterable[SignalChoice]) -> None:
        self._messages = {(m.frame_id, m.is_extended_frame): m for m in messages}
        self._roles: dict[str, dict[str, str]] = {}
        for choice in choices:
            roles = self._roles.setdefault(choice.message, {})
            roles[choice.signal] = role_name(choice.role, choice.axle)
        self._kept: dict[MessageKey, _Kept] = {}

    def add(self, key: MessageKey, frame: Frame, rejection: Rejection | None) -> None:
        """Keep a data frame.

        Args:
            key: Identifier of its message in the database; its own where the database has none.
            frame: Frame.
            rejection: Reason for which the service rejects it; None: it does not.

        """
        kept = self._kept.get(key)
        if kept is None:
            if len(self._kept) >= MOST_IDS:
                return
            kept = self._kept[key] = _Kept(self._layout(key), {})
        selection = () if kept.layout is None else kept.layout.selection(frame)
        kept.frames.pop(selection, None)  # so that the latest one is last
        kept.frames[selection] = frame
        if len(kept.frames) > MOST_SELECTIONS:
            del kept.frames[next(iter(kept.frames))]
        kept.rejection = rejection

    def latest(self) -> Mapping[MessageKey, LatestFrames]:
        """What is kept now, by message."""
        return MappingProxyType({
            key: LatestFrames(kept.layout, tuple(kept.frames.values()), kept.rejection)
            for key, kept in self._kept.items()
        })  # fmt: skip

    def _layout(self, key: MessageKey) -> MessageLayout | None:
        message = self._messages.get(key)
        return (
            None if message is None else MessageLayout(message, self._roles.get(message.name, {}))
        )


@dataclass(slots=True)
class _Kept:
    layout: MessageLayout | None
    frames: dict[tuple[int, ...], Frame]
    rejection: Rejection | None = None
