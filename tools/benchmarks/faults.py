"""Signs, units and delays that are wrong, put into measured and simulated data: found and named?

The tyre rig and the trolleybuses are not part of the project: `tyre_rig_83kPa.csv.gz` and `ztbus`
in `$ADHESION_CAN_REALDATA`. The drives are those of the tests.
"""

import io
import json
import re
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from _real_data import real_data
from _report import over_cores
from _rows import add_seed_and_jobs, positive, row_parser, run_rows

from tests.diagnosis.bad_logs import CYCLE_S, readings, write
from tools.gallery import bus_rows, columns
from tools.gallery import write as write_table

STRAIGHT_DEG = 0.5
LATE_SHARE = 0.2
"""A delay is right within this share of it and half a row."""
OTHERS = {"effort_delay", "wheel_speed_delay"}
"""On a rig of constant speed a late force is an early wheel: only the difference is in the data."""
CYCLES_S = {"rig": 0.01, "bus": 1.0, "drive": 0.01}


@dataclass(frozen=True)
class Fault:
    """A fault and the answer that it must get.

    Attributes:
        source: Data in which it is put: 'rig', 'bus' or 'drive'.
        spoil: From columns or readings and random numbers to the spoilt ones and the delay, s.
        says: Pattern of the sentence that names it; '' where a delay is to be named.
        effect: Effect that names a delay.
        config: From random numbers to a configuration that is wrong; None: the default one.

    """

    source: str
    spoil: Callable
    says: str = ""
    effect: str = ""
    config: Callable | None = None


# --- faults in tables ----------------------------------------------------------------------------


def times(name, factor):
    """A column in another unit or with the other sign."""
    return lambda given, _rng: ({**given, name: factor * given[name]}, 0.0)


def late_column(name, low_s, high_s):
    """A column later or earlier by a whole number of rows; 'wheel' is that of the slip."""

    def spoil(given, rng):
        step = float(np.median(np.diff(given["time_s"])))
        by = round(rng.uniform(low_s, high_s) / step) * int(rng.choice([-1, 1]))
        found = dict(given)
        source = (1.0 + given["slip"]) * given["speed_mps"] if name == "wheel" else given[name]
        moved = np.empty_like(source)
        cuts = np.flatnonzero(np.diff(given["time_s"]) > 1.5 * step) + 1
        for rows in np.split(np.arange(len(source)), cuts):
            place = np.clip(np.arange(len(rows)) - by, 0, len(rows) - 1)
            moved[rows] = source[rows[place]]
        if name == "wheel":
            found["slip"] = moved / given["speed_mps"] - 1.0
        else:
            found[name] = moved
        return found, by * step

    return spoil


def late_signal(name, low_s, high_s):
    """A signal later or earlier by a whole number of cycles."""

    def spoil(given, rng):
        values, step = getattr(given, name), CYCLE_S[name]
        by = round(rng.uniform(low_s, high_s) / step) * int(rng.choice([-1, 1]))
        place = np.clip(np.arange(len(values)) - by, 0, len(values) - 1)
        return replace(given, **{name: values[place]}), by * step

    return spoil


def as_given(given, _rng):
    """No fault in the data: it is in the configuration."""
    return given, 0.0


def _role(name, axle, key):
    signal = {
        "wheel_speed": f"WheelSpeeds{1 + (axle > 3)}.WheelSpeed_Ax{axle}",
        "tractive_effort": f"TractiveEffort{1 + (axle > 3)}.TractiveEffort_Ax{axle}",
        "axle_load": f"AxleLoads{1 + (axle > 3)}.AxleLoad_Ax{axle}",
        "vehicle_speed": "VehicleSpeed.VehicleSpeed",
    }[name]
    number = "" if name == "vehicle_speed" else f".{axle}"
    more = f", {key}" if key else ""
    return f'"{name}{number}" = {{ signal = "{signal}"{more} }}\n'


def _roles(wrong, key, axles):
    """All roles of a drive's signals, some of them with a key that is wrong."""
    text = "[roles]\n" + _role("vehicle_speed", 0, key if wrong == "vehicle_speed" else "")
    for name in ("wheel_speed", "tractive_effort", "axle_load"):
        for axle in range(1, 7):
            text += _role(name, axle, key if name == wrong and axle in axles else "")
    return text


def roles(wrong, key):
    """Configuration in which a quantity is read with a key that is wrong."""
    return lambda _rng: _roles(wrong, key, range(1, 7))


def a_role(wrong, key):
    """Configuration in which a signal of one axle is read with a key that is wrong."""
    return lambda rng: _roles(wrong, key, (int(rng.integers(1, 7)),))


def misread(says, config):
    """A drive without a fault that is read by a configuration that has one."""
    return Fault("drive", as_given, says, config=config)


KN = 'unit = "kN"'
OPPOSITE = r"slip and force have opposite signs"
REVERSED = r"rim runs at -1 times .*change sign of wheel_speed"
PERCENT = r"--column slip=slip,unit=percent"
LOAD = "normal_load_N"
FORCE = "longitudinal_force_N"
FAULTS = {
    "rig: slip reversed": Fault("rig", times("slip", -1.0), OPPOSITE),
    "rig: force reversed": Fault("rig", times(FORCE, -1.0), OPPOSITE),
    "rig: load below 0": Fault("rig", times(LOAD, -1.0), rf"{LOAD}.*sign=-1"),
    "rig: slip in percent": Fault("rig", times("slip", 100.0), PERCENT),
    "rig: load in kN": Fault("rig", times(LOAD, 1e-3), rf"{LOAD}={LOAD},unit=kN"),
    "rig: load in kg": Fault("rig", times(LOAD, 1 / 9.80665), rf"{LOAD}={LOAD},unit=kg"),
    "rig: force in kN": Fault("rig", times(FORCE, 1e-3), rf"{FORCE}={FORCE},unit=kN"),
    "rig: speed in km/h": Fault("rig", times("speed_mps", 3.6), r"speed_mps=speed_mps,unit=km/h"),
    "rig: force late": Fault("rig", late_column(FORCE, 0.1, 0.3), effect="effort_delay"),
    "rig: wheel speed late": Fault(
        "rig", late_column("wheel", 0.1, 0.3), effect="wheel_speed_delay"
    ),
    "bus: slip reversed": Fault("bus", times("slip", -1.0), OPPOSITE),
    "bus: force reversed": Fault("bus", times(FORCE, -1.0), OPPOSITE),
    "bus: slip in percent": Fault("bus", times("slip", 100.0), PERCENT),
    "bus: load in kN": Fault("bus", times(LOAD, 1e-3), rf"{LOAD}={LOAD},unit=kN"),
    "bus: load in t": Fault("bus", times(LOAD, 1 / 9806.65), rf"{LOAD}={LOAD},.*unit=t\b"),
    "bus: force in kN": Fault("bus", times(FORCE, 1e-3), rf"{FORCE}={FORCE},unit=kN"),
    "bus: speed in km/h": Fault("bus", times("speed_mps", 3.6), r"speed_mps=speed_mps,unit=km/h"),
    "bus: force late": Fault("bus", late_column(FORCE, 2.0, 5.0), effect="effort_delay"),
    "drive: wheel speeds reversed": misread(REVERSED, roles("wheel_speed", "sign = -1")),
    "drive: a wheel speed reversed": misread(REVERSED, a_role("wheel_speed", "sign = -1")),
    "drive: efforts reversed": misread(OPPOSITE, roles("tractive_effort", "sign = -1")),
    "drive: an effort reversed": misread(
        rf"axle \d: {OPPOSITE}", a_role("tractive_effort", "sign = -1")
    ),
    "drive: speed in km/h": misread(
        r"rim runs at .*vehicle_speed: it may be in km/h", roles("vehicle_speed", "factor = 3.6")
    ),
    "drive: wheel speeds in rpm": misread(
        r"rim runs at .*wheel_speed: it may be in rad/s", roles("wheel_speed", 'unit = "rpm"')
    ),
    "drive: efforts in kN": misread(r"unit of the tractive effort", roles("tractive_effort", KN)),
    "drive: loads in kN": misread(r"axle load", roles("axle_load", KN)),
    "drive: diameters for radii": misread(
        r"rim runs at .*wheel radius: it may be a diameter",
        lambda _rng: "[vehicle]\nwheel_radius_m = 1.25\n",
    ),
    "drive: wheel speeds late": Fault(
        "drive", late_signal("wheel_speed", 0.06, 0.3), effect="wheel_speed_delay"
    ),
    "drive: speed late": Fault("drive", late_signal("speed", 0.06, 0.3), effect="speed_delay"),
    "drive: efforts late": Fault("drive", late_signal("effort", 0.06, 0.3), effect="effort_delay"),
}


# --- data ----------------------------------------------------------------------------------------


def rig_table():
    """Rows of the tyre rig that run straight."""
    (path,) = real_data("tyre_rig_83kPa.csv.gz")
    table = columns(path)
    straight = np.abs(table["slip_angle_deg"]) < STRAIGHT_DEG
    straight &= np.abs(table["inclination_deg"]) < STRAIGHT_DEG
    names = ("time_s", "slip", FORCE, LOAD, "speed_mps")
    return {name: table[name][straight] for name in names}


def make(source, number):
    """Data without a fault, other ones by the number where there are several."""
    if source == "rig":
        return rig_table()
    if source == "bus":
        paths = real_data("ztbus/*.csv.gz")
        return bus_rows(columns(paths[number % len(paths)]))
    return readings(240.0, seed=number + 1)


def ask(words, folder):
    """Exit status, all that was said, and the causes."""
    from adhesion_can.cli.main import main

    said, answer = io.StringIO(), Path(folder) / "d.json"
    answer.unlink(missing_ok=True)
    with redirect_stdout(said), redirect_stderr(said):
        status = main([*words, "--json", str(answer)])
    document = json.loads(answer.read_text()) if answer.exists() else {}
    return status, said.getvalue(), document.get("causes", [])


def answers(source, given, config):
    """What `check` and `diagnose` say of some data, and the causes that are named."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / ("drive.log" if source == "drive" else "rows.csv")
        if source == "drive":
            write(path, given)
        else:
            write_table(path, given)
        words = [str(path)]
        if config:
            (Path(folder) / "c.toml").write_text(config)
            words += ["--config", str(Path(folder) / "c.toml")]
        _, checked, _ = ask(["check", *words], folder)
        status, diagnosed, causes = ask(["diagnose", *words], folder)
    return status, f"{checked}\n{diagnosed}", causes


def tried(task):
    """Whether a fault was named, the names that are false, whether each of these has the fault as a
    rival, and what was said instead."""
    name, seed, number = task
    fault = FAULTS[name]
    rng = np.random.default_rng([seed, number, *name.encode()])
    given = make(fault.source, seed + number)
    spoilt, delay_s = fault.spoil(given, rng)
    _, said, causes = answers(fault.source, spoilt, fault.config and fault.config(rng))
    sizes = {c["effect"]: next(iter(c["parameters"].values()))["value"] for c in causes}
    own = {fault.effect}
    if fault.says:
        found = re.search(fault.says, said) is not None
    else:
        own |= OTHERS if fault.source == "rig" else set()
        sign = {fault.effect: 1.0}
        told = [sign.get(name, -1.0) * sizes[name] for name in own & set(sizes)]
        told += _shifts(said, fault.effect)
        most = LATE_SHARE * abs(delay_s) + CYCLES_S[fault.source] / 2
        found = any(abs(size - delay_s) <= most for size in told)
    # What was named before is no fault's doing: the data are real.
    known = set() if fault.source == "drive" else _known(fault.source, seed + number)
    false = sorted(set(sizes) - known - own)
    rivals = {c["effect"]: own & set(c["rivals"]) for c in causes}
    beside = all(rivals[name] for name in false)
    return found, false, beside, _short(said, causes, delay_s)


def _shifts(said, effect):
    """Delays of the signal of an effect that were told before anything was fitted, s."""
    told = re.findall(r"the (force|slip) (?:may )?lags? the \w+ by ([\d.]+) s", said)
    late = "force" if effect == "effort_delay" else "slip"
    return [float(size) * (1.0 if name == late else -1.0) for name, size in told]


def _known(source, number):
    _, _, causes = answers(source, make(source, number), None)
    return {cause["effect"] for cause in causes}


def _short(said, causes, delay_s):
    """What was said, in a line."""
    odd = re.findall(r"^(?:WRONG|WARNING|adhesion-can).*", said, re.MULTILINE)
    told = [f"{c['effect']} {next(iter(c['parameters'].values()))['value']:.4g}" for c in causes]
    delay = f"{delay_s:+.2f} s; " if delay_s else ""
    return delay + ("; ".join(told) or "nothing named") + " | " + " / ".join(odd[:2])[:160]


# --- rows ----------------------------------------------------------------------------------------


def row(source, report, options):
    names = [name for name, fault in FAULTS.items() if fault.source == source]
    tasks = [(name, options.seed, run) for name in names for run in range(options.runs)]
    outcomes = over_cores(tried, tasks, options.jobs, source)
    right, wrong, beside = 0, 0, 0
    for k, name in enumerate(names):
        own = outcomes[k * options.runs : (k + 1) * options.runs]
        found = sum(one[0] for one in own)
        right += found == len(own)
        wrong += sum(bool(one[1]) for one in own)
        beside += sum(bool(one[1]) and one[2] for one in own)
        report.write(f"{name}: found in {found} of {len(own)}")
        for is_found, false, _, said in own:
            if false or not is_found:
                report.write(f"    {'FALSE ' + '+'.join(false) if false else 'not found'}: {said}")
    return len(names), right, wrong, beside


def all_row(report, options):
    """Every kind of fault, in as many draws as `--runs` says; found: in each of them."""
    total = np.sum([row(source, report, options) for source in CYCLES_S], axis=0)
    kinds, right, wrong, beside = (int(one) for one in total)
    report.check(f"kinds found, of {kinds}", f"{right}", "27", met=right >= 27)
    report.check("false verdicts", f"{wrong}", "0", met=wrong == 0)
    report.write(
        f"of them with the fault as a rival, since these data cannot part the two: {beside}"
    )


def _source_row(source):
    def measure(report, options):
        kinds, right, wrong, beside = row(source, report, options)
        report.write(
            f"{right} of {kinds} kinds found, {wrong} false verdicts, {beside} of them with the "
            "fault as a rival"
        )

    measure.__doc__ = f"The faults of one source: {source}."
    return measure


ROWS = {"all": all_row, **{source: _source_row(source) for source in CYCLES_S}}


def main():
    parser = row_parser("faults", ROWS)
    parser.set_defaults(only=["all"])
    parser.add_argument(
        "--runs", type=positive(int), default=3, metavar="N", help="draws of each kind (default 3)"
    )
    add_seed_and_jobs(parser)
    run_rows(ROWS, parser.parse_args())


if __name__ == "__main__":
    main()
