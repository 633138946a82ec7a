"""Readings -> a candump log, all frames of a message at once.

Places and factors come from the DBC through cantools; packing, counter and CRC are NumPy's.
"""

from functools import cache
from pathlib import Path

import cantools
import numpy as np
from cantools.database.can import Database, Message
from numpy.typing import NDArray

from tests.worlds.plant import Readings
from tests.worlds.rail import Floats

DBC = Path(__file__).resolve().parents[2] / "dbc" / "adhesion.dbc"
Bytes = NDArray[np.uint8]


@cache
def database() -> Database:
    """The message set."""
    loaded = cantools.database.load_file(DBC)
    assert isinstance(loaded, Database)
    return loaded


def write_log(readings: Readings, path: Path, begin_s: int = 0) -> None:
    """Write the drive as candump does with -L, each message at its cycle from a time on, s."""
    stamps, ids, payloads = [], [], []
    for name, signals in messages(readings).items():
        message = database().get_message_by_name(name)
        frames = packed(message, signals)
        cycle = message.cycle_time
        assert cycle is not None
        stamps.append(np.arange(len(frames), dtype=np.int64) * cycle * 1000)
        ids.append(np.full(len(frames), message.frame_id))
        payloads.append(frames)
    t_us, number, data = np.concatenate(stamps), np.concatenate(ids), np.concatenate(payloads)
    t_us += begin_s * 1_000_000
    order = np.lexsort((number, t_us))
    path.write_bytes(_text(t_us[order], number[order], data[order]))


def messages(readings: Readings) -> dict[str, dict[str, Floats]]:
    """Physical values of every signal that is not 0, by message; one row a frame."""

    def axles(signal: str, values: Floats, first: int) -> dict[str, Floats]:
        return {f"{signal}_Ax{i + 1}": values[:, i] for i in range(first, first + 3)}

    r = readings
    steady = np.ones(len(r.speed))
    return {
        "WheelSpeeds1": axles("WheelSpeed", r.wheel_speed, 0),
        "WheelSpeeds2": axles("WheelSpeed", r.wheel_speed, 3),
        "VehicleSpeed": {
            "VehicleSpeed": r.speed,
            "VehicleSpeedSource": steady,
            "Direction": steady if r.forward else 2 * steady,
        },
        "TractiveEffort1": axles("TractiveEffort", r.effort, 0),
        "TractiveEffort2": axles("TractiveEffort", r.effort, 3),
        "AxleLoads1": axles("AxleLoad", r.load, 0),
        "AxleLoads2": axles("AxleLoad", r.load, 3),
        "Environment": {
            "AmbientTemperature": r.ambient_temperature,
            "RailTemperature": r.rail_temperature,
            "RelativeHumidity": r.humidity,
            "SandingActive": r.sanding,
        },
        "TrackGeometry": {"Gradient": 1000 * r.gradient, "Curvature": 1000 * r.curvature},
    }


def packed(message: Message, signals: dict[str, Floats], first: int = 0) -> Bytes:
    """Frames of a message with counter and checksum of E2E profile 1, (n, 8).

    Args:
        message: of the message set.
        signals: Physical values by name, a row a frame.
        first: Number of the first frame, from 0.

    """
    n = len(next(iter(signals.values())))
    word = np.zeros(n, dtype=np.uint64)
    counts = {"Alive": (first + np.arange(n)) % 15}
    for signal in message.signals:
        values = counts.get(signal.name, signals.get(signal.name))
        if values is None:
            continue
        raw = np.rint((values - signal.offset) / signal.scale).astype(np.int64)
        mask = np.uint64((1 << signal.length) - 1)
        word |= (raw.astype(np.uint64) & mask) << np.uint64(signal.start)
    data = word.astype("<u8").view(np.uint8).reshape(n, 8)
    assert message.dbc is not None
    data_id = int(message.dbc.attributes["E2EDataId"].value)
    crc = np.full(n, _TABLE[_TABLE[data_id & 0xFF] ^ (data_id >> 8)], dtype=np.uint8)
    for column in range(1, 8):
        crc = _TABLE[crc ^ data[:, column]]
    data[:, 0] = crc
    return data


def _crc_table() -> Bytes:
    table = np.arange(256)
    for _ in range(8):
        table = np.where(table & 0x80, (table << 1) ^ 0x1D, table << 1) & 0xFF
    return table.astype(np.uint8)


_TABLE = _crc_table()
_HEX = np.frombuffer(b"0123456789ABCDEF", dtype=np.uint8)


def _text(t_us: NDArray[np.int64], number: NDArray[np.int64], data: Bytes) -> bytes:
    """Lines of one length at a time: the seconds have as many digits as they need."""
    parts = []
    digits = np.char.str_len((t_us // 1_000_000).astype(str)) if len(t_us) else t_us
    for width in np.unique(digits):
        rows = digits == width
        parts.append(_lines(t_us[rows], number[rows], data[rows], int(width)))
    return b"".join(parts)


def _lines(t_us: NDArray[np.int64], number: NDArray[np.int64], data: Bytes, width: int) -> bytes:
    template = f"({'0' * width}.000000) can0 000#{'0' * 16}\n".encode()
    text = np.tile(np.frombuffer(template, dtype=np.uint8), (len(t_us), 1))
    _decimal(text, t_us // 1_000_000, 1, width)
    _decimal(text, t_us % 1_000_000, 2 + width, 6)
    head = 15 + width
    for k in range(3):
        text[:, head + k] = _HEX[(number >> (8 - 4 * k)) & 0xF]
    text[:, head + 4 : head + 20 : 2] = _HEX[data >> 4]
    text[:, head + 5 : head + 20 : 2] = _HEX[data & 0xF]
    return text.tobytes()


def _decimal(text: Bytes, values: NDArray[np.int64], first: int, digits: int) -> None:
    for k in range(digits):
        text[:, first + digits - 1 - k] = 48 + values // 10**k % 10
