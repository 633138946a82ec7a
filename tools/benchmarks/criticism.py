"""`diagnose` on drives that hide an effect: seconds, memory, and what a longer drive costs."""

import json
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from _report import aside
from _rows import positive, row_parser, run_rows

ROOT = Path(__file__).resolve().parents[2]
# The folder of this file is on the path; the worlds need the project's.
sys.path.insert(1, str(ROOT))

from tests.worlds import make_world  # noqa: E402  after the path

DRIVE_S = 240.0
TARGET_S, TARGET_MIB, TARGET_RATIO = 10.0, 2048.0, 1.25
KINDS = (
    "null:0",
    "null:surfaces",
    "load_dependence",
    "creep_relaxation",
    "pair:load_dependence+speed_delay",
)
"""Nothing, a rail that changes, two single effects of which one has a memory, two at once."""
DRIVES = (1, 2, 4)
LONGER = ("null:0", "load_dependence")
"""Whose longer drives are made. The several recordings are null drives of several worlds: what
they cost is measured, not their answer."""


@dataclass(frozen=True)
class Cost:
    """Cost of one diagnosis.

    Attributes:
        seconds: Wall-clock time of the whole process, s.
        start: Processor time of the imports, s; the same however long the drive is.
        work: Processor time of the rest, s; other load of the machine hardly changes it.
        mib: Peak memory, MiB.
        answer: Named effects, or the verdict.

    """

    seconds: float
    start: float
    work: float
    mib: float
    answer: str


def measure_diagnosis(paths):
    """Cost of `adhesion-can diagnose` on recordings, as a user calls it, without the page."""
    answer = paths[0].with_suffix(".json")
    words = [sys.executable, str(Path(__file__).with_name("_diagnosis.py"))]
    words += [*map(str, paths), "--json", str(answer)]
    began = time.perf_counter()
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - began
    if done.returncode:
        raise RuntimeError(f"diagnose {' '.join(map(str, paths))} failed:\n{done.stderr}")
    cost = json.loads(done.stdout.splitlines()[-1])
    found = json.loads(answer.read_text())
    answer = " + ".join(cause["effect"] for cause in found["causes"]) or found["verdict"]
    return Cost(seconds, **cost, answer=answer)


def drive(folder, kind, seed, count=1):
    """A drive of `count` times the usual length."""
    name = f"{kind}-{seed}-{count}".replace(":", "_").replace("+", "-")
    path = folder / f"{name}.log"
    if not path.exists():
        make_world(kind, seed, path, duration_s=count * DRIVE_S)
    return path


def time_row(report, options, folder):
    """Seconds and peak memory of a drive, in a process of its own, the imports in it."""
    report.write(
        f"drives of {DRIVE_S:.0f} s, six axles at 100 Hz; {options.repeats} of each kind, medians"
    )
    for kind in KINDS:
        runs = [
            measure_diagnosis([drive(folder, kind, options.seed + k)])
            for k in range(options.repeats)
        ]
        answers = ", ".join(dict.fromkeys(run.answer for run in runs))
        report.write(
            f"{kind}: {min(run.seconds for run in runs):.1f} to "
            f"{max(run.seconds for run in runs):.1f} s; of the processor "
            f"{median(run.start for run in runs):.1f} s to start and "
            f"{median(run.work for run in runs):.1f} to work; found: {answers}"
        )
        report.at_most(f"{kind}: s", median(run.seconds for run in runs), TARGET_S, ".1f")
        report.at_most(f"{kind}: MiB", max(run.mib for run in runs), TARGET_MIB, ".0f")


def compare_durations(report, options, what, inputs):
    """1, 2 and 4 drives side by side; the ratio is of the work a drive to that of one drive."""
    rounds = []
    for number in range(options.repeats):
        rounds.append([measure_diagnosis(paths) for paths in inputs])
        aside(f"{what}: {number + 1} of {options.repeats} rounds")
    for place, count in enumerate(DRIVES):
        runs = [one[place] for one in rounds]
        work = median(run.work for run in runs)
        report.write(
            f"{what}, {count}: processor {work:.1f} s without the start, {work / count:.1f} a "
            f"drive; clock {median(run.seconds for run in runs):.1f} s; "
            f"{max(run.mib for run in runs):.0f} MiB; found: {runs[0].answer}"
        )
    for place, count in enumerate(DRIVES[1:], start=1):
        ratio = median(one[place].work / count / one[0].work for one in rounds)
        report.at_most(f"{what}: work a drive, {count} to 1", ratio, TARGET_RATIO, ".2f")
    most = max(one[-1].mib for one in rounds)
    report.at_most(f"{what}: MiB of {DRIVES[-1]}", most, TARGET_MIB, ".0f")


def length_row(report, options, folder):
    """One recording of 1, 2 and 4 drives' length: what a drive's length of it costs."""
    for kind in LONGER:
        inputs = [[drive(folder, kind, options.seed, count)] for count in DRIVES]
        compare_durations(report, options, f"{kind}, drives in one recording", inputs)


def recordings_row(report, options, folder):
    """1, 2 and 4 recordings together: what one of them costs."""
    paths = [drive(folder, "null:0", options.seed + k) for k in range(DRIVES[-1])]
    inputs = [paths[:count] for count in DRIVES]
    compare_durations(report, options, "null:0, recordings", inputs)


ROWS = {"time": time_row, "length": length_row, "recordings": recordings_row}


def parse_options():
    parser = row_parser("criticism", ROWS)
    add = parser.add_argument
    add(
        "--repeats",
        type=positive(int),
        default=3,
        metavar="N",
        help="drives of each kind, and rounds of each comparison (default 3)",
    )
    add("--seed", type=positive(int), default=1, metavar="N", help="of the drives (default 1)")
    return parser.parse_args()


def main():
    options = parse_options()
    with TemporaryDirectory(prefix="bench-") as folder:
        run_rows(ROWS, options, Path(folder))


if __name__ == "__main__":
    main()
