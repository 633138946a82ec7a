"""Trolleybuses in service: what one bus shows beside what another has, and nothing where none is.

Missions of two buses, a row a second, that are not part of the project: `ztbus` in
`$ADHESION_CAN_REALDATA`. The rows are those of the gallery.
"""

import io
import json
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from _real_data import real_data
from _report import over_cores
from _rows import add_seed_and_jobs, positive, row_parser, run_rows

from tools.gallery import bus_rows, columns, write

BUSES = ("B183", "B208")
BLOCK_S = 60.0
"""Length of the blocks in which signs are flipped, s."""


def missions():
    """Files of all missions, by bus."""
    paths = real_data("ztbus/*.csv.gz")
    return {bus: [path for path in paths if path.name.startswith(bus)] for bus in BUSES}


def diagnose(folder, tables, held=()):
    """Answer of `diagnose` on tables of columns; None where it ended with an error."""
    from adhesion_can.cli.main import main

    paths = []
    for number, table in enumerate((*tables, *held)):
        paths.append(str(Path(folder) / f"t{number}.csv"))
        write(Path(paths[-1]), table)
    words = ["diagnose", *paths[: len(tables)]]
    words += ["--holdout", *paths[len(tables) :]] if held else []
    out = Path(folder) / "d.json"
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        status = main([*words, "--json", str(out)])
    return json.loads(out.read_text()) if status == 0 else None


def crossed(task):
    """What is named on missions of one bus, and its gain on all of the other."""
    paths, held = task
    with TemporaryDirectory() as folder:
        tables, other = ([bus_rows(columns(p)) for p in some] for some in (paths, held))
        answer = diagnose(folder, tables, other)
    names = [cause["effect"] for cause in answer["causes"]] if answer else []
    gain = answer["gain"] if answer else None
    return names, gain and gain["percent"], gain and gain["interval"]


def flipped(task):
    """What is named on a mission whose signs of slip and force are flipped at random in blocks."""
    path, seed, together = task
    table = bus_rows(columns(path))
    rng = np.random.default_rng(seed)
    block = (table["time_s"] // BLOCK_S).astype(int)
    signs = rng.choice([-1.0, 1.0], size=(2, block.max() + 1))
    slip, force = signs[0][block], signs[0 if together else 1][block]
    table["slip"] = table["slip"] * slip
    table["longitudinal_force_N"] = table["longitudinal_force_N"] * force
    with TemporaryDirectory() as folder:
        answer = diagnose(folder, [table])
    return [cause["effect"] for cause in answer["causes"]] if answer else []


def crossed_row(report, options):
    """What is named on missions of one bus, each alone and all together, on the other's."""
    files = missions()
    tasks = []
    for one, other in (BUSES, BUSES[::-1]):
        tasks += [([path], files[other]) for path in files[one]] + [(files[one], files[other])]
    found = over_cores(crossed, tasks, options.jobs, "crossed")
    bad = 0
    for (paths, _), (names, percent, interval) in zip(tasks, found, strict=True):
        what = paths[0].name[:15] if len(paths) == 1 else f"all of {paths[0].name[:4]}"
        if not names:
            report.write(f"{what}: nothing named")
            continue
        low, high = (np.nan if end is None else end for end in interval)
        told = f"{' + '.join(names)}, gain {percent:.1f} % ({low:.1f} to {high:.1f})"
        report.write(f"{what}: {told}")
        bad += not low > 0.0
    named = sum(bool(names) for names, _, _ in found)
    report.check(
        f"named without a gain on the other bus, of {named} named", f"{bad}", "0", met=bad == 0
    )


def _flips(report, options, together):
    files = [path for paths in missions().values() for path in paths]
    tasks = [
        (path, [options.seed, number, run], together)
        for number, path in enumerate(files)
        for run in range(options.runs)
    ]
    found = over_cores(flipped, tasks, options.jobs, "flips")
    named = [names for names in found if names]
    told = sorted({name for names in named for name in names})
    report.write(f"named: {', '.join(told) or 'nothing'}")
    return len(named), len(found)


def apart_row(report, options):
    """Signs of slip and force flipped in blocks, each by itself: no curve is left."""
    named, count = _flips(report, options, together=False)
    share = 100.0 * named / count
    report.check(f"a name in {named} of {count}", f"{share:.1f} %", "at most 5 %", met=share <= 5.0)


def together_row(report, options):
    """Signs of slip and force flipped in blocks, both at once: the curve stays."""
    named, count = _flips(report, options, together=True)
    report.write(f"a name in {named} of {count}: what does not depend on the sign stays")


ROWS = {"crossed": crossed_row, "apart": apart_row, "together": together_row}


def main():
    parser = row_parser("buses", ROWS)
    add = parser.add_argument
    add("--runs", type=positive(int), default=4, metavar="N", help="flips of each mission")
    add_seed_and_jobs(parser)
    run_rows(ROWS, parser.parse_args())


if __name__ == "__main__":
    main()
