"""`replay --table`: the same rows in CSV, Parquet and MF4."""

import csv

import numpy as np
import pytest
from asammdf import MDF
from pyarrow import parquet

from adhesion_can.cli.main import main
from adhesion_can.recordings.candump import format_frame
from tests.wire import Bench


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """Tables of a drive of 3 s that stops for a while: there are values, and times without."""
    folder = tmp_path_factory.mktemp("tables")
    bench, log = Bench(), folder / "d.log"
    frames = [*bench.drive(10**12, 10**12 + 1_500_000)]
    frames += bench.drive(10**12 + 3_700_000, 10**12 + 5_000_000, slip=0.01)
    log.write_text("".join(map(format_frame, frames)))
    out = {suffix: folder / f"t.{suffix}" for suffix in ("csv", "parquet", "mf4")}
    for path in out.values():
        assert main(["replay", str(log), "--table", str(path)]) == 0
    return out


@pytest.fixture(scope="module")
def rows(tables):
    with tables["csv"].open() as file:
        return list(csv.DictReader(file))


def number(text):
    return float(text) if text else float("nan")


@pytest.mark.costly
def test_the_csv_is_that_of_the_contract(rows):
    assert list(rows[0])[:10] == [
        "time_s", "status", "mu_max", "mu_max_std", "lambda_m", "lambda_m_std", "c1", "c2", "c3",
        "surface_age_s",
    ]  # fmt: skip
    per_axle = [f"{n}_ax{i}" for n in ("mu_max", "lambda_m") for i in range(1, 7)]
    assert list(rows[0])[10:] == [
        *per_axle, "speed_mps", "creep_speed_setpoint_mps", "doubt", "family", "objection",
    ]  # fmt: skip
    assert len(rows) == 250
    assert rows[0]["time_s"] == "1000000.000000"
    assert {row["status"] for row in rows} >= {"INIT", "STALE_INPUT"}
    assert any(row["mu_max"] for row in rows)
    assert not rows[0]["mu_max"]


def test_parquet_has_the_same_rows_with_units(rows, tables):
    table = parquet.read_table(tables["parquet"])
    assert table.column("status").to_pylist() == [row["status"] for row in rows]
    assert table.column("doubt").to_pylist() == [row["doubt"] or None for row in rows]
    for name in table.column_names:
        if name in ("status", "doubt", "family", "objection", "time_ns"):
            continue
        values = [float("nan") if v is None else v for v in table.column(name).to_pylist()]
        np.testing.assert_allclose(values, [number(row[name]) for row in rows], rtol=1e-8)
    field = table.schema.field("surface_age_s")
    assert field.metadata[b"unit"] == b"s"
    assert b"maximum adhesion" in table.schema.field("mu_max").metadata[b"comment"]
    assert b"adhesion_can.version" in table.schema.metadata


@pytest.mark.costly
def test_mf4_has_the_same_rows_with_units(rows, tables):
    with MDF(tables["mf4"]) as mdf:
        status = [word.decode() for word in mdf.get("status").samples]
        assert status == [row["status"] for row in rows]
        doubt = [word.decode() for word in mdf.get("doubt").samples]
        assert doubt == [row["doubt"] for row in rows if row["doubt"]]
        signal = mdf.get("mu_max")  # without the samples that are marked as invalid
        expected = np.array([number(row["mu_max"]) for row in rows])
        stamps = np.array([float(row["time_s"]) for row in rows])
        told = np.isfinite(expected)
        np.testing.assert_allclose(signal.samples, expected[told], rtol=1e-8)
        np.testing.assert_allclose(signal.timestamps, (stamps - stamps[0])[told], atol=1e-9)
        assert mdf.get("surface_age_s").unit == "s"
    assert 0 < told.sum() < len(told)
