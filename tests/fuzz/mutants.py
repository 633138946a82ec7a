"""Mutants of files through the command line: a status of 0, 1 or 2, and two lines at most.

Coverage cannot guide a fuzzer through asammdf and SQLite. These mutants know where the links,
sizes and cells of a file are instead, and go through whole commands.
"""

import io
import os
import random
import re
import resource
import sqlite3
import struct
import tempfile
from contextlib import closing, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from adhesion_can.cli.main import main
from adhesion_can.recordings.candump import format_frame
from tests.fuzz.odd_drives import odd_log, odd_table
from tests.fuzz.rule import MOST_MIB
from tests.recordings.test_mf4 import group, logged, unsorted_logging
from tests.wire import Bench

LONGEST_S = 20
"""Processor time of a command, s."""
LINES = 2
_COMMANDS = (("check",), ("check",), ("check",), ("identify",), ("replay",), ("convert",))
_DRIVE_COMMANDS = (("check",), ("identify",), ("replay",), ("calibrate",), ("diagnose",))
_TABLE_COMMANDS = (("check",), ("identify",), ("diagnose",))
_MODEL_COMMANDS = (("replay",), ("identify",))
DRIVES = {"drive.log": (odd_log, _DRIVE_COMMANDS), "table.csv": (odd_table, _TABLE_COMMANDS)}
"""Kinds of odd drives, with what makes them and the commands that take them."""
_NUMBERS = (0, 1, 2, 7, 8, 64, 255, 2**15, 2**16 - 1, 2**31, 2**32 - 1, 2**40, 2**63, 2**64 - 1)
_CELLS = (
    "", "nan", "inf", "-1e999", "1e308", "-0", "=1+1", "0x10", "1,5", "'", '"', '"a\nb"', "\x00",
    "\x1b[31m", "\u202e", "9" * 400, "x" * 200_000, "time_s", "slip", "#", "None", "1_000", "٣",
)  # fmt: skip

_VALUES = (
    "0", "0.0", "-1", "1e308", "-1e-308", "nan", "inf", "1e999", "9" * 400, "true", '""', '"x"',
    "[]", "[[]]", "[nan]", "[1.0, 1.0, 0.0]", "{}", "1979-05-27", "[" * 3000, "3.0", "7.0", "1_0",
    "[" + "1.0, " * 20_000 + "]", '"\\u001b[31m"', '"\\u202e"', '"' + "x" * 100_000 + '"', "0x10",
    "2000000000",
)  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """What a command did with a mutant.

    Attributes:
        status: Exit status.
        seconds: Time of the processor, s, with that of its child.
        lines: Lines on stderr.

    """

    status: int
    seconds: float
    lines: list[str]


def _peaks_mib():
    """Largest memory of this process so far, and of its children, MiB."""
    own, of_children = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
    return [resource.getrusage(who).ru_maxrss / 1024 for who in (own, of_children)]


def play(kind, data, number=0):
    """Run a command with a file; an AssertionError where it breaks the rule.

    Args:
        kind: Suffix of the file, with its dot.
        data: Bytes of the file.
        number: Number of the command.

    """
    commands = _MODEL_COMMANDS if kind == ".toml" else _COMMANDS
    commands = DRIVES[kind][1] if kind in DRIVES else commands
    command = commands[number % len(commands)]
    with tempfile.TemporaryDirectory(dir=_memory_folder()) as folder:
        path = Path(folder) / f"m{Path(kind).suffix or kind}"
        path.write_bytes(data)
        line = [*command, str(path)]
        if command == ("convert",):
            line += ["--out", f"{folder}/out.csv"]
        if kind == ".toml":
            (log := Path(folder) / "drive.log").write_text(_sound_log())
            line = [*command, str(log), "--model", str(path)]
        out, err = io.StringIO(), io.StringIO()
        before, peaks = sum(os.times()[:4]), _peaks_mib()
        with redirect_stdout(out), redirect_stderr(err):
            status = main(line)
        seconds = sum(os.times()[:4]) - before
    lines = err.getvalue().splitlines()
    assert status in (0, 1, 2), status
    assert len(lines) <= LINES, lines
    assert (status == 2) == bool(lines), (status, lines)
    assert seconds < LONGEST_S, seconds
    # Peaks of a whole life: what a process has had before says nothing of this file.
    for peak, earlier in zip(_peaks_mib(), peaks, strict=True):
        assert peak < MOST_MIB or peak == earlier
    return Outcome(status, seconds, lines)


def _memory_folder():
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


# --- seeds ---------------------------------------------------------------------------------------


@cache
def seeds(kind):
    """Sound files of a kind, small."""
    with tempfile.TemporaryDirectory() as folder:
        return tuple(path.read_bytes() for path in _SEEDS[kind](Path(folder)))


def _table():
    rng = np.random.default_rng(1)
    slip = rng.uniform(0, 0.2, 400)
    adhesion = 0.4 * (1 - np.exp(-60 * slip)) - 0.3 * slip + rng.normal(0, 0.01, 400)
    return np.arange(400) * 0.02, slip, adhesion, 20 + np.arange(400) % 7


def _mf4(folder):
    import asammdf

    times, slip, adhesion, speed = _table()
    for level in (0, 2):
        with asammdf.MDF(version="4.10") as mdf:
            columns = {"slip": slip, "adhesion": adhesion, "speed": speed}
            mdf.append(
                [asammdf.Signal(c, times, name=n, unit="") for n, c in columns.items()],
                common_timebase=True,
            )
            yield mdf.save(folder / f"t{level}.mf4", compression=level)
    name, _, samples = group(len(_frames()))
    samples[f"{name}.ID"] = [frame.arbitration_id for frame in _frames()]
    samples[f"{name}.DataBytes"] = [list(frame.data) for frame in _frames()]
    for field, number in {"IDE": 0, "EDL": 0, "DataLength": 8}.items():
        samples[f"{name}.{field}"] = number
    stamps = np.array([frame.t_us / 1e6 - 10**6 for frame in _frames()])
    yield logged(folder / "log.mf4", (name, stamps, samples), start=10**6)
    yield unsorted_logging(folder / "unsorted.mf4", 200)


def _frames():
    return list(Bench().drive(10**12, 10**12 + 400_000))


@cache
def _sound_log():
    """Candump text of the drive that models are read for."""
    return "".join(map(format_frame, Bench().drive(10**12, 10**12 + 3_000_000)))


def _db(folder):
    path = folder / "a.db"
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(
            "CREATE TABLE messages(ts REAL, arbitration_id INTEGER, extended INTEGER, "
            "remote INTEGER, error INTEGER, dlc INTEGER, data BLOB)"
        )
        connection.executemany(
            "INSERT INTO messages VALUES(?,?,0,0,0,8,?)",
            [(frame.t_us / 1e6, frame.arbitration_id, frame.data) for frame in _frames()],
        )
        connection.commit()
    yield path


def _csv(folder):
    path = folder / "table.csv"
    rows = zip(*(column.tolist() for column in _table()), strict=True)
    lines = ["time_s,slip,adhesion,speed", *(",".join(f"{n:.6g}" for n in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    yield path
    from base64 import b64encode

    path = folder / "log.csv"
    lines = ["timestamp,arbitration_id,extended,remote,error,dlc,data"]
    for frame in _frames():
        data = b64encode(frame.data).decode()
        lines.append(f"{frame.t_us / 1e6:.6f},{frame.arbitration_id:#x},0,0,0,8,{data}")
    path.write_text("\n".join(lines) + "\n")
    yield path


def _toml(folder):
    for text in _MODELS:
        (folder / "model.toml").write_text(text)
        yield folder / "model.toml"


_BASE = """[base]
c1 = 0.4
c2 = 30.0
c3 = 0.3
covariance = [[1e-4, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1e-4]]
"""
_MODELS = (
    f"""{_BASE}
[[effect]]
id = "wheel_radius"
[effect.parameters]
error = 0.01
axle = 1.0

[[effect]]
id = "formula"
expression = "1 + a * max(speed - b, 0)"
[effect.parameters]
a = 0.001
b = 5.0
""",
    f"""{_BASE}
[curve]
family = "magic_formula"
peak_std = [0.1, 0.2]
[curve.parameters]
B = 60.0
C = 1.3
D = 0.4
E = 0.0

[[spline]]
channel = "speed"
kind = "factor"
knots = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]
coefficients = [0.0, 0.1, 0.1, 0.0]

[provenance]
command = "diagnose"
""",
)
_EXPRESSIONS = (
    "1/(speed-speed)", "lag(speed, -1)", "lag(speed, 0/0)", "speed**speed**speed", "a" * 5000,
    "(" * 300 + "a" + ")" * 300, "exp(exp(speed))", "log(-speed)", "__import__('os')", "1 if a",
    "lag(lag(speed, 3), 1e-300)", "nothing * a", "max(a)", "speed.real", "1e308 * 1e308 * speed",
)  # fmt: skip

_SEEDS = {".mf4": _mf4, ".db": _db, ".csv": _csv, ".toml": _toml}
KINDS = tuple(_SEEDS)


# --- mutations -----------------------------------------------------------------------------------


def mutant(kind, number):
    """The mutant of a number: bytes of a file."""
    if kind in DRIVES:
        return DRIVES[kind][0](number)
    rng = random.Random(f"{kind} {number}")
    data = bytearray(rng.choice(seeds(kind)))
    own = {
        ".mf4": (_link, _link, _field),
        ".db": (_field, _word, _schema),
        ".csv": (_cell, _row),
        ".toml": (_value, _value, _row),
    }
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        rng.choice((*own[kind], *own[kind], _flip, _hole, _cut, _repeat))(data, rng)
    return bytes(data)


def _blocks(data):
    return [found.start() for found in re.finditer(rb"##[A-Z]{2}", bytes(data))]


def _link(data, rng):
    """A link of a block of MDF leads elsewhere, or a number of its data is another."""
    places = _blocks(data)
    if not places:
        return
    at = rng.choice(places)
    if at + 24 > len(data):
        return
    links = min(int.from_bytes(data[at + 16 : at + 24], "little"), 8)
    place = at + 24 + 8 * rng.randrange(max(links, 1) + 3)
    target = rng.choice((at, 0x40, 0, len(data) - 8, len(data), 2**63, rng.choice(places)))
    if place + 8 <= len(data):
        struct.pack_into("<Q", data, place, target)


def _field(data, rng):
    """A number of 1, 2, 4 or 8 bytes is an odd one."""
    size = rng.choice((1, 2, 4, 8))
    at = rng.randrange(0, max(len(data) - size, 1))
    at -= rng.choice((0, at % 8))
    number = rng.choice(_NUMBERS) % 256**size
    data[at : at + size] = number.to_bytes(size, rng.choice(("little", "big")))


def _word(data, rng):
    """A number in the head of a database or of a page."""
    page = rng.randrange(max(len(data) // 4096, 1)) * 4096
    at = min(page + rng.randrange(108), len(data) - 4)
    size = rng.choice((1, 2, 4))
    data[at : at + size] = (rng.choice(_NUMBERS) % 256**size).to_bytes(size, "big")


def _schema(data, rng):
    """Another word in the text of the schema."""
    old, new = rng.choice(
        (
            (b"CREATE TABLE", b"CREATE VIEW "),
            (b"data BLOB", b"data TEXT"),
            (b"ts REAL", b"ts JSON"),
            (b"messages", b"Messages"),
            (b"tablemessages", b"view_messages"),
            (b"dlc INTEGER", b"dlc AS (ts)"),
            (b"error INTEGER", b"error INT,a,b"),
        )
    )
    place = data.find(old)
    if place >= 0:
        data[place : place + len(old)] = new


def _cell(data, rng):
    """A cell is an odd one, or the comma behind it another sign."""
    lines = data.split(b"\n")
    place = rng.choice((0, 1, rng.randrange(len(lines))))
    cells = lines[min(place, len(lines) - 1)].split(b",")
    at = rng.randrange(len(cells))
    if rng.random() < 0.8:
        cells[at] = rng.choice(_CELLS).encode("utf-8")
    sign = rng.choice((b",", b",", b",", b";", b"\t", b"|", b"\r", b"\n"))
    lines[min(place, len(lines) - 1)] = sign.join(cells)
    data[:] = b"\n".join(lines)


def _row(data, rng):
    """Rows are gone, doubled, empty or of other encodings."""
    lines = data.split(b"\n")
    at = rng.randrange(len(lines))
    way = rng.randrange(6)
    if way == 0:
        del lines[at:]
    elif way == 1:
        lines[at:at] = [lines[at]] * rng.choice((1, 100, 3000))
    elif way == 2:
        lines[at] = b""
    elif way == 3:
        lines[0], lines[at] = lines[at], lines[0]
    elif way == 4:
        lines.insert(0, rng.choice((b"# comment", b"\xef\xbb\xbf", b"\xff\xfe", b"sep=;", b"%")))
    else:
        lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
    data[:] = b"\n".join(lines)


def _value(data, rng):
    """A value is an odd one of the same or of another type, or a key has the name of another."""
    lines = data.split(b"\n")
    places = [at for at, line in enumerate(lines) if b" = " in line]
    if not places:
        return
    at = rng.choice(places)
    key, value = lines[at].split(b" = ", 1)
    if rng.random() < 0.15:
        key = lines[rng.choice(places)].split(b" = ", 1)[0]
    elif key == b"expression":
        value = f'"{rng.choice(_EXPRESSIONS)}"'.encode()
    else:
        value = rng.choice(_VALUES).encode()
    lines[at] = key + b" = " + value
    data[:] = b"\n".join(lines)


def _flip(data, rng):
    for _ in range(rng.choice((1, 4, 40))):
        if data:
            data[rng.randrange(len(data))] = rng.randrange(256)


def _hole(data, rng):
    at = rng.randrange(len(data) + 1)
    size = min(rng.choice((8, 100, 1000)), len(data) - at)
    data[at : at + size] = rng.choice((b"\0", b"\xff")) * size


def _cut(data, rng):
    del data[rng.randrange(len(data) + 1) :]


def _repeat(data, rng):
    at, size = rng.randrange(len(data) + 1), rng.choice((8, 24, 200))
    to = rng.randrange(len(data) + 1)
    data[to:to] = data[at : at + size]
