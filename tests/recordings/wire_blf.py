"""Files in Vector's .blf format, put together here from its description and not by the package."""

import struct
import zlib

START = (2023, 11, 2, 14, 22, 13, 20, 123)  # SYSTEMTIME: year, month, weekday, day, h, min, s, ms


def head(length=0, start=START, size=144):
    packed = struct.pack("<4sLBBBBBBBBQQLL8H8H", b"LOGG", size, 5, 0, 0, 0, 2, 6, 8, 1, length,
                         0, 0, 0, *start, *start)  # fmt: skip
    return packed.ljust(size, b"\0")


def obj(kind, body, stamp=0, unit=2, version=1, size=None, head_size=None):
    """An object with its head, and its padding."""
    if version == 2:
        more = struct.pack("<LBxHQ8x", unit, 0, 0, stamp)
    else:
        more = struct.pack("<LHHQ", unit, 0, 0, stamp)
    whole = 16 + len(more) + len(body)
    base = struct.pack("<4sHHLL", b"LOBJ", head_size or 16 + len(more), version,
                       whole if size is None else size, kind)  # fmt: skip
    return base + more + body + b"\0" * (whole % 4)


def classic(ident, data, channel=1, flags=0, dlc=None, kind=1, **more):
    size = len(data) if dlc is None else dlc
    body = struct.pack("<HBBL8s", channel, flags, size, ident, data)
    if kind == 86:  # with frame length, bit count
        body += struct.pack("<LBBH", 0, 0, 0, 0)
    return obj(kind, body, **more)


def fd(ident, data, channel=1, flags=0, fd_flags=1, valid=None, **more):
    size = len(data) if valid is None else valid
    body = struct.pack("<HBBLLBBB5x64s", channel, flags, 0, ident, 0, 0, fd_flags, size, data)
    return obj(100, body, **more)


def fd64(ident, data, channel=1, flags=0x1000, valid=None, extra=0, tail=b"", **more):
    size = len(data) if valid is None else valid
    body = struct.pack("<BBBBLLLLLLLHBBL", channel, 0, size, 0, ident, 0, flags, 0, 0, 0, 0, 0, 0,
                       extra, 0)  # fmt: skip
    return obj(101, body + data + tail, **more)


def error(ident=0, channel=1, **more):
    body = struct.pack("<HHLBBBxLLH2x8s", channel, 0, 0, 0, 0, 0, 0, ident, 0, bytes(8))
    return obj(73, body, **more)


def container(data, method=2, claimed=None, size=None):
    packed = zlib.compress(data) if method == 2 else data
    whole = 32 + len(packed)
    base = struct.pack("<4sHHLL", b"LOBJ", 16, 1, whole if size is None else size, 10)
    more = struct.pack("<H6xL4x", method, len(data) if claimed is None else claimed)
    return base + more + packed + b"\0" * (whole % 4)


def blf(*containers, length=None, **more):
    """A whole file of containers."""
    body = b"".join(containers)
    return head(144 + len(body) if length is None else length, **more) + body
