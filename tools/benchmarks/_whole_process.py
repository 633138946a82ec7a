"""Whole processes, from the command line to the end: `convert` by message, and the peers' way."""

import shutil
import sys
from statistics import median

import _exchange_data as data
from _peer_environment import peer_python
from _process_time import MAIN, processor_seconds
from _reading_ways import DBC, PEERS

LEAST, STRETCH = 12.0, 20.0
DECODED = """
import sys
# Nobody who reads text needs it, and python-can imports it wherever it is installed.
sys.modules["asammdf"] = None
import can, cantools
log, dbc, folder = sys.argv[1:]
database = cantools.database.load_file(dbc)
def decoded():
    with can.LogReader(log) as reader:
        for message in reader:
            number = message.arbitration_id
            yield message, database.decode_message(number, message.data, decode_choices=False)
"""
KEEP_NOTHING = "for _ in decoded(): pass"
TO_CSV = """
import csv
from pathlib import Path
rows = {}
for message, values in decoded():
    found = rows.setdefault(message.arbitration_id, [])
    found.append({"time_s": message.timestamp, **values})
for number, found in rows.items():
    message = database.get_message_by_frame_id(number)
    with (Path(folder) / f"{message.name}.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, ["time_s", *(signal.name for signal in message.signals)])
        writer.writeheader()
        writer.writerows(found)
"""


def whole_process(report, folder, frames, rounds):
    """Processor time of processes with everything that they load, in turn.

    Ours has the extras of this environment. The target holds against the peers' decoding alone,
    with nothing kept; what they take to write the same files is shown beside it.
    """
    python = peer_python("peers", PEERS, report)
    log, out = data.recording(folder, DBC, frames), folder / "whole"
    ours = [sys.executable, "-c", MAIN, "convert", log, "--dbc", DBC, "--out", f"{out}/"]
    ways = {"ours to Parquet": ours, "ours to CSV": [*ours, "--format", "csv"]}
    if python is not None:
        for name, code in (("peers, nothing kept", KEEP_NOTHING), ("peers to CSV", TO_CSV)):
            ways[name] = [python, "-E", "-s", "-c", DECODED + code, log, DBC, out]
    spent = {name: [] for name in ways}
    for _ in range(rounds):
        for name, words in ways.items():
            shutil.rmtree(out, ignore_errors=True)
            out.mkdir()
            spent[name].append(processor_seconds(*words))
    shutil.rmtree(out)
    seconds = {name: median(values) for name, values in spent.items()}
    for name, value in seconds.items():
        report.write(f"{name}: {value:.2f} s of the processor for {frames / 1e6:g} M frames")
    what = "convert by message, times as fast as python-can + cantools with nothing kept"
    target = f"at least {LEAST:.0f}, stretch {STRETCH:.0f}"
    if python is None:
        report.check(what, "not measured", target, met=False)
        return
    to_csv = seconds["peers to CSV"] / seconds["ours to CSV"]
    report.write(f"to CSV files, times as fast as python-can + cantools to the same: {to_csv:.1f}")
    ratio = seconds["peers, nothing kept"] / seconds["ours to Parquet"]
    report.check(what, f"{ratio:.1f}", target, met=ratio >= LEAST)
