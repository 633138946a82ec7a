"""Tables as spreadsheets, loggers and MATLAB write them, and columns by name, unit and sign."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from adhesion_can.config import load_configuration
from adhesion_can.errors import ConfigError, InputError, TableError
from adhesion_can.recordings.tables.choice import ColumnChoice, parse_choice
from adhesion_can.recordings.tables.sample_table import is_table, read_table

ROWS = [(0.0, 0.01, 0.1), (0.5, 0.025, 0.2), (1.0, -0.03, -0.25)]
NAMES = ("time_s", "slip", "adhesion")


def written(path, delimiter=",", decimal=".", *, units=None, comment="", names=NAMES, rows=ROWS):
    lines = [comment] if comment else []
    lines.append(delimiter.join(names))
    if units:
        lines.append(delimiter.join(units))
    lines += [delimiter.join(str(v).replace(".", decimal) for v in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def slips(table):
    return table.samples.slip.tolist()


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|"])
@pytest.mark.parametrize("units", [None, ("s", "-", "-"), ("[s]", "[1]", "[1]")])
@pytest.mark.parametrize("comment", ["", "# rig 7\n% sweep 3", "// logger 2"])
def test_every_dialect_gives_the_same_numbers(tmp_path, delimiter, units, comment):
    for decimal in ".," if delimiter != "," else ".":
        path = written(tmp_path / "a.csv", delimiter, decimal, units=units, comment=comment)
        assert is_table(path)
        table = read_table(path)
        assert slips(table) == [0.01, 0.025, -0.03], (decimal, table.notes)
        assert table.samples.adhesion.tolist() == [0.1, 0.2, -0.25]
        assert table.samples.t_us.tolist() == [0, 500_000, 1_000_000]
        assert ("decimal commas" in " ".join(table.notes)) is (decimal == ",")


@settings(max_examples=60, deadline=None)
@given(
    rows=st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), min_size=1, max_size=8),
    delimiter=st.sampled_from([";", "\t", "|"]),
    decimal=st.sampled_from([".", ","]),
)
def test_numbers_of_any_dialect_come_back_to_the_last_bit(
    tmp_path_factory, rows, delimiter, decimal
):
    path = tmp_path_factory.getbasetemp() / "dialect.csv"
    rows.sort(key=lambda row: row[0])
    table = read_table(written(path, delimiter, decimal, rows=rows))
    # What is smaller than anything that is measured counts as 0.
    rows = [[x if abs(x) >= 1e-30 else 0.0 for x in row] for row in rows]
    assert slips(table) == [row[1] for row in rows]
    assert table.samples.adhesion.tolist() == [row[2] for row in rows]


def test_the_first_row_of_numbers_is_no_line_of_units(tmp_path):
    for row in [(0, 1, 1), ("", 0.1, 0.2), (1, 1, 1)]:
        table = read_table(written(tmp_path / "a.csv", rows=[row, *ROWS]))
        assert table.rows == 4, row


def test_units_in_the_heading_are_converted(tmp_path):
    names = ("time_s [ms]", "slip [%]", "longitudinal_force_N [kN]", "normal_load_N (t)",
             "speed_mps [km/h]")  # fmt: skip
    table = read_table(written(tmp_path / "a.csv", names=names, rows=[(500, 2.0, 5.0, 10.0, 36.0)]))
    samples = table.samples
    assert samples.t_us.tolist() == [500_000]
    assert slips(table) == [0.02]
    assert samples.load.tolist() == pytest.approx([98_066.5])
    assert samples.adhesion.tolist() == pytest.approx([5000 / 98_066.5])
    assert samples.speed.tolist() == pytest.approx([10.0])
    assert "slip from 'slip' in %" in table.notes


def test_a_line_of_units_is_converted_as_well(tmp_path):
    names = ("time_s", "slip", "adhesion", "speed_mps")
    rows = [(*row, 72.0) for row in ROWS]
    table = read_table(
        written(tmp_path / "a.csv", units=("s", "-", "-", "km/h"), names=names, rows=rows)
    )
    assert table.samples.speed.tolist() == pytest.approx([20.0] * 3)


def test_an_unknown_unit_names_those_that_are_known(tmp_path):
    path = written(tmp_path / "a.csv", names=("time_s", "slip", "adhesion", "speed_mps [knots]"),
                   rows=[(*row, 5.0) for row in ROWS])  # fmt: skip
    with pytest.raises(TableError, match=r"unit 'knots'.*km/h"):
        read_table(path)


def test_columns_are_named_with_unit_and_sign(tmp_path):
    path = written(tmp_path / "a.csv", names=("t", "kappa", "mu"), rows=[(1.5, -4.0, 0.3)])
    with pytest.raises(TableError, match="--column slip=ITS_NAME"):
        is_table(path)
    texts = ("time_s=t", "slip=kappa,unit=percent,sign=-1", "adhesion=mu")
    choices = [parse_choice(text) for text in texts]
    assert is_table(path, choices)
    table = read_table(path, choices)
    assert slips(table) == [0.04]
    assert table.samples.t_us.tolist() == [1_500_000]
    assert table.samples.covariates == {}


def test_a_column_that_is_nearly_named_is_told(tmp_path):
    path = written(tmp_path / "a.csv", names=("time_s", "Schlupf", "adhesion"))
    with pytest.raises(TableError, match=r"no column 'Schlup' for 'slip'; similar names: Schlupf"):
        is_table(path, [parse_choice("slip=Schlup")])


def test_columns_can_be_swapped(tmp_path):
    path = written(tmp_path / "a.csv", names=("time_s", "adhesion", "slip"))
    choices = [parse_choice("slip=adhesion"), parse_choice("adhesion=slip")]
    assert slips(read_table(path, choices)) == [0.01, 0.025, -0.03]


def test_a_chosen_column_that_is_not_there_lists_those_that_are(tmp_path):
    path = written(tmp_path / "a.csv")
    with pytest.raises(TableError, match=r"no column 'kappa' for 'slip'.*adhesion"):
        read_table(path, [ColumnChoice("slip", "kappa")])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("slip", "NAME=COLUMN"),
        ("=kappa", "NAME=COLUMN"),
        ("slip=kappa,percent", "unknown key"),
        ("slip=kappa,unit=knots", "unit 'knots'"),
        ("slip=kappa,sign=2", "sign '2'"),
        ("slip=kappa,late_s=soon", "late_s 'soon'"),
        ("slip=kappa,late_s=inf", "late_s inf"),
        ("x=y,unit=V", "none is known"),
    ],
)
def test_what_is_no_choice_is_an_error(text, says):
    with pytest.raises(InputError, match=says):
        parse_choice(text)


def test_the_configuration_file_names_columns(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(
        '[table]\nslip = { column = "kappa", unit = "%", sign = -1, late_s = 0.1 }\n'
        'adhesion = "mu"\n'
    )
    columns = load_configuration(path).columns
    assert columns == (ColumnChoice("slip", "kappa", "%", -1, 0.1), ColumnChoice("adhesion", "mu"))
    for text, says in (
        ('slip = { unit = "%" }', "names no column"),
        ('slip = { column = "k", unit = "knots" }', "unit 'knots'"),
        ("slip = 5", "not a table"),
        ('slip = { column = "k", units = "%" }', "unknown key"),
    ):
        path.write_text(f"[table]\n{text}\n")
        with pytest.raises(ConfigError, match=says):
            load_configuration(path)


# --- texts --------------------------------------------------------------------------------------


def test_texts_that_group_the_rows_are_channels(tmp_path):
    rows = [
        (k, 0.01 * k, 0.1, rail, f"row {k}")
        for k, rail in enumerate(itertools.chain(*[["dry"] * 6, ["wet"] * 5, ["oily"] * 2]))
    ]
    table = read_table(written(tmp_path / "a.csv", names=(*NAMES, "rail", "note"), rows=rows))
    covariates = table.samples.covariates
    assert set(covariates) == {"rail=dry", "rail=wet"}, "two rows of a text are no group"
    assert covariates["rail=wet"].tolist() == [0] * 6 + [1] * 5 + [0] * 2
    assert table.ignored == ("note",)


def test_segments_may_be_texts(tmp_path):
    rows = [(*row, name) for row, name in zip(ROWS, ("b", "b", "a"), strict=True)]
    table = read_table(written(tmp_path / "a.csv", names=(*NAMES, "segment"), rows=rows))
    assert table.segment.tolist() == [1, 1, 0]


def test_cells_without_a_value_are_empty(tmp_path):
    rows = [(*row, cell) for row, cell in zip(ROWS, ("n/a", "-", "3.5"), strict=True)]
    table = read_table(written(tmp_path / "a.csv", names=(*NAMES, "x"), rows=rows))
    assert np.isnan(table.samples.covariates["x"]).tolist() == [True, True, False]


def test_what_is_not_numeric_is_shown(tmp_path):
    path = written(tmp_path / "a.csv", rows=[*ROWS, (2.0, "low", 0.1)])
    with pytest.raises(TableError, match="it has 'low'"):
        read_table(path)


# --- other files --------------------------------------------------------------------------------


def test_utf_16_and_cp1252_are_read(tmp_path):
    text = "time_s\tslip\tadhesion\tµ°\n" + "\n".join("\t".join(map(str, (*r, 1))) for r in ROWS)
    for encoding in ("utf-16", "cp1252", "utf-8", "utf-8-sig"):
        path = tmp_path / "a.csv"
        path.write_bytes(text.encode(encoding))
        table = read_table(path)
        assert slips(table) == [0.01, 0.025, -0.03], encoding
        assert list(table.samples.covariates) == ["µ°"], encoding


def test_a_heading_in_the_last_comment_is_one(tmp_path):
    path = tmp_path / "a.csv"
    np.savetxt(path, np.array(ROWS), delimiter=",", header="time_s,slip,adhesion")
    assert is_table(path)
    assert slips(read_table(path)) == [0.01, 0.025, -0.03]


def test_line_numbers_are_those_of_the_file(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("# one\n# two\ntime_s;slip;adhesion\n0;0,1;0,2\n\n0;1\n")
    with pytest.raises(TableError, match=r"a\.csv:6: 2 fields under 3 columns"):
        read_table(path)


def test_matlab_files_are_read(tmp_path):
    path = tmp_path / "a.mat"
    time_s, slip, adhesion = map(np.array, zip(*ROWS, strict=True))
    savemat(path, {"rig": {"time_s": time_s, "slip": slip}, "adhesion": adhesion[:, None],
                   "name": "rig 7", "calibration": np.arange(5.0)})  # fmt: skip
    assert is_table(path)
    table = read_table(path)
    assert slips(table) == [0.01, 0.025, -0.03]
    assert table.samples.adhesion.tolist() == [0.1, 0.2, -0.25]
    assert "not used, since their length differs: calibration" in table.notes


@pytest.mark.parametrize("content", [b"", b"MATLAB 5.0", b"\x00" * 300, b"time_s,slip\n1,2\n"])
def test_what_is_no_matlab_file_is_an_error(tmp_path, content):
    path = tmp_path / "a.mat"
    path.write_bytes(content)
    with pytest.raises(TableError, match=r"MATLAB|no vectors"):
        read_table(path)


def test_a_matlab_file_without_vectors_is_an_error(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"x": 1.0})
    with pytest.raises(TableError, match="no vectors"):
        read_table(path)
