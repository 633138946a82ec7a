"""--model: the same file for run, replay, identify and simulate."""

import csv
import hashlib
import json
from dataclasses import replace
from math import exp, log

import numpy as np
import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.config.model_file import read_model, write_model
from adhesion_can.estimation.extended.estimator import ExtendedEstimator
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.effects import ActiveEffect, effect_by_id
from adhesion_can.physics.effects.empirical import Empirical
from adhesion_can.recordings.candump import ReadReport, read_candump
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.replay import replay
from tests.cli.test_commands import fails
from tests.service.test_live import (
    Running,
    assert_replayed,
    everything,
    opened,
    own,
    send_drive,
    wait_until,
)
from tests.wire import Bench

BASE = (0.4, 60.0, 0.3)
PEAK = log(BASE[0] * BASE[1] / BASE[2]) / BASE[1]
HEIGHT = BASE[0] * (1 - exp(-BASE[1] * PEAK)) - BASE[2] * PEAK


def active(name, *values, form=""):
    return ActiveEffect(effect_by_id(name, form), values)


def factor(v):
    """Curtius and Kniffler, by hand."""
    return (7.5 / (3.6 * v + 44) + 0.161) / (7.5 / 44 + 0.161)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A drive on dry rail, and models for it."""
    folder = tmp_path_factory.mktemp("model")
    arguments = ["simulate", "--scenario", "dry", "--duration", "12", "--seed", "3"]
    assert main([*arguments, "--log", str(folder / "a.log")]) == 0
    speed = ExtendedModel(
        BASE, effects=(active("speed_dependence", 1.0),), covariances=(((0.01,),),)
    )
    write_model(speed, folder / "speed.toml")
    write_model(replace(speed, effects=(active("effort_bias", 5000.0),)), folder / "bias.toml")
    write_model(ExtendedModel(BASE), folder / "none.toml")
    return folder


def replayed(files, tmp_path, *more):
    """(rows of the table, frames, JSON)."""
    names = [tmp_path / name for name in ("e.csv", "f.log", "r.json")]
    arguments = ["replay", str(files / "a.log"), *map(str, more), "--to", "4"]
    arguments += ["--table", str(names[0]), "--frames", str(names[1]), "--json", str(names[2])]
    assert main(arguments) == 0
    rows = list(csv.DictReader(names[0].read_text().splitlines()))
    return rows, names[1].read_bytes(), json.loads(names[2].read_text())


@pytest.fixture(scope="module")
def plain(files, tmp_path_factory):
    """The same without a model."""
    return replayed(files, tmp_path_factory.mktemp("plain"))


@pytest.mark.costly
def test_replay_with_a_model_says_the_whole_curve_and_names_the_model(files, plain, tmp_path):
    without, _, before = plain
    rows, _, document = replayed(files, tmp_path, "--model", files / "speed.toml")
    # The speed hardly changes: base curve and factor together are the curve of before.
    assert float(rows[-1]["mu_max"]) == pytest.approx(float(without[-1]["mu_max"]), rel=0.01)
    assert float(rows[-1]["lambda_m"]) == pytest.approx(float(without[-1]["lambda_m"]), rel=0.03)
    assert rows[-1]["c1"] != without[-1]["c1"]
    content = (files / "speed.toml").read_bytes()
    assert document["model"] == {
        "path": str(files / "speed.toml"),
        "sha256": hashlib.sha256(content).hexdigest(),
    }
    assert "model" not in before
    assert document["samples_left_out"] == {}


def test_a_model_without_effects_changes_no_byte(files, plain, tmp_path):
    _, with_model, _ = replayed(files, tmp_path, "--model", files / "none.toml")
    assert with_model == plain[1]


def test_an_error_of_the_instruments_is_taken_out_of_the_samples(files, plain, tmp_path):
    rows, _, _ = replayed(files, tmp_path, "--model", files / "bias.toml")
    moved = float(plain[0][-1]["mu_max"]) - float(rows[-1]["mu_max"])
    assert moved == pytest.approx(5000 / 245e3, abs=0.006)


def test_identify_fits_the_base_curve_and_says_so(files, tmp_path, capsys):
    results = []
    for more in ([], ["--model", str(files / "speed.toml")]):
        target = tmp_path / "i.json"
        assert main(["identify", str(files / "a.log"), "--json", str(target), *more]) == 0
        results.append((json.loads(target.read_text()), capsys.readouterr().out))
    (plain, quiet), (base, told) = results
    ratio = plain["mu_max"]["value"] / base["mu_max"]["value"]
    assert ratio == pytest.approx(factor(10.0), rel=0.03)
    assert base["curve"] == "base curve of the extended model"
    assert base["effects"] == [
        {"effect": "speed_dependence", "form": "", "parameters": {"share": 1.0}}
    ]
    assert base["model"]["sha256"]
    flat = " ".join(told.split())
    assert "Base curve of the extended model" in flat
    assert "without speed_dependence" in flat
    assert "Base curve" not in quiet
    assert "curve" not in plain


def table_of(path, **columns):
    names = list(columns)
    lines = [",".join(names)]
    lines += [",".join(map(repr, map(float, row))) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n")


def test_identify_of_a_table_without_what_its_rig_got_wrong(tmp_path):
    rng = np.random.default_rng(2)
    n = 3000
    slip, v = rng.uniform(-0.15, 0.15, n), rng.uniform(5, 25, n)
    wet = rng.uniform(0, 1, n)
    mu = np.sign(slip) * (BASE[0] * -np.expm1(-BASE[1] * np.abs(slip)) - BASE[2] * np.abs(slip))
    adhesion = mu * factor(v) * (1 - 0.3 * wet**2) + 0.002 * rng.standard_normal(n)
    wet[::50] = np.nan
    table_of(
        tmp_path / "t.csv",
        time_s=np.arange(n) * 0.01, slip=slip, adhesion=adhesion, speed_mps=v, water_mm=wet,
    )  # fmt: skip
    (tmp_path / "t.csv").write_text((tmp_path / "t.csv").read_text().replace("nan", ""))
    # 1 + s(x) = 1 − 0.3 x² is a spline without inner knots: x² has the blossom (0, 0, 1/3, 1).
    bend = Empirical("water_mm", "factor", (0.0,) * 4 + (1.0,) * 4, (0.0, 0.0, -0.1, -0.3))
    model = ExtendedModel(BASE, effects=(active("speed_dependence", 1.0),), splines=(bend,))
    write_model(model, tmp_path / "m.toml")
    arguments = ["identify", str(tmp_path / "t.csv"), "--json", str(tmp_path / "r.json")]
    assert main([*arguments, "--model", str(tmp_path / "m.toml")]) == 0
    result = json.loads((tmp_path / "r.json").read_text())
    for name, true in zip(("c1", "c2", "c3"), BASE, strict=True):
        assert abs(result[name]["value"] - true) < 6 * result[name]["std"]
    assert result["mu_max"]["value"] == pytest.approx(HEIGHT, rel=0.002)
    assert result["left_out_by_model"] == {"water_mm not available": n // 50}
    assert result["splines"] == [{"channel": "water_mm", "kind": "factor"}]
    assert len(result["segments"]) == 1


def test_the_level_in_the_data_is_told_beside_the_base_curves(tmp_path, capsys):
    """A tyre's loads of 3 kN: the power law's base curve is that at 100 kN, far below."""
    rng = np.random.default_rng(3)
    n = 2000
    slip, load = rng.uniform(-0.15, 0.15, n), rng.uniform(2e3, 4e3, n)
    mu = np.sign(slip) * (BASE[0] * -np.expm1(-BASE[1] * np.abs(slip)) - BASE[2] * np.abs(slip))
    adhesion = mu * (load / 1e5) ** -0.25 + 0.002 * rng.standard_normal(n)
    table_of(
        tmp_path / "t.csv",
        time_s=np.arange(n) * 0.01, slip=slip, adhesion=adhesion, normal_load_N=load,
    )  # fmt: skip
    power = active("load_dependence", 0.25, form="power")
    write_model(ExtendedModel(BASE, effects=(power,)), tmp_path / "m.toml")
    arguments = ["identify", str(tmp_path / "t.csv"), "--json", str(tmp_path / "r.json")]
    assert main([*arguments, "--model", str(tmp_path / "m.toml")]) == 0
    result = json.loads((tmp_path / "r.json").read_text())
    assert result["mean_factor"] == pytest.approx(0.03**-0.25, rel=0.02)
    assert result["mu_max"]["value"] == pytest.approx(HEIGHT, rel=0.01)
    said = capsys.readouterr().out
    assert f"mu_max is {result['mean_factor'] * result['mu_max']['value']:.4f} there" in said


def test_a_model_that_asks_for_what_is_not_there(files, tmp_path, capsys):
    log_file = files / "a.log"
    assert "none.such" in fails(capsys, "replay", log_file, "--model", tmp_path / "none.such")
    assert "no effect" in _failing(capsys, tmp_path, log_file, '[[effect]]\nid = "moonlight"')
    spline = (
        '[[spline]]\nchannel = "position_m"\nkind = "factor"\nknots = [0,0,0,0,1,1,1,1]\n'
        "coefficients = [0,0,0,0]"
    )
    assert "needs position_m" in _failing(capsys, tmp_path, log_file, spline)
    err = fails(
        capsys, "simulate", "--scenario", "dry", "--duration", "1",
        "--log", tmp_path / "x.log", "--model", tmp_path / "m.toml",
    )  # fmt: skip
    assert "needs position_m, which the simulated locomotive" in err
    radius = '[[effect]]\nid = "wheel_radius"\nparameters = {error = 0.01, axle = 9}'
    assert "axle 9" in _failing(capsys, tmp_path, log_file, radius)
    err = fails(
        capsys, "run", "-i", "virtual", "-c", "x", "--duration", "1",
        "--model", tmp_path / "m.toml",
    )  # fmt: skip
    assert "axle 9" in err
    table_of(
        tmp_path / "t.csv", time_s=range(50), slip=np.linspace(0, 0.1, 50), adhesion=[0.1] * 50
    )
    err = fails(capsys, "identify", tmp_path / "t.csv", "--model", files / "speed.toml")
    assert "speed_mps" in err
    assert "t.csv" in err


def _failing(capsys, tmp_path, recording, text):
    (tmp_path / "m.toml").write_text(f"[base]\nc1 = 0.4\nc2 = 60\nc3 = 0.3\n{text}\n")
    return fails(capsys, "replay", recording, "--model", tmp_path / "m.toml")


def test_simulate_lets_the_effects_of_a_model_act(files, tmp_path, capsys):
    """The same run as with --effect; the base curve of the model changes nothing."""
    common = ["simulate", "--scenario", "dry", "--duration", "2", "--log"]
    assert main([*common, str(tmp_path / "a.log"), "--effect", "speed_dependence=1"]) == 0
    truth = tmp_path / "t.json"
    with_model = [str(tmp_path / "b.log"), "--model", str(files / "speed.toml")]
    assert main([*common, *with_model, "--truth", str(truth)]) == 0
    assert (tmp_path / "a.log").read_bytes() == (tmp_path / "b.log").read_bytes()
    document = json.loads(truth.read_text())
    assert [e["effect"] for e in document["effects"]] == ["speed_dependence"]
    assert document["model"]["sha256"] == read_model(files / "speed.toml").sha256
    err = fails(capsys, *common, *with_model, "--effect", "speed_dependence")
    assert "give it once" in err


@pytest.mark.costly
def test_live_and_the_replay_of_its_log_are_byte_identical_with_a_model():
    """With states that lag behind, and a vehicle speed that every sample waits for."""
    effects = (
        active("speed_delay", 0.15),
        active("creep_relaxation", 0.5),
        active("speed_dependence", 1.0),
        active("adhesion_recovery", 1e-6, 2.0),
    )
    doubt = (None, ((0.01,),), ((0.04,),), ((1e-14, 0.0), (0.0, 0.01)))
    config = replace(
        load_configuration(), model=ExtendedModel(BASE, effects=effects, covariances=doubt)
    )
    core = ServiceCore(config)
    with opened("model") as sender, opened("model") as listener:
        with Running(core, opened("model")) as live:
            # A sender that waits for its turn on a busy machine loses samples for their stamps.
            send_drive(sender, 60.0, until=lambda: core.counts.samples > 600)
            received = []
            wait_until(lambda: received.extend(own(everything(listener))) or len(received) > 500)
        received += own(everything(listener))
    assert core.counts.samples > 600
    assert core.faults == []
    items = list(read_candump([line.encode() for line in live.lines], ReadReport()))
    sent, logged = [], [item for item in items if isinstance(item, Frame)]
    replay(items, ServiceCore(config), sent.append)
    assert own(logged) == received
    assert_replayed(sent, logged, live.service.counts.overdue)
    assert len(received) > 500
    plain = []
    replay(items, ServiceCore(load_configuration()), plain.append)
    assert own(plain) != own(sent)


def test_a_restart_begins_with_a_fresh_estimator():
    """After a hole in time the service says what it said the first time."""
    effects = (active("adhesion_recovery", 1e-6, 2.0), active("speed_dependence", 1.0))
    config = replace(load_configuration(), model=ExtendedModel(BASE, effects=effects))
    core = ServiceCore(config)
    bench, says = Bench(), []
    for start in (0, 90_000_000):
        for frame in bench.drive(start, start + 1_000_000):
            core.feed(frame)
        assert isinstance(core._estimation._estimator.inner, ExtendedEstimator)
        says.append(core.estimate)
    assert core.counts.restarts == 1
    assert says[0].theta == says[1].theta
    assert says[0].samples == says[1].samples


def test_samples_without_the_covariate_are_left_out_and_told():
    """A bus that has humidity in its database, and never on the wire."""
    config = replace(
        load_configuration(), model=ExtendedModel(BASE, effects=(active("humidity", -0.003),))
    )
    core = ServiceCore(config)
    bench = Bench()
    for frame in bench.drive(0, 500_000):
        core.feed(frame)
    assert core.estimate is None
    count = core.left_out_samples["relative_humidity_percent not available"]
    assert count == core.counts.samples > 200
    for t_us in range(500_000, 1_000_000, 10_000):
        if t_us == 500_000:
            core.feed(bench.frame("Environment", t_us, RelativeHumidity=80.0))
        for name in ("WheelSpeeds1", "WheelSpeeds2", "TractiveEffort1", "TractiveEffort2"):
            core.feed(bench.steady(name, t_us))
        if t_us % 20_000 == 0:
            core.feed(bench.steady("VehicleSpeed", t_us))
    assert core.estimate is not None
    assert core.left_out_samples["relative_humidity_percent not available"] < count + 40
