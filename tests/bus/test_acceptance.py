"""Checks of frames: each option of the policy, and columns equal to frame by frame."""

from dataclasses import FrozenInstanceError, fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.acceptance import (
    CONVERT_POLICY,
    SERVICE_POLICY,
    AcceptancePolicy,
    DecodedFrame,
    MessageAcceptance,
    accept_frame,
)
from adhesion_can.bus.acceptance_columns import DecodedRows, accept_rows
from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.rejection import REJECTION_CODE, Rejection
from tests.bus.bus_helpers import sealed

FAST = settings(max_examples=200, deadline=None)
DATA_ID, CYCLE = 0x123, 10_000
OUT_OF_RANGE, UNKNOWN_SELECTOR = 1, 2
"""Bits of byte 2, which the decoders of this test report."""


def decode_frame(frame):
    faults = frame.data[2]
    return DecodedFrame(faults, not faults & OUT_OF_RANGE, bool(faults & UNKNOWN_SELECTOR))


def decode_rows(words):
    faults = (words[:, 0] >> np.uint64(16)) & np.uint64(0xFF)
    return DecodedRows(
        faults,
        (faults & np.uint64(OUT_OF_RANGE)) == 0,
        (faults & np.uint64(UNKNOWN_SELECTOR)) != 0,
    )


POLICIES = st.builds(AcceptancePolicy, **{f.name: st.booleans() for f in fields(AcceptancePolicy)})


@st.composite
def drives(draw, size):
    """Frames of one message on one bus or two, with every fault that a check finds."""
    frames, counts, t_us = [], [0, 0], 0
    for _ in range(draw(st.integers(0, 40))):
        t_us += draw(st.sampled_from([0, CYCLE, CYCLE, CYCLE, 12 * CYCLE]))
        bus = draw(st.sampled_from([0, 0, 0, 1]))
        counts[bus] += draw(st.sampled_from([1, 1, 1, 1, 0, 2, 3, 5]))
        count = draw(st.sampled_from([*[counts[bus] % 15] * 9, 15]))
        faults = draw(st.sampled_from([0, 0, 0, 0, OUT_OF_RANGE, UNKNOWN_SELECTOR, 3]))
        data = sealed(DATA_ID, count, bytes([0, 0, faults]).ljust(size, b"\x5a"))
        damage = draw(st.sampled_from(["", "", "", "", "flip", "short", "long"]))
        if damage == "flip":
            data = bytes([data[0] ^ 4]) + data[1:]
        elif damage:
            data = (data + bytes(4))[: size + (4 if damage == "long" else -1)]
        frames.append(Frame(t_us, 0x100, data, f"can{bus}", is_fd=True))
    return frames


@FAST
@given(
    policy=POLICIES,
    protected=st.booleans(),
    cycle_us=st.sampled_from([None, CYCLE]),
    frames=st.sampled_from([3, 7, 8, 12, 20]).flatmap(
        lambda size: drives(size).map(lambda drive: (size, drive))
    ),
    cuts=st.lists(st.integers(0, 40), max_size=3),
)
def test_columns_equal_frame_by_frame_under_every_policy(policy, protected, cycle_us, frames, cuts):
    size, drive = frames
    one, many = (
        MessageAcceptance(policy, size, DATA_ID if protected else None, cycle_us) for _ in range(2)
    )
    wanted, lost = [], []
    for frame in drive:
        before = one.lost
        found = accept_frame(one, frame, decode_frame)
        rejection = found if isinstance(found, Rejection) else None
        wanted.append((REJECTION_CODE[rejection], None) if rejection else (0, found))
        lost.append(one.lost - before)
    ends = sorted({0, len(drive), *(cut for cut in cuts if cut < len(drive))})
    got, got_lost = [], []
    for begin, end in zip(ends, ends[1:], strict=False):
        block = Block.from_frames(drive[begin:end], channels=("can0", "can1"))
        found = accept_rows(many, block, np.arange(end - begin), decode_rows)
        for code, value in zip(found.outcome.tolist(), found.columns.tolist(), strict=True):
            got.append((code, None) if code else (0, value))
        got_lost += found.lost.tolist()
    assert got == wanted
    assert got_lost == lost
    assert one.lost == many.lost


def outcome(policy, data, *, data_id=None, size=4):
    """Rejection of a first frame, by both ways; None: accepted."""
    frame = Frame(0, 0x100, data, "can0")
    acceptance = MessageAcceptance(policy, size, data_id, CYCLE)
    found = accept_frame(acceptance, frame, decode_frame)
    rejection = found if isinstance(found, Rejection) else None
    acceptance = MessageAcceptance(policy, size, data_id, CYCLE)
    (code,) = accept_rows(
        acceptance, Block.from_frames([frame]), np.array([0]), decode_rows
    ).outcome
    assert code == (REJECTION_CODE[rejection] if rejection else 0)
    return rejection


@pytest.mark.parametrize(
    ("option", "data", "reason"),
    [
        ("exact_length", bytes(5), Rejection.LENGTH),
        ("check_range", bytes([0, 0, OUT_OF_RANGE, 0]), Rejection.RANGE),
        ("check_selectors", bytes([0, 0, UNKNOWN_SELECTOR, 0]), Rejection.MULTIPLEXER),
    ],
)
@pytest.mark.parametrize("policy", [SERVICE_POLICY, CONVERT_POLICY])
def test_each_option_switches_one_check(policy, option, data, reason):
    assert outcome(replace(policy, **{option: True}), data) is reason
    assert outcome(replace(policy, **{option: False}), data) is None


def test_a_decoder_that_reports_no_fault_is_believed():
    strict = AcceptancePolicy(**{f.name: True for f in fields(AcceptancePolicy)})
    acceptance = MessageAcceptance(strict, 4, None, CYCLE)
    frame = Frame(0, 0x100, bytes(4))
    assert accept_frame(acceptance, frame, lambda _: DecodedFrame("values")) == "values"


def test_a_policy_that_all_messages_share_cannot_be_changed():
    with pytest.raises(FrozenInstanceError):
        SERVICE_POLICY.check_range = False


@pytest.mark.parametrize("policy", [SERVICE_POLICY, CONVERT_POLICY])
def test_no_option_switches_off_length_checksum_and_counter(policy):
    assert outcome(policy, bytes(3)) is Rejection.LENGTH
    good = sealed(DATA_ID, 0, bytes(4))
    assert outcome(policy, good, data_id=DATA_ID) is None
    assert outcome(policy, good + bytes(1), data_id=DATA_ID) is Rejection.LENGTH
    assert outcome(policy, b"\xff" + good[1:], data_id=DATA_ID) is Rejection.CHECKSUM
    assert outcome(policy, sealed(DATA_ID, 15, bytes(4)), data_id=DATA_ID) is Rejection.ORDER


def test_the_policies_differ_where_convert_shows_what_was_sent():
    different = {
        f.name: (getattr(SERVICE_POLICY, f.name), getattr(CONVERT_POLICY, f.name))
        for f in fields(AcceptancePolicy)
    }
    assert different == {
        "exact_length": (True, False),
        "check_range": (True, False),
        "check_selectors": (False, True),
        "counter_per_channel": (False, True),
    }


@pytest.mark.parametrize("per_channel", [False, True])
def test_a_counter_for_all_channels_or_for_each(per_channel):
    policy = replace(SERVICE_POLICY, counter_per_channel=per_channel)
    acceptance = MessageAcceptance(policy, 4, DATA_ID, CYCLE)
    found = [
        accept_frame(acceptance, Frame(0, 0x100, sealed(DATA_ID, 0, bytes(4)), name), decode_frame)
        for name in ("can0", "can1")
    ]
    assert found == [0, 0 if per_channel else Rejection.REPEAT]
