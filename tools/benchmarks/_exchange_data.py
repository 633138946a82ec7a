"""The recordings that the writers are measured with: candump text of whole databases."""

from itertools import pairwise
from random import Random

import cantools
import numpy as np
from _ladder_data import CRC, HEX, appearing
from _report import aside

FIRST_US = 1_700_000_000_000_000
HUNDRED = "hundred.dbc"
CYCLES_MS = (10, 20, 50, 100, 200, 1000)
INPUTS = range(0x101, 0x160)
"""Ids of our own database that the service reads."""


def hundred_messages(folder):
    """A database of 100 messages, the same each time: lengths, signs, factors, both byte orders."""
    path = folder / HUNDRED
    text = "\n".join(('VERSION ""', "BU_: A B", *_messages(Random(15)), *_cycles()))
    if not path.exists() or path.read_text() != text:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return path


def _messages(random):
    for number in range(100):
        size = random.choice((2, 4, 6, 8, 8, 8))
        extended = number % 10 == 9
        key = (0x18FF0000 + number) | 1 << 31 if extended else 0x100 + number
        yield f"\nBO_ {key} Message{number}: {size} A"
        yield from _signals(random, number, 8 * size)


def _signals(random, number, bits):
    """Signals that fill a message; in every tenth message two pages behind a multiplexer."""
    intel, first, page = number % 3 > 0, 0, ""
    if number % 10 == 4:
        yield _signal(f"Page{number}", " M", 0, 8, intel, False, 1, 0)
        first = 8
    place = 0
    while first < bits:
        length = min(random.choice((1, 2, 4, 8, 8, 12, 16, 16, 32)), bits - first)
        if number % 10 == 4:
            page = f" m{place % 2}"
        signed = length > 1 and random.random() < 0.4
        factor = random.choice((1, 1, 0.1, 0.01, 0.002, 0.5, 10))
        offset = random.choice((0, 0, 0, -40, 100))
        yield _signal(f"S{place}", page, first, length, intel, signed, factor, offset)
        first, place = first + length, place + 1


def _signal(name, page, first, length, intel, signed, factor, offset):
    start = first if intel else 8 * (first // 8) + 7 - first % 8
    kind = f"{start}|{length}@{1 if intel else 0}{'-' if signed else '+'}"
    return f' SG_ {name}{page} : {kind} ({factor},{offset}) [0|0] "unit" B'


def _cycles():
    yield 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;'
    yield 'BA_DEF_DEF_ "GenMsgCycleTime" 0;'
    for number in range(100):
        key = (0x18FF0000 + number) | 1 << 31 if number % 10 == 9 else 0x100 + number
        cycle = CYCLES_MS[number % len(CYCLES_MS)]
        yield f'BA_ "GenMsgCycleTime" BO_ {key} {cycle};'
    yield ""


def recording(folder, database_path, frames):
    """candump text of a database's messages at their cycles; written where it is not there yet."""
    path = folder / f"{database_path.stem}-{frames}.log"
    if path.exists() and path.stat().st_mtime_ns >= database_path.stat().st_mtime_ns:
        return path
    aside(f"writing {path}")
    messages = _sent(cantools.database.load_file(database_path))
    rate = sum(1e3 / message.cycle_time for message in messages)
    seconds = 1.01 * frames / rate + 1
    stamps, lines = [], []
    for message in messages:
        t_us = np.arange(0, int(seconds * 1e6), 1000 * message.cycle_time)
        t_us = t_us + message.frame_id * 37 % 1000 + np.arange(len(t_us)) * 7919 % 97
        stamps.append(t_us)
        lines.append(_lines(message, FIRST_US + t_us))
    order = np.argsort(np.concatenate(stamps), kind="stable")[:frames]
    with appearing(path) as file:
        file.write(b"".join(np.concatenate(lines)[order].tolist()))
    return path


def _sent(database):
    """The messages of a database that others send; of ours, what the service reads."""
    return [
        message
        for message in database.messages
        if message.cycle_time and (message.frame_id in INPUTS or len(database.messages) == 100)
    ]


def _lines(message, t_us):
    """Lines of candump, an object array."""
    turn = np.arange(len(t_us))
    payload = np.zeros((len(turn), message.length), np.uint8)
    for place, signal in enumerate(message.signals):
        if signal.name in ("Crc", "Alive"):
            continue
        raw = _moving(message, signal, place, turn)
        for bit, (byte, within) in enumerate(_bits(signal)):
            payload[:, byte] |= ((raw >> bit & 1) << within).astype(np.uint8)
    if "E2EDataId" in message.dbc.attributes:
        _protect(message, payload, turn)
    number = b"%08X" if message.is_extended_frame else b"%03X"
    head = b" can0 " + number % message.frame_id + b"#"
    texts = HEX[payload].reshape(len(turn), -1)
    seconds, fraction = np.divmod(t_us, 1_000_000)
    lines = np.empty(len(turn), object)
    lines[:] = [
        b"(%d.%06d)%b%b\n" % (whole, part, head, text)
        for whole, part, text in zip(
            seconds.tolist(), fraction.tolist(), map(bytes, texts), strict=True
        )
    ]
    return lines


def _moving(message, signal, place, turn):
    """Raw values that move as measured ones do, none of them 'not available'."""
    if signal.is_multiplexer:
        pages = {number for one in message.signals for number in one.multiplexer_ids or ()}
        return turn % len(pages)
    top = (1 << min(signal.length - signal.is_signed, 31)) - 2
    if signal.length <= 4:
        return turn // 500 % max(top, 2)
    phase = turn / (1500 + 400 * place) + place
    noise = turn * 7919 % 23 if signal.length > 8 else 0
    return np.rint(0.4 * top + 0.1 * top * np.sin(phase)).astype(np.int64) + noise


def _bits(signal):
    """(byte, bit) of each bit of a signal, the least significant first."""
    if signal.byte_order == "little_endian":
        return [divmod(signal.start + bit, 8) for bit in range(signal.length)]
    places = [divmod(signal.start, 8)]
    for _ in pairwise(range(signal.length + 1)):
        byte, bit = places[-1]
        places.append((byte, bit - 1) if bit else (byte + 1, 7))
    return places[: signal.length][::-1]


def _protect(message, payload, turn):
    """AUTOSAR E2E profile 1: counter and checksum."""
    payload[:, 1] |= (turn % 15).astype(np.uint8)
    data_id = message.dbc.attributes["E2EDataId"].value
    low, high = data_id & 0xFF, data_id >> 8
    crc = CRC[np.full(len(turn), CRC[low] ^ high)]
    for place in range(1, message.length):
        crc = CRC[crc ^ payload[:, place]]
    payload[:, 0] = crc
