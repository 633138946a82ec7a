"""The recording that all ways read: candump text of four messages with right checks, any length."""

import gzip
import shutil
from contextlib import contextmanager

import numpy as np
from _report import aside

IDS = {"WheelSpeeds1": 0x101, "VehicleSpeed": 0x111, "TractiveEffort1": 0x121, "AxleLoads1": 0x131}
FIRST_US, STEP_US = 1_700_000_000_000_000, 2_500
TEMPLATE = b"(0000000000.000000) can0 000#0000000000000000\n"
STAMP_DIGITS = [*range(1, 11), *range(12, 18)]
PIECE = 200_000
WHAT = (
    f"{', '.join(IDS)} in turn, one every {STEP_US / 1e3} ms, 8 bytes each, signals that move, "
    "right checksums and counters, as 'candump -L' writes it"
)


def _crc_table():
    table = np.arange(256)
    for _ in range(8):
        table = (table << 1 ^ (table >> 7) * 0x1D) & 0xFF
    return table.astype(np.uint8)


CRC = _crc_table()
HEX = np.frombuffer(b"".join(b"%02X" % byte for byte in range(256)), np.uint8).reshape(256, 2)


def _moving(message, place, turn):
    """Raw values of the bits from 16 on, 16 for each place, none of them 'not available'."""
    if message == "VehicleSpeed" and place > 0:
        return np.full(len(turn), 0x11 if place == 1 else 0)  # radar, forward
    level, swing = {
        "WheelSpeeds1": (9000, 4000),
        "VehicleSpeed": (5600, 2500),
        "TractiveEffort1": (500, 9000),
        "AxleLoads1": (20_700, 900),
    }[message]
    phase = turn / (1500 + 400 * place) + place
    return np.rint(level + swing * np.sin(phase) + turn * 7919 % 23).astype(np.int64)


def _payloads(message, turn):
    """Payloads of a message's frames with their checks, shape (n, 8)."""
    payload = np.zeros((len(turn), 8), np.uint8)
    payload[:, 1] = turn % 15
    for place in range(3):
        raw = _moving(message, place, turn)
        payload[:, 2 + 2 * place], payload[:, 3 + 2 * place] = raw & 0xFF, raw >> 8 & 0xFF
    low, high = IDS[message] & 0xFF, IDS[message] >> 8
    crc = CRC[np.full(len(turn), CRC[low] ^ high)]
    for place in range(1, 8):
        crc = CRC[crc ^ payload[:, place]]
    payload[:, 0] = crc
    return payload


def lines(first, count):
    """Lines of frames, each the same in a recording of any length; shape (count, characters)."""
    number = np.arange(first, first + count)
    text = np.tile(np.frombuffer(TEMPLATE, np.uint8), (count, 1))
    t_us = FIRST_US + number * STEP_US + number * 7919 % 97
    for place in reversed(STAMP_DIGITS):
        t_us, digit = np.divmod(t_us, 10)
        text[:, place] += digit.astype(np.uint8)
    for place, message in enumerate(IDS):
        here = np.flatnonzero(number % len(IDS) == place)
        text[here, 25:28] = np.frombuffer(b"%03X" % IDS[message], np.uint8)
        payload = _payloads(message, number[here] // len(IDS))
        text[here, 29:45] = HEX[payload].reshape(len(here), 16)
    return text


def _is_as_made(path, frames):
    """Whether a file kept from another run is this one: its length, its head and its tail."""
    size = len(TEMPLATE)
    if not path.exists() or path.stat().st_size != frames * size:
        return False
    some = min(frames, 1000)
    with path.open("rb") as file:
        head = file.read(some * size)
        file.seek((frames - some) * size)
        return (
            head == lines(0, some).tobytes() and file.read() == lines(frames - some, some).tobytes()
        )


def recording_path(folder, frames):
    return folder / f"ladder-{frames}.log"


def recording(folder, frames):
    """The recording of so many frames; written where it is not there yet."""
    path = recording_path(folder, frames)
    if not _is_as_made(path, frames):
        aside(f"writing {path}")
        with appearing(path) as file:
            for first in range(0, frames, PIECE):
                file.write(lines(first, min(PIECE, frames - first)).tobytes())
    return path


def packed(path):
    """A recording with gzip."""
    out = path.with_name(path.name + ".gz")
    if older(out, path):
        aside(f"writing {out}")
        with path.open("rb") as raw, appearing(out) as file, gzip.open(file, "wb", 6) as into:
            shutil.copyfileobj(raw, into, 1 << 20)
    return out


def older(made, source):
    """Whether a file that is made from another one is to be made again."""
    return not made.exists() or made.stat().st_mtime_ns < source.stat().st_mtime_ns


@contextmanager
def appearing(path):
    """A file that gets its name when it is written whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    with part.open("wb") as file:
        yield file
    part.replace(path)
