"""`convert --raster`: all signals on one time base, beside the rows of the frames themselves."""

import csv
import json

import numpy as np
import pytest

from adhesion_can.cli.main import main
from adhesion_can.reporting.export.raster import parse_raster
from tests.cli.test_commands import fails


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("raster") / "drive.log"
    assert main(["simulate", "--scenario", "dry", "--duration", "2", "--log", str(path)]) == 0
    lines = path.read_text().splitlines()
    # A second without vehicle speed: 0x111 each 20 ms.
    kept = [x for x in lines if not ("111#" in x and 0.5 < float(x[1:].split(")")[0]) % 10 < 1.5)]
    assert len(kept) < len(lines)
    path.write_text("\n".join(kept) + "\n")
    return path


def columns(path):
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {
        name: np.array([float(r[name]) if r[name] else np.nan for r in rows]) for name in rows[0]
    }


SIGNALS = ["WheelSpeed_Ax1", "VehicleSpeed.VehicleSpeed", "AxleLoad_Ax2"]


def test_each_signal_holds_its_last_value_for_three_cycles(log, tmp_path):
    """Against the rows of the frames, with loops of the test's own."""
    frames, table = tmp_path / "frames.csv", tmp_path / "table.csv"
    assert main(["convert", str(log), "--out", str(frames), "--signals", *SIGNALS]) == 0
    out = ["convert", str(log), "--out", str(table), "--raster", "25ms", "--signals", *SIGNALS]
    assert main(out) == 0
    with frames.open() as file:
        rows = list(csv.DictReader(file))
    found = columns(table)
    names = [name for name in found if name != "time_s"]
    assert names == [
        "WheelSpeeds1.WheelSpeed_Ax1", "VehicleSpeed.VehicleSpeed", "AxleLoads1.AxleLoad_Ax2",
    ]  # fmt: skip
    assert np.diff(found["time_s"]) == pytest.approx(0.025)
    cycle_s = dict(zip(names, (0.010, 0.020, 0.200), strict=True))
    for name in names:
        readings = [(float(r["time_s"]), float(r[name])) for r in rows if r[name]]
        for now, value in zip(found["time_s"], found[name], strict=True):
            before = [(t, x) for t, x in readings if t <= now + 1e-9]
            if before and now - before[-1][0] <= 3 * cycle_s[name] + 1e-9:
                assert value == before[-1][1]
            else:
                assert np.isnan(value)
    assert np.isnan(found["VehicleSpeed.VehicleSpeed"]).sum() > 20


def test_the_report_is_that_of_one_pass(log, tmp_path):
    plain, even = tmp_path / "plain.json", tmp_path / "even.json"
    main(["convert", str(log), "--out", str(tmp_path / "a.csv"), "--json", str(plain)])
    raster = ["--raster", "10ms", "--json", str(even)]
    main(["convert", str(log), "--out", str(tmp_path / "b.csv"), *raster])
    one, other = (json.loads(path.read_text()) for path in (plain, even))
    assert one["messages"] == other["messages"]
    assert one["frames"] == other["frames"]


def test_parquet_has_the_same_table(log, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="Parquet needs pyarrow")
    words = ["convert", str(log), "--raster", "50ms", "--out"]
    for name in ("t.csv", "t.parquet"):
        assert main([*words, str(tmp_path / name), "--signals", *SIGNALS]) == 0
    table = parquet.read_table(tmp_path / "t.parquet").to_pydict()
    for name, values in columns(tmp_path / "t.csv").items():
        other = np.array([np.nan if x is None else x for x in table[name]], dtype=float)
        assert other == pytest.approx(values, abs=1e-6, nan_ok=True)


@pytest.mark.parametrize(
    ("text", "step_ns"), [("10ms", 10**7), ("0.5s", 5 * 10**8), ("20us", 20_000)]
)
def test_times(text, step_ns):
    assert parse_raster(text) == step_ns


@pytest.mark.parametrize("text", ["10", "ms", "0ms", "-1s", "nan s", "10min"])
def test_what_is_no_time_is_refused(text, log, tmp_path, capsys):
    words = ["convert", str(log), "--out", str(tmp_path / "x.csv"), f"--raster={text}"]
    assert "such as 10ms" in fails(capsys, *words)
    assert not (tmp_path / "x.csv").exists()
