"""`--plan` and `--next-drive` on the command line: what is written, and what is wrong usage."""

import json
import threading

import numpy as np
import pytest

from adhesion_can.api.simulation import simulate
from adhesion_can.cli.main import main
from adhesion_can.config.plan_file import read_plan, write_plan
from adhesion_can.physics.driving_plan import DrivingPlan, PlanStep
from adhesion_can.recordings.recording import Recording

PLAN = DrivingPlan(
    (
        PlanStep(0.5, "coast"),
        PlanStep(1.5, "traction", (0.02, 0.02), sand=True),
        PlanStep(0.5, "coast"),
    ),
    10.0,
)


@pytest.fixture
def plan(tmp_path):
    path = tmp_path / "plan.toml"
    write_plan(PLAN, path)
    return path


def fails(capsys, *arguments):
    assert main([str(x) for x in arguments]) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    return said


def test_simulate_drives_a_plan_as_long_as_it_lasts(tmp_path, plan):
    out = tmp_path / "out.log"
    arguments = ["simulate", "--scenario", "dry", "--closed-loop", "--plan", plan, "--log", out]
    assert main([str(x) for x in arguments]) == 0
    frames = list(Recording(out))
    times = np.array([frame.t_us for frame in frames]) / 1e6
    assert times.max() - times.min() == pytest.approx(2.5, abs=0.1)
    demands = [frame for frame in frames if frame.arbitration_id == 0x301]
    assert len(demands) > 200
    sand = np.array([bool(frame.data[1] & 0x10) for frame in demands])
    stamps = np.array([frame.t_us for frame in demands]) / 1e6
    on = stamps[sand] - times.min()
    assert on.min() == pytest.approx(0.5, abs=0.05)
    assert on.max() == pytest.approx(2.0, abs=0.05)
    # The same drive in a program.
    made = simulate("dry", seed=1, plan=plan)
    assert [f.data for f in made.frames] == [f.data for f in frames]


def test_a_plan_needs_a_drive_that_obeys(tmp_path, plan, capsys):
    out = tmp_path / "out.log"
    arguments = ("simulate", "--scenario", "dry", "--plan", plan, "--log", out)
    assert "add --closed-loop" in fails(capsys, *arguments)
    assert not out.exists()


@pytest.mark.parametrize("command", ["control", "simulate"])
def test_a_plan_with_a_mistake_is_told(command, tmp_path, plan, capsys):
    plan.write_text(plan.read_text().replace("traction", "sideways"))
    given = {
        "control": ("-i", "virtual", "-c", "plans-0"),
        "simulate": ("--scenario", "dry", "--closed-loop", "--log", tmp_path / "out.log"),
    }
    said = fails(capsys, command, *given[command], "--plan", plan)
    assert "plan.toml: step[2].mode: 'sideways'" in said


def test_control_drives_a_plan_on_a_bus_and_ends(tmp_path, plan):
    """Both in real time: how well it is driven depends on the machine, that it ends does not."""
    bus = ("-i", "virtual", "-c", "plans-1")
    simulated = ["simulate", "--scenario", "dry", "--closed-loop", "--duration", "6", *bus]
    locomotive = threading.Thread(target=main, args=([*simulated, "--plan", str(plan)],))
    locomotive.start()
    out = tmp_path / "control.json"
    arguments = ["control", *bus, "--plan", str(plan), "--json", str(out), "--duration", "60"]
    assert main(arguments) == 0
    locomotive.join()
    shares = json.loads(out.read_text())["share_of_steps"]
    assert shares["over"] > 0.0
    assert "step 2" in shares


def test_of_a_table_no_drive_is_planned(tmp_path, capsys):
    rng = np.random.default_rng(1)
    slip = rng.uniform(-0.15, 0.15, 3000)
    size = np.abs(slip)
    adhesion = np.sign(slip) * (0.4 * (1 - np.exp(-60 * size)) - 0.3 * size)
    adhesion = adhesion * (1.0 + 0.2 * (slip < 0.0)) + rng.normal(0.0, 0.01, len(slip))
    table, out = tmp_path / "t.csv", tmp_path / "plan.toml"
    columns = np.column_stack([0.02 * np.arange(len(slip)), slip, adhesion])
    head = "time_s,slip,adhesion"
    np.savetxt(table, columns, delimiter=",", header=head, comments="", fmt="%.6g")
    document = tmp_path / "d.json"
    arguments = ["diagnose", table, "--next-drive", out, "--json", document]
    assert main([str(x) for x in arguments]) == 0
    said = capsys.readouterr().out
    assert "a sample table has no wheel and vehicle speeds" in said
    assert "not written, there is no plan" in said
    assert not out.exists()
    assert json.loads(document.read_text())["next_drive"]["steps"] == []


@pytest.mark.slow
def test_diagnose_writes_a_plan_that_simulate_drives(tmp_path, capsys):
    first, out = tmp_path / "first.log", tmp_path / "plan.toml"
    simulate("dry", 120.0, 1, effects=["effort_delay=0.02"]).write(first)
    document = tmp_path / "d.json"
    arguments = ["diagnose", first, "--next-drive", out, "--json", document]
    assert main([str(x) for x in arguments]) == 0
    assert "Drive " in capsys.readouterr().out
    found = json.loads(document.read_text())["next_drive"]
    plan = read_plan(out)
    assert found["duration_s"] == pytest.approx(plan.duration_s)
    assert [one.name for one in plan.predictions] == found["explanations"]
    assert all(pair["power"] > 0.95 for pair in found["pairs"])
