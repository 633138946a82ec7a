"""Signals in and out of payloads, with cantools as the oracle."""

import math
import struct

import cantools
import pytest
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from adhesion_can.bus.codec import MessagePlan, SignalPlan
from tests.bus.bus_helpers import DBC

OWN = cantools.database.load_file(DBC, strict=True)
FAST = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
LONG = settings(max_examples=5000, deadline=None, suppress_health_check=list(HealthCheck))


@st.composite
def conversions(draw, *, is_float=False):
    scale = draw(st.sampled_from([1, 2, 10, 0.5, 0.01, 2e-5, -1, -0.25, 1e-3, 127]))
    offset = draw(st.sampled_from([0, 0, -40, 1, -67.67, 1000.5, 7]))
    return BaseConversion.factory(scale=scale, offset=offset, is_float=is_float)


def motorola_start(bit):
    """DBC's number of a bit counted from the top of byte 0 downwards."""
    return 8 * (bit // 8) + 7 - bit % 8


@st.composite
def regions(draw, bits):
    """Cut a run of bits into fields with holes: (first, length) each."""
    fields, at = [], 0
    while at < bits and len(fields) < 6:
        at += draw(st.integers(0, 5))
        if at >= bits:
            break
        length = draw(st.integers(1, min(64, bits - at)))
        fields.append((at, length))
        at += length
    return fields


@st.composite
def signals(draw, name, start, length, order, floats):
    floats = floats and length in (16, 32, 64) and draw(st.booleans())
    return Signal(
        name,
        start,
        length,
        byte_order=order,
        is_signed=draw(st.booleans()),
        conversion=draw(conversions(is_float=floats)),
    )


@st.composite
def messages(draw, sizes=(1, 2, 3, 5, 8, 8, 8, 12, 64), *, floats=True):
    """A message of Intel fields in its first bytes and Motorola ones in the rest."""
    size = draw(st.sampled_from(sizes))
    intel = draw(st.integers(0, size))
    found = [
        draw(signals(f"I{i}", first, length, "little_endian", floats))
        for i, (first, length) in enumerate(draw(regions(8 * intel)))
    ]
    found += [
        draw(signals(f"M{i}", motorola_start(8 * intel + first), length, "big_endian", floats))
        for i, (first, length) in enumerate(draw(regions(8 * (size - intel))))
    ]
    assume(found)
    return Message(0x123, "Random", size, found, strict=True, is_fd=size > 8)


@st.composite
def multiplexed(draw):
    """A multiplexer of either order, three pages, and a field of every page."""
    order = draw(st.sampled_from(["little_endian", "big_endian"]))
    big = order == "big_endian"
    width = draw(st.integers(2, 8))
    ids = draw(st.lists(st.integers(0, 2**width - 1), min_size=3, max_size=3, unique=True))
    chooser = Signal("Page", 7 if big else 0, width, byte_order=order, is_multiplexer=True)
    found = [chooser, Signal("Always", 63 if big else 56, 8, byte_order=order)]
    for i, pages in enumerate((ids[:1], ids[1:], ids[2:])):
        first = 8 if i < 2 else 40
        length = draw(st.integers(1, 16 if i == 2 else 32))
        found.append(
            Signal(
                f"S{i}",
                motorola_start(first) if big else first,
                length,
                byte_order=order,
                is_signed=draw(st.booleans()),
                conversion=draw(conversions()),
                multiplexer_ids=pages,
                multiplexer_signal="Page",
            )
        )
    return Message(0x123, "Pages", 8, found, strict=True), ids


def words(data):
    return int.from_bytes(data, "little"), int.from_bytes(data, "big")


def plan_values(plan, data):
    little, big = words(data)
    return {
        name: signal.value(signal.raw(big if signal.big_endian else little))
        for name, signal in plan.signals.items()
        if plan.present(name, little, big)
    }


def same(a, b):
    return (math.isnan(a) and math.isnan(b)) or a == b or math.isclose(a, b, rel_tol=1e-12)


def check_decoding(message, data):
    plan = MessagePlan(message)
    wanted = message.decode(data, decode_choices=False)
    found = plan_values(plan, data)
    assert found.keys() == wanted.keys()
    for name, value in wanted.items():
        assert same(found[name], float(value)), (name, found[name], value)
    little, big = words(data)
    for name, raw in message.decode(data, decode_choices=False, scaling=False).items():
        signal = plan.signals[name]
        if not signal.is_float:
            assert signal.raw(big if signal.big_endian else little) == raw


@FAST
@given(message=messages(), content=st.binary(min_size=64, max_size=64))
def test_decoding_equals_cantools(message, content):
    check_decoding(message, content[: message.length])


@pytest.mark.slow
@LONG
@given(message=messages(), content=st.binary(min_size=64, max_size=64))
def test_decoding_equals_cantools_at_length(message, content):
    check_decoding(message, content[: message.length])


@FAST
@given(pages=multiplexed(), content=st.binary(min_size=8, max_size=8), data=st.data())
def test_multiplexed_decoding_equals_cantools(pages, content, data):
    message, ids = pages
    chooser = message.get_signal_by_name("Page")
    page = data.draw(st.sampled_from(ids))
    content = bytearray(content)
    if chooser.byte_order == "little_endian":
        content[0] = content[0] >> chooser.length << chooser.length & 0xFF | page
    else:
        content[0] = content[0] & (0xFF >> chooser.length) | page << (8 - chooser.length)
    check_decoding(message, bytes(content))


def test_a_page_that_no_signal_belongs_to_carries_only_the_common_ones():
    plan = MessagePlan(OWN.get_message_by_name("AxleSetpoint"))
    data = bytes([0, 0xF0, *range(6)])
    little, big = words(data)
    present = {name for name in plan.signals if plan.present(name, little, big)}
    assert present == {"Crc", "Alive", "Axle"}


def test_nested_multiplexing_needs_the_whole_chain():
    outer = Signal("Outer", 0, 4, is_multiplexer=True)
    inner = Signal(
        "Inner", 4, 4, is_multiplexer=True, multiplexer_ids=[1], multiplexer_signal="Outer"
    )
    leaf = Signal("Leaf", 8, 8, multiplexer_ids=[2, 3], multiplexer_signal="Inner")
    other = Signal("Other", 8, 8, multiplexer_ids=[0], multiplexer_signal="Outer")
    message = Message(1, "Nested", 2, [outer, inner, leaf, other], strict=True)
    plan = MessagePlan(message)
    assert plan_values(plan, b"\x21\x55") == {"Outer": 1, "Inner": 2, "Leaf": 0x55}
    assert plan_values(plan, b"\x31\x55") == {"Outer": 1, "Inner": 3, "Leaf": 0x55}
    assert plan_values(plan, b"\x41\x55") == {"Outer": 1, "Inner": 4}
    assert plan_values(plan, b"\x20\x55") == {"Outer": 0, "Other": 0x55}, "Inner is not selected"


def check_encoding(message, data):
    """On values that the raw grid holds exactly, both ways must give the same bytes."""
    plan = MessagePlan(message)
    values = {}
    for signal in message.signals:
        # 52 bits: beyond that a float has no room for the value itself.
        length = min(signal.length, 52 if isinstance(signal.scale, int) else 40)
        low = -(1 << (length - 1)) if signal.is_signed else 0
        high = (1 << (length - signal.is_signed)) - 1
        if signal.length >= 8:
            high -= length == signal.length
        raw = data.draw(st.integers(low, max(low, high)))
        values[signal.name] = raw * float(signal.scale) + float(signal.offset)
    wanted = message.encode(values, strict=False)
    assert bytes(plan.encode(values)) == wanted


@FAST
@given(message=messages(floats=False), data=st.data())
def test_encoding_equals_cantools(message, data):
    check_encoding(message, data)


@settings(max_examples=60, deadline=None)
@given(
    length=st.sampled_from([16, 32, 64]),
    big=st.booleans(),
    conversion=conversions(is_float=True),
    eighths=st.integers(-1000, 1000),
    data=st.data(),
)
def test_encoding_of_ieee_floats_equals_cantools(length, big, conversion, eighths, data):
    first = data.draw(st.integers(0, 64 - length))
    start = motorola_start(first) if big else first
    order = "big_endian" if big else "little_endian"
    signal = Signal("F", start, length, byte_order=order, conversion=conversion)
    message = Message(1, "Floats", 8, [signal])
    value = eighths / 8 * conversion.scale + conversion.offset
    payload = bytes(MessagePlan(message).encode({"F": value}))
    assert payload == message.encode({"F": value}, strict=False)


@FAST
@given(pages=multiplexed(), data=st.data())
def test_multiplexed_encoding_equals_cantools(pages, data):
    message, ids = pages
    page = data.draw(st.sampled_from(ids))
    assume(page != 0xFF)  # says 'not available', and a value saturates below it
    values = {"Page": page, "Always": 17}
    for signal in message.signals:
        if signal.multiplexer_ids and page in signal.multiplexer_ids:
            high = (1 << (signal.length - signal.is_signed)) - 2
            raw = data.draw(st.integers(0, max(high, 0)))
            values[signal.name] = raw * signal.scale + signal.offset
    assert bytes(MessagePlan(message).encode(values)) == message.encode(values, strict=False)


@pytest.mark.parametrize("message", OWN.messages, ids=lambda m: m.name)
@settings(max_examples=30, deadline=None)
@given(content=st.binary(min_size=8, max_size=8), axle=st.integers(1, 6))
def test_our_own_messages_decode_as_in_cantools(message, content, axle):
    if message.is_multiplexed():
        content = bytes([content[0], content[1] & 0x0F | axle << 4, *content[2:]])
    check_decoding(message, content)


@pytest.mark.parametrize("message", OWN.messages, ids=lambda m: m.name)
@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_our_own_messages_encode_to_the_nearest_step(message, data):
    """Any physical value lands on the raw step nearest to it, as cantools rounds."""
    axle = data.draw(st.integers(1, 6))
    values = {}
    for signal in message.signals:
        if signal.multiplexer_ids and axle not in signal.multiplexer_ids:
            continue
        if signal.name == "Crc":  # no number: the protection writes it
            continue
        values[signal.name] = data.draw(
            st.floats(float(signal.minimum), float(signal.maximum), allow_nan=False)
        )
    if "Axle" in values:
        values["Axle"] = axle
    payload = bytes(MessagePlan(message).encode(values))
    back = message.decode(payload, decode_choices=False)
    assert back.keys() == values.keys() | {"Crc"}
    for signal in message.signals:
        if signal.name in values:
            error = abs(float(back[signal.name]) - values[signal.name])
            assert error <= float(signal.scale) * 0.5000001, signal.name


NUMBERS = [(m, s) for m in OWN.messages for s in m.signals if s.length >= 8 and s.name != "Crc"]


@pytest.mark.parametrize(("message", "signal"), NUMBERS, ids=lambda x: x.name)
def test_not_available_both_ways(message, signal):
    plan = MessagePlan(message)
    ones = 0x7FFF if signal.is_signed else (1 << signal.length) - 1
    values = {signal.name: None}
    if signal.multiplexer_ids:
        values["Axle"] = signal.multiplexer_ids[0]
    payload = bytes(plan.encode(values))
    oracle = message.decode(payload, decode_choices=False, scaling=False)
    assert oracle[signal.name] == ones
    own = plan.signals[signal.name]
    little, _ = words(payload)
    assert own.raw(little) == ones == own.not_available
    assert not own.in_range(own.value(ones)), "the raw value is tested before it is scaled"


@pytest.mark.parametrize(("message", "signal"), NUMBERS, ids=lambda x: x.name)
@pytest.mark.parametrize("excess", [1.0, 1e6, math.inf])
def test_numbers_saturate_one_below_all_ones(message, signal, excess):
    plan = MessagePlan(message).signals[signal.name]
    ones = 0x7FFF if signal.is_signed else (1 << signal.length) - 1
    step = float(signal.scale)
    top = ones * step + float(signal.offset)
    assert plan.raw(plan.encode(top)) == ones - 1
    assert plan.raw(plan.encode(top + excess * step)) == ones - 1
    bottom = -0x8000 if signal.is_signed else 0
    assert plan.raw(plan.encode(bottom * step + float(signal.offset) - excess * step)) == bottom


def test_signals_below_eight_bits_have_no_way_to_say_not_available():
    for message in OWN.messages:
        for signal in message.signals:
            if signal.length < 8:
                plan = SignalPlan.from_signal(signal, 8)
                assert plan.not_available is None
                assert plan.raw(plan.encode(1e9)) == (1 << signal.length) - 1
                with pytest.raises(ValueError, match=signal.name):
                    plan.encode(None)


@pytest.mark.parametrize("length", range(1, 65))
@pytest.mark.parametrize("signed", [False, True])
def test_not_available_is_all_ones_from_eight_bits_on(length, signed):
    plan = SignalPlan.from_signal(Signal("S", 0, length, is_signed=signed), 8)
    if length < 8:
        assert plan.not_available is None
    else:
        assert plan.not_available == int("1" * (length - signed), 2)
        assert plan.raw(plan.encode(None)) == plan.not_available


def test_bits_not_named_are_zero():
    for message in OWN.messages:
        plan = MessagePlan(message)
        payload = plan.encode({})
        assert bytes(payload) == bytes(8)
        assert len(payload) == message.length


@pytest.mark.parametrize(
    ("length", "form"), [(16, "<e"), (32, "<f"), (64, "<d")], ids=["half", "single", "double"]
)
def test_ieee_floats_go_out_as_they_come_in(length, form):
    signal = Signal("F", 0, length, conversion=BaseConversion.factory(is_float=True))
    plan = SignalPlan.from_signal(signal, 8)
    for value in (0.0, 1.5, -2.25, 1024.0, 6.103515625e-05):
        (bits,) = struct.unpack({16: "<H", 32: "<I", 64: "<Q"}[length], struct.pack(form, value))
        assert plan.value(bits) == value
        assert plan.encode(value) == bits


@pytest.mark.parametrize("bad", [math.inf, -math.inf, math.nan])
def test_a_float_that_is_no_number_is_out_of_range(bad):
    signal = Signal("F", 0, 32, conversion=BaseConversion.factory(is_float=True))
    plan = SignalPlan.from_signal(signal, 8)
    (bits,) = struct.unpack("<I", struct.pack("<f", bad))
    assert not plan.in_range(plan.value(bits))


def ranged(lowest, highest, scale=0.5):
    return SignalPlan.from_signal(
        Signal(
            "S",
            0,
            16,
            conversion=BaseConversion.factory(scale=scale),
            minimum=lowest,
            maximum=highest,
        ),
        8,
    )


def test_range_includes_its_ends_and_no_step_beyond():
    plan = ranged(10, 100)
    for value in (10, 10.5, 99.5, 100):
        assert plan.in_range(value)
    for value in (9.5, 100.5, 0, 1e9):
        assert not plan.in_range(value)


def test_no_range_where_the_database_states_none():
    for lowest, highest in ((None, None), (0, 0)):
        plan = ranged(lowest, highest)
        assert plan.in_range(0)
        assert plan.in_range(32767.5)


def test_a_range_with_one_end_holds_at_that_end():
    # KCD and ARXML can state one end alone.
    assert not ranged(None, 100).in_range(100.5)
    assert ranged(None, 100).in_range(-5)
    assert not ranged(10, None).in_range(9.5)
    assert ranged(10, None).in_range(1000)
