"""`replay --samples`: the points as the service formed them, and back again as a TABLE."""

import csv
import json

import numpy as np
import pytest

import adhesion_can
from adhesion_can.cli.main import main
from adhesion_can.recordings.tables.sample_table import read_table


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("samples")
    log, out = folder / "drive.log", folder / "samples.csv"
    what = ["--scenario", "dry-wet-dry", "--duration", "15", "--seed", "5"]
    assert main(["simulate", *what, "--log", str(log)]) == 0
    result = folder / "r.json"
    assert main(["replay", str(log), "--samples", str(out), "--json", str(result)]) == 0
    return folder, json.loads(result.read_text())


@pytest.mark.costly
def test_every_sample_is_a_row(drive):
    folder, result = drive
    with (folder / "samples.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == result["samples"]
    stamps = [float(row["time_s"]) for row in rows]
    assert stamps == sorted(stamps)
    assert {row["axle"] for row in rows} == set("123456")
    assert {row["left_out"] for row in rows} == {"no"}
    for row in rows[::500]:
        force = float(row["adhesion"]) * float(row["normal_load_N"])
        assert float(row["longitudinal_force_N"]) == pytest.approx(force, rel=1e-6)
        assert float(row["slip_std"]) > 0.0


def test_residuals_and_surfaces_are_those_of_the_service(drive):
    folder, _ = drive
    table = read_table(folder / "samples.csv")
    with (folder / "samples.csv").open() as file:
        rows = list(csv.DictReader(file))
    residual = np.array([float(row["residual"] or "nan") for row in rows])
    t_s = np.array([float(row["time_s"]) for row in rows])
    settled = (t_s > 3.0) & (t_s < 5.0)
    assert np.std(residual[settled]) < 0.02
    assert table.segment is not None
    # Two changes of the rail, at 5 and 10 s; the service may begin with one of its own.
    assert 2 <= table.segment.max() <= 4


@pytest.mark.costly
def test_the_points_give_the_same_curve_as_the_recording(drive):
    folder, _ = drive
    by_log = adhesion_can.identify(folder / "drive.log").segments[0].estimate
    table = read_table(folder / "samples.csv").samples
    first = table.select(table.t_us < 5_000_000)
    by_points = adhesion_can.identify(first).whole
    assert by_points.mu_max == pytest.approx(by_log.mu_max, rel=0.01)
    assert by_points.lambda_m == pytest.approx(by_log.lambda_m, rel=0.05)
    assert by_points.mu_max_std == pytest.approx(by_log.mu_max_std, rel=0.5)


@pytest.mark.costly
def test_diagnose_reads_them_and_takes_no_bookkeeping_for_a_cause(drive, tmp_path):
    folder, _ = drive
    result = tmp_path / "d.json"
    assert main(["diagnose", str(folder / "samples.csv"), "--json", str(result)]) == 0
    document = json.loads(result.read_text())
    named = {cause["effect"] for cause in document["causes"]}
    tested = {one["effect"] for one in document["evidence"]}
    for name in ("residual", "slip_std", "adhesion_std"):
        assert f"channel:{name}" not in named | tested


@pytest.mark.costly
def test_parquet_holds_the_same(drive, tmp_path):
    pytest.importorskip("pyarrow")
    folder, _ = drive
    path = tmp_path / "samples.parquet"
    assert main(["replay", str(folder / "drive.log"), "--samples", str(path)]) == 0
    a, b = read_table(folder / "samples.csv").samples, read_table(path).samples
    np.testing.assert_array_equal(a.t_us, b.t_us)
    np.testing.assert_allclose(a.slip, b.slip, atol=1e-9)


@pytest.mark.costly
def test_mf4_holds_the_same_and_is_read_back_as_a_table(drive, tmp_path, capsys):
    pytest.importorskip("asammdf")
    folder, _ = drive
    path = tmp_path / "samples.mf4"
    assert main(["replay", str(folder / "drive.log"), "--samples", str(path)]) == 0
    a, b = read_table(folder / "samples.csv").samples, read_table(path).samples
    np.testing.assert_array_equal(np.diff(a.t_us), np.diff(b.t_us))
    np.testing.assert_allclose(a.slip, b.slip, atol=1e-9)
    assert main(["check", str(path)]) == 0
    assert main(["replay", str(path)]) == 2
    assert "a table of samples, not a recording" in capsys.readouterr().err


def test_an_unknown_format_is_an_error_before_the_work(drive, tmp_path, capsys):
    folder, _ = drive
    assert main(["replay", str(folder / "drive.log"), "--samples", str(tmp_path / "s.xls")]) == 2
    assert "--samples" in capsys.readouterr().err


@pytest.mark.costly
def test_the_table_of_setpoints_has_speed_and_creep_setpoint(drive, tmp_path):
    folder, _ = drive
    path = tmp_path / "t.csv"
    assert main(["replay", str(folder / "drive.log"), "--table", str(path)]) == 0
    with path.open() as file:
        rows = [row for row in csv.DictReader(file) if row["status"] == "TRACKING"]
    for row in rows[::50]:
        creep, lambda_m = float(row["creep_speed_setpoint_mps"]), float(row["lambda_m"])
        speed = float(row["speed_mps"])
        assert 0.3 * lambda_m * speed < creep <= lambda_m * speed * 1.001
