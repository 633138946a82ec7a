"""Acceptance of received frames by length, checksum, range, counter and multiplexer.

The checks run in this order, and the first one that a frame fails rejects it. The service and
`convert` share them; an `AcceptancePolicy` names what they do differently. `accept_frame` is the
reference. `acceptance_columns.accept_rows` is its optimisation for many frames at once.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from adhesion_can.bus.e2e import CounterSupervision, checksum_ok
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.rejection import Rejection

Values = TypeVar("Values")


@dataclass(frozen=True, slots=True)
class AcceptancePolicy:
    """Options of the checks.

    Attributes:
        exact_length: Whether a payload longer than its message is rejected where the message has no
            checksum; with a checksum it always is. A shorter payload is always rejected.
        check_range: Whether a value outside the database's range rejects its frame.
        check_selectors: Whether a multiplexer value that the database does not define rejects its
            frame. The frame's counter is valid all the same.
        counter_per_channel: Whether each bus has a counter of its own for the message.

    """

    exact_length: bool
    check_range: bool
    check_selectors: bool
    counter_per_channel: bool


SERVICE_POLICY = AcceptancePolicy(
    exact_length=True, check_range=True, check_selectors=False, counter_per_channel=False
)
"""Checks of the service: nothing that is doubtful reaches the estimator."""

CONVERT_POLICY = AcceptancePolicy(
    exact_length=False, check_range=False, check_selectors=True, counter_per_channel=True
)
"""Checks of `convert`: the columns show what was sent, as cantools decodes it."""


@dataclass(slots=True)
class DecodedFrame(Generic[Values]):
    """Signals of one payload.

    Attributes:
        values: Decoded values, in the form of the decoder.
        in_range: Whether each available value lies within its range in the database.
        unknown_selector: Whether a multiplexer has a value that the database does not define.

    """

    values: Values
    in_range: bool = True
    unknown_selector: bool = False


@dataclass(slots=True)
class MessageAcceptance:
    """Protection of one message and the state of its counters.

    Attributes:
        policy: Options of the checks.
        size: Length of the message, bytes.
        data_id: Data id of the E2E protection, 0..65535; None: neither checksum nor counter.
        cycle_us: Cycle time of the message, µs; None where unknown.

    """

    policy: AcceptancePolicy
    size: int
    data_id: int | None
    cycle_us: int | None
    _counters: dict[str, CounterSupervision] = field(default_factory=dict, init=False)

    @property
    def lost(self) -> int:
        """Number of lost frames by the counters, all channels together."""
        return sum([counter.lost for counter in self._counters.values()])

    def counter(self, channel: str) -> CounterSupervision:
        """Supervision of the counter on a channel."""
        key = channel if self.policy.counter_per_channel else ""
        counter = self._counters.get(key)
        if counter is None:
            counter = self._counters[key] = CounterSupervision(self.cycle_us)
        return counter


def accept_frame(
    acceptance: MessageAcceptance, frame: Frame, decode: Callable[[Frame], DecodedFrame[Values]]
) -> Values | Rejection:
    """Check one frame of a message and decode it.

    Args:
        acceptance: Protection and counters of the message.
        frame: Frame with the id of the message.
        decode: Decoder of a payload whose length and checksum are valid.

    Returns:
        Decoded values, or the reason to reject the frame.

    """
    policy, size, data_id = acceptance.policy, acceptance.size, acceptance.data_id
    data = frame.data
    counter = acceptance.counter(frame.channel)
    if len(data) != size and (len(data) < size or policy.exact_length or data_id is not None):
        counter.interrupt()
        return Rejection.LENGTH
    if data_id is not None and not checksum_ok(data, data_id):
        counter.interrupt()
        return Rejection.CHECKSUM
    decoded = decode(frame)
    if policy.check_range and not decoded.in_range:
        counter.interrupt()
        return Rejection.RANGE
    if data_id is not None:
        rejection = counter.accept(data[1] & 0x0F, frame.t_us)
        if rejection is not None:
            return rejection
    if policy.check_selectors and decoded.unknown_selector:
        return Rejection.MULTIPLEXER
    return decoded.values
