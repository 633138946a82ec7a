"""Ways to read the traces of other tools: ours, python-can, vblf, and mdfr for MF4."""

from pathlib import Path

import _trace_data as traces
from _peer_environment import peer_python
from _reading_speed import Way, run_process
from _reading_ways import lean_mf4, ours

_PEERS = ("python-can", "vblf", "mdfr")


def trace_ways(report, log, frames):
    """The ways, and of each of ours the keys of the peers that read the same file."""
    files = {
        "blf": traces.blf(log, frames, packed=True),
        "blf-plain": traces.blf(log, frames, packed=False),
        "asc": traces.asc(log, frames),
        "trc": traces.trc(log, frames),
    }
    mf4 = lean_mf4(report, log)
    if mf4:
        files["mf4"] = mf4
    names = {
        "blf": ".blf, compressed",
        "blf-plain": ".blf, plain",
        "asc": ".asc",
        "trc": ".trc",
        "mf4": ".mf4 of lean records",
    }
    ways = [
        Way(f"ours-{key}", f"ours: {names[key]}", ours("parse", path), frames)
        for key, path in files.items()
    ]
    pairs = []
    python = peer_python("trace-peers", _PEERS, report)
    if python:
        words = (str(python), "-E", "-s", str(Path(__file__).with_name("_trace_peers.py")))
        found = run_process((*words, "versions", *_PEERS))["versions"]
        report.write(f"peers: {', '.join(f'{name} {number}' for name, number in found.items())}")
        for key, path in files.items():
            reads = ["vblf"] if key.startswith("blf") else []
            reads = ["mdfr"] if key == "mf4" else ["python-can", *reads]
            for peer in reads:
                ways.append(Way(f"{peer}-{key}", f"{peer}: {names[key]}",
                                (*words, peer, str(path)), frames))  # fmt: skip
                pairs.append((f"ours-{key}", f"{peer}-{key}"))
    return ways, pairs
