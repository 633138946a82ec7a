"""Recordings at speed: the ladder of ways to read one, our place in it, and what replay takes."""

import subprocess
import sys
import time
from math import isclose
from statistics import median

import _ladder_data as data
from _exchange import exchange
from _reading_speed import Way, climb, run_process, speed, table, times_as_fast
from _reading_ways import BUILD, ladder, ours
from _report import aside
from _rows import positive, row_parser, run_rows
from _trace_ways import trace_ways
from _whole_process import whole_process

FOLDER = BUILD / "bench"
FRAMES = 1_000_000
TARGETS = (
    # (its name, our way, so many times as fast at least, than)
    ("python-can + cantools", "columns", 40.0, "cantools"),
    ("asammdf's extract", "columns", 2.0, "asammdf"),
    ("asammdf's extract from lean MF4", "columns", 2.0, "asammdf-lean"),
    ("C, stretch", "columns", 1 / 2.5, "c"),
)
BLF_LEAST = 3.0  # M frames/s
LENGTHS, SPEED_WITHIN, MEMORY_GROWTH = (100_000, 1_000_000, 10_000_000), 0.2, 1.2
REPLAY, REPLAY_STRETCH, REPLAY_MIB = 30.0, 60.0, 1024.0
SCENARIO = "dry-wet-greasy-dry"


def at_least(report, what, value, least, form):
    report.check(what, format(value, form), f"at least {least:{form}}", met=value >= least)


def ladder_row(report, options):
    """Ways to read one recording, side by side in turn."""
    log = data.recording(FOLDER, FRAMES)
    megabytes = log.stat().st_size / 1e6
    report.write(f"{log.name}: {FRAMES / 1e6:.0f} M frames, {megabytes:.0f} MB:")
    report.write(data.WHAT)
    ways = ladder(report, log, FRAMES)
    by_key = {way.key: way for way in ways}
    figures, failed = climb(ways, options.rounds)
    for key, reason in failed.items():
        report.write(f"{by_key[key].title}: not measured: {reason}")
    measured = [way for way in ways if way.key in figures]
    table(report, figures, measured, by_key["cantools"] if "cantools" in figures else None)
    tell_first(report, figures)
    for than, key, least, other in TARGETS:
        what = f"times as fast as {than}"
        if key in figures and other in figures:
            ratio = times_as_fast(figures, by_key[key], by_key[other])
            at_least(report, what, ratio, least, ".2f")
        else:
            report.check(what, "not measured", f"at least {least:.2f}", met=False)
    same_values(report, figures)


def tell_first(report, figures):
    """What the first pass of a process costs beside the others: short runs pay it."""
    shares = (
        f"{key} {median(a / b for a, b in zip(one.first, one.processor, strict=True)):.2f}"
        for key, one in figures.items()
        if key != "read"
    )
    report.write(f"first pass of a process / its median: {', '.join(shares)}")


def same_values(report, figures):
    """Whether the ways found the same: the sums of all signals, and no fault of the checks."""
    sums = {key: one.answer["sums"] for key, one in figures.items() if "sums" in one.answer}
    first = next(iter(sums.values()), {})
    same = bool(first) and all(
        one.keys() == first.keys()
        and all(isclose(one[name], first[name], rel_tol=1e-9) for name in first)
        for one in sums.values()
    )
    what = f"sums of {len(first)} signals by {', '.join(sums)}"
    report.check(what, "equal" if same else "different", "equal", met=same)
    kinds = ("rejected", "lost", "bad_lines", "bad_checksums", "bad_counters")
    faults = {
        f"{key}: {kind}": one.answer[kind]
        for key, one in figures.items()
        for kind in kinds
        if one.answer.get(kind)
    }
    report.check("faults found", str(faults or "none"), "none", met=not faults)


def traces_row(report, options):
    """The same recording as traces of other tools (.blf, .asc, .trc, .mf4) to frames alone."""
    log = data.recording(FOLDER, FRAMES)
    ways, pairs = trace_ways(report, log, FRAMES)
    by_key = {way.key: way for way in ways}
    figures, failed = climb(ways, options.rounds)
    for key, reason in failed.items():
        report.write(f"{by_key[key].title}: not measured: {reason}")
    measured = [way for way in ways if way.key in figures]
    table(report, figures, measured, by_key.get("python-can-blf"))
    for ours_key, peer in pairs:
        if ours_key in figures and peer in figures:
            ratio = times_as_fast(figures, by_key[ours_key], by_key[peer])
            report.write(f"{by_key[ours_key].title}: {ratio:.1f} times as fast as {peer}")
    million = speed(figures, by_key["ours-blf"]) / 1e6
    at_least(report, "M frames/s of compressed .blf", million, BLF_LEAST, ".2f")


def linear_row(report, options):
    """What a frame costs in recordings of 0.1, 1 and 10 M frames, and the memory, none kept."""
    some, usual, many = (
        Way(f"{frames / 1e6:g} M", "", ours("streamed", data.recording(FOLDER, frames)), frames)
        for frames in LENGTHS
    )
    figures, failed = climb([some, usual, many], options.rounds)
    if failed:
        raise RuntimeError("; ".join(failed.values()))
    for way in (some, usual, many):
        mib = max(figures[way.key].mib)
        report.write(f"{way.key}: {speed(figures, way) / 1e6:.3g} M frames/s, {mib:.0f} MiB")
    for way in (some, many):
        ratio = times_as_fast(figures, way, usual)
        target = f"{1 - SPEED_WITHIN:.1f} to {1 + SPEED_WITHIN:.1f}"
        met = abs(ratio - 1) <= SPEED_WITHIN
        what = f"frames/s of {way.key} to {usual.key}"
        if way is many:
            report.check(what, f"{ratio:.2f}", target, met=met)
        else:
            report.write(f"{what}: {ratio:.2f}")
    ratio = max(figures[many.key].mib) / max(figures[usual.key].mib)
    report.at_most(f"memory of {many.key} to {usual.key}", ratio, MEMORY_GROWTH, ".2f")
    if not options.keep:
        data.recording_path(FOLDER, LENGTHS[-1]).unlink()


def exchange_row(report, options):
    """Two recordings written in every format: nine messages of ours, and 100 of many kinds."""
    exchange(report, FOLDER, FRAMES, options.rounds, same_values)


def process_row(report, options):
    """Whole processes, imports and all: `convert` by message beside python-can + cantools."""
    whole_process(report, FOLDER, FRAMES, options.rounds)


def parts_row(report, _options):
    """Where our chain's time goes on one core."""
    answer = run_process(ours("parts", data.recording(FOLDER, FRAMES)), core=0)
    total = sum(answer["parts"].values())
    for name, seconds in answer["parts"].items():
        report.write(
            f"{1e9 * seconds / FRAMES:6.1f} ns a frame, {100 * seconds / total:3.0f} %: {name}"
        )


def replay_row(report, options):
    """One `adhesion-can replay` of the contract's full input with the tracker, by the clock."""
    seconds = 60 * options.replay_minutes
    log = FOLDER / f"drive-{options.replay_minutes:g}min.log"
    if not log.exists():
        aside(f"simulating {log} (kept; some minutes for an hour)")
        FOLDER.mkdir(parents=True, exist_ok=True)
        words = [sys.executable, "-m", "adhesion_can.cli.main", "simulate", "--scenario", SCENARIO]
        words += ["--duration", str(seconds), "--seed", "1", "--log", str(log)]
        subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    began = time.perf_counter()
    cost = run_process(ours("replay", log))
    clock = time.perf_counter() - began
    answer = cost["answer"]
    drive = answer["to_s"] - answer["from_s"]
    (_, processor) = cost["passes"][0]
    report.write(
        f"{log.name}: {SCENARIO}, {drive:.0f} s, {answer['frames'] / 1e6:.2f} M frames, "
        f"{answer['samples'] / 1e6:.2f} M samples, {answer['frames_sent'] / 1e6:.2f} M "
        f"frames sent; {clock:.1f} s, of the processor {processor:.1f} s without the imports"
    )
    for what, least in (("times real time", REPLAY), ("times real time, stretch", REPLAY_STRETCH)):
        at_least(report, what, drive / clock, least, ".1f")
    report.write(f"by the processor's time without the imports: {drive / processor:.1f}")
    report.at_most("MiB", cost["mib"], REPLAY_MIB, ".0f")


ROWS = {
    "ladder": ladder_row,
    "traces": traces_row,
    "linear": linear_row,
    "exchange": exchange_row,
    "process": process_row,
    "parts": parts_row,
    "replay": replay_row,
}


def parsed():
    more = " Files and the peers' environment are kept under build/."
    parser = row_parser("recordings", ROWS, more)
    count, minutes = positive(int), positive(float)
    add = parser.add_argument
    add("--rounds", type=count, default=5, metavar="N",
        help="of ladder and linear, each way once in each (default 5)")  # fmt: skip
    add("--replay-minutes", type=minutes, default=60.0, metavar="M",
        help="of the drive that is replayed (default 60)")  # fmt: skip
    add("--keep", action="store_true", help="keep the recording of 10 M frames (460 MB), too")
    return parser.parse_args()


def main():
    run_rows(ROWS, parsed())


if __name__ == "__main__":
    main()
