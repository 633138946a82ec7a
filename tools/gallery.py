"""The gallery: measured data of others, what was asked, what came out, beside a fit by hand."""

import csv
import gzip
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import curve_fit

from adhesion_can.physics.curves import FAMILIES, Conditions

ROOT = Path(__file__).resolve().parents[1]
PAGE, PICTURES = ROOT / "docs" / "gallery.md", ROOT / "docs" / "gallery"
BLUE, ORANGE, GREEN, GREY = "#1f5fa8", "#d9731a", "#3a7d44", "#8a8a8a"
HEAD = """# Gallery

Data that others measured: what was asked of them, what came out, and what a fit by hand gives.
`tools/gallery` runs the commands and writes this page; the times are those of one run on two cores.
Where a case needs data that are not part of the repository, it names their source.
"""


@dataclass
class Case:
    """A case of the page in the making.

    Attributes:
        folder: Folder in which the commands run.
        text: Markdown so far.

    """

    folder: Path
    text: str = ""

    def say(self, text: str) -> None:
        """Add a paragraph."""
        self.text += text.strip() + "\n\n"

    def run(self, words: str, keep: str) -> str:
        """Run a command, and show it, the lines that match and the time; its whole output."""
        begin = time.perf_counter()
        done = subprocess.run(
            ["adhesion-can", *words.split()],
            cwd=self.folder, capture_output=True, text=True, check=False,
            env={**os.environ, "COLUMNS": "110"},
        )  # fmt: skip
        took = time.perf_counter() - begin
        lines = (done.stdout + done.stderr).splitlines()
        shown = [line.rstrip() for line in lines if re.search(keep, line)]
        block = "\n".join([f"$ adhesion-can {words}", *shown])
        status = "" if done.returncode == 0 else f", exit status {done.returncode}"
        self.say(f"```\n{block}\n```\n\n{took:.1f} s{status}.")
        return done.stdout

    def picture(self, name: str, draw: Callable[[plt.Axes], None], caption: str) -> None:
        """Draw a picture and show it."""
        figure, axes = plt.subplots(figsize=(7.5, 3.6), dpi=110, layout="constrained")
        draw(axes)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        axes.grid(alpha=0.25)
        axes.legend(frameon=False, fontsize=8)
        PICTURES.mkdir(exist_ok=True)
        figure.savefig(PICTURES / f"{name}.png", metadata={"Software": None})
        plt.close(figure)
        self.say(f"![{caption}](gallery/{name}.png)")


def burckhardt(slip, c1, c2, c3):
    """Signed adhesion of Burckhardt's curve."""
    size = np.abs(slip)
    return np.sign(slip) * (-c1 * np.expm1(-c2 * size) - c3 * size)


def by_hand(curve, slip, adhesion, start):
    """Parameters and RMSE of least squares, as one would do it in a notebook."""
    found, _ = curve_fit(curve, slip, adhesion, start, maxfev=20_000)
    return found, float(np.sqrt(np.mean((adhesion - curve(slip, *found)) ** 2)))


def columns(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV file, gzip or not."""
    content = path.read_bytes()
    text = (gzip.decompress(content) if path.suffix == ".gz" else content).decode()
    rows = list(csv.DictReader(text.splitlines()))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def write(path: Path, table: Mapping[str, np.ndarray]) -> None:
    """Write columns as CSV."""
    values = np.column_stack(list(table.values()))
    np.savetxt(path, values, fmt="%.7g", delimiter=",", header=",".join(table), comments="")


# --- the cases -----------------------------------------------------------------------------------


def eurosprinter(case: Case, _data: Path) -> None:
    """140 points that were measured on a locomotive."""
    points = PICTURES / "eurosprinter_points.csv"
    (case.folder / points.name).write_bytes(points.read_bytes())
    case.say("""
**Asked**: where does the adhesion of a Siemens Eurosprinter 127 001 peak, and what is its
contact like? 140 points at 36 km/h, read off a plot
([gallery/eurosprinter_points.csv](gallery/eurosprinter_points.csv); Engel, Beck, Alders,
Elektrische Bahnen 96 (1998) 201-209, as plotted in the documentation of eve70a/CONTACT,
Apache-2.0).
""")
    case.run(
        f"identify {points.name} --curve all --json fit.json",
        r"^ (curve|polach|free|burckhardt|magic|pooled|of the surface)"
        r"|cannot distinguish|In Polach|form",
    )
    curves = json.loads((case.folder / "fit.json").read_text())["curves"]
    case.run(f"diagnose {points.name}", r"^(Named|Nothing|Undecided|Unexplained|Gain|The peak|- )")
    table = columns(points)
    slip, adhesion = table["slip"], table["adhesion"]
    hand, rmse = by_hand(burckhardt, slip, adhesion, (0.3, 200.0, 0.5))
    place = float(np.log(hand[0] * hand[1] / hand[2]) / hand[1])
    case.say(
        f"**By hand**: `scipy.optimize.curve_fit` of Burckhardt's curve leaves an RMSE of "
        f"{rmse:.4f}, with its peak of {burckhardt(place, *hand):.3f} at a slip of {place:.4f}."
    )

    def draw(axes):
        axes.plot(slip, adhesion, ".", color=GREY, ms=4, label="measured")
        grid = np.geomspace(5e-4, 0.3, 300)
        axes.plot(grid, burckhardt(grid, *hand), color=ORANGE, label="Burckhardt by hand")
        computed = ROOT / "tests" / "worlds" / "data" / "contact_curves.csv"
        with computed.open() as file:
            rows = [r for r in csv.DictReader(file) if r["model"] == "contact_extended"]
        axes.plot(
            [float(r["slip"]) for r in rows], [float(r["adhesion"]) for r in rows],
            color=GREEN, ls="--", label="computed by CONTACT",
        )  # fmt: skip
        best = curves["families"][0]
        values = np.array([p["value"] for p in best["parameters"].values()])
        family = FAMILIES[best["curve"]]
        height = family.adhesion(grid, values, Conditions(10.0, 213_400.0))
        axes.plot(grid, height, color=BLUE, label=f"best family, {best['curve']}")
        place = curves["pooled"]["lambda_m"]
        ends = (place["value"] - 1.96 * place["std"], place["value"] + 1.96 * place["std"])
        axes.axvspan(*ends, color=BLUE, alpha=0.12, lw=0)
        axes.plot([], [], color=BLUE, alpha=0.3, lw=6, label="λ_m, 95 %")
        axes.set(xscale="log", xlabel="slip ratio", ylabel="adhesion", xlim=(5e-4, 0.3))

    case.picture("eurosprinter", draw, "Points, a fit by hand and a computed curve")
    case.say("""
**No help**: the points scatter by 8 % about any curve, and at small slip their error is as
large as the slip. No fit of them gives the peak's place to better than a quarter.
""")


def tyre_rig(case: Case, data: Path) -> None:
    """A tyre on a flat belt."""
    table = columns(data / "tyre_rig_83kPa.csv.gz")
    straight = (np.abs(table["slip_angle_deg"]) < 0.5) & (np.abs(table["inclination_deg"]) < 0.5)
    names = ("time_s", "slip", "longitudinal_force_N", "normal_load_N", "speed_mps")
    rows = {name: table[name][straight] for name in names}
    write(case.folder / "straight.csv", rows)
    case.say(f"""
**Asked**: what does Burckhardt's curve get wrong of a racing tyre that runs straight?
{int(straight.sum())} rows of slip sweeps at four loads, 83 kPa (FSAE TTC, published with
permission, via teasit/magic-formula-tyre-library; not part of the repository).
""")
    case.run(
        "diagnose straight.csv --extended model.toml",
        r"^(Named|Nothing|Undecided|Unexplained|Gain|The residual depends|- )",
    )
    case.run("evaluate straight.csv --model model.toml", r"^ data |straight|all|model|curve")
    slip, load = rows["slip"], rows["normal_load_N"]
    adhesion = rows["longitudinal_force_N"] / load
    plain, rmse = by_hand(burckhardt, slip, adhesion, (1.5, 20.0, 1.0))

    def with_load(x, c1, c2, c3, exponent):
        return burckhardt(x[0], c1, c2, c3) * (x[1] / load.mean()) ** -exponent

    found, _ = curve_fit(with_load, (slip, load), adhesion, (1.5, 20.0, 1.0, 0.2), maxfev=20_000)
    left = float(np.sqrt(np.mean((adhesion - with_load((slip, load), *found)) ** 2)))
    case.say(
        f"**By hand**: least squares of the plain curve leave {rmse:.3f}, with a power of the load "
        f"{left:.3f} at an exponent of {found[3]:.3f}, both on the data that were fitted. That the "
        "load is the cause one has to know before."
    )

    def draw(axes):
        edges = np.quantile(load, [0, 0.25, 0.5, 0.75, 1])
        for low, high, color in zip(edges, edges[1:], (BLUE, GREEN, ORANGE, GREY), strict=False):
            some = np.flatnonzero((load >= low) & (load <= high))[::4]
            axes.plot(slip[some], adhesion[some], ".", ms=1.5, color=color,
                      label=f"{low:.0f} to {high:.0f} N")  # fmt: skip
        grid = np.linspace(-0.2, 0.16, 200)
        axes.plot(grid, burckhardt(grid, *plain), color="black", lw=1, label="one curve by hand")
        axes.set(xlabel="slip ratio", ylabel="adhesion", ylim=(-3, 3))

    case.picture("tyre_rig", draw, "Adhesion by slip, coloured by the load")
    case.say("""
**No help**: at small loads the load's own error makes most of what is left. The second cause is
small: as the report says, a bias or a drift explains as much.
""")


def trolleybuses(case: Case, data: Path) -> None:
    """Two trolleybuses in service, one reading a second."""
    mission = {"named": "B183_2021-06-10", "held": "B208_2021-08-02"}
    tables = {}
    for key, name in mission.items():
        (path,) = (data / "ztbus").glob(f"{name}*.csv.gz")
        tables[key] = bus_rows(columns(path))
        write(case.folder / f"{name[:4]}.csv", tables[key])
    case.say("""
**Asked**: does the driven middle axle of a trolleybus show anything beside its slip stiffness?
Slip against the undriven front axle, half of the traction force, a load from 24.7 t and 70 kg a
passenger, rows above 3 m/s without brake pressure and steering (ZTBus, Widmer, Ritter, Onder
2023, CC-BY-4.0; not part of the repository). Named on one bus, tried on the other.
""")
    case.run("check B183.csv", r"^(NOT|FOUND|verdict)")
    case.run(
        "diagnose B183.csv --holdout B208.csv",
        r"^(Named|Nothing|Undecided|Unexplained|Gain|Not tested: (speed_delay|creep))",
    )
    table = tables["named"]
    adhesion = table["longitudinal_force_N"] / table["normal_load_N"]
    slope = float(table["slip"] @ adhesion / (table["slip"] @ table["slip"]))
    case.say(f"**By hand**: the slope of adhesion by slip through the origin is {slope:.1f}.")

    def draw(axes):
        axes.plot(table["slip"], adhesion, ".", ms=2, color=BLUE, label="bus 183")
        ends = np.array([-0.012, 0.015])
        axes.plot(ends, slope * ends, color=ORANGE, label="slope by hand")
        axes.set(xlabel="slip ratio", ylabel="adhesion", xlim=(-0.02, 0.025))

    case.picture("trolleybus", draw, "Adhesion by slip of a trolleybus in service")
    case.say("""
**No help**: the wheels use 1.5 % of slip at most, so the peak is not in the data; with a row a
second neither delays nor relaxation can be found, and how the force divides between the axles in
traction and in braking is not known: the asymmetry that is named may be that.
""")


def bus_rows(table: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Rows of a mission from which a slip and an adhesion can be formed."""

    def wheel(axle):
        sides = (table[f"odometry_wheelSpeed_{axle}{side}"] for side in "lr")
        return sum(sides) / 2

    people = table["itcs_numberOfPassengers"]
    last = np.maximum.accumulate(np.where(np.isfinite(people), np.arange(len(people)), 0))
    front, middle = wheel("f"), wheel("m")
    with np.errstate(invalid="ignore", divide="ignore"):
        slip = middle / front - 1
    load = (24_700 + 70 * people[last]) * 9.81 / 4
    use = (front > 3) & (table["traction_brakePressure"] < 5e4)
    use &= np.abs(table["odometry_steeringAngle"]) < 0.1
    found = {
        "time_s": table["time_unix"] - table["time_unix"][0],
        "slip": slip,
        "longitudinal_force_N": table["traction_tractionForce"] / 2,
        "normal_load_N": load,
        "speed_mps": front,
        "passengers": people[last],
        "ambient_degC": table["temperature_ambient"] - 273.15,
    }
    use &= np.all([np.isfinite(column) for column in found.values()], axis=0)
    return {name: column[use] for name, column in found.items()}


CAR_DBC = """VERSION ""
BO_ 170 WHEEL_SPEEDS: 8 X
 SG_ FrontLeft : 7|16@0+ (0.01,-67.67) [0|250] "km/h" X
 SG_ FrontRight : 23|16@0+ (0.01,-67.67) [0|250] "km/h" X
 SG_ RearLeft : 39|16@0+ (0.01,-67.67) [0|250] "km/h" X
 SG_ RearRight : 55|16@0+ (0.01,-67.67) [0|250] "km/h" X
"""


def car(case: Case, data: Path) -> None:
    """A minute on the bus of a car."""
    log = data / "rav4_drive.log.gz"
    (case.folder / "car.log").write_bytes(gzip.decompress(log.read_bytes()))
    (case.folder / "car.dbc").write_text(CAR_DBC)
    case.say("""
**Asked**: what do the wheels of a car say against its GNSS? 135 468 raw frames of four buses, a
DBC of six lines (comma2k19, MIT; not part of the repository).
""")
    case.run(
        "convert car.log --dbc car.dbc --channel can0 --raster 100ms --out wheels.csv",
        r"frames|WHEEL|wheels.csv",
    )
    with (case.folder / "wheels.csv").open() as file:
        rows = list(csv.DictReader(file))
    names = [name for name in rows[0] if name != "time_s"]
    t = np.array([float(row["time_s"]) for row in rows])
    speeds = np.array([[float(row[name] or "nan") / 3.6 for name in names] for row in rows])
    gnss = columns(data / "rav4_gnss_speed.csv")
    v = np.interp(t, gnss["time_s"], gnss["gnss_speed_mps"], left=np.nan, right=np.nan)
    use = (v > 3) & np.isfinite(speeds).all(axis=1)
    ratio = [float((s[use] @ v[use]) / (v[use] @ v[use])) for s in speeds.T]
    front, rear = 100 * (1 - np.mean(ratio[:2])), 100 * (1 - np.mean(ratio[2:]))
    case.say(
        f"**By hand**, from the table: by least squares over {int(use.sum())} rows the front "
        f"wheels read {front:.2f} % low, the rear ones {rear:.2f} %."
    )

    def draw(axes):
        axes.plot(t - t[0], v, color="black", lw=1.5, label="GNSS")
        axes.plot(t - t[0], speeds[:, 0], color=BLUE, lw=0.8, label="front left")
        axes.plot(t - t[0], speeds[:, 2], color=ORANGE, lw=0.8, label="rear left")
        axes.set(xlabel="time, s", ylabel="speed, m/s")

    case.picture("car", draw, "Wheel speeds beside the GNSS speed")
    case.say("""
**No help**: no signal gives a torque, so there is no adhesion, and nothing to identify.
`convert` is all that the tool does here.
""")


CASES: Mapping[str, tuple[str, Callable[[Case, Path], None], str]] = {
    "eurosprinter": ("A locomotive's measured points", eurosprinter, ""),
    "tyre-rig": ("A tyre rig", tyre_rig, "tyre_rig_83kPa.csv.gz"),
    "trolleybuses": ("Trolleybuses in service", trolleybuses, "ztbus"),
    "car": ("A drive on the bus of a car", car, "rav4_drive.log.gz"),
}
"""Title, function and data of each case, by its name."""


def section(page: str, title: str) -> str:
    """Section of a page by its title; '' where it has none."""
    found = re.search(rf"^## {re.escape(title)}\n.*?(?=^## |\Z)", page, re.DOTALL | re.MULTILINE)
    return found[0] if found else ""


def main(names: list[str]) -> int:
    """Build the cases that are named, or all; 0: all were built."""
    data = Path(os.environ.get("ADHESION_CAN_REALDATA", ROOT.parent / "shared" / "realdata"))
    before = PAGE.read_text() if PAGE.exists() else ""
    parts, absent = [HEAD], 0
    for name, (title, build, needed) in CASES.items():
        kept = section(before, title)
        if names and name not in names:
            parts.append(kept)
        elif needed and not (data / needed).exists():
            print(f"{name}: not built, {needed} is not in {data} (set ADHESION_CAN_REALDATA)")
            parts.append(kept)
            absent += 1
        else:
            print(f"{name} ..", flush=True)
            with TemporaryDirectory(prefix="gallery-") as folder:
                case = Case(Path(folder), f"## {title}\n\n")
                build(case, data)
            parts.append(case.text)
    PAGE.write_text("\n".join(part.strip() + "\n" for part in parts if part.strip()))
    print(f"written: {PAGE.relative_to(ROOT)}")
    return 1 if absent else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
