"""Whether the output messages of a user's database can carry what the service sends."""

from itertools import combinations

from cantools.database.can import Message, Signal

from adhesion_can.bus.codec import MessagePlan, SignalPlan
from adhesion_can.bus.signal_columns import find_obstacle
from adhesion_can.errors import DatabaseError

PROTECTION = ("Crc", "Alive")
"""Signals that `e2e.protect` writes, at the places that the profile gives them."""
_PROTECTED_BITS = 0xFFF


def require_layout(message: Message, packaged: Message, where: str) -> None:
    """Refuse a message that would carry other values than those sent, or fail while sending.

    Args:
        message: Message of the user's database.
        packaged: Message of that name in the package's own database.
        where: File and message, for the error.

    Raises:
        DatabaseError: A signal has no place of its own, no factor, or no room for its values.

    """
    if message.length < 2:
        raise DatabaseError(where, "no room for checksum and counter", "give it 8 bytes")
    present = {signal.name: signal for signal in message.signals}
    pairs = [
        (present[signal.name], signal) for signal in packaged.signals if signal.name in present
    ]
    for signal, original in pairs:
        obstacle = find_obstacle(signal, message)
        if obstacle:
            raise DatabaseError(where, f"its signal {signal.name}: {obstacle}", "correct it")
        if _page(signal) != _page(original):
            raise DatabaseError(
                where,
                f"its signal {signal.name} is multiplexed differently from the one that is sent",
                f"write {_page_text(original)}",
            )
    plan, own_plan = MessagePlan(message), MessagePlan(packaged)
    for signal, original in pairs:
        if signal.name in PROTECTION:
            _require_protection(plan.signals[signal.name], own_plan.signals[signal.name], where)
        else:
            _require_values(plan.signals[signal.name], own_plan.signals[original.name], where)
    _require_places(plan, [sent for _, sent in pairs if sent.name not in PROTECTION], where)


def _page(signal: Signal) -> tuple[bool, str | None, frozenset[int]]:
    """Whether a signal is a multiplexer, and the selector and its values that it is sent with."""
    ids = frozenset(signal.multiplexer_ids or ())
    return signal.is_multiplexer, signal.multiplexer_signal, ids


def _page_text(signal: Signal) -> str:
    """Page of a signal as a DBC writes it, `SG_ NAME m1`."""
    number = "".join(f" m{page}" for page in signal.multiplexer_ids or ())
    return f"SG_ {signal.name}{' M' if signal.is_multiplexer else number}"


def _require_protection(plan: SignalPlan, packaged: SignalPlan, where: str) -> None:
    """DatabaseError where receivers would look for checksum or counter in another place."""
    scaling = plan.is_float, plan.signed, plan.scale, plan.offset
    if _bits(plan) != _bits(packaged) or scaling != (False, False, 1, 0):
        raise DatabaseError(
            where,
            f"its signal {plan.name} has another position than the one that is sent",
            f"start it at bit {packaged.shift} with {packaged.length} bits, no sign, factor 1 and "
            "offset 0",
        )


def _require_values(plan: SignalPlan, packaged: SignalPlan, where: str) -> None:
    """DatabaseError where a signal has no room for 'not available', or for each of a few numbers.

    Values beyond the range of a signal saturate: a status would be another one.
    """
    if not abs(plan.scale) > 0.0:
        raise DatabaseError(
            where, f"its signal {plan.name} has the factor 0", "give it another factor"
        )
    if packaged.not_available is not None:
        if plan.not_available is None:
            raise DatabaseError(
                where,
                f"its signal {plan.name} cannot say 'not available'",
                "make it an integer of 8 bits or more",
            )
        return
    for number in range(int(packaged.minimum or 0), int(packaged.maximum or 0) + 1):
        if plan.is_float or plan.value(plan.raw(plan.encode(float(number)))) != number:
            raise DatabaseError(
                where,
                f"its signal {plan.name} cannot carry {number}",
                f"give it {packaged.length} bits without a sign, factor 1 and offset 0",
            )


def _require_places(plan: MessagePlan, signals: list[Signal], where: str) -> None:
    """DatabaseError where signals of one frame share bits, with each other or the protection."""
    bits = {signal.name: _bits(plan.signals[signal.name]) for signal in signals}
    for name, signal_bits in bits.items():
        if signal_bits & _PROTECTED_BITS:
            raise DatabaseError(
                where,
                f"its signal {name} overlaps the checksum or counter",
                "start it at bit 12 or later",
            )
    for first, second in combinations(signals, 2):
        pages = [set(signal.multiplexer_ids or ()) for signal in (first, second)]
        apart = all(pages) and pages[0].isdisjoint(pages[1])
        if not apart and bits[first.name] & bits[second.name]:
            raise DatabaseError(
                where, f"its signals {first.name} and {second.name} share bits", "move one of them"
            )


def _bits(plan: SignalPlan) -> int:
    """Bits of a signal in the payload read as one little-endian integer."""
    ones = plan.mask << plan.shift
    if plan.big_endian:
        ones = int.from_bytes(ones.to_bytes(plan.size, "big"), "little")
    return ones
