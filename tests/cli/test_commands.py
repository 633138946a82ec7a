"""The commands as a user types them: what they write, what they say, how they fail."""

import csv
import gzip
import json
import os
import subprocess
import sys
from pathlib import Path

import can
import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.cli.main import main
from adhesion_can.recordings.candump import ReadReport, parse_line, read_candump
from tests.promptness import frames_with_prompt_past, need_prompt
from tests.wire import DB, DBC, Bench, decoded, seal_ok

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """18 s of dry, wet and dry rail, with its truth."""
    folder = tmp_path_factory.mktemp("recording")
    arguments = ["simulate", "--scenario", "dry-wet-dry", "--duration", "18", "--seed", "1"]
    assert (
        main([*arguments, "--log", str(folder / "a.log"), "--truth", str(folder / "t.json")]) == 0
    )
    return folder


def frames_of(path):
    return [parse_line(line) for line in path.read_bytes().splitlines(keepends=True)]


def rows_of(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def fails(capsys, *arguments):
    """Runs a command that must fail with exit status 2 and one line; returns the line."""
    try:
        code = main([str(a) for a in arguments])
    except SystemExit as error:
        code = error.code
    assert code == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1, err
    assert err.startswith("adhesion-can")
    return err


# --- simulate, replay


def test_simulate_writes_the_same_bytes_for_the_same_seed(tmp_path):
    arguments = ["simulate", "--scenario", "dry-wet-dry", "--duration", "3", "--log"]
    found = []
    for number, seed in enumerate((1, 1, 2)):
        log = tmp_path / f"{number}.log"
        assert main([*arguments, str(log), "--seed", str(seed)]) == 0
        found.append(log.read_bytes())
    one, again, other = found
    assert one == again
    assert one != other


def test_truth_has_the_names_of_the_contract(recording):
    truth = json.loads((recording / "t.json").read_text())
    assert {"scenario", "seed", "vehicle", "surfaces", "effects", "noise"} <= truth.keys()
    keys = {"from_s", "to_s", "name", "c1", "c2", "c3", "mu_max", "lambda_m"}
    assert [set(s) for s in truth["surfaces"]] == [keys] * 3
    assert truth["surfaces"][1]["from_s"] == truth["surfaces"][0]["to_s"] == 6.0


@pytest.mark.costly
def test_replay_gives_frames_a_table_and_json_that_agree(recording, tmp_path, capsys):
    frames, table, result = tmp_path / "b.log", tmp_path / "e.csv", tmp_path / "r.json"
    code = main(
        [
            "replay",
            str(recording / "a.log"),
            "--frames",
            str(frames),
            "--table",
            str(table),
            "--json",
            str(result),
        ]
    )
    assert code == 0
    assert "Setpoints by status" in capsys.readouterr().out
    sent = frames_of(frames)
    assert all(seal_ok(frame) for frame in sent)
    rows = rows_of(table)
    setpoints = [(f.t_us, decoded(f)) for f in sent if f.arbitration_id == 0x201]
    assert len(rows) == len(setpoints)
    for row, (t_us, point) in zip(rows, setpoints, strict=True):
        assert row["time_s"] == f"{t_us / 1e6:.6f}"
        assert row["status"] == str(point["Status"])
        if row["mu_max"]:
            assert float(row["mu_max"]) == pytest.approx(float(point["MuMax"]), abs=1.1e-5)
        else:
            assert str(point["MuMax"]) == "not available"
    document = json.loads(result.read_text())
    assert document["version"]
    assert document["inputs"][0]["sha256"]
    assert document["dbc"]["sha256"]
    assert document["frames_rejected"] == 0
    assert document["setpoints_by_status"].keys() <= {
        "INIT",
        "LOW_EXCITATION",
        "SURFACE_CHANGE",
        "TRACKING",
    }


@pytest.mark.costly
def test_replay_comes_within_5_percent_of_each_surface(recording, tmp_path):
    table = tmp_path / "e.csv"
    assert main(["replay", str(recording / "a.log"), "--table", str(table)]) == 0
    rows = rows_of(table)
    for surface in json.loads((recording / "t.json").read_text())["surfaces"]:
        last = [r for r in rows if float(r["time_s"]) <= surface["to_s"]][-1]
        assert float(last["mu_max"]) == pytest.approx(surface["mu_max"], rel=0.05)
        assert last["status"] == "TRACKING"
        assert float(last["lambda_m"]) == pytest.approx(surface["lambda_m"], rel=0.1)


@pytest.mark.costly
def test_replay_skips_and_counts_our_own_frames(recording, tmp_path, capsys):
    first, quick = tmp_path / "answers.log", ["--estimator", "rls"]
    assert main(["replay", str(recording / "a.log"), "--frames", str(first), *quick]) == 0
    both = tmp_path / "both.log"
    lines = (recording / "a.log").read_text().splitlines(keepends=True)
    lines += first.read_text().splitlines(keepends=True)
    both.write_text("".join(sorted(lines, key=lambda line: float(line[1:].split(")")[0]))))
    again, result = tmp_path / "again.log", tmp_path / "r.json"
    capsys.readouterr()
    assert main(["replay", str(both), "--frames", str(again), "--json", str(result), *quick]) == 0
    assert again.read_bytes() == first.read_bytes()
    own = json.loads(result.read_text())["frames_own_skipped"]
    assert own == len(first.read_text().splitlines())


def test_replay_of_a_part(recording, tmp_path):
    table = tmp_path / "part.csv"
    arguments = ["replay", str(recording / "a.log"), "--table", str(table)]
    assert main([*arguments, "--from", "5", "--to", "7"]) == 0
    times = [float(r["time_s"]) for r in rows_of(table)]
    assert times[0] == pytest.approx(5.0, abs=0.01)
    assert times[-1] == pytest.approx(7.0, abs=0.03)


@pytest.mark.costly
def test_replay_of_several_recordings_in_sequence_equals_that_of_the_whole(recording, tmp_path):
    lines = (recording / "a.log").read_text().splitlines(keepends=True)
    halves = [tmp_path / "1.log", tmp_path / "2.log.gz"]
    halves[0].write_text("".join(lines[:4000]))
    with gzip.open(halves[1], "wt") as file:
        file.write("".join(lines[4000:]))
    outs = [tmp_path / "parts.out", tmp_path / "whole.out"]
    for out, logs in zip(outs, (halves, [recording / "a.log"]), strict=True):
        arguments = [*map(str, logs), "--estimator", "rls", "--frames", str(out)]
        assert main(["replay", *arguments]) == 0
    assert outs[0].read_bytes() == outs[1].read_bytes()


def test_replay_reads_what_python_can_writes(recording, tmp_path):
    out = tmp_path / "plain.out"
    assert main(["replay", str(recording / "a.log"), "--frames", str(out), "--to", "2"]) == 0
    for suffix in ("asc", "blf"):
        converted = tmp_path / f"a.{suffix}"
        with can.LogReader(recording / "a.log") as reader, can.Logger(converted) as writer:
            for message in reader:
                if message.timestamp < 2.0:
                    message.channel = 0
                    writer.on_message_received(message)
        again = tmp_path / f"{suffix}.out"
        assert main(["replay", str(converted), "--frames", str(again)]) == 0
        assert len(again.read_text().splitlines()) == pytest.approx(
            len(out.read_text().splitlines()), abs=10
        )


@pytest.mark.costly
def test_the_closed_loop_obeys_and_is_recorded_with_its_answers(tmp_path):
    log = tmp_path / "closed.log"
    arguments = ["simulate", "--scenario", "dry", "--duration", "8", "--closed-loop"]
    assert main([*arguments, "--log", str(log)]) == 0
    frames = frames_of(log)
    assert {0x201, 0x101} <= {f.arbitration_id for f in frames}
    # Once the rail is known the wheels stand at the setpoint instead of sweeping.
    wheel = [
        decoded(f)["WheelSpeed_Ax1"]
        for f in frames
        if f.arbitration_id == 0x101 and f.t_us > 6_500_000
    ]
    speed = [
        decoded(f)["VehicleSpeed"]
        for f in frames
        if f.arbitration_id == 0x111 and f.t_us > 6_500_000
    ]
    creep = [
        decoded(f)["CreepSpeedSetpoint"]
        for f in frames
        if f.arbitration_id == 0x201 and f.t_us > 6_500_000
    ]
    measured = 0.625 * sum(wheel) / len(wheel) - sum(speed) / len(speed)
    assert measured == pytest.approx(sum(creep) / len(creep), rel=0.05)


def test_an_effect_changes_the_drive_and_stands_in_the_truth(tmp_path):
    truth = tmp_path / "t.json"
    arguments = ["simulate", "--scenario", "dry", "--duration", "3", "--truth", str(truth)]
    for effect in ("load_dependence", "load_dependence=3e-12", "falling_friction=0.2"):
        assert main([*arguments, "--log", str(tmp_path / effect), "--effect", effect]) == 0
        written = json.loads(truth.read_text())["effects"][0]
        assert written["effect"] == effect.split("=")[0]
        size = next(iter(written["parameters"].values()))
        assert size == (float(effect.split("=")[1]) if "=" in effect else 4e-12)
    contents = {p.read_bytes() for p in tmp_path.iterdir() if p.suffix != ".json"}
    assert len(contents) == 3


# --- identify


def test_identify_finds_the_surfaces_of_a_log(recording, capsys):
    assert main(["identify", str(recording / "a.log"), "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    truth = json.loads((recording / "t.json").read_text())["surfaces"]
    assert len(result["segments"]) == 3
    for segment, surface in zip(result["segments"], truth, strict=True):
        assert segment["from_s"] == pytest.approx(surface["from_s"], abs=0.2)
        assert segment["identifiable"] == {"mu_max": True, "lambda_m": True}
        for name in ("mu_max", "lambda_m", "c1", "c2"):
            assert segment[name]["value"] == pytest.approx(surface[name], rel=0.03)
            assert 0 < segment[name]["std"] < 0.05 * surface[name]
    # One curve for all describes nothing, and says so.
    assert result["identifiable"] == {"mu_max": False, "lambda_m": False}
    assert result["mu_max"]["std"] is None


def test_identify_reads_tables(tmp_path, capsys):
    import numpy as np

    rng = np.random.default_rng(1)
    slip = rng.uniform(0, 0.2, 2000)
    mu = 0.5 * (1 - np.exp(-30 * slip)) - 0.08 * slip + 0.01 * rng.standard_normal(2000)
    plain, gz = tmp_path / "x.csv", tmp_path / "x.csv.gz"
    rows = "\n".join(
        f"{i / 100},{s},{m},7.5" for i, (s, m) in enumerate(zip(slip, mu, strict=True))
    )
    plain.write_text(f"time_s,slip,adhesion,humidity\n{rows}\n")
    with gzip.open(gz, "wt") as file:
        file.write(plain.read_text())
    for path in (plain, gz):
        assert main(["identify", str(path), "--json", "-"]) == 0
        result = json.loads(capsys.readouterr().out)
        assert result["mu_max"]["value"] == pytest.approx(0.484, rel=0.01)
        assert result["samples"] == 2000
        assert len(result["segments"]) == 1


@pytest.mark.costly
def test_identify_says_what_low_slip_cannot_tell(tmp_path, capsys):
    import numpy as np

    rng = np.random.default_rng(1)
    slip = rng.uniform(0, 0.01, 2000)
    mu = 0.5 * (1 - np.exp(-30 * slip)) - 0.08 * slip + 0.01 * rng.standard_normal(2000)
    path = tmp_path / "low.csv"
    rows = "\n".join(f"{i / 100},{s},{m}" for i, (s, m) in enumerate(zip(slip, mu, strict=True)))
    path.write_text(f"time_s,slip,adhesion\n{rows}\n")
    assert main(["identify", str(path)]) == 0
    said = capsys.readouterr().out
    assert "the peak is not in the data: 97 % of the slips stay below 0.00" in said
    assert "where the adhesion is 0.13 and still rises" in said
    assert said.count("not in data") == 2
    assert "± ?" not in said
    assert "form holds" not in said
    assert main(["identify", str(path), "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["segments"][0]["missing"].startswith("the peak is not in the data")
    assert result["identifiable"] == {"mu_max": False, "lambda_m": False}
    assert result["lambda_m"]["std"] is None


# --- check


def test_check_passes_a_good_recording(recording, capsys):
    assert main(["check", str(recording / "a.log")]) == 0
    out = capsys.readouterr().out
    assert "verdict: usable" in out
    assert "WheelSpeeds1 0x101" in out


def test_check_names_every_kind_of_fault(recording, tmp_path, capsys):
    lines = (recording / "a.log").read_text().splitlines(keepends=True)
    wheel = [i for i, line in enumerate(lines) if " 101#" in line]
    lines[wheel[100]] = lines[wheel[100]][:-17] + "00" + lines[wheel[100]][-15:]  # checksum
    lines[wheel[200]] = lines[wheel[200]][:-3] + "\n"  # length
    lines[wheel[300]] = ""  # lost
    for i in wheel[400:420]:
        lines[i] = ""  # a gap
    lines[wheel[500]] = "nonsense\n"
    bad = tmp_path / "bad.log"
    bad.write_text("".join(lines))
    assert main(["check", str(bad), "--json", str(tmp_path / "c.json")]) == 1
    out = capsys.readouterr().out
    for words in ("checksum", "length", "lost", "of more than three cycles", "malformed"):
        assert words in out
    result = json.loads((tmp_path / "c.json").read_text())
    message = next(m for m in result["messages"] if m["name"] == "WheelSpeeds1")
    assert message["rejected"]["checksum"] == 1
    assert message["rejected"]["length"] == 1
    assert result["usable"] is False


def test_check_reports_a_value_out_of_range(tmp_path, capsys):
    bench = Bench()
    log = tmp_path / "range.log"
    frames = list(bench.drive(0, 200_000))
    frames += [bench.frame("Environment", 150_000, RelativeHumidity=120.0)]
    frames += [bench.frame("VehicleSpeed", 200_000, VehicleSpeed=10.0, VehicleSpeedSource=9)]
    log.write_text(
        "".join(
            f"({f.t_us / 1e6:.6f}) can0 {f.arbitration_id:03X}#{f.data.hex()}\n" for f in frames
        )
    )
    assert main(["check", str(log)]) == 1
    out = capsys.readouterr().out
    assert "Environment (0x141): 1 of 1 frames rejected: range" in out
    assert "VehicleSpeed (0x111): 1 of 11 frames rejected: range" in out


def test_check_says_that_the_car_has_no_effort_and_what_that_costs(realdata, tmp_path, capsys):
    (tmp_path / "car.dbc").write_text(CAR_DBC)
    (tmp_path / "car.toml").write_text(CAR_TOML)
    code = main(
        ["check", str(realdata / "rav4_drive.log.gz"), "--config", str(tmp_path / "car.toml")]
    )
    out = capsys.readouterr().out
    assert code == 1
    assert "WRONG: no role gives vehicle speed or tractive effort" in out
    assert "mu_max and lambda_m cannot be estimated" in out
    assert "135468 frames" in out


CAR_DBC = """VERSION ""
NS_ :
BS_:
BU_: CAR
BO_ 170 WHEEL_SPEEDS: 8 CAR
 SG_ FL : 7|16@0+ (0.01,-67.67) [0|250] "km/h" CAR
 SG_ FR : 23|16@0+ (0.01,-67.67) [0|250] "km/h" CAR
 SG_ RL : 39|16@0+ (0.01,-67.67) [0|250] "km/h" CAR
 SG_ RR : 55|16@0+ (0.01,-67.67) [0|250] "km/h" CAR
"""
CAR_TOML = """[vehicle]
axles = 4
wheel_radius_m = 0.35
[bus]
database = "car.dbc"
[roles]
"wheel_speed.1" = { signal = "WHEEL_SPEEDS.FL", channel = "can0" }
"wheel_speed.2" = { signal = "WHEEL_SPEEDS.FR", channel = "can0" }
"wheel_speed.3" = { signal = "WHEEL_SPEEDS.RL", channel = "can0" }
"wheel_speed.4" = { signal = "WHEEL_SPEEDS.RR", channel = "can0" }
"""


# --- demo


@pytest.mark.realtime
def test_the_demo_ends_with_its_table_and_a_recording_that_replay_takes(tmp_path, capsys):
    out = tmp_path / "demo"
    assert main(["demo", "--headless", "--duration", "14", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "Truth and estimate at the end of each surface" in text
    page = out / "report.html"
    assert f"\nreport: {page}; in a browser: {page.as_uri()}\n" in text
    phases = json.loads((out / "demo.json").read_text())["phases"]
    assert [p["surface"] for p in phases] == ["dry", "wet", "greasy", "dry"]
    assert main(["replay", str(out / "demo.log"), "--json", str(out / "r.json")]) == 0
    result = json.loads((out / "r.json").read_text())
    # At most what is due in 14 s; a busy machine starts late, and leaves out what is overdue.
    assert 371 < result["frames_own_skipped"] <= 14 * 371 + 30
    items = read_candump((out / "demo.log").read_bytes().splitlines(True), ReadReport())
    frames = [item for item in items if isinstance(item, Frame)]
    prompt = frames_with_prompt_past(frames, 0x201, past_us=0)
    # 371 a second, of which 50 are setpoints.
    assert result["frames_own_skipped"] > 0.95 * 371 / 50 * len(prompt)
    assert result["frames_rejected"] == result["frames_lost"] == 0
    written = {"demo.log", "demo.json", "truth.json", "report.html", "r.json"}
    assert {p.name for p in out.iterdir()} == written
    report = (out / "report.html").read_text()
    assert "Truth and estimate at the end of each surface." in report
    assert report.count('"name":"truth"') >= 2 * 2  # of two quantities, over time and over distance
    need_prompt(len(prompt) / (14 * 50), 0.9)
    assert max(abs(p["mu_max_error"]) for p in phases) < 0.05


# --- bad input


def test_a_missing_file(capsys, tmp_path):
    for command in ("replay", "check", "identify"):
        line = fails(capsys, command, tmp_path / "nope.log")
        assert "nope.log: No such file" in line
    assert "No such file" in fails(capsys, "replay", "x.log", "--config", tmp_path / "no.toml")


def test_a_dbc_without_a_needed_signal(capsys, tmp_path, recording):
    text = DBC.read_text().replace("WheelSpeed_Ax5", "WheelSpeed_AxV")
    (tmp_path / "mine.dbc").write_text(text)
    line = fails(capsys, "replay", recording / "a.log", "--dbc", tmp_path / "mine.dbc")
    assert (
        "mine.dbc: WheelSpeeds2.WheelSpeed_Ax5: no such signal; the role wheel_speed.5 needs it"
        in line
    )
    assert "--config" in line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[service]\nspeed = 3\n", "service.speed: unknown key"),
        ("colour = 1\n", "colour: unknown key"),
        (
            '[roles]\nvehicle_speed = { signal = "VehicleSpeed.VehicleSpeed", unit = "kg" }\n',
            "unit 'kg'",
        ),
        ("[vehicle]\naxles = 'six'\n", "vehicle.axles: 'six' is not a whole number"),
        ("[[[", "not TOML"),
    ],
)
def test_a_config_that_nobody_understands(capsys, tmp_path, recording, text, words):
    (tmp_path / "c.toml").write_text(text)
    line = fails(capsys, "replay", recording / "a.log", "--config", tmp_path / "c.toml")
    assert "c.toml" in line
    assert words in line


def test_a_log_without_a_known_frame(capsys, tmp_path):
    (tmp_path / "other.log").write_text("(1.000000) can0 7DF#0102\n" * 3)
    for command in ("replay", "check", "identify"):
        line = fails(capsys, command, tmp_path / "other.log")
        assert "messages are missing" in line
        assert "the recording has 0x7DF" in line
        assert "--dbc" in line


def test_an_empty_log(capsys, tmp_path):
    (tmp_path / "empty.log").write_text("")
    assert "no frames" in fails(capsys, "replay", tmp_path / "empty.log")


def test_a_file_of_another_kind(capsys, tmp_path):
    (tmp_path / "x.pdf").write_bytes(b"%PDF-1.7 \x00\x01")
    assert "a document, not a recording" in fails(capsys, "replay", tmp_path / "x.pdf")
    (tmp_path / "x.xyz").write_bytes(b"whatever \x00\x01")
    assert "not candump text" in fails(capsys, "replay", tmp_path / "x.xyz")
    assert "write it to a file" in fails(capsys, "replay", "-")


def test_a_table_without_its_columns(capsys, tmp_path):
    (tmp_path / "t.csv").write_text("time_s,slip\n1,0.1\n")
    assert "no column 'adhesion'" in fails(capsys, "identify", tmp_path / "t.csv")
    (tmp_path / "u.csv").write_text("a,b\n1,2\n")
    assert "neither a 'slip' column" in fails(capsys, "identify", tmp_path / "u.csv")


def test_a_bus_that_does_not_exist(capsys, tmp_path):
    log = tmp_path / "run.log"
    line = fails(capsys, "run", "-i", "socketcan", "-c", "nosuchcan0", "--log", log)
    assert "bus socketcan:nosuchcan0: cannot be opened" in line
    assert not list(tmp_path.iterdir())
    assert "cannot be opened" in fails(
        capsys, "simulate", "--scenario", "dry", "-i", "socketcan", "-c", "nosuchcan0"
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["simulate", "--scenario", "ice", "--log", "x"], "no scenario 'ice'"),
        (["simulate", "--scenario", "dry"], "--log and -i: neither is given"),
        (["simulate", "--scenario", "dry", "--log", "x", "--duration", "-1"], "--duration"),
        (["simulate", "--scenario", "dry", "--log", "x", "--duration", "nan"], "--duration"),
        (["simulate", "--scenario", "dry", "--log", "x", "--seed", "-1"], "--seed"),
        (["simulate", "--scenario", "dry", "--log", "x", "--effect", "magic"], "no effect 'magic'"),
        (
            ["simulate", "--scenario", "dry", "--log", "x", "--effect", "load_dependence=9"],
            "out of range",
        ),
        (["simulate", "--scenario", "dry", "--log", "/no/such/folder/x"], "folder does not exist"),
        (["replay", "x", "--estimator", "magic"], "no estimator 'magic'"),
        (["replay", "x", "--table", "x.xls"], "unknown format"),
        (["replay"], "required"),
        (["demo", "--duration", "3"], "too short"),
        (["conquer"], "no command 'conquer'"),
        ([], "required"),
    ],
)
def test_wrong_usage_is_one_line(capsys, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert words in fails(capsys, *arguments)
    assert not list(tmp_path.iterdir())


def test_nothing_half_written_is_left_behind(tmp_path, capsys):
    for name in ("b.log", "e.csv", "r.json"):
        (tmp_path / name).write_text("old")
    (tmp_path / "other.log").write_text("(1.000000) can0 7DF#0102\n")
    fails(
        capsys, "replay", tmp_path / "other.log", "--frames", tmp_path / "b.log",
        "--table", tmp_path / "e.csv", "--json", tmp_path / "r.json",
    )  # fmt: skip
    for name in ("b.log", "e.csv", "r.json"):
        assert (tmp_path / name).read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 4


def test_recordings_out_of_order(capsys, recording, tmp_path):
    lines = (recording / "a.log").read_text().splitlines(keepends=True)
    (tmp_path / "1.log").write_text("".join(lines[:2000]))
    (tmp_path / "2.log").write_text("".join(lines[2000:4000]))
    line = fails(capsys, "replay", tmp_path / "2.log", tmp_path / "1.log")
    assert "starts before the previous recording ends" in line


# --- as installed


@pytest.mark.costly
def test_the_installed_command_works_from_any_folder(tmp_path):
    script = Path(sys.executable).with_name("adhesion-can")
    done = subprocess.run(
        [script, "simulate", "--scenario", "wet", "--duration", "2", "--log", "x.log"],
        cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "x.log: 933 frames of 2 s of 'wet'\n"
    done = subprocess.run(
        ["sh", "-c", f"{script} check x.log | head -n 1"], cwd=tmp_path, capture_output=True,
        text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.stderr == ""
    assert "frames in 2.0 s" in done.stdout


@pytest.mark.costly
def test_the_wheel_carries_the_dbc(tmp_path):
    """Built without a network: the build backend must be there (extra 'test')."""
    hatchling = pytest.importorskip("hatchling.build", reason="hatchling is not installed")
    here = Path.cwd()
    os.chdir(ROOT)
    try:
        wheel = hatchling.build_wheel(str(tmp_path))
    finally:
        os.chdir(here)
    import zipfile

    with zipfile.ZipFile(tmp_path / wheel) as archive:
        names = archive.namelist()
        archive.extractall(tmp_path / "site")
    assert "adhesion_can/dbc/adhesion.dbc" in names
    assert not [n for n in names if n.startswith(("tests", "tools"))]
    code = "from adhesion_can.bus.database import packaged_path; print(packaged_path())"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": str(tmp_path / "site")}, check=True, timeout=60,
    )  # fmt: skip
    assert Path(done.stdout.strip()) == tmp_path / "site/adhesion_can/dbc/adhesion.dbc"
    assert len(DB.messages) == 16


@pytest.mark.costly
def test_one_broken_stamp_far_ahead_costs_its_own_frame_alone(recording, tmp_path, capsys):
    lines = (recording / "a.log").read_text().splitlines(keepends=True)
    stray = tmp_path / "stray.log"
    broken = "(99999999.000000)" + lines[3000].split(")")[1]
    stray.write_text("".join([*lines[:3000], broken, *lines[3000:]]))
    outs = [tmp_path / "clean.out", tmp_path / "stray.out"]
    quick = ["replay", "--estimator", "rls"]
    assert main([*quick, str(recording / "a.log"), "--frames", str(outs[0])]) == 0
    capsys.readouterr()
    assert main([*quick, str(stray), "--frames", str(outs[1])]) == 0
    assert "stamp is far ahead" in capsys.readouterr().out
    assert outs[0].read_bytes() == outs[1].read_bytes()
    assert main(["check", str(stray)]) == 1


@pytest.mark.costly
def test_a_recording_with_a_pause_goes_on_after_it(recording, tmp_path):
    lines = (recording / "a.log").read_text().splitlines(keepends=True)[:4000]
    later = [f"({float(line[1:].split(')')[0]) + 7200:.6f}){line.split(')')[1]}" for line in lines]
    paused = tmp_path / "paused.log"
    paused.write_text("".join(lines + later))
    assert main(["replay", str(paused), "--json", str(tmp_path / "r.json")]) == 0
    result = json.loads((tmp_path / "r.json").read_text())
    assert result["restarts"] == 1
    assert result["frames"] == 8000
    assert result["problems"] == []
