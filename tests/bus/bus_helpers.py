"""What several tests of the bus share; nothing of it comes from the package under test."""

import os
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
DATA = REPOSITORY / "tests" / "data"
DBC = REPOSITORY / "dbc" / "adhesion.dbc"


def crc8_bitwise(octets):
    """CRC-8, polynomial 0x1D, init 0, no reflection, no final xor: one bit at a time."""
    register = 0
    for octet in octets:
        for bit in range(7, -1, -1):
            feedback = (register >> 7) ^ ((octet >> bit) & 1)
            register = (register << 1) & 0xFF
            if feedback:
                register ^= 0x1D
    return register


def e2e_checksum(data_id, payload):
    """Byte 0 of a protected payload, as the contract says it."""
    return crc8_bitwise([data_id & 0xFF, data_id >> 8, *payload[1:]])


def sealed(data_id, count, payload):
    """A payload with counter and checksum, built without the package."""
    body = bytearray(payload)
    body[1] = (body[1] & 0xF0) | count
    body[0] = e2e_checksum(data_id, body)
    return bytes(body)


def payload_of(*fields, size=8):
    """Payload from (start, length, raw) of little-endian fields."""
    word = 0
    for start, length, raw in fields:
        word |= (raw & ((1 << length) - 1)) << start
    return word.to_bytes(size, "little")


def real_data():
    """Folder of the measured data, or None where it is absent."""
    stated = os.environ.get("ADHESION_CAN_REALDATA")
    folder = Path(stated) if stated else REPOSITORY.parent / "shared" / "realdata"
    return folder if folder.is_dir() else None
