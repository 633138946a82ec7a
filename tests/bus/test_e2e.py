"""E2E profile 1: the checksum against a bitwise one, the counter against a model of the rule."""

from dataclasses import asdict
from itertools import pairwise, product

import numpy as np
import pytest
from e2e.p01 import E2E_P01_DATAID_BOTH, e2e_p01_check, e2e_p01_protect
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from adhesion_can.bus.e2e import (
    CounterSupervision,
    checksum_ok,
    checksums_ok,
    counter_column,
    protect,
)
from adhesion_can.bus.rejection import REJECTIONS, Rejection
from tests.bus.bus_helpers import crc8_bitwise, e2e_checksum, sealed

payloads = st.binary(min_size=2, max_size=64)
data_ids = st.integers(0, 0xFFFF)
CYCLE = 10_000


# --- checksum ------------------------------------------------------------------------------------


def test_the_bitwise_crc_is_the_catalogued_one():
    # CRC-8/SAE-J1850 (poly 0x1D, init 0xFF, xorout 0xFF) has the check value 0x4B over
    # '123456789'; with init 0 and no xorout the catalogue's CRC-8/GSM-A has 0x37.
    assert crc8_bitwise(b"123456789") == 0x37


# (data id, counter, payload before, payload protected); the first two are AUTOSAR's own example of
# profile 1 with both data-id bytes (PRS_E2EProtocol), the others fixed when this was written.
GOLDEN = [
    (0x123, 0, "00" * 8, "cc00000000000000"),
    (0x123, 1, "00" * 8, "9101000000000000"),
    (0x101, 0, "0000ffffffffffff", "f100ffffffffffff"),
    (0x111, 14, "0000e80300000000", "490ee80300000000"),
]


@pytest.mark.parametrize(("data_id", "count", "plain", "wanted"), GOLDEN)
def test_golden_payloads(data_id, count, plain, wanted):
    payload = bytearray.fromhex(plain)
    protect(payload, data_id, count)
    assert payload.hex() == wanted
    assert payload == sealed(data_id, count, bytes.fromhex(plain))


@given(payload=payloads, data_id=data_ids, count=st.integers(0, 14))
@settings(max_examples=200, deadline=None)
def test_protect_writes_counter_and_bitwise_checksum_and_nothing_else(payload, data_id, count):
    body = bytearray(payload)
    protect(body, data_id, count)
    assert body[0] == e2e_checksum(data_id, body)
    assert body[1] & 0x0F == count
    assert body[1] & 0xF0 == payload[1] & 0xF0
    assert body[2:] == payload[2:]
    assert checksum_ok(bytes(body), data_id)


@given(payload=payloads, data_id=data_ids)
@settings(max_examples=200, deadline=None)
def test_checksum_judgement_equals_the_bitwise_one_and_the_library(payload, data_id):
    assume(payload[1] & 0x0F != 15)  # the library takes that for a checksum fault
    right = payload[0] == e2e_checksum(data_id, payload)
    assert checksum_ok(payload, data_id) is right
    library = e2e_p01_check(bytearray(payload), data_id, data_id_mode=E2E_P01_DATAID_BOTH)
    assert library is right


@pytest.mark.parametrize("count", range(16))
@given(payload=payloads, data_id=data_ids)
@settings(max_examples=10, deadline=None)
def test_a_right_checksum_is_right_whatever_the_counter_says(payload, data_id, count):
    """15 is the counter's fault and is to be reported as such: a sender counts modulo 16."""
    assert checksum_ok(sealed(data_id, count, payload), data_id)


@given(payload=payloads, data_id=data_ids, count=st.integers(0, 13))
@settings(max_examples=100, deadline=None)
def test_the_library_as_sender_is_understood(payload, data_id, count):
    body = bytearray(payload)
    body[1] = (body[1] & 0xF0) | count
    # It increments before it sends.
    e2e_p01_protect(body, data_id, data_id_mode=E2E_P01_DATAID_BOTH)
    assert body[1] & 0x0F == count + 1
    assert checksum_ok(bytes(body), data_id)
    ours = bytearray(payload)
    protect(ours, data_id, count + 1)
    assert ours == body


@given(
    payload=st.binary(min_size=8, max_size=8),
    data_id=data_ids,
    count=st.integers(0, 14),
    first=st.integers(0, 48),
    pattern=st.integers(1, 255),
)
@settings(max_examples=200, deadline=None)
def test_every_burst_of_up_to_eight_bits_is_seen(payload, data_id, count, first, pattern):
    """Within bytes 1..7, which the checksum runs over: what a CRC-8 promises."""
    body = sealed(data_id, count, payload)
    bits = int.from_bytes(body, "big") ^ (pattern << first)
    assert not checksum_ok(bits.to_bytes(8, "big"), data_id)


def test_checksum_needs_both_bytes_of_the_data_id():
    body = sealed(0x0101, 3, bytes(8))
    assert checksum_ok(body, 0x0101)
    for other in (0x0100, 0x0102, 0x0001, 0x0201, 0xFF01):
        assert not checksum_ok(body, other)


def test_the_judgement_does_not_touch_the_payload():
    body = bytearray(sealed(0x111, 4, b"\x00\x30\x01\x02\x03\x04\x05\x06"))
    before = bytes(body)
    assert checksum_ok(body, 0x111)
    assert body == before


def test_fifteen_counts_then_zero_again_all_pass_supervision():
    supervision = CounterSupervision(CYCLE)
    for i in range(40):
        assert supervision.accept(i % 15, i * CYCLE) is None
    assert supervision.lost == 0


# --- counter -------------------------------------------------------------------------------------


class Rule:
    """The contract's sentence about the counter, restated over the whole history.

    Nothing is kept but what was received and how it was judged; every verdict is worked out from
    that anew, so that no state can go stale.
    """

    def __init__(self, cycle_us):
        self.cycle_us = cycle_us
        self.received = []  # (count, t_us, accepted); None stands for a frame rejected before
        self.lost = 0

    def judge(self, count, t_us):
        verdict, lost = self._verdict(count, t_us)
        self.received.append((count, t_us, verdict is None))
        self.lost += lost
        return verdict

    def rejected_otherwise(self):
        self.received.append(None)

    def _verdict(self, count, t_us):
        if count == 15:
            return "order", 0
        frames = [entry for entry in self.received if entry]
        accepted = [entry for entry in frames if entry[2]]
        if not accepted:
            return None, 0
        silence = t_us - frames[-1][1]
        if self.cycle_us is not None and silence >= 10 * self.cycle_us:
            return None, 0
        delta = (count - accepted[-1][0]) % 15
        if delta in (1, 2, 3):
            return None, delta - 1
        before = self.received[-2:]
        follow = [(count - 2) % 15, (count - 1) % 15]
        if (
            len(before) == 2
            and all(entry and not entry[2] for entry in before)
            and [entry[0] for entry in before] == follow
        ):
            return None, 0
        return ("repeat" if delta == 0 else "order"), 0


steps = st.one_of(
    st.sampled_from([1, 1, 1, 1, 2, 3, 0]),
    st.integers(0, 14),
)
waits = st.one_of(
    st.just(CYCLE), st.integers(0, 3 * CYCLE), st.sampled_from([10 * CYCLE, 10 * CYCLE - 1])
)
events = st.lists(
    st.one_of(
        st.tuples(st.just("frame"), steps, waits),
        st.tuples(st.just("frame"), st.just(1), st.just(CYCLE)),
        st.tuples(st.just("fifteen"), st.just(0), waits),
        st.tuples(st.just("bad"), st.just(0), st.just(0)),
    ),
    max_size=60,
)


def run_both(sequence, cycle_us, first=0):
    rule, supervision = Rule(cycle_us), CounterSupervision(cycle_us)
    count, t_us = first, 1_000_000
    for position, (kind, step, wait) in enumerate(sequence):
        if kind == "bad":
            rule.rejected_otherwise()
            supervision.interrupt()
            continue
        t_us += wait
        if kind == "fifteen":
            sent = 15
        else:
            count = sent = (count + step) % 15
        wanted = rule.judge(sent, t_us)
        found = supervision.accept(sent, t_us)
        assert found == wanted, (position, sent, t_us)
        assert supervision.lost == rule.lost, position


FRAMES = [("frame", 1, CYCLE)]


@given(sequence=events, first=st.integers(0, 14), cycle=st.sampled_from([CYCLE, None]))
@example(sequence=[*FRAMES, ("frame", 7, CYCLE), *FRAMES, *FRAMES, *FRAMES], first=0, cycle=CYCLE)
@example(sequence=[*FRAMES * 3, ("frame", 5, 10 * CYCLE)], first=0, cycle=CYCLE)
@settings(max_examples=300, deadline=None)
def test_supervision_equals_the_rule(sequence, first, cycle):
    run_both(sequence, cycle, first)


@pytest.mark.slow
@given(sequence=events, first=st.integers(0, 14), cycle=st.sampled_from([CYCLE, None]))
@settings(max_examples=10_000, deadline=None)
def test_supervision_equals_the_rule_at_length(sequence, first, cycle):
    run_both(sequence, cycle, first)


def test_supervision_equals_the_rule_over_every_short_sequence():
    """All 15 counts, four deep, from one baseline: nothing left to chance."""
    for counts in product(range(15), repeat=3):
        rule, supervision = Rule(CYCLE), CounterSupervision(CYCLE)
        for i, count in enumerate((0, *counts)):
            assert supervision.accept(count, i * CYCLE) == rule.judge(count, i * CYCLE), counts
        assert supervision.lost == rule.lost


def started(*counts):
    supervision = CounterSupervision(CYCLE)
    for i, count in enumerate(counts):
        supervision.accept(count, i * CYCLE)
    return supervision, len(counts) * CYCLE


@pytest.mark.parametrize("first", range(15))
def test_the_first_frame_is_accepted_whatever_its_count(first):
    supervision = CounterSupervision(CYCLE)
    assert supervision.accept(first, 0) is None
    assert supervision.lost == 0


@pytest.mark.parametrize("base", range(15))
@pytest.mark.parametrize("delta", range(15))
def test_the_table_of_steps(base, delta):
    supervision, t_us = started(base)
    verdict = supervision.accept((base + delta) % 15, t_us)
    if delta in (1, 2, 3):
        assert verdict is None
        assert supervision.lost == delta - 1
    else:
        assert verdict == (Rejection.REPEAT if delta == 0 else Rejection.ORDER)
        assert supervision.lost == 0


def test_fifteen_is_never_valid_not_even_first_or_after_silence():
    supervision = CounterSupervision(CYCLE)
    assert supervision.accept(15, 0) is Rejection.ORDER
    assert supervision.accept(15, 1000 * CYCLE) is Rejection.ORDER
    assert supervision.accept(3, 1001 * CYCLE) is None


def test_a_rejected_frame_never_moves_the_baseline():
    supervision, t_us = started(4)
    for i, count in enumerate((9, 4, 12, 15, 2)):
        assert supervision.accept(count, t_us + i * CYCLE) is not None
    assert supervision.accept(5, t_us + 5 * CYCLE) is None
    assert supervision.lost == 0


def test_three_frames_that_follow_each_other_take_the_count_over():
    supervision, t_us = started(0)
    assert supervision.accept(8, t_us) is Rejection.ORDER
    assert supervision.accept(9, t_us + CYCLE) is Rejection.ORDER
    assert supervision.accept(10, t_us + 2 * CYCLE) is None
    assert supervision.accept(11, t_us + 3 * CYCLE) is None
    assert supervision.lost == 0, "a new count says nothing about frames lost"


@pytest.mark.parametrize("between", ["accepted", "checksum", "fifteen", "gap"])
def test_the_three_must_be_consecutive(between):
    supervision, t_us = started(0)
    assert supervision.accept(8, t_us) is Rejection.ORDER
    assert supervision.accept(9, t_us + CYCLE) is Rejection.ORDER
    third = 10
    if between == "accepted":
        assert supervision.accept(1, t_us + CYCLE) is None
    elif between == "checksum":
        supervision.interrupt()
    elif between == "fifteen":
        assert supervision.accept(15, t_us + CYCLE) is Rejection.ORDER
    else:
        third = 11
    assert supervision.accept(third, t_us + 2 * CYCLE) is Rejection.ORDER


def test_after_an_accepted_frame_three_take_over_anew():
    supervision, t_us = started(0)
    verdicts = [
        supervision.accept(n, t_us + i * CYCLE) for i, n in enumerate((8, 9, 1, 10, 11, 12))
    ]
    order = Rejection.ORDER
    assert verdicts == [order, order, None, order, order, None]


def test_a_stuck_counter_is_never_taken_over():
    supervision, t_us = started(6)
    verdicts = {supervision.accept(6, t_us + i * CYCLE) for i in range(50)}
    assert verdicts == {Rejection.REPEAT}


@pytest.mark.parametrize(("cycles", "taken"), [(9.9999, False), (10, True), (500, True)])
def test_ten_cycles_of_silence_take_any_count(cycles, taken):
    supervision = CounterSupervision(CYCLE)
    supervision.accept(0, 0)
    verdict = supervision.accept(7, round(cycles * CYCLE))
    assert (verdict is None) is taken
    assert supervision.lost == 0


def test_a_message_without_cycle_knows_no_silence():
    supervision = CounterSupervision(None)
    supervision.accept(0, 0)
    assert supervision.accept(7, 10**12) is Rejection.ORDER


# --- many frames at once -------------------------------------------------------------------------


def as_words(rows, width):
    """Payloads as a block has them: little-endian words, 0 behind each payload's end."""
    octets = b"".join(row.ljust(8 * width, b"\0") for row in rows)
    return np.frombuffer(octets, dtype="<u8").astype(np.uint64).reshape(len(rows), width)


@given(data=st.data(), size=st.integers(2, 64), data_id=data_ids)
@settings(max_examples=200, deadline=None)
def test_checksums_at_once_equal_those_one_by_one(data, size, data_id):
    rows = data.draw(st.lists(st.binary(min_size=size, max_size=size), max_size=20))
    right = data.draw(st.lists(st.booleans(), min_size=len(rows), max_size=len(rows)))
    rows = [sealed(data_id, 3, r) if good else r for r, good in zip(rows, right, strict=True)]
    width = 1 if size <= 8 and data.draw(st.booleans()) else 8
    found = checksums_ok(as_words(rows, width), size, data_id)
    assert found.dtype == bool
    assert found.tolist() == [checksum_ok(row, data_id) for row in rows]
    assert all(found[good] for good in np.flatnonzero(right))


def test_every_single_flipped_bit_is_seen_at_once():
    body = int.from_bytes(sealed(0x1234, 7, bytes(range(8))), "little")
    flipped = np.array([[body ^ (1 << bit)] for bit in range(64)], dtype=np.uint64)
    assert not checksums_ok(flipped, 8, 0x1234).any()
    assert checksums_ok(np.array([[body]], dtype=np.uint64), 8, 0x1234).all()


def test_counters_at_once_are_the_low_nibble_of_byte_1():
    rows = [
        bytes([0xA5, high << 4 | low, 0x3C]) + bytes(6) for high in (0, 15) for low in range(16)
    ]
    found = counter_column(as_words(rows, 2))
    assert found.dtype == np.uint8
    assert found.tolist() == [*range(16)] * 2


def one_by_one(supervision, counts, t_us, sound):
    outcome, lost = [], []
    for count, t, good in zip(counts.tolist(), t_us.tolist(), sound.tolist(), strict=True):
        before, rejection = supervision.lost, None
        if good:
            rejection = supervision.accept(count, t)
        else:
            supervision.interrupt()
        outcome.append(0 if rejection is None else 1 + REJECTIONS.index(rejection))
        lost.append(supervision.lost - before)
    return outcome, lost


def check_at_once(counts, t_us, sound, cycle, cuts):
    """Any cut into blocks: same verdicts, same losses, same state."""
    single, many = CounterSupervision(cycle), CounterSupervision(cycle)
    bounds = sorted({0, len(counts), *(cut % (len(counts) + 1) for cut in cuts)})
    for low, high in pairwise(bounds or [0, 0]):
        part = slice(low, high)
        wanted = one_by_one(single, counts[part], t_us[part], sound[part])
        outcome, lost = many.accept_all(counts[part], t_us[part], sound[part])
        assert outcome.dtype == np.uint8
        assert lost.dtype == np.int64
        assert (outcome.tolist(), lost.tolist()) == wanted
        assert asdict(many) == asdict(single)
        assert type(many.lost) is type(many._baseline or 0) is type(many._received_us) is int


def columns_of(sequence, first):
    rows, count, t_us = [], first, 1_000_000
    for kind, step, wait in sequence:
        t_us += wait
        if kind == "frame":
            count = (count + step) % 15
        rows.append((15 if kind == "fifteen" else count, t_us, kind != "bad"))
    counts, stamps, sound = zip(*rows, strict=True) if rows else ((), (), ())
    return (
        np.array(counts, dtype=np.uint8),
        np.array(stamps, dtype=np.int64),
        np.array(sound, dtype=bool),
    )


IN_STEP = st.integers(1, 12).map(lambda n: [("frame", 1, CYCLE)] * n)
TAKEN_OVER = st.integers(0, 14).map(lambda jump: [("frame", jump, CYCLE), *FRAMES * 3])
STUCK = st.integers(1, 5).map(lambda n: [("frame", 0, CYCLE)] * n)
runs = st.lists(st.one_of(IN_STEP, TAKEN_OVER, STUCK, events), max_size=8).map(
    lambda parts: [event for part in parts for event in part]
)
cuts = st.lists(st.integers(0, 200), max_size=5)


@given(sequence=runs, first=st.integers(0, 14), cycle=st.sampled_from([CYCLE, None]), cuts=cuts)
@settings(max_examples=300, deadline=None)
def test_supervision_at_once_equals_one_by_one(sequence, first, cycle, cuts):
    check_at_once(*columns_of(sequence, first), cycle, cuts)


@pytest.mark.slow
@given(sequence=runs, first=st.integers(0, 14), cycle=st.sampled_from([CYCLE, None]), cuts=cuts)
@settings(max_examples=10_000, deadline=None)
def test_supervision_at_once_equals_one_by_one_at_length(sequence, first, cycle, cuts):
    check_at_once(*columns_of(sequence, first), cycle, cuts)


def test_frames_that_are_in_order_are_judged_at_once(monkeypatch):
    """Lost frames, pauses and frames damaged elsewhere are no reason to go one by one: a recording
    of hours would take minutes."""
    steps = np.array([0, *[1, 1, 2, 3] * 50, 7, *[1] * 50])
    waits = np.where(steps == 7, 10 * CYCLE, CYCLE)
    counts, stamps = (np.cumsum(steps) % 15).astype(np.uint8), np.cumsum(waits)
    sound = np.arange(len(counts)) % 40 != 21
    expected = one_by_one(CounterSupervision(CYCLE), counts, stamps, sound)

    def refuse(*_):
        raise AssertionError("judged by itself")

    monkeypatch.setattr(CounterSupervision, "accept", refuse)
    many = CounterSupervision(CYCLE)
    begin, end = (many.accept_all(counts[p], stamps[p], sound[p]) for p in (np.s_[:90], np.s_[90:]))
    outcome, lost = (np.concatenate(pair).tolist() for pair in zip(begin, end, strict=True))
    assert (outcome, lost) == expected
    assert many.lost == sum(lost) > 100


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("rate", [0.0, 0.001, 0.3])
def test_supervision_at_once_over_a_long_run_with_faults(seed, rate):
    rng = np.random.default_rng(seed)
    n = 5000
    counts = (np.cumsum(np.where(rng.random(n) < rate, rng.integers(0, 15, n), 1)) % 15).astype(
        np.uint8
    )
    counts[rng.random(n) < rate / 3] = 15
    waits = np.where(rng.random(n) < rate, rng.integers(-CYCLE, 12 * CYCLE, n), CYCLE)
    check_at_once(counts, np.cumsum(waits), rng.random(n) >= rate, CYCLE, rng.integers(0, n, 9))


def test_supervision_at_once_over_every_short_sequence():
    """Steps of every kind, four deep, from one baseline."""
    for counts in product((0, 1, 2, 4, 8, 9, 10, 14, 15), repeat=4):
        row = np.array((0, *counts), dtype=np.uint8)
        stamps = np.arange(5, dtype=np.int64) * CYCLE
        single, many = CounterSupervision(CYCLE), CounterSupervision(CYCLE)
        wanted = one_by_one(single, row, stamps, np.ones(5, dtype=bool))
        outcome, lost = many.accept_all(row, stamps, np.ones(5, dtype=bool))
        assert (outcome.tolist(), lost.tolist()) == wanted
        assert asdict(many) == asdict(single)


def test_damaged_frames_at_the_edges_of_blocks_end_the_run_of_a_new_count():
    """Wherever a block ends between the frames of a new count, and whichever frames are damaged."""
    counts = np.array([0, 8, 9, 10, 11, 12, 13], dtype=np.uint8)
    stamps = np.arange(7, dtype=np.int64) * CYCLE
    for damaged in product((True, False), repeat=6):
        for cut in range(1, 7):
            check_at_once(counts, stamps, np.array([True, *damaged]), CYCLE, [cut])


@pytest.mark.parametrize("wait", [CYCLE, 10 * CYCLE - 1, 10 * CYCLE, 10 * CYCLE + 1, -CYCLE])
@pytest.mark.parametrize("step", range(15))
def test_supervision_at_once_at_the_edge_of_silence(step, wait):
    counts = np.array([3, 4, 4 + step, 5 + step, 6 + step], dtype=np.uint8) % 15
    stamps = np.cumsum([0, CYCLE, wait, CYCLE, CYCLE])
    for cut in range(6):
        check_at_once(counts, stamps, np.ones(5, dtype=bool), CYCLE, [cut])
