"""The ways of the ladder: ours, the peers' in an environment of their own, and one in C."""

import shutil
import subprocess
import sys
from pathlib import Path

import _ladder_data as data
from _passes import SPEND_S
from _peer_environment import BUILD, peer_python
from _reading_speed import Way, run_process
from _report import aside

HERE = Path(__file__).resolve().parent
DBC = HERE.parents[1] / "dbc" / "adhesion.dbc"
PEERS = ("python-can", "cantools", "asammdf")

CANTOOLS = "python-can + cantools"
EXTRACT = "asammdf `extract_bus_logging`"
OURS = "ours: text to columns, E2E checked"


def ours(way, path, *more):
    return (sys.executable, str(HERE / "_ours.py"), way, str(path), *more)


def peers(report):
    """Words that start a peer's way; None where they cannot be had, which is reported."""
    python = peer_python("peers", PEERS, report)
    if python is None:
        return None
    # -E -s: what is installed for us is not theirs.
    words = (str(python), "-E", "-s", str(HERE / "_peers.py"))
    versions = run_process((*words, "versions"))["versions"]
    report.write(f"peers: {', '.join(f'{name} {number}' for name, number in versions.items())}")
    return words


def _compiled(report):
    """The ladder's rung in C; None where there is no compiler, which is reported."""
    program, source = BUILD / "ladder", HERE / "ladder.c"
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        report.write("no C compiler: without the hand-written reader")
        return None
    if data.older(program, source):
        words = [compiler, "-O2", "-o", str(program), str(source)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode:
            report.write(f"the hand-written reader does not compile: {done.stderr.strip()}")
            return None
    return program


def bus_logging(words, log, name, payload_bytes, compression):
    """The recording as MF4, written where it is not there yet."""
    out = log.with_name(name)
    if data.older(out, log):
        aside(f"writing {out}")
        run_process((*words, "write-mf4", str(log), str(out), str(payload_bytes), str(compression)))
    return out


def lean_mf4(report, log):
    """The recording as MF4 as suits its readers best; None where asammdf cannot be had."""
    words = peers(report)
    return bus_logging(words, log, "ladder-lean.mf4", 8, 0) if words else None


def ladder(report, log, frames):
    """The ways that can be measured; the others are reported."""
    words, program = peers(report), _compiled(report)
    ways = list(_peer_ways(words, log)) if words else []
    ways += _own_ways(log)
    if program:
        title = "hand-written C, `gcc -O2`, E2E checked"
        ways.append(("c", title, (str(program), str(log), str(SPEND_S))))
    ways.append(("read", "reading the file", ours("read", log)))
    return [Way(key, title, words, frames, free="all cores" in title) for key, title, words in ways]


def _peer_ways(words, log):
    """The peers' ways; MF4 as python-can's logger writes it, and as suits asammdf best."""
    as_logged = bus_logging(words, log, "ladder.mf4", 64, 2)
    lean = bus_logging(words, log, "ladder-lean.mf4", 8, 0)
    text, database = str(log), str(DBC)
    lists = f"{CANTOOLS}, into a list a signal"
    yield "cantools", CANTOOLS, (*words, "cantools", text, database)
    yield "cantools-columns", lists, (*words, "cantools-columns", text, database)
    for path, tail, where in ((as_logged, "", "MF4"), (lean, "-lean", "lean MF4")):
        for key, more in (("", ""), ("-load", " with load"), ("-values", " with load, in units")):
            process = (*words, f"asammdf{key}", str(path), database)
            yield f"asammdf{key}{tail}", f"{EXTRACT} from {where}{more}", process


def _own_ways(log):
    packed = data.packed(log)
    return [
        ("columns", OURS, ours("columns", log)),
        ("columns-all", f"{OURS}, all cores", ours("columns", log)),
        ("columns-gzip", f"{OURS}, gzip", ours("columns", packed)),
        ("streamed", f"{OURS}, none kept", ours("streamed", log)),
        ("parse", "ours: text to frames alone", ours("parse", log)),
        ("convert", "`adhesion-can convert` to Parquet", ours("convert", log)),
        ("convert-all", "`adhesion-can convert` to Parquet, all cores", ours("convert", log)),
    ]
