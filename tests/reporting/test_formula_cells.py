"""Cells of CSV that a spreadsheet would compute: text for it, and the same names for us."""

import csv
import gzip

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.cli.main import main
from adhesion_can.formula_cells import quote_formula, unquote_formula
from adhesion_can.recordings.tables.csv_file import heading_of, read_csv
from adhesion_can.recordings.tables.text import read_head
from adhesion_can.reporting.export import open_table
from adhesion_can.reporting.export.layout import Field, FieldColumn
from tests.test_printable import log_file

DANGEROUS = ("=cmd|'/C calc'!A0", "+1+1", "-1+1", "@SUM A1", "＝1+1", "'=1", "''@x")
HARMLESS = ("-1.5", "+2e3", "-1,5", "speed", "'quoted'", "a=b", "1+1", "", "μ")
KCD = """<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0"><Document/>
<Bus name="b"><Message id="0x101" name="=cmd|x" length="8">
<Signal name="@HYPER" offset="0" length="16"><LabelSet><Label name="+1" value="7"/></LabelSet>
</Signal></Message></Bus></NetworkDefinition>"""


@pytest.mark.parametrize("cell", DANGEROUS)
def test_a_formula_gets_an_apostrophe(cell):
    assert quote_formula(cell) == f"'{cell}"
    assert unquote_formula(quote_formula(cell)) == cell


@pytest.mark.parametrize("cell", HARMLESS)
def test_other_cells_stay(cell):
    assert quote_formula(cell) == cell
    assert unquote_formula(cell) == cell


@given(st.text(alphabet="'=+-@a1.") | st.text())
def test_every_name_comes_back(cell):
    quoted = quote_formula(cell)
    assert unquote_formula(quoted) == cell
    assert quoted[:1] not in ("=", "@")


def written(path, names, *, keep=False):
    fields = tuple(Field(name) for name in ("slip", "adhesion", *names))
    texts = Field("text", np.dtype(np.uint8), names={0.0: "=1+1", 1.0: "-1.5"}, text=True)
    with open_table(path, (*fields, texts), {}, keep_formulas=keep) as write:
        numbers = [FieldColumn(np.array([-0.5, 0.25])) for _ in fields]
        codes = FieldColumn(np.array([0, 1], np.uint8))
        write(np.array([0, 10**9]), [*numbers, codes])
    return path


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz"])
def test_a_table_reads_back_as_it_was(tmp_path, name):
    path = written(tmp_path / name, DANGEROUS)
    assert tuple(heading_of(read_head(path), (), path)) == (
        "time_s",
        "slip",
        "adhesion",
        *DANGEROUS,
        "text",
    )
    columns = read_csv(path)
    assert list(columns.values) == ["time_s", "slip", "adhesion", *DANGEROUS, "text"]
    assert columns.values["text"] == ("=1+1", "-1.5")
    assert columns.values[DANGEROUS[0]].tolist() == [-0.5, 0.25]
    packed = path.read_bytes()
    text = (gzip.decompress(packed) if name.endswith(".gz") else packed).decode()
    rows = list(csv.reader(text.splitlines()))
    assert not any(cell[:1] in ("=", "@") for row in rows for cell in row)
    assert rows[1][1] == "-0.5"


def test_they_can_be_kept(tmp_path):
    text = written(tmp_path / "a.csv", ["=1+1"], keep=True).read_text()
    assert ",=1+1," in text
    assert "'" not in text


@pytest.mark.parametrize("out", ["a.csv", "folder/", "raster.csv"])
@pytest.mark.parametrize("keep", [False, True])
def test_convert_quotes_names_and_texts(tmp_path, out, keep):
    log, database = log_file(tmp_path / "a.log"), tmp_path / "a.kcd"
    database.write_text(KCD)
    words = ["convert", log, "--dbc", database, "--out", f"{tmp_path}/{out}"]
    words += ["--format", "csv"] if out.endswith("/") else []
    words += ["--raster", "100ms"] if out == "raster.csv" else []
    words += ["--csv-formulas", "keep"] if keep else []
    assert main([str(word) for word in words]) == 0
    (path,) = tmp_path.glob("folder/*.csv") if out.endswith("/") else [tmp_path / out]
    with path.open(newline="") as file:
        cells = {cell for row in csv.reader(file) for cell in row}
    bad = {cell for cell in cells if cell[:1] in ("=", "@", "+")}
    assert bool(bad) == keep


def test_a_name_is_refused_where_there_is_none(tmp_path, capsys):
    log, database = log_file(tmp_path / "a.log"), tmp_path / "a.kcd"
    for word in ("=cmd|x", "@HYPER"):
        database.write_text(KCD.replace(word, " "))
        for out in ("a.mf4", "a.csv"):
            done = main(["convert", str(log), "--dbc", str(database), "--out", f"{tmp_path}/{out}"])
            assert done == 2
            error = capsys.readouterr().err
            assert "name; give it one in the database" in error
            assert error.count("\n") == 1
