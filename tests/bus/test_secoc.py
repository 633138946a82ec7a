"""Secured frames: the vectors of RFC 4493, and every way to forge one that we know."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.bus.frame import Frame
from adhesion_can.bus.secoc import COUNTER_BITS, FrameAuthenticator, FrameVerifier, Refusal, cmac

KEY = bytes.fromhex("2b7e151628aed2a6abf7158809cf4f3c")
MESSAGE = bytes.fromhex(
    "6bc1bee22e409f96e93d7e117393172aae2d8a571e03ac9c9eb76fac45af8e51"
    "30c81c46a35ce411e5fbc1191a0a52eff69f2445df4f9b17ad2b417be66c3710"
)
RFC_4493 = {
    0: "bb1d6929e95937287fa37d129b756746",
    16: "070a16b46b4d4144f79bdd9dd04a287c",
    40: "dfa66747de9ae63030ca32611497c827",
    64: "51f0bebf7e3b9d92fc49741779363cfe",
}
"""Section 4: AES-CMAC of the first bytes of the message."""
FRAME = Frame(1000, 0x201, bytes(range(8)))


def sender(trip=1, key=KEY):
    trips = iter(range(trip, trip + 10))
    return FrameAuthenticator(key, lambda: next(trips))


@pytest.mark.parametrize("size", RFC_4493)
def test_the_vectors_of_the_rfc(size):
    assert cmac(KEY, MESSAGE[:size]).hex() == RFC_4493[size]


def test_a_secured_frame_as_it_stands_on_the_bus():
    """By the definition: data id, payload, freshness; the first half of the authenticator."""
    found = sender(trip=7).secure(FRAME)
    freshness = bytes.fromhex("0000000700000001")
    code = cmac(KEY, bytes.fromhex("00000201") + FRAME.data + freshness)
    assert found == FRAME._replace(data=FRAME.data + freshness + code[:8], is_fd=True)
    assert len(found.data) == 24  # a length that CAN FD has


@given(st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(max_size=48)), max_size=30))
def test_what_was_sent_is_accepted_once(sent):
    source, target = sender(), FrameVerifier(KEY)
    for number, payload in sent:
        frame = source.secure(Frame(0, number, payload))
        assert target.accept(frame) == payload
        assert target.accept(frame) is Refusal.FRESHNESS


@given(st.integers(0, 24 * 8 - 1))
def test_any_flipped_bit_is_refused(bit):
    data = bytearray(sender().secure(FRAME).data)
    data[bit // 8] ^= 1 << bit % 8
    forged = FRAME._replace(data=bytes(data), is_fd=True)
    assert FrameVerifier(KEY).accept(forged) is Refusal.AUTHENTICATOR


@given(st.integers(0, 23))
def test_a_frame_that_was_cut_is_refused(size):
    secured = sender().secure(FRAME)
    reason = FrameVerifier(KEY).accept(secured._replace(data=secured.data[:size]))
    assert reason is (Refusal.LENGTH if size < 16 else Refusal.AUTHENTICATOR)


def test_another_identifier_or_key_is_refused():
    secured = sender().secure(FRAME)
    others = [
        secured._replace(arbitration_id=0x204),
        secured._replace(is_extended=True),
        secured._replace(arbitration_id=0x10201, is_extended=True),
    ]
    for other in others:
        assert FrameVerifier(KEY).accept(other) is Refusal.AUTHENTICATOR
    wrong = FrameVerifier(bytes(16))
    assert wrong.accept(secured) is Refusal.AUTHENTICATOR


def test_a_recording_is_refused_also_after_a_restart_of_both_sides():
    source, target = sender(), FrameVerifier(KEY)
    recorded = [source.secure(FRAME) for _ in range(100)]
    for frame in recorded:
        target.accept(frame)
    restarted = FrameVerifier(KEY, target.latest)
    assert {restarted.accept(frame) for frame in recorded} == {Refusal.FRESHNESS}
    # The sender's message counter begins anew, its trip counter goes on.
    assert restarted.accept(sender(trip=2).secure(FRAME)) == FRAME.data
    assert restarted.accept(recorded[-1]) is Refusal.FRESHNESS


def test_frames_may_be_lost_and_not_overtake_each_other():
    source, target = sender(), FrameVerifier(KEY)
    first, _, third = (source.secure(FRAME) for _ in range(3))
    assert target.accept(third) == FRAME.data
    assert target.accept(first) is Refusal.FRESHNESS


def test_each_identifier_has_a_freshness_of_its_own():
    source, target = sender(), FrameVerifier(KEY)
    early = source.secure(FRAME)
    late = source.secure(FRAME._replace(arbitration_id=0x204))
    assert target.accept(late) == FRAME.data
    assert target.accept(early) == FRAME.data


def test_the_message_counter_rolls_over_into_a_new_trip():
    source, target = sender(trip=3), FrameVerifier(KEY)
    source._count = (1 << COUNTER_BITS) - 2
    frames = [source.secure(FRAME) for _ in range(3)]
    values = [int.from_bytes(frame.data[8:16], "big") for frame in frames]
    assert values[0] == (3 << COUNTER_BITS) + (1 << COUNTER_BITS) - 1
    assert values[1:] == [(4 << COUNTER_BITS) + 1, (4 << COUNTER_BITS) + 2]
    assert [target.accept(frame) for frame in frames] == [FRAME.data] * 3


@pytest.mark.parametrize("flag", ["is_remote", "is_error"])
def test_what_carries_no_payload_is_refused(flag):
    frame = sender().secure(FRAME)._replace(**{flag: True})
    assert FrameVerifier(KEY).accept(frame) is Refusal.LENGTH


@pytest.mark.parametrize("size", [0, 15, 17, 32])
def test_a_key_of_another_length_is_refused(size):
    with pytest.raises(ValueError, match=f"a key has 16 bytes, not {size}"):
        FrameVerifier(bytes(size))
    with pytest.raises(ValueError, match="a key has 16 bytes"):
        sender(key=bytes(size))
