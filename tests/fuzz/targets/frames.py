"""Frames of the bus: checks frame by frame beside the same in columns, and authenticated frames."""

from math import isnan

import numpy as np

from adhesion_can.bus.acceptance import Rejection
from adhesion_can.bus.block import Block
from adhesion_can.bus.database import load_database
from adhesion_can.bus.e2e import CounterSupervision, checksum_ok, checksums_ok
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.receiver import Receiver
from adhesion_can.bus.rejection import REJECTION_CODE
from adhesion_can.bus.roles import bind, packaged_choices
from adhesion_can.bus.secoc import TRAILER_BYTES, FrameAuthenticator, FrameVerifier, Refusal
from tests.fuzz.octets import Octets
from tests.wire import sealed

BOUND = bind(packaged_choices(), load_database(), (0.625,) * 6, "fuzz")
KEY = bytes(range(16))
_STATISTICS = (
    "frames", "accepted", "rejected", "first_us", "last_us", "longest_gap_us", "gap_at_us", "late",
    "not_available", "readings", "lost",
)  # fmt: skip


def acceptance(data):
    """Frames of our messages, sealed or not: the same readings and reasons in both ways."""
    choices = Octets(data)
    frames, t_us = [], 0
    cuts = [0]
    while choices and len(frames) < 200:
        t_us += _step_us(choices)
        frames.append(_frame(choices, t_us))
        if choices.below(8) == 7:  # not 0: inputs have many zeros, and blocks would have one frame
            cuts.append(len(frames))
    _require_same_checksums([frame.data for frame in frames if len(frame.data) == 8])
    single, many = Receiver(BOUND), Receiver(BOUND)
    outcomes = [single.accept(frame) for frame in frames]
    found = {}
    for first, end in zip(cuts, [*cuts[1:], len(frames)], strict=True):
        if first == end:
            continue
        block = Block.from_frames(frames[first:end])
        received = many.accept_block(block, block.t_us)
        rejected = {first + row for rows in received.rejected for row in rows.tolist()}
        assert rejected == {
            row for row in range(first, end) if isinstance(outcomes[row], Rejection)
        }
        for key, (times, values) in received.readings.items():
            pairs = zip(times.tolist(), values.tolist(), strict=True)
            found.setdefault(key, []).extend((t, None if isnan(v) else v) for t, v in pairs)
    wanted = {}
    for outcome in outcomes:
        for reading in outcome if isinstance(outcome, list) else ():
            key = reading.role, reading.axle
            wanted.setdefault(key, []).append((reading.t_us, reading.value))
    assert {key: rows for key, rows in found.items() if rows} == wanted
    for one, other in zip(single.records, many.records, strict=True):
        for name in _STATISTICS:
            assert getattr(one, name) == getattr(other, name), name


def _step_us(choices):
    """Time to the next frame: most often about a cycle, at times a silence."""
    code = choices.number()
    return code * 100 if code < 200 else (code - 199) * 50_000


def _frame(choices, t_us):
    """A frame of one of the messages; most have the right checksum."""
    message = choices.among(BOUND)
    kind = choices.number()
    size = message.plan.size if kind < 240 else kind - 240
    payload = choices.take(size)
    number = message.plan.frame_id
    if kind < 200 and size >= 2:
        payload = sealed(message.data_id, payload, payload[1] & 0x0F)
    return Frame(t_us, number, payload, is_remote=kind == 239, is_error=kind == 238)


def _require_same_checksums(payloads):
    if payloads:
        words = np.frombuffer(b"".join(payloads), "<u8").astype(np.uint64)[:, None]
        many = checksums_ok(words, 8, 0x101).tolist()
        assert many == [checksum_ok(payload, 0x101) for payload in payloads]


def counter(data):
    """Counts with silences and frames rejected before: the same outcomes one by one and at once."""
    choices = Octets(data)
    cycle_us = choices.among((None, 10_000, 1_000_000))
    single, many = CounterSupervision(cycle_us), CounterSupervision(cycle_us)
    t_us = 0
    while choices:
        rows = []
        for _ in range(choices.below(20)):
            t_us += _step_us(choices)
            code = choices.number()
            rows.append((code & 0x0F, t_us, code < 224))
        outcomes, lost = [], []
        for count, stamp, passed in rows:
            before = single.lost
            rejection = single.accept(count, stamp) if passed else single.interrupt()
            outcomes.append(0 if rejection is None else REJECTION_CODE[rejection])
            lost.append(single.lost - before)
        columns = np.array(rows).reshape(-1, 3).T
        found = many.accept_all(
            columns[0].astype(np.uint8), columns[1].astype(np.int64), columns[2].astype(np.bool_)
        )
        assert [column.tolist() for column in found] == [outcomes, lost]
        assert single == many


def secoc(data):
    """Frames that were secured and changed: accepted are those alone that are whole and fresh."""
    choices = Octets(data)
    sealer, verifier = FrameAuthenticator(KEY, lambda: 1), FrameVerifier(KEY)
    latest = {}
    while choices:
        number, is_extended = choices.number(4) & 0x1FFFFFFF, choices.below(2) == 1
        plain = Frame(0, number if is_extended else number & 0x7FF, choices.take(choices.below(49)))
        secured = sealer.secure(plain._replace(is_extended=is_extended))
        heard = _changed(secured, choices)
        freshness = int.from_bytes(heard.data[-TRAILER_BYTES : -TRAILER_BYTES // 2], "big")
        for frame in (heard, heard):  # the second time it is a repetition
            outcome = verifier.accept(frame)
            sender = frame.arbitration_id, frame.is_extended
            is_fresh = freshness > latest.get(sender, 0)
            assert isinstance(outcome, Refusal) == (heard != secured or not is_fresh)
            if not isinstance(outcome, Refusal):
                assert outcome == plain.data
                latest[sender] = freshness
    assert verifier.latest == latest


def _changed(frame, choices):
    """The frame as it is, or with some bits, its length, its id or its kind changed."""
    match choices.below(8):
        case 0:
            data = bytearray(frame.data)
            data[choices.below(len(data))] ^= choices.number()
            return frame._replace(data=bytes(data))
        case 1:
            return frame._replace(data=frame.data[: choices.below(len(frame.data) + 1)])
        case 2:
            return frame._replace(data=choices.take(choices.below(65)))
        case 3:
            return frame._replace(arbitration_id=frame.arbitration_id ^ (1 << choices.below(11)))
        case 4:
            return frame._replace(is_remote=True)
    return frame
