"""Columns of one signal, equal to its values one by one."""

import math
import struct

import numpy as np
import pytest
from cantools.database.can import Signal
from cantools.database.conversion import BaseConversion
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from adhesion_can.bus.codec import SignalPlan

FAST = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
LONG = settings(max_examples=3000, deadline=None, suppress_health_check=list(HealthCheck))


def as_words(rows, width):
    """Payloads as a block has them: little-endian words, 0 behind each payload's end."""
    octets = b"".join(row.ljust(8 * width, b"\0") for row in rows)
    return np.frombuffer(octets, dtype="<u8").astype(np.uint64).reshape(len(rows), width)


def bits_of(number):
    """A float distinct from every other, -0.0 from 0.0 too; all NaNs are one."""
    return "nan" if math.isnan(number) else struct.pack("<d", number)


def motorola_start(bit):
    """DBC's number of a bit counted from the top of byte 0 downwards."""
    return 8 * (bit // 8) + 7 - bit % 8


SCALES = [1, 2, 10, 3, 0.5, 0.01, 2e-5, -1, -0.25, 1e-3, 127, 2**40, 1e300, 1.0, 4.0]
OFFSETS = [0, 0, -40, 1, -67.67, 1000.5, 7, -(2**50), 1e-3, 0.0, -273.0]


@st.composite
def one_signal(draw):
    """(signal, size of its payload), anywhere in it."""
    size = draw(st.sampled_from([1, 2, 3, 5, 7, 8, 8, 8, 12, 20, 48, 64]))
    is_float = size > 1 and draw(st.booleans())
    lengths = st.integers(1, min(64, 8 * size))
    length = draw(
        st.sampled_from([n for n in (16, 32, 64) if n <= 8 * size]) if is_float else lengths
    )
    first = draw(st.integers(0, 8 * size - length))
    big = draw(st.booleans())
    signal = Signal(
        "S",
        motorola_start(first) if big else first,
        length,
        byte_order="big_endian" if big else "little_endian",
        is_signed=draw(st.booleans()),
        minimum=draw(st.sampled_from([None, None, -10, 0])),
        maximum=draw(st.sampled_from([None, None, 0, 1000.5])),
        conversion=BaseConversion.factory(
            scale=draw(st.sampled_from(SCALES)),
            offset=draw(st.sampled_from(OFFSETS)),
            is_float=is_float,
        ),
    )
    return signal, size


EXTREMES = st.sampled_from([b"\0" * 64, b"\xff" * 64, b"\x80" + b"\0" * 63, b"\x7f" + b"\xff" * 63])
CONTENTS = st.lists(st.binary(min_size=64, max_size=64) | EXTREMES, max_size=8)


def check_signal(signal, size, contents):
    plan = SignalPlan.from_signal(signal, size)
    rows = [content[:size] for content in contents]
    words = as_words(rows, 1 if size <= 8 else 8)
    raw = plan.raw_column(words)
    unsigned = plan.length == 64 and not plan.signed
    assert raw.dtype == (np.uint64 if unsigned else np.int64)
    order = "big" if plan.big_endian else "little"
    one_by_one = [plan.raw(int.from_bytes(row, order)) for row in rows]
    assert raw.tolist() == one_by_one
    values = plan.value_column(raw)
    assert values.dtype == np.float64
    wanted = [plan.value(one) for one in one_by_one]
    assert [bits_of(v) for v in values.tolist()] == [bits_of(v) for v in wanted]
    assert raw.tolist() == one_by_one, "the raw values are left as they were"
    inside = plan.in_range_column(values)
    assert inside.tolist() == [plan.in_range(v) for v in wanted]


@FAST
@given(place=one_signal(), contents=CONTENTS)
def test_a_column_equals_its_values_one_by_one(place, contents):
    check_signal(*place, contents)


@pytest.mark.slow
@LONG
@given(place=one_signal(), contents=CONTENTS)
def test_a_column_equals_its_values_one_by_one_at_length(place, contents):
    check_signal(*place, contents)


@pytest.mark.parametrize("big", [False, True], ids=["Intel", "Motorola"])
@pytest.mark.parametrize("signed", [False, True])
def test_every_place_and_length_in_two_words(big, signed):
    rng = np.random.default_rng(1)
    rows = [rng.bytes(16), b"\xaa" * 16]
    words = as_words(rows, 8)
    order = "big" if big else "little"
    numbers = [int.from_bytes(row, order) for row in rows]
    for first in range(128):
        for length in range(1, min(64, 128 - first) + 1):
            plan = SignalPlan.from_signal(
                Signal(
                    "S",
                    motorola_start(first) if big else first,
                    length,
                    byte_order=f"{order}_endian",
                    is_signed=signed,
                ),
                16,
            )
            found = plan.raw_column(words).tolist()
            assert found == [plan.raw(number) for number in numbers], (first, length)
