"""Rows of setpoints with a doubt, in every format of `replay --table`."""

import csv

import numpy as np
import pytest
from asammdf import MDF
from pyarrow import parquet

from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status
from adhesion_can.reporting.setpoints import COLUMNS, setpoint_row, setpoint_table
from adhesion_can.service.outputs import Outputs, Setpoint

DOUBTS = [*Doubt, Doubt.NONE, Doubt.NOT_AVAILABLE]
OBJECTIONS = ["SPEED_JUMP" if doubt is Doubt.SPEED else "NONE" for doubt in DOUBTS]
NAMES = [None if doubt is Doubt.NOT_AVAILABLE else doubt.name for doubt in DOUBTS]


def outputs(doubt):
    return Outputs(
        Status.TRACKING,
        Setpoint(0.3, 0.05, 0.4),
        {1: Setpoint(0.31, 0.06, 0.4)},
        (0.4, 60.0, 0.3),
        0.01,
        0.002,
        12.5,
        doubt,
        None if doubt is Doubt.NOT_AVAILABLE else "polach",
        objection=Objection.SPEED_JUMP if doubt is Doubt.SPEED else Objection.NONE,
    )


def write(path, doubts):
    with setpoint_table(path, {}) as add:
        for place, doubt in enumerate(doubts):
            add(10**12 + 20_000 * place, outputs(doubt))
    return path


def test_doubt_family_and_objection_are_the_last_columns_and_move_no_other():
    names = [column.field.name for column in COLUMNS]
    assert names[-3:] == ["doubt", "family", "objection"]
    rows = [setpoint_row(outputs(doubt)) for doubt in DOUBTS]
    for numbers, doubt in zip(rows, DOUBTS, strict=True):
        np.testing.assert_array_equal(numbers[:-3], rows[0][:-3])
        row = dict(zip(names, numbers, strict=True))
        missing = doubt is Doubt.NOT_AVAILABLE
        assert row["doubt"] == doubt or (np.isnan(row["doubt"]) and missing)
        assert np.isnan(row["family"]) == missing
        assert row["objection"] == (doubt is Doubt.SPEED)


def test_csv_names_each_doubt_and_leaves_empty_what_is_not_available(tmp_path):
    with write(tmp_path / "t.csv", DOUBTS).open() as file:
        rows = list(csv.DictReader(file))
    assert [row["doubt"] for row in rows] == [name or "" for name in NAMES]
    assert [row["family"] for row in rows] == ["polach" if name else "" for name in NAMES]
    assert [row["objection"] for row in rows] == OBJECTIONS
    assert {row["mu_max_ax1"] for row in rows} == {"0.31"}


def test_parquet_names_each_doubt_and_has_null_where_not_available(tmp_path):
    table = parquet.read_table(write(tmp_path / "t.parquet", DOUBTS))
    assert table.column_names[-3:] == ["doubt", "family", "objection"]
    assert table.column("family").to_pylist() == ["polach" if name else None for name in NAMES]
    assert table.column("doubt").to_pylist() == NAMES
    assert table.column("objection").to_pylist() == OBJECTIONS


def test_mf4_names_each_doubt_and_marks_what_is_not_available_as_invalid(tmp_path):
    with MDF(write(tmp_path / "t.mf4", DOUBTS)) as mdf:
        shown = [word.decode() for word in mdf.get("doubt").samples]
        every = mdf.get("doubt", ignore_invalidation_bits=True).samples
    assert shown == [name for name in NAMES if name]
    # A reader that knows no invalidation bits must not find 'NONE' there.
    assert [word.decode() for word in every] == [doubt.name for doubt in DOUBTS]


@pytest.mark.parametrize("suffix", ["csv", "parquet", "mf4"])
def test_a_table_without_any_doubt_is_written_all_the_same(tmp_path, suffix):
    path = write(tmp_path / f"t.{suffix}", [Doubt.NOT_AVAILABLE] * 3)
    if suffix == "mf4":
        with MDF(path) as mdf:
            assert len(mdf.get("doubt").samples) == 0
            assert len(mdf.get("mu_max").samples) == 3
    elif suffix == "parquet":
        assert parquet.read_table(path).column("doubt").to_pylist() == [None] * 3
    else:
        ends = [line.split(",")[-3:] for line in path.read_text().splitlines()[1:]]
        assert ends == [["", "", "NONE"]] * 3


def test_the_source_of_an_observed_speed_is_a_further_column(tmp_path):
    path = tmp_path / "t.csv"
    with setpoint_table(path, {}, speed_observed=True) as add:
        add(0, Outputs(speed_observed=False))
        add(20_000, Outputs(speed=10.0, speed_observed=True))
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["time_s", *(c.field.name for c in COLUMNS), "speed_source"]
    assert [row["speed_source"] for row in rows] == ["", "observed"]
    with write(tmp_path / "plain.csv", DOUBTS).open() as file:
        assert "speed_source" not in next(csv.reader(file))
