"""The ladder's recording as other tools' traces: .blf (packed and plain), .asc, .trc."""

import struct
import zlib

import _ladder_data as data
import numpy as np
from _report import aside

_CONTAINER = 128 * 1024  # bytes of objects, as Vector's and python-can's writers fill them
_START_S = data.FIRST_US // 1_000_000
_START = (2023, 11, 2, 14, 22, 13, 20, 0)  # the same as SYSTEMTIME


def _rows(first, count):
    """Stamps from the first second on, ids and payloads of frames: (n,) in µs, (n,), (n, 8)."""
    text = data.lines(first, count)
    digits = text[:, data.STAMP_DIGITS].astype(np.int64) - ord("0")
    t_us = (digits * 10 ** np.arange(15, -1, -1)).sum(1) - _START_S * 1_000_000
    head = bytes(np.ascontiguousarray(text[:, 25:28]).tobytes()).decode()
    ids = np.array([int(head[i : i + 3], 16) for i in range(0, len(head), 3)])
    payload = bytes.fromhex(np.ascontiguousarray(text[:, 29:45]).tobytes().decode())
    return t_us, ids, np.frombuffer(payload, np.uint8).reshape(-1, 8)


def _objects(first, count):
    t_us, ids, payload = _rows(first, count)
    rows = np.zeros(count, [("mark", "S4"), ("head", "<u2"), ("version", "<u2"), ("size", "<u4"),
                            ("type", "<u4"), ("flags", "<u4"), ("client", "<u4"), ("t", "<u8"),
                            ("channel", "<u2"), ("dir", "u1"), ("dlc", "u1"), ("id", "<u4"),
                            ("data", "u1", 8)])  # fmt: skip
    rows["mark"], rows["head"], rows["version"], rows["size"], rows["type"] = b"LOBJ", 32, 1, 48, 1
    rows["flags"], rows["t"], rows["channel"], rows["dlc"] = 2, 1000 * t_us, 1, 8
    rows["id"], rows["data"] = ids, payload
    return rows.tobytes()


def blf(log, frames, *, packed):
    """The recording as .blf, its containers compressed with zlib's usual level or not at all."""
    out = log.with_name(f"ladder{'' if packed else '-plain'}.blf")
    if data.older(out, log):
        aside(f"writing {out}")
        with data.appearing(out) as file:
            # The level of compression stands in the head; without it vblf unpacks nothing.
            head = struct.pack("<4sLLBBBBQQLL8H8H", b"LOGG", 144, 0, 5, 6 if packed else 0, 0, 0,
                               0, 0, frames, 0, *_START, *_START)  # fmt: skip
            file.write(head.ljust(144, b"\0"))
            rest = b""
            for first in range(0, frames, data.PIECE):
                rest += _objects(first, min(data.PIECE, frames - first))
                is_last = first + data.PIECE >= frames
                whole = len(rest) if is_last else len(rest) // _CONTAINER * _CONTAINER
                for place in range(0, whole, _CONTAINER):
                    _write_container(file, rest[place : min(place + _CONTAINER, whole)], packed)
                rest = rest[whole:]
    return out


def _write_container(file, contents, packed):
    stored = zlib.compress(contents) if packed else contents
    size = 32 + len(stored)
    file.write(struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, 10))
    file.write(struct.pack("<H6xL4x", 2 if packed else 0, len(contents)))
    file.write(stored + bytes(size % 4))


_ASC_HEAD = (
    "date Tue Nov 14 22:13:20.000 2023\nbase hex  timestamps absolute\ninternal events logged\n"
    "Begin Triggerblock Tue Nov 14 22:13:20.000 2023\n   0.000000 Start of measurement\n"
)
_TRC_HEAD = ";$FILEVERSION=2.1\n;$STARTTIME=45244.925925925927\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n;\n"


def asc(log, frames):
    """The recording as Vector's tools write .asc."""

    def line(_, t_us, ident, payload):
        return (
            f"{t_us / 1e6:11.6f} 1  {ident:<15X} Rx   d 8 {payload}"
            f"  Length = 244015 BitCount = 125 ID = {ident}\n"
        )

    return _text(log.with_name("ladder.asc"), log, frames, _ASC_HEAD, line, "End TriggerBlock\n")


def trc(log, frames):
    """The recording as PEAK's tools write .trc, version 2.1."""

    def line(number, t_us, ident, payload):
        return f"{number + 1:7} {t_us / 1e3:13.3f} DT  1      {ident:04X} Rx -  8    {payload} \n"

    return _text(log.with_name("ladder.trc"), log, frames, _TRC_HEAD, line, "")


def _text(out, log, frames, head, line, tail):
    if data.older(out, log):
        aside(f"writing {out}")
        with data.appearing(out) as file:
            file.write(head.encode())
            for first in range(0, frames, data.PIECE):
                t_us, ids, payload = _rows(first, min(data.PIECE, frames - first))
                numbers = range(first, first + len(ids))
                rows = zip(numbers, t_us.tolist(), ids.tolist(), payload, strict=True)
                file.write("".join(line(n, t, i, p.tobytes().hex(" ").upper())
                                   for n, t, i, p in rows).encode())  # fmt: skip
            file.write(tail.encode())
    return out
