"""Writing at speed: a recording to the files of other tools, beside python-can and cantools."""

import _exchange_data as data
from _reading_speed import Way, climb, speed, times_as_fast
from _reading_ways import CANTOOLS, DBC, EXTRACT, bus_logging, ours, peers

TIMES = 20.0
"""Target: so many times as fast as python-can + cantools, to the whole folder written."""

OUTPUTS = {
    "parquet/": "a folder, Parquet",
    "arrow/": "a folder, Arrow",
    "csv/": "a folder, CSV",
    "a.parquet": "one Parquet, one row per frame",
    "a.arrow": "one Arrow, one row per value",
    "a.mf4": "MF4",
    "a.csv": "CSV",
    "a.mcap": "MCAP, signals and frames",
}


def exchange(report, folder, frames, rounds, same_values):
    """Each database's recording written in every format, and decoded by others, in one run."""
    words = peers(report)
    for database in (DBC, data.hundred_messages(folder)):
        log = data.recording(folder, database, frames)
        report.write(f"{log.name}: {frames / 1e6:g} M frames, {log.stat().st_size / 1e6:.0f} MB")
        ways = [*_peer_ways(words, log, database), *_own_ways(log, database)]
        ways = [Way(key, title, process, frames) for key, title, process in ways]
        figures, failed = climb(ways, rounds)
        by_key = {way.key: way for way in ways}
        for key, reason in failed.items():
            report.write(f"{by_key[key].title}: not measured: {reason}")
        base = by_key.get("cantools")
        _table(figures, [way for way in ways if way.key in figures], base)
        what = f"{database.stem}: a folder of Parquet, times {CANTOOLS}"
        if base and {"cantools", "parquet/"} <= figures.keys():
            ratio = times_as_fast(figures, by_key["parquet/"], base)
            report.check(what, f"{ratio:.1f}", f"at least {TIMES:.0f}", met=ratio >= TIMES)
        else:
            report.check(what, "not measured", f"at least {TIMES:.0f}", met=False)
        same_values(report, figures)


def _peer_ways(words, log, database):
    if not words:
        return
    text, dbc = str(log), str(database)
    yield "cantools", CANTOOLS, (*words, "cantools", text, dbc)
    yield "lists", f"{CANTOOLS}, into a list a signal", (*words, "cantools-columns", text, dbc)
    lean = bus_logging(words, log, f"{log.stem}-lean.mf4", 8, 0)
    title = f"{EXTRACT} from lean MF4, nothing written"
    yield "asammdf", title, (*words, "asammdf", str(lean), dbc)


def _own_ways(log, database):
    for out, title in OUTPUTS.items():
        yield out, f"ours: text to {title}", ours("write", log, str(database), out)
    title = "`adhesion-can convert` to a folder, the whole command"
    yield "command", title, ours("command", log, str(database))


def _table(figures, ways, base):
    print("\n| way | frames/s | times python-can + cantools | MB | MiB of memory |")
    print("|---|---|---|---|---|")
    for way in ways:
        ratio = f"{times_as_fast(figures, way, base):.1f}" if base and base.key in figures else "?"
        size = figures[way.key].answer.get("bytes")
        megabytes = "" if size is None else f"{size / 1e6:.1f}"
        fast, mib = speed(figures, way) / 1e6, max(figures[way.key].mib)
        print(f"| {way.title} | {fast:.3g} M | {ratio} | {megabytes} | {mib:.0f} |")
    print(flush=True)
