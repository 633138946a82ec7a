"""Whole processes, from the command line to the files: `convert` by message, and the peers' way."""

import resource
import shutil
import subprocess
import sys
from statistics import median

import _exchange_data as data
from _peer_environment import peer_python
from _reading_ways import DBC, PEERS

LEAST, STRETCH = 12.0, 20.0
MAIN = "import sys; from adhesion_can.cli.main import main; sys.exit(main())"
PEER = """
import csv, sys
from pathlib import Path
import can, cantools
log, dbc, folder = sys.argv[1:]
database = cantools.database.load_file(dbc)
rows = {}
with can.LogReader(log) as reader:
    for message in reader:
        number = message.arbitration_id
        values = database.decode_message(number, message.data, decode_choices=False)
        rows.setdefault(number, []).append({"time_s": message.timestamp, **values})
for number, found in rows.items():
    message = database.get_message_by_frame_id(number)
    with (Path(folder) / f"{message.name}.csv").open("w", newline="") as file:
        names = ["time_s", *(signal.name for signal in message.signals)]
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(found)
"""


def whole_process(report, folder, frames, rounds):
    """Processor time of a conversion with everything that its process loads, in turn.

    Ours runs in this environment with the extras that it has; the peers in theirs, where
    python-can finds asammdf, too, and imports it.
    """
    python = peer_python("peers", PEERS, report)
    log, out = data.recording(folder, DBC, frames), folder / "whole"
    ours = [sys.executable, "-c", MAIN, "convert", str(log), "--dbc", str(DBC)]
    ways = {
        "to a CSV file a message": [*ours, "--out", f"{out}/", "--format", "csv"],
        "to a Parquet file a message": [*ours, "--out", f"{out}/"],
    }
    if python is not None:
        # asammdf is left out for the peers: nobody who reads text needs it.
        code = f"import sys; sys.modules['asammdf'] = None{PEER}"
        ways["peers"] = [str(python), "-E", "-s", "-c", code, str(log), str(DBC), str(out)]
    spent = {name: [] for name in ways}
    for _ in range(rounds):
        for name, words in ways.items():
            shutil.rmtree(out, ignore_errors=True)
            out.mkdir()
            spent[name].append(_processor_seconds(words))
    shutil.rmtree(out)
    seconds = {name: median(values) for name, values in spent.items()}
    for name, value in seconds.items():
        report.write(f"{name}: {value:.2f} s of the processor for {frames / 1e6:g} M frames")
    what = "times as fast as python-can + cantools to CSV, whole processes"
    target = f"at least {LEAST:.0f}, stretch {STRETCH:.0f}"
    if python is None:
        report.check(what, "not measured", target, met=False)
        return
    to_csv, by_default = (seconds["peers"] / seconds[name] for name in list(ways)[:2])
    report.write(f"convert to CSV, {what}: {to_csv:.1f}")
    report.check(f"convert, {what}", f"{by_default:.1f}", target, met=by_default >= LEAST)


def _processor_seconds(words):
    """User and system time of a process, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(words, stdout=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
