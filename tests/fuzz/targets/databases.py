"""CAN databases, and payloads decoded by our plans beside cantools."""

import math
import struct
from hashlib import shake_128
from itertools import combinations

import numpy as np
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from cantools.database.errors import DecodeError

from adhesion_can.bus.codec import MessagePlan
from adhesion_can.bus.database import load_database
from adhesion_can.bus.decoder import Decoder
from adhesion_can.bus.frame import MAX_PAYLOAD
from adhesion_can.bus.signal_columns import MessageSignals
from tests.fuzz.octets import Octets
from tests.fuzz.rule import file_of, value_or_refusal

_SCALES = (1, 1, 2, -1, 10, 0.5, 0.01, -0.25, 127, 2**40, 2**63, 1e300, 1.0, 4.0)
_OFFSETS = (0, 0, 1, -40, 1000.5, -67.67, 0.0, 2**63, -(2**63), 1e-3)
_MOST_MESSAGES = 6


def database(data):
    """A DBC, whole or without its faulty messages: what is in it decodes as cantools does."""
    path = file_of("fuzz.dbc", data)
    for lenient in (False, True):
        found = value_or_refusal(load_database, path, lenient=lenient)
        if found is not None:
            value_or_refusal(Decoder, found)
            for message in found.db.messages[:_MOST_MESSAGES]:
                if not message.is_container and message.length <= MAX_PAYLOAD:
                    _require_same(message, [shake_128(data).digest(message.length)])


def other_database(data):
    """A database of the other formats that cantools reads, by the first byte."""
    choices = Octets(data)
    suffix = choices.among(("kcd", "arxml", "sym", "cdd", "xls", "dbc.dbc", ""))
    path = file_of(f"fuzz.{suffix}" if suffix else "fuzz", choices.rest())
    found = value_or_refusal(load_database, path)
    if found is not None:
        value_or_refusal(Decoder, found)


def decoding(data):
    """Payloads of a message with signals at any place: as cantools decodes them."""
    choices = Octets(data)
    size = choices.among((8, 8, 8, 1, 2, 3, 5, 12, 20, 64))
    signals = [_signal(choices, place) for place in range(1 + choices.below(4))]
    message = Message(1, "M", size, signals, strict=False, is_fd=size > 8)
    _require_same(message, [choices.take(size) for _ in range(1 + choices.below(4))])


def _signal(choices, place):
    """A signal; the first one may be a multiplexer of the others."""
    length = choices.among((8, 16, 32, 64, *range(1, 65)))
    code = choices.number()
    return Signal(
        f"S{place}",
        choices.below(512) if code & 1 else choices.below(64),
        length,
        byte_order="big_endian" if code & 2 else "little_endian",
        is_signed=bool(code & 4),
        conversion=BaseConversion.factory(
            scale=choices.among(_SCALES),
            offset=choices.among(_OFFSETS),
            is_float=bool(code & 8) and length in (16, 32, 64),
        ),
        is_multiplexer=place == 0 and bool(code & 16),
        multiplexer_ids=[choices.below(4), choices.number()] if place and code & 32 else None,
        multiplexer_signal="S0" if place and code & 32 else None,
    )


def _require_same(message, payloads):
    """Columns of a message equal cantools' values; what it cannot decode has a reason."""
    undecodable = {}
    signals = MessageSignals(message, None, undecodable)
    assert all(reason.strip() for reason in undecodable.values())
    if undecodable or has_overlap(message):
        return  # cantools decodes a message as a whole, and no signals that share bits
    width = 1 if message.length <= 8 else 8
    padded = b"".join(payload.ljust(8 * width, b"\0") for payload in payloads)
    words = np.frombuffer(padded, "<u8").astype(np.uint64).reshape(-1, width)
    columns, unknown = signals.decode(words)
    plan = MessagePlan(message)
    for row, payload in enumerate(payloads):
        wanted = _by_cantools(message, payload)
        assert (wanted is None) == (unknown is not None and bool(unknown[row]))
        for name, column in columns.items() if wanted is not None else ():
            present = column.present is None or bool(column.present[row])
            assert present == (name in wanted), name
            if present:
                assert _is_same(column.values[row].item(), wanted[name], column.values), name
    for name, signal in plan.signals.items():
        raw = signal.raw_column(words)
        for row, payload in enumerate(payloads):
            order = "big" if signal.big_endian else "little"
            one = signal.raw(int.from_bytes(payload, order))
            assert raw[row].item() == one, name
            assert _bits(signal.value_column(raw)[row].item()) == _bits(signal.value(one)), name


def has_overlap(message):
    """Whether two signals of one byte order, and of one page, share bits."""
    for one, other in combinations(message.signals, 2):
        pages = [set(signal.multiplexer_ids or ()) for signal in (one, other)]
        apart = one.multiplexer_signal == other.multiplexer_signal is not None and pages[
            0
        ].isdisjoint(pages[1])
        if not apart and one.byte_order == other.byte_order and _bits_of(one) & _bits_of(other):
            return True
    return False


def _bits_of(signal):
    """Bits of a signal, counted along the payload in its byte order."""
    start = signal.start
    if signal.byte_order == "big_endian":
        start = 8 * (start // 8) + 7 - start % 8
    return ((1 << signal.length) - 1) << start


def _by_cantools(message, payload):
    """Values by name; None where a multiplexer has a value that the database does not know."""
    try:
        return message.decode(payload, decode_choices=False, scaling=True)
    except (DecodeError, ValueError, OverflowError):  # a multiplexer that is NaN or infinite
        return None


def _is_same(found, wanted, column):
    if isinstance(wanted, int) and column.dtype != np.float64:
        return found == wanted
    return _bits(found) == _bits(_nearest(wanted))


def _nearest(number):
    """The float nearest to a number, infinity beyond the largest."""
    try:
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf


def _bits(number):
    """A float distinct from every other; all NaNs are one."""
    return "nan" if math.isnan(number) else struct.pack("<d", number)
