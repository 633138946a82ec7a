"""Start-up of the commands against the imports that nothing can do without, in one run.

Every figure is processor time (user and system) of a whole process, the median over rounds in which
all candidates run in turn. The targets of `check` and `convert` hold for a short log, beside the
imports of NumPy and cantools where asammdf is not installed, whatever extras are here; of `check`
what it takes in a process that has everything imported is taken off. SciPy's optimisers, which its
fit loads, are in that figure; `check --help`, all imports without them, is shown beside it.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from _process_time import MAIN, processor_seconds
from _report import Report
from _rows import positive

from adhesion_can.bus.database import load_database
from adhesion_can.recordings.candump import format_frame
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

SHORT_S = 0.5
"""Length of the log for `check`, s."""
BASE = "import numpy, cantools"
WORK = """
import contextlib, io, resource, sys
from adhesion_can.cli.main import main
def spent():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime
with contextlib.redirect_stdout(io.StringIO()):
    main(["check", sys.argv[1]])
    began = spent()
    for _ in range(5):
        main(["check", sys.argv[1]])
print((spent() - began) / 5)
"""


def work_seconds(log):
    """Processor time of `check` without its imports, s."""
    command = [sys.executable, "-c", WORK, str(log)]
    return float(subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout)


def write_drive(path, duration_s):
    """A drive on a dry surface as candump text."""
    simulation = Simulation(RunSettings(scenario_by_name("dry"), duration_s), load_database())
    lines = [format_frame(frame) for step in simulation.run() for frame in step]
    path.write_text("".join(lines))
    return path


def main():
    parser = argparse.ArgumentParser(prog="tools/bench startup", description=__doc__)
    parser.add_argument("--rounds", type=positive(int), default=9, metavar="N", help="default 9")
    rounds = parser.parse_args().rounds
    report = Report()
    with tempfile.TemporaryDirectory() as folder:
        log = write_drive(Path(folder) / "short.log", SHORT_S)
        candidates = {
            "import numpy": ("import numpy",),
            "import numpy, can, cantools": ("import numpy, can, cantools",),
            BASE: (f"import sys; sys.modules['asammdf'] = None; {BASE}",),
            "import scipy.optimize": ("import scipy.optimize",),
            "import adhesion_can": ("import adhesion_can",),
            "--help": (MAIN, "--help"),
            "--version": (MAIN, "--version"),
            "check --help": (MAIN, "check", "--help"),
            "check of a short log": (MAIN, "check", log),
            "convert of a short log": (MAIN, "convert", log, "--out", Path(folder) / "short.csv"),
        }
        spent = {name: [] for name in candidates}
        for _ in range(rounds):
            for name, words in candidates.items():
                spent[name].append(processor_seconds(sys.executable, "-c", *words))
        seconds = {name: median(values) for name, values in spent.items()}
        for name, value in seconds.items():
            report.write(f"{name}: {value:.3f} s")
        work = median(work_seconds(log) for _ in range(3))
    report.write(f"work of the check: {work:.3f} s")
    light, base = seconds["import numpy"], seconds[BASE]
    for name in ("--help", "--version"):
        report.at_most(f"{name} / import numpy", seconds[name] / light, 2.0, ".2f")
    for name in ("check --help", "import numpy, can, cantools"):
        report.write(f"{name} / {BASE} without asammdf: {seconds[name] / base:.2f}")
    whole = (seconds["check of a short log"] - work) / base
    report.at_most("check of a short log less its work / the same", whole, 1.3, ".2f")
    converted = seconds["convert of a short log"] / base
    report.at_most("convert of a short log / the same", converted, 1.3, ".2f")
    report.summarise()


if __name__ == "__main__":
    main()
