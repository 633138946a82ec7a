"""Replay of a drive with the tracker against real time, with and without the extra `fast`.

In columns, as `adhesion-can replay` does it, and frame by frame, as the live service. Each turn
runs all four ways, so that they share what else the machine does. The frames sent must be equal.
"""

import argparse
import hashlib
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import adhesion_can
from adhesion_can.config import load_configuration
from adhesion_can.estimation.tracker import kernels
from adhesion_can.recordings.sequence import blocks_in_sequence, in_sequence, open_recordings
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.replay import replay, replay_blocks

TARGETS = {"columns": 120.0, "frames": 60.0}
SCENARIO = "dry-wet-greasy-dry"


def play(way: str, path: str) -> None:
    """Replay a recording once; print seconds and the hash of what was sent."""
    recordings = open_recordings([Path(path)])
    core, sent = ServiceCore(load_configuration()), []
    if way == "columns":
        began = time.perf_counter()
        replay_blocks(blocks_in_sequence(recordings), core, sent.append)
    else:
        frames = list(in_sequence(recordings))  # a bus decodes no text
        began = time.perf_counter()
        replay(frames, core, sent.append)
    seconds = time.perf_counter() - began
    payloads = hashlib.sha256(b"".join(bytes(frame.data) for frame in sent)).hexdigest()
    print(seconds, payloads)


def time_once(way: str, path: Path, compiled: str) -> tuple[float, str]:
    """Seconds and hash of a replay in a process of its own."""
    told = subprocess.run(
        [sys.executable, __file__, "--play", way, str(path)],
        env=os.environ | {kernels.SWITCH: compiled},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    return float(told[0]), told[1]


def main() -> int:
    """Run the command; 1 where the frames differ."""
    parser = argparse.ArgumentParser(prog="tools/bench replay", description=__doc__)
    parser.add_argument("--seconds", type=float, default=120.0, help="length of the drive")
    parser.add_argument("--runs", type=int, default=5, help="turns, of which the median counts")
    parser.add_argument("--play", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.play:
        play(*options.play)
        return 0
    rates: dict[tuple[str, str], list[float]] = {}
    hashes: set[str] = set()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.log"
        adhesion_can.simulate(SCENARIO, options.seconds).write(path)
        for _ in range(options.runs):
            for way in TARGETS:
                for compiled in "01":
                    seconds, payloads = time_once(way, path, compiled)
                    rates.setdefault((way, compiled), []).append(options.seconds / seconds)
                    hashes.add(payloads)
    print(f"{SCENARIO}, {options.seconds:g} s, six axles, median of {options.runs}")
    print(f"{'times real time':<20}{'NumPy':>8}{'fast':>8}{'ratio':>8}{'target':>8}")
    for way, target in TARGETS.items():
        plain, fast = (median(rates[way, compiled]) for compiled in "01")
        met = "met" if fast >= target else "MISSED"
        print(f"{way:<20}{plain:>8.1f}{fast:>8.1f}{fast / plain:>8.2f}{target:>8.0f}  {met}")
    print(f"frames sent: {'equal in all runs' if len(hashes) == 1 else 'DIFFER'}")
    return int(len(hashes) > 1)


if __name__ == "__main__":
    sys.exit(main())
