"""Authenticated frames of CAN FD, based on AUTOSAR SecOC with AES-CMAC.

A secured frame carries payload, freshness value (8 bytes) and authenticator (8 bytes), all
big-endian. The authenticator is the first half of AES-CMAC (RFC 4493) over the data id, the payload
and the freshness value (AUTOSAR CP R22-11, Specification of Secure Onboard Communication, 'Data to
Authenticator'). The data id is the identifier in 4 bytes, with bit 31 set where it has 29 bits:
AUTOSAR's 16 bits would let frames pass for others of the same low bits. The freshness value is a
trip counter, which goes up with each start of the sender, and a message counter; it is sent whole,
so that a receiver that joins late needs no synchronisation. Needs the extra `secoc`.
"""

from collections.abc import Callable
from enum import StrEnum
from hmac import compare_digest

from cryptography.hazmat.primitives.ciphers.algorithms import AES
from cryptography.hazmat.primitives.cmac import CMAC

from adhesion_can.bus.frame import Frame

KEY_BYTES = 16
"""Length of a key of AES-128, bytes."""
FRESHNESS_BYTES, AUTHENTICATOR_BYTES = 8, 8
"""Lengths of the freshness value and of the truncated authenticator, bytes. NIST SP 800-38B,
appendix A, advises against less than 64 bits."""
TRAILER_BYTES = FRESHNESS_BYTES + AUTHENTICATOR_BYTES
COUNTER_BITS = 32
"""Width of the message counter, the lower part of the freshness value, bits."""
MOST_TRIPS = (1 << 32) - 1
"""Highest trip counter."""


class Refusal(StrEnum):
    """Reason to refuse a secured frame."""

    LENGTH = "length"
    FRESHNESS = "freshness"
    AUTHENTICATOR = "authenticator"


class _Authenticator:
    """AES-CMAC with a key that is expanded once."""

    def __init__(self, key: bytes) -> None:
        if len(key) != KEY_BYTES:
            raise ValueError(f"a key has {KEY_BYTES} bytes, not {len(key)}")
        self._code = CMAC(AES(key))

    def compute(self, message: bytes) -> bytes:
        """Code of a message, 16 bytes."""
        code = self._code.copy()
        code.update(message)
        return code.finalize()

    def authenticate(self, frame: Frame, payload: bytes, freshness: bytes) -> bytes:
        """Truncated authenticator of a payload in a frame."""
        data_id = frame.arbitration_id | frame.is_extended << 31
        return self.compute(data_id.to_bytes(4, "big") + payload + freshness)[:AUTHENTICATOR_BYTES]


def cmac(key: bytes, message: bytes) -> bytes:
    """AES-CMAC of a message (RFC 4493), 16 bytes.

    Raises:
        ValueError: The key has not 16 bytes.

    """
    return _Authenticator(key).compute(message)


class FrameAuthenticator:
    """Secures frames, each with a freshness value of its own.

    Args:
        key: Key, 16 bytes.
        next_trip: Function that gives a trip counter that was never used with this key, and higher
            than all before; called at the start and when the message counter is used up.

    Raises:
        ValueError: The key has not 16 bytes.

    """

    def __init__(self, key: bytes, next_trip: Callable[[], int]) -> None:
        self._authenticator = _Authenticator(key)
        self._next_trip = next_trip
        self._trip, self._count = next_trip(), 0

    def secure(self, frame: Frame) -> Frame:
        """Secured frame of CAN FD with the same identifier and stamp."""
        self._count += 1
        if self._count >> COUNTER_BITS:
            self._trip, self._count = self._next_trip(), 1
        value = self._trip << COUNTER_BITS | self._count
        freshness = value.to_bytes(FRESHNESS_BYTES, "big")
        code = self._authenticator.authenticate(frame, frame.data, freshness)
        return frame._replace(data=frame.data + freshness + code, is_fd=True)


class FrameVerifier:
    """Checks secured frames.

    Args:
        key: Key, 16 bytes.
        latest: Freshness value of the last accepted frame by identifier and whether it has 29
            bits; what is not fresher is refused. Kept over a restart, it refuses what was recorded
            before.

    Raises:
        ValueError: The key has not 16 bytes.

    """

    def __init__(self, key: bytes, latest: dict[tuple[int, bool], int] | None = None) -> None:
        self._authenticator = _Authenticator(key)
        self.latest = {} if latest is None else dict(latest)

    def accept(self, frame: Frame) -> bytes | Refusal:
        """Payload of an authentic and fresh frame, or the reason to refuse it."""
        size = len(frame.data) - TRAILER_BYTES
        if not frame.is_data or size < 0:
            return Refusal.LENGTH
        payload, trailer = frame.data[:size], frame.data[size:]
        freshness, code = trailer[:FRESHNESS_BYTES], trailer[FRESHNESS_BYTES:]
        expected = self._authenticator.authenticate(frame, payload, freshness)
        if not compare_digest(code, expected):
            return Refusal.AUTHENTICATOR
        value = int.from_bytes(freshness, "big")
        sender = frame.arbitration_id, frame.is_extended
        if value <= self.latest.get(sender, 0):
            return Refusal.FRESHNESS
        self.latest[sender] = value
        return payload
