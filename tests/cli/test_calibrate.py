"""`calibrate` as a user types it: worn wheels found, written, and right when read again."""

import csv
import json
import shutil
import tomllib
from dataclasses import replace
from itertools import islice
from pathlib import Path

import cantools
import numpy as np
import pytest

import adhesion_can
from adhesion_can.bus.database import load_database
from adhesion_can.bus.frame import Frame
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.config.calibrated_file import Correction, with_correction
from adhesion_can.estimation.doubt.settings import InstrumentUncertainty
from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.recordings.candump import format_frame
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name
from tests.wire import Bench

DATA = Path(__file__).resolve().parents[1] / "data"
WORN = (0.625, 0.6125, 0.625, 0.640625, 0.625, 0.625)
"""Axle 2 worn by 2 %, axle 4 new on a locomotive whose wheels are set at 0.625 m."""


SWEEP = scenario_by_name("sweep")
STEADY = replace(SWEEP, speed=15.0, speed_swing=0.0)
"""Near one speed, so that no offset of the vehicle speed is told."""


def recorded(path, scenario, duration_s):
    """A drive on worn wheels."""
    settings = RunSettings(scenario, duration_s, seed=2, vehicle=Locomotive(wheel_radius=WORN))
    with path.open("w") as file:
        for frames in Simulation(settings, load_database()).run():
            file.writelines(map(format_frame, frames))
    return path


@pytest.fixture(scope="module")
def worn(tmp_path_factory):
    """`sweep` near one speed."""
    return recorded(tmp_path_factory.mktemp("worn") / "worn.log", STEADY, 100.0)


def calibrated(tmp_path, *arguments):
    """Runs the command; returns its JSON."""
    result = tmp_path / "result.json"
    assert main(["calibrate", *map(str, arguments), "--json", str(result)]) == 0
    return json.loads(result.read_text())


def fails(capsys, *arguments):
    """Runs the command, which must end with 2 and one line; returns the line."""
    try:
        code = main(["calibrate", *map(str, arguments)])
    except SystemExit as error:
        code = error.code
    assert code == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1, err
    assert err.startswith("adhesion-can calibrate")
    return err


# --- worn wheels


@pytest.fixture(scope="module")
def found(worn):
    """(result, written configuration) of the worn wheels."""
    out = worn.parent / "calibrated.toml"
    return calibrated(worn.parent, worn, "--out", out), out


@pytest.mark.costly
def test_worn_wheels_are_found_within_their_errors(found):
    result, _ = found
    for axle, true in zip(result["axles"], WORN, strict=True):
        value, std = axle["radius_m"]["value"], axle["radius_m"]["std"]
        assert value == pytest.approx(true, rel=1e-3)
        assert abs(value - true) < 6 * std
        assert std < 1e-3 * true
        assert axle["configured_m"] == 0.625
        assert axle["change_percent"] == pytest.approx(100 * (value / 0.625 - 1))
        assert axle["coasting_s"] > 5
        assert axle["corrected_by"] == "wheel_radius_m"
        low, high = axle["radius_m"]["interval"]
        assert low < value < high
    assert result["coasting_told_by"] == "tractive effort"
    assert 0 < result["systematic_percent"] < 0.1
    assert result["relative_to"] == "vehicle speed"
    assert result["offset_mps"] == {"value": None, "std": None, "interval": None}
    assert result["version"]
    assert result["inputs"][0]["sha256"]
    assert any("offset" in note and "0.67 %" in note for note in result["notes"])


def test_it_says_which_radii_differ_from_the_configuration(worn, found, tmp_path):
    result, written = found
    assert result["agrees_with_configuration"] is False
    assert result["axles_that_differ"] == [2, 4]
    assert result["axles_not_tested"] == []
    assert result["agreement"].startswith("The radii differ from the configuration: axle 2 by -2.0")
    assert result["agreement"].endswith(" The others agree within their uncertainty.")
    again = calibrated(tmp_path, worn, "--config", written)
    assert again["agrees_with_configuration"] is True
    assert again["axles_that_differ"] == []
    assert again["agreement"].startswith("The radii agree with the configuration within their")


def test_the_public_function_finds_what_the_command_finds(worn, found):
    document, _ = found
    result = adhesion_can.calibrate(worn)
    assert json.loads(json.dumps(result.to_dict()))["axles"] == document["axles"]
    assert "<table>" in result._repr_html_()


def test_the_written_configuration_mends_the_slip_and_the_peak(worn, found, tmp_path):
    """λ_m of the dry rail is 0.0734: 2 % of wear on an axle shifts its slip by 0.02."""
    _, out = found
    written = load_configuration(out)
    assert written.vehicle.wheel_radius == pytest.approx(WORN, rel=1e-3)
    true = SWEEP.sections(1.0)[0].surface
    first = tmp_path / "first.log"
    with worn.open() as file, first.open("w") as head:
        head.writelines(islice(file, 30_000))
    fits = {}
    for name, extra in (("nominal", []), ("calibrated", ["--config", str(out)])):
        fit = tmp_path / f"{name}.json"
        assert main(["identify", str(first), "--json", str(fit), *extra]) == 0
        fits[name] = json.loads(fit.read_text())
    mended, off = fits["calibrated"], fits["nominal"]
    assert mended["lambda_m"]["value"] == pytest.approx(true.lambda_m, rel=0.02)
    assert mended["mu_max"]["value"] == pytest.approx(true.mu_max, rel=0.01)
    assert mended["noise_std"] < 0.5 * off["noise_std"]
    errors = [abs(fit["lambda_m"]["value"] - true.lambda_m) for fit in (off, mended)]
    assert errors[0] > 4 * errors[1]


def test_calibrating_again_with_the_written_configuration_changes_nothing(worn, found, tmp_path):
    first, out = found
    again = calibrated(tmp_path, worn, "--config", out)
    for axle, before in zip(again["axles"], first["axles"], strict=True):
        assert abs(axle["change_percent"]) < 0.01
        assert axle["radius_m"]["value"] == pytest.approx(before["radius_m"]["value"], rel=1e-4)


def test_comments_and_all_else_of_the_users_file_stay(worn, tmp_path):
    mine, out = tmp_path / "mine.toml", tmp_path / "out.toml"
    mine.write_text(
        "# our locomotive\n[vehicle]\n"
        "wheel_radius_m = [\n  0.625, # lathe\n  0.625,\n  0.625, 0.625, 0.625, 0.625,\n] # m\n"
        "train_mass_kg = 1.0e6  # empty\n\n[sampling]\nv_min = 2.0\n"
    )
    calibrated(tmp_path, worn, "--config", mine, "--out", out)
    text = out.read_text()
    for kept in ("# our locomotive", "# lathe", "# empty", "[sampling]\nv_min = 2.0", "] # m"):
        assert kept in text
    assert "calibrated: standard errors in m: axle 1 ± " in text
    assert "worn.log (sha256 " in text
    assert load_configuration(out).vehicle.wheel_radius == pytest.approx(WORN, rel=1e-3)
    assert load_configuration(out).vehicle.train_mass == 1e6
    # What the slips' scale may still be wrong by is that of the radii, far below the default.
    instruments = load_configuration(out).estimators.instruments
    assert 0.0 < instruments.speed_error_std < 0.2 * InstrumentUncertainty().speed_error_std
    # Once more, onto itself: one remark for each key, the newer one.
    calibrated(tmp_path, worn, "--config", out, "--out", out)
    assert out.read_text().count("calibrated:") == 2
    assert "] # m; calibrated: " in out.read_text()


@pytest.mark.costly
def test_where_speeds_vary_the_offset_is_told_and_each_key_has_one_remark(tmp_path):
    """Also the second time: one behind the radii, their error, and the vehicle speed."""
    log, out = recorded(tmp_path / "swing.log", SWEEP, 80.0), tmp_path / "out.toml"
    result = calibrated(tmp_path, log, "--out", out)
    assert abs(result["offset_mps"]["value"]) < 6 * result["offset_mps"]["std"] < 0.04
    first = out.read_text()
    calibrated(tmp_path, log, "--config", out, "--out", out)
    remarked = [line for line in out.read_text().splitlines() if "calibrated:" in line]
    assert [line.count("calibrated:") for line in remarked] == [1, 1, 1]
    keys = ["wheel_radius_m", "speed_error_std", "vehicle_speed"]
    assert [line.split()[0] for line in remarked] == keys
    assert len(out.read_text()) < len(first) + 20, "digits may differ, nothing may grow"


# --- a bench of small recordings: coasting with steps of speed, other units and roles


def bench_log(path, spell, radius=0.625, offset=0.0, reference=None, speeds=(6, 9, 12, 15, 18)):
    """Coasts at steps of speed for 12 s each, with correlated errors of the vehicle speed."""
    rng, bench, error, rows = np.random.default_rng(5), Bench(), 0.0, []
    with path.open("w") as file:
        for k in range(len(speeds) * 600):
            t_us = k * 20_000
            v = float(speeds[k // 600])
            error = 0.98 * error + 0.2 * 0.01 * rng.standard_normal()
            rows.append((t_us / 1e6, v + offset + error))
            for frame in spell(bench, t_us, v, v / radius, v + offset + error):
                file.write(format_frame(frame))
    if reference:
        with reference.open("w", newline="") as file:
            csv.writer(file).writerows([("time_s", "gnss"), *rows])
    return path


def own_messages(bench, t_us, _v, omega, measured):
    yield bench.frame("WheelSpeeds1", t_us, **{f"WheelSpeed_Ax{i}": omega for i in (1, 2, 3)})
    yield bench.frame("VehicleSpeed", t_us, VehicleSpeed=measured, VehicleSpeedSource=1)
    yield bench.frame("TractiveEffort1", t_us)


THREE_AXLES = "[vehicle]\naxles = 3\n"


def test_the_offset_is_written_at_the_role_of_the_vehicle_speed(tmp_path):
    """No roles in the file: one of them would displace all defaults, so all are written."""
    log = bench_log(tmp_path / "a.log", own_messages, radius=0.61, offset=0.3)
    mine, out = tmp_path / "mine.toml", tmp_path / "out.toml"
    mine.write_text(THREE_AXLES)
    first = calibrated(tmp_path, log, "--config", mine, "--out", out)
    assert first["offset_mps"]["value"] == pytest.approx(0.3, abs=6 * first["offset_mps"]["std"])
    assert first["axles"][0]["radius_m"]["value"] == pytest.approx(0.61, rel=1e-3)
    before, after = load_configuration(mine), load_configuration(out)
    (speed,) = [c for c in after.choices if c.role is Role.VEHICLE_SPEED]
    assert speed.offset == pytest.approx(first["offset_mps"]["value"], abs=1e-6)
    assert {(c.name, c.message, c.signal) for c in after.choices} == {
        (c.name, c.message, c.signal) for c in before.choices
    }
    again = calibrated(tmp_path, log, "--config", out, "--out", out)
    assert abs(again["offset_mps"]["value"]) < 1e-4
    assert abs(again["axles"][0]["change_percent"]) < 1e-3
    # A second offset adds to the first.
    (speed,) = [c for c in load_configuration(out).choices if c.role is Role.VEHICLE_SPEED]
    assert speed.offset == pytest.approx(0.3, abs=6 * first["offset_mps"]["std"] + 1e-3)


CAR = cantools.database.load_file(DATA / "car.dbc")


def car_messages(_bench, t_us, v, _omega, measured):
    # Front wheels' sender reads 1.5 % low, rear wheels' 0.5 % high.
    rims = {"FL": 0.985, "FR": 0.985, "RL": 1.005, "RR": 1.005}
    wheels = {f"WHEEL_SPEED_{w}": 3.6 * v * k for w, k in rims.items()}
    yield Frame(t_us, 170, CAR.encode_message("WHEEL_SPEEDS", wheels), "can0")
    yield Frame(t_us, 180, CAR.encode_message("SPEED", {"SPEED": 3.6 * measured, "NO_UNIT": 0}))


@pytest.fixture(scope="module")
def car(tmp_path_factory):
    """(configuration, log, reference) of a car whose wheel speeds are speeds of the rim."""
    folder = tmp_path_factory.mktemp("car")
    for name in ("car.toml", "car.dbc"):
        shutil.copy(DATA / name, folder)
    log = bench_log(folder / "car.log", car_messages, reference=folder / "ref.csv")
    return folder / "car.toml", log, folder / "ref.csv"


def test_wheel_speeds_at_the_rim_get_a_factor_and_no_radius(car, tmp_path, capsys):
    """A radius would cancel out: it turns m/s into rad/s and back."""
    toml, log, _ = car
    out = tmp_path / "out.toml"
    first = calibrated(tmp_path, log, "--config", toml, "--out", out)
    ratios = [1 / 0.985, 1 / 0.985, 1 / 1.005, 1 / 1.005]
    for axle, ratio in zip(first["axles"], ratios, strict=True):
        assert axle["radius_m"]["value"] / axle["configured_m"] == pytest.approx(ratio, rel=1e-3)
        assert axle["corrected_by"] == "factor"
    assert first["coasting_told_by"] is None
    assert first["systematic_percent"] is None
    assert any("contain the slip of traction" in note for note in first["notes"])
    assert "steady speed" in capsys.readouterr().out
    written = tomllib.loads(out.read_text())
    assert written["vehicle"]["wheel_radius_m"] == [0.35, 0.35, 0.36, 0.36]
    assert written["roles"]["wheel_speed"]["1"]["factor"] == pytest.approx(ratios[0], rel=1e-3)
    assert written["roles"]["wheel_speed.3"]["factor"] == pytest.approx(ratios[2], rel=1e-3)
    assert written["roles"]["wheel_speed"]["1"]["cycle_ms"] == 12
    assert (out.parent / written["bus"]["database"]).samefile(toml.parent / "car.dbc")
    again = calibrated(tmp_path, log, "--config", out)
    for axle in again["axles"]:
        assert abs(axle["change_percent"]) < 0.01, "the written factor corrects the slip"


def test_a_reference_of_another_recorder_takes_the_place_of_the_vehicle_speed(car, tmp_path):
    toml, log, reference = car
    alone = tmp_path / "alone.toml"
    text = toml.read_text().replace('vehicle_speed = "SPEED.SPEED"\n', "")
    alone.write_text(text.replace('"car.dbc"', f'"{toml.parent / "car.dbc"}"'))
    by_bus = calibrated(tmp_path, log, "--config", toml)
    for option in (reference, f"{reference}:gnss"):
        by_reference = calibrated(tmp_path, log, "--config", alone, "--speed", option)
        for a, b in zip(by_bus["axles"], by_reference["axles"], strict=True):
            assert a["radius_m"]["value"] == pytest.approx(b["radius_m"]["value"], rel=2e-4)
        assert by_reference["inputs"][1]["path"] == str(reference)


@pytest.mark.parametrize("spelling", ["plain", "dotted", "header", "factor"])
def test_the_factor_is_written_however_the_role_is_spelt(car, tmp_path, spelling):
    toml, log, _ = car
    before, _, _ = toml.read_text().partition("wheel_speed.1 =")
    signal = "WHEEL_SPEEDS.WHEEL_SPEED_FL"
    roles, old = {
        "plain": (f'"wheel_speed.1" = "{signal}" # front\n', 1.0),
        "dotted": (f'wheel_speed.1.signal = "{signal}"\n', 1.0),
        "header": (f'[roles."wheel_speed.1"] # front\nsignal = "{signal}"\n', 1.0),
        "factor": (
            f'wheel_speed.1 = {{ signal = "{signal}", factor = 1.01, offset = 0.1 }}\n',
            1.01,
        ),
    }[spelling]
    mine, out = tmp_path / "mine.toml", tmp_path / "out.toml"
    shutil.copy(toml.parent / "car.dbc", tmp_path)
    mine.write_text(f'{before}vehicle_speed = "SPEED.SPEED"\n{roles}')
    first = calibrated(tmp_path, log, "--config", mine, "--out", out)
    (choice,) = [c for c in load_configuration(out).choices if c.role is Role.WHEEL_SPEED]
    ratio = first["axles"][0]["radius_m"]["value"] / 0.35
    assert choice.factor == pytest.approx(old * ratio, rel=1e-6)
    assert choice.offset == pytest.approx((0.1 if spelling == "factor" else 0.0) * ratio)
    assert "calibrated: factor ± " in out.read_text()
    assert ("# front; calibrated" in out.read_text()) is (spelling == "plain")
    again = calibrated(tmp_path, log, "--config", out)
    assert abs(again["axles"][0]["change_percent"]) < 0.01


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[vehicle.geometry]\ncoupler_height_m = 1.0\n",
        "vehicle.train_mass_kg = 1e6\n",
        "vehicle = { train_mass_kg = 1e6 } # x\r\n",
        "[vehicle]\r\nwheel_radius_m = 0.62 # turned\r\n[sampling]\r\nv_min = 2\r\n",
        (
            '[roles]\nvehicle_speed = "VehicleSpeed.VehicleSpeed" # radar\n'
            'wheel_speed.1 = "WheelSpeeds1.WheelSpeed_Ax1"\n'
        ),
        (
            '[roles.vehicle_speed]\nsignal = "VehicleSpeed.VehicleSpeed"\n[roles.wheel_speed]\n'
            '1 = "WheelSpeeds1.WheelSpeed_Ax1"\n'
        ),
        (
            'roles = { vehicle_speed = { signal = "VehicleSpeed.VehicleSpeed", offset = 0.1 }, '
            '"wheel_speed.1" = "WheelSpeeds1.WheelSpeed_Ax1" }\n'
        ),
    ],
)
def test_any_way_to_write_the_file_takes_the_correction_twice(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_bytes(text.encode())
    first = load_configuration(path)
    correction = Correction(
        radius_ratio={1: 0.98},
        offset=0.05,
        speed_error_std=0.0004,
        radii_remark="radii",
        factor_remark={1: "factor"},
        offset_remark="offset",
    )
    for _ in range(2):
        now = load_configuration(path)
        path.write_bytes(with_correction(now, path, path, correction).encode())
    last = load_configuration(path)
    assert last.estimators.instruments.speed_error_std == 0.0004
    radius = first.vehicle.wheel_radius
    assert last.vehicle.wheel_radius == pytest.approx((0.98**2 * radius[0], *radius[1:]))
    assert last.vehicle.train_mass == first.vehicle.train_mass
    offsets = [
        next(c.offset for c in conf.choices if c.role is Role.VEHICLE_SPEED)
        for conf in (first, last)
    ]
    assert offsets[1] - offsets[0] == pytest.approx(0.1)
    assert {c.name for c in last.choices} == {c.name for c in first.choices}
    assert path.read_text().count("calibrated: offset") == ("roles = {" not in text)


def test_speeds_derived_from_the_driven_axles_calibrate_nothing(tmp_path, capsys):
    def derived(bench, t_us, v, omega, measured):
        for frame in own_messages(bench, t_us, v, omega, measured):
            if frame.arbitration_id != 0x111:
                yield frame
        yield bench.frame("VehicleSpeed", t_us, VehicleSpeed=v, VehicleSpeedSource=4)

    log = bench_log(tmp_path / "a.log", derived, speeds=(10, 12))
    mine = tmp_path / "mine.toml"
    mine.write_text(THREE_AXLES)
    assert "independent of the driven axles" in fails(capsys, log, "--config", mine)


# --- bad input


def test_no_coasting_is_one_line_with_the_fix(tmp_path, capsys):
    log = tmp_path / "a.log"
    with log.open("w") as file:
        file.writelines(map(format_frame, Bench().drive(0, 10_000_000)))
    message = fails(capsys, log)
    assert "no axle coasts for 5 s" in message
    assert "--adhesion-max" in message


SLOW_DBC = """VERSION ""
BU_: BUS
BO_ 256 Wheels: 8 BUS
 SG_ Left : 0|16@1- (0.001,0) [-5|30] "m/s" BUS
 SG_ Right : 16|16@1- (0.001,0) [-5|30] "m/s" BUS
BO_ 257 Ground: 2 BUS
 SG_ Speed : 0|16@1- (0.001,0) [-5|30] "m/s" BUS
BO_ 258 Drive: 2 BUS
 SG_ F : 0|16@1- (1,0) [-20000|20000] "N" BUS
"""
SLOW_TOML = """[vehicle]
axles = 2
wheel_radius_m = 0.48
axle_load_N = 47500.0
[bus]
database = "slow.dbc"
[roles]
vehicle_speed = { signal = "Ground.Speed", cycle_ms = 1000 }
"wheel_speed.1" = { signal = "Wheels.Left", cycle_ms = 1000 }
"wheel_speed.2" = { signal = "Wheels.Right", cycle_ms = 1000 }
"tractive_effort.1" = { signal = "Drive.F", cycle_ms = 1000 }
"tractive_effort.2" = { signal = "Drive.F", cycle_ms = 1000 }
"""


def every_second(folder, seconds, force, scale=1.0):
    """A bus on which every signal comes once a second; the right wheel reads 0.5 % too fast."""
    (folder / "slow.dbc").write_text(SLOW_DBC)
    (folder / "slow.toml").write_text(SLOW_TOML)
    rng, lines = np.random.default_rng(11), []
    for k in range(seconds):
        v = scale * (9.0 + 3.0 * np.sin(k / 40.0))
        pulls = k % 60 < 20
        values = {
            256: np.array([v, 1.005 * v]) * (1.02 if pulls else 1.0) + 0.003 * rng.normal(size=2),
            257: np.array([v + 0.01 * rng.normal()]),
        }
        for number, speeds in values.items():
            data = np.round(speeds * 1000).astype("<i2").tobytes()
            data += bytes((8 if number == 256 else 2) - len(data))
            lines.append(f"({k + number / 1e6:.6f}) can0 {number:X}#{data.hex().upper()}")
        effort = np.array([force if pulls else 0.0]).astype("<i2").tobytes()
        lines.append(f"({k + 0.000300:.6f}) can0 102#{effort.hex().upper()}")
    (folder / "slow.log").write_text("\n".join(lines) + "\n")
    return folder / "slow.log", "--config", folder / "slow.toml"


def test_signals_once_a_second_are_calibrated(tmp_path):
    result = calibrated(tmp_path, *every_second(tmp_path, 900, 8000))
    left, right = result["axles"]
    assert min(left["coasting_s"], right["coasting_s"]) > 300
    for axle, percent in ((left, 0.0), (right, -0.5)):
        std = 100 * axle["radius_m"]["std"] / axle["configured_m"]
        assert std < 0.1
        assert abs(axle["change_percent"] - percent) < 4 * std + 0.01


@pytest.mark.parametrize(
    ("seconds", "how", "options", "reason"),
    [
        (300, {}, ("--settle", "60"), "0.0 s after 60 s of that); record longer coasting"),
        (300, {"scale": 0.2}, (), "0.0 s above 3 m/s); record a faster drive"),
        (300, {}, ("--adhesion-max", "1e-9", "--acceleration-max", "1e-4"), "--acceleration-max"),
        (20, {}, (), "with an adhesion below 0.005); record a drive in which an axle coasts"),
        (35, {}, (), "the coasting fills fewer than 4 blocks"),
    ],
)
def test_the_condition_that_leaves_no_coasting_is_named(
    tmp_path, capsys, seconds, how, options, reason
):
    message = fails(capsys, *every_second(tmp_path, seconds, 8000, **how), *options)
    assert reason in message


def test_bad_inputs_are_one_line_each(car, tmp_path, capsys):
    toml, log, reference = car
    empty = tmp_path / "empty.log"
    empty.write_text("")
    assert "no frames" in fails(capsys, empty)
    table = tmp_path / "t.csv"
    table.write_text("time_s,slip,adhesion\n0,0.1,0.2\n")
    assert "not a recording" in fails(capsys, table)
    assert "does not fit adhesion.dbc" in fails(capsys, log)
    assert "its folder does not exist" in fails(capsys, log, "--out", tmp_path / "no" / "x.toml")
    assert "--block" in fails(capsys, log, "--block", "nan")
    assert "--delay" in fails(capsys, log, "--delay", "inf")
    one = [log, "--config", toml, "--speed"]
    assert "No such file" in fails(capsys, *one, tmp_path / "none.csv")
    assert "no column 'x'" in fails(capsys, log, "--config", toml, "--speed", f"{reference}:x")
    bad = tmp_path / "bad.csv"
    for text, said in (
        ("", "needs the columns"),
        ("time_s\n1\n", "needs the columns"),
        ("time_s,a,b\n1,2,3\n", "more than one column (a, b)"),
        ("time_s,a\n1,2\n2,x\n", "bad.csv:3"),
        ("time_s,a\n1,2\n2\n", "bad.csv:3"),
        ("time_s,a\nnan,2\n", "not a time"),
        ("time_s,a\n1,nan\n2,\n", "has no numbers"),
        ("time_s,a\n", "has no numbers"),
        ("time_s,a\n2,1\n1,1\n", "run backwards"),
        ("time_s,a\n5000,10\n6000,10\n", "lie outside the recording's"),
    ):
        bad.write_text(text)
        assert said in fails(capsys, *one, bad), text
    bad.write_bytes(b"time_s,a\n\xff\xfe,1\n")
    assert "not CSV" in fails(capsys, *one, bad)


def test_missing_roles_are_named(car, tmp_path, capsys):
    toml, log, _ = car
    before, _, _ = toml.read_text().partition("wheel_speed.1 =")
    shutil.copy(toml.parent / "car.dbc", tmp_path)
    mine = tmp_path / "mine.toml"
    mine.write_text(before + 'vehicle_speed = "SPEED.SPEED"\n')
    assert "no role gives a wheel speed" in fails(capsys, log, "--config", mine)
    mine.write_text(before + '"wheel_speed.1" = "WHEEL_SPEEDS.WHEEL_SPEED_FL"\n')
    message = fails(capsys, log, "--config", mine)
    assert "no role gives the vehicle speed" in message
    assert "--speed" in message


def test_roles_that_are_never_heard_are_named(worn, tmp_path, capsys):
    for ids, said in (
        (("111#",), "no vehicle speed"),
        (("101#", "102#"), "no wheel speed"),
        (("121#", "122#"), "no tractive effort"),
    ):
        log = tmp_path / "part.log"
        lines = worn.read_text().splitlines(keepends=True)[:5000]
        log.write_text("".join(line for line in lines if not any(i in line for i in ids)))
        assert said in fails(capsys, log)


# --- a car on the road


def test_a_car_on_the_road_agrees_with_its_data_sheet(realdata, tmp_path, capsys):
    """Wheels 0.77 % (front) and 0.96 % (rear) low: within the standard error or 0.1 %."""
    result = calibrated(
        tmp_path,
        realdata / "rav4_drive.log.gz",
        "--config",
        DATA / "car.toml",
        "--speed",
        f"{realdata / 'rav4_gnss_speed.csv'}:gnss_speed_mps",
    )
    for axle, sheet in zip(result["axles"], (0.77, 0.77, 0.96, 0.96), strict=True):
        std = 100 * axle["radius_m"]["std"] / axle["configured_m"]
        assert axle["change_percent"] == pytest.approx(sheet, abs=max(std, 0.1))
        assert 0.01 < std < 0.15
    assert result["offset_mps"]["value"] is None, "60 s near one speed do not tell it"
    assert "cannot be detected" in capsys.readouterr().out


def test_it_says_whether_and_where_it_wrote_the_configuration(worn, tmp_path, capsys):
    out, result = tmp_path / "out.toml", tmp_path / "result.json"
    capsys.readouterr()
    assert main(["calibrate", str(worn), "--json", str(result)]) == 0
    said = capsys.readouterr().out
    assert said.count("No configuration was written: --out CONFIG.toml writes one") == 1
    assert json.loads(result.read_text())["written"] is None
    assert main(["calibrate", str(worn), "--out", str(out), "--json", str(result)]) == 0
    said = capsys.readouterr().out
    assert said.count(f"written: {out}, the configuration with the radii of 6 axles") == 1
    assert "No configuration was written" not in said
    assert json.loads(result.read_text())["written"] == str(out)
