"""Faults hidden in a fleet: three effects, five vehicles with worn wheels, and thirteen missions.

The locomotives are simulated by `tests/worlds`, which shares no code with the effects' definitions;
the missions are those of two trolleybuses. The command itself works on them, with two workers.
"""

import csv
import json
import subprocess
import sys
import time

import numpy as np

from tests.worlds.fleet import HIDDEN, draw_fleet, write_drive
from tools.gallery import bus_rows, columns

DURATION_S = 100.0
"""Duration of a drive, s: with less some have too little coasting for a calibration."""
SHOWN = HIDDEN[:3]
"""Effects that are hidden, each in one vehicle."""
WORN = 5
PROGRESS_S = 15.0
"""Time between two lines on how far the command is, s."""
LEAST_QUIET = 0.95
"""Share of the other vehicles on which nothing may be named."""


def make_locomotives(folder, vehicles, seed):
    """Write the drives; their rows of the manifest, and what is hidden, by vehicle."""
    drives = draw_fleet(seed, vehicles, SHOWN, WORN, drives=1)
    for one in drives:
        write_drive(one, folder / one.name, duration_s=DURATION_S)
    rng = np.random.default_rng([seed, 9])
    rows = []
    for one in drives:
        # Somewhere along its line, for the map: lines leave a city in all directions.
        along, angle = 0.4 * rng.random(), 1.2 * int(one.line.removeprefix("line"))
        place = 47.4 + along * np.sin(angle), 8.5 + 1.5 * along * np.cos(angle)
        rows.append((one.name, one.vehicle, one.line, *place))
    return rows, {one.vehicle: one.effects for one in drives if one.effects}


def make_missions(folder, missions):
    """Write the missions as tables; their rows of the manifest."""
    rows = []
    for path in missions:
        whole = columns(path)
        table = bus_rows(whole)
        table["time_s"] = table["time_s"] + whole["time_unix"][0]
        name = f"{path.name.split('.')[0]}.csv"
        form = ["%.1f" if column == "time_s" else "%.7g" for column in table]
        np.savetxt(
            folder / name,
            np.column_stack(list(table.values())),
            fmt=form,
            delimiter=",",
            header=",".join(table),
            comments="",
        )
        rows.append((name, path.name[:4], "", "", ""))
    return rows


def run_causes(folder, missions=(), vehicles=200, seed=1, workers=2):
    """Run the command on a fleet; what it says, what is hidden, and the seconds it took.

    Args:
        folder: Folder for the recordings and the data set, empty.
        missions: Files of the trolleybus missions.
        vehicles: Number of simulated locomotives.
        seed: Seed of the fleet.
        workers: Number of workers.

    """
    recordings = folder / "recordings"
    recordings.mkdir()
    print(f"  seed {seed}: writing {vehicles} drives of {DURATION_S:g} s", flush=True)
    rows, hidden = make_locomotives(recordings, vehicles, seed)
    rows += make_missions(recordings, missions)
    manifest = recordings / "units.csv"
    with manifest.open("w", newline="") as file:
        out = csv.writer(file)
        out.writerow(("path", "vehicle", "line", "latitude", "longitude"))
        out.writerows(rows)
    began = time.perf_counter()
    words = ["fleet", "--units", manifest, "--out", folder / "out", "--workers", workers]
    process = subprocess.Popen([sys.executable, "-m", "adhesion_can.cli.main", *map(str, words),
                                "--no-progress"], stdout=subprocess.DEVNULL)  # fmt: skip
    watch_units(process, folder / "out" / "units", len(rows), began)
    if process.returncode:
        raise SystemExit("the command failed")
    seconds = time.perf_counter() - began
    return json.loads((folder / "out" / "fleet.json").read_text()), hidden, len(rows), seconds


def watch_units(process, folder, units, began):
    """Print how many units are complete, now and then, until the command ends."""
    while True:
        try:
            process.wait(PROGRESS_S)
        except subprocess.TimeoutExpired:
            done = sum(1 for _ in folder.rglob("*.parquet"))
            spent = time.perf_counter() - began
            left = f", {spent * (units / done - 1):.0f} s left" if done else ""
            print(f"  {done} of {units} units in {spent:.0f} s{left}", flush=True)
        else:
            return


def judge(found, hidden):
    """Figures of a fleet: faulty vehicles on top with all their causes, and others with a name.

    Returns:
        Number of faulty vehicles among the first, number of those with the right cause, vehicles
        that are named without a reason, and the number of vehicles without a fault.

    """
    first = found["vehicles"][: len(hidden)]
    on_top = [one for one in first if one["vehicle"] in hidden]
    right = [one for one in on_top if is_right(one["findings"], hidden[one["vehicle"]])]
    others = [one for one in found["vehicles"] if one["vehicle"] not in hidden]
    wrong = [
        (one["vehicle"], [finding["effect"] for finding in one["findings"]])
        for one in others
        if one["findings"]
    ]
    return len(on_top), len(right), wrong, len(others)


def is_right(findings, effects):
    """Whether the findings of a vehicle are what is hidden in it, worn axles one by one."""
    named = {(one["effect"], one["axle"]) for one in findings}
    return named == {(one.effect, int(one.parameters.get("axle", 0))) for one in effects}


def causes_row(report, folder, missions, vehicles=200, seeds=(1,), workers=2):
    """Faults hidden in 200 simulated locomotives, and thirteen trolleybus missions."""
    count = on_top = right = others = 0
    wrong = []
    for seed in seeds:
        own = folder / f"seed{seed}"
        own.mkdir(parents=True)
        found, hidden, units, seconds = run_causes(own, missions, vehicles, seed, workers)
        report.write(
            f"{units} units of {len(found['vehicles'])} vehicles in {seconds:.0f} s, {workers} "
            f"workers: {workers * seconds / units:.1f} s of a worker each"
        )
        describe(report, found, hidden)
        figures = judge(found, hidden)
        count += len(hidden)
        on_top, right, others = on_top + figures[0], right + figures[1], others + figures[3]
        wrong += [(f"seed {seed}: {vehicle}", names) for vehicle, names in figures[2]]
    for vehicle, names in wrong:
        report.write(f"{vehicle}: named without a reason: {', '.join(names)}")
    report.check("faulty vehicles on top", f"{on_top} of {count}", f"{count}", met=on_top == count)
    report.check(
        "of these with their causes", f"{right} of {count}", f"{count}", met=right == count
    )
    quiet = 1.0 - len(wrong) / max(others, 1)
    report.check(
        "others without a name", f"{100 * quiet:.1f} %", f"{100 * LEAST_QUIET:g} %",
        met=quiet >= LEAST_QUIET,
    )  # fmt: skip


def describe(report, found, hidden):
    """Write who is compared with whom, the first vehicles, and what is shared."""
    for kind in found["kinds"]:
        report.write(
            f"{kind['name'] or 'one kind'}: {kind['vehicles']} vehicles, {kind['units']} units"
            + ("" if kind["compared"] else ", too few to be compared")
        )
    for one in found["vehicles"][: len(hidden)]:
        names = ", ".join(
            f"{f['effect']}{' axle ' + str(f['axle']) if f['axle'] else ''} {f['value']:.3g}"
            for f in one["findings"]
        )
        truth = ", ".join(
            f"{e.effect} {' '.join(f'{v:.3g}' for v in e.parameters.values())}"
            for e in hidden.get(one["vehicle"], ())
        )
        report.write(f"{one['vehicle']}: {names or 'nothing'} (hidden: {truth or 'nothing'})")
    for finding in found["shared"]:
        report.write(f"{finding['scope']} {finding['where']}: {finding['effect']}")
    alone = [one for one in found["vehicles"] if one["causes"] and one["vehicle"] not in hidden]
    report.write(f"others whose own recordings name a cause: {len(alone)}")
