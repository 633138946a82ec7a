"""Tables of samples: CSV, packed CSV and Parquet."""

import gzip

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.errors import TableError
from adhesion_can.recordings.tables import text as table_text
from adhesion_can.recordings.tables.sample_table import is_table, read_table

ROWS = [
    # time_s, slip, adhesion
    (0.0, 0.01, 0.10),
    (0.01, 0.02, 0.20),
    (0.02, -0.03, -0.25),
]


def csv_of(path, header, rows, *, end="\n"):
    lines = [",".join(header), *(",".join(map(str, row)) for row in rows)]
    path.write_bytes((end.join(lines) + end).encode())
    return path


def simple(path, **others):
    """A table of three rows with further columns."""
    header = ["time_s", "slip", "adhesion", *others]
    rows = [(*row, *(column[i] for column in others.values())) for i, row in enumerate(ROWS)]
    return csv_of(path, header, rows)


def parquet_of(path, **columns):
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")
    pq.write_table(pa.table(columns), path)
    return path


def refused(path, *parts, read=read_table):
    with pytest.raises(TableError) as caught:
        read(path)
    error = caught.value
    message = str(error)
    assert len(message.splitlines()) == 1
    assert len(message) < 500
    assert path.name in message
    assert error.fix
    assert message == f"{error.where}: {error.what}; {error.fix}"
    for part in parts:
        assert part in message, message


def only_our_own_error(read, path):
    """Whatever is in the file, the outcome is a result or one line."""
    try:
        read(path)
    except TableError as error:
        message = str(error)
    else:
        return
    assert len(message.splitlines()) == 1


# --- what is a table -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("header", "wanted"),
    [
        ("time_s,slip,adhesion", True),
        (" time_s , slip ,adhesion", True),
        ("time_s,slip,arbitration_id", True),
        ("timestamp,arbitration_id,extended,remote,error,dlc,data", False),
        ('"time_s","slip","adhesion"', True),
        ('"timestamp","arbitration_id"', False),
        ("\ufefftime_s,slip,adhesion", True),
        ("slip,time_s,adhesion", True),
        ("\ufeffslip,time_s,adhesion", True),
    ],
)
def test_a_csv_is_a_table_by_its_slip_column(tmp_path, header, wanted):
    for name, end in (("a.csv", "\n"), ("a.CSV", "\r\n"), ("v1.2.csv", ""), ("a.b.csv", "\n")):
        path = tmp_path / name
        path.write_bytes((header + end).encode())
        assert is_table(path) is wanted
        packed = tmp_path / f"{name}.gz"
        packed.write_bytes(gzip.compress((header + end).encode()))
        assert is_table(packed) is wanted


@pytest.mark.parametrize("header", ["time_s,adhesion", "time;slipp;mu", "", "slippage,id", "1,2,3"])
def test_a_csv_that_is_neither_is_an_error(tmp_path, header):
    path = tmp_path / "a.csv"
    path.write_text(header + "\n1,2\n")
    refused(path, "slip", "arbitration_id", read=is_table)


def test_the_content_decides_whatever_the_name(tmp_path):
    for name in ("a.log", "a.asc", "a.dat", "a", "a.tsv", "2024.05.01"):
        path = tmp_path / name
        path.write_text("slip,time_s,adhesion\n")
        assert is_table(path) is True, name
        path.write_text("(0.000000) can0 123#00\nslip,time_s,adhesion\n")
        assert is_table(path) is False, name
        path.write_bytes(b"slip,time_s,adhesion\n\0")
        assert is_table(path) is False, name
    for name in ("a.parquet", "a.PARQUET", "b.c.parquet"):
        assert is_table(tmp_path / name) is True, name


@pytest.mark.parametrize(
    "content",
    [
        b"time_s,slip,adhesion\r0,0.1,0.2\r1,0.2,0.3\r",
        b"x" * 200_000,
        b"\x00" * 200_000,
        b'"' + b"slip," * 50_000,
        b'time_s,"slip',
        bytes(range(256)) * 10,
    ],
    ids=["CR alone", "a long word", "zeros", "open quote", "cut quote", "bytes"],
)
def test_a_csv_that_is_no_csv_raises_our_own_error_alone(tmp_path, content):
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    only_our_own_error(is_table, path)
    only_our_own_error(read_table, path)


def test_a_missing_csv_is_named(tmp_path):
    refused(tmp_path / "gone.csv", "No such file", read=is_table)
    refused(tmp_path / "gone.csv", "No such file")
    refused(tmp_path / "gone.parquet")


# --- reading -------------------------------------------------------------------------------------


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_table_of_adhesion(tmp_path, end):
    path = csv_of(tmp_path / "a.csv", ["time_s", "slip", "adhesion"], ROWS, end=end)
    table = read_table(path)
    assert (table.rows, table.left_out, table.ignored, table.segment) == (3, 0, (), None)
    samples = table.samples
    assert samples.t_us.tolist() == [0, 10_000, 20_000]
    assert samples.slip.tolist() == [0.01, 0.02, -0.03]
    assert samples.adhesion.tolist() == [0.10, 0.20, -0.25]
    assert samples.axle.tolist() == [0, 0, 0]
    assert samples.load.tolist() == samples.speed.tolist() == [1, 1, 1]
    assert samples.covariates == {}


def test_adhesion_is_force_over_load(tmp_path):
    header = ["time_s", "slip", "longitudinal_force_N", "normal_load_N"]
    rows = [(0, 0.1, 300, 1000), (1, 0.2, -500, 2000), (2, 0.3, 100, 0), (3, 0.4, 100, -5)]
    table = read_table(csv_of(tmp_path / "a.csv", header, rows))
    assert table.samples.adhesion.tolist() == [0.3, -0.25]
    assert table.samples.load.tolist() == [1000, 2000]
    assert (table.rows, table.left_out) == (4, 2), "no adhesion without load"


def test_a_stated_adhesion_is_taken_before_force_over_load(tmp_path):
    path = simple(tmp_path / "a.csv", longitudinal_force_N=[1, 2, 3], normal_load_N=[10, 20, 30])
    samples = read_table(path).samples
    assert samples.adhesion.tolist() == [0.10, 0.20, -0.25]
    assert samples.load.tolist() == [10, 20, 30]


def test_speed_axle_and_segment_are_known_and_the_rest_are_covariates(tmp_path):
    path = simple(
        tmp_path / "a.csv",
        speed_mps=[10, 20, 30],
        axle=[1, 2, 3],
        segment=[7, 7, 9],
        rail_temp_C=[1.5, "", -3],
        driver=["Ann", "Bob", "Cy"],
    )
    table = read_table(path)
    samples = table.samples
    assert samples.speed.tolist() == [10, 20, 30]
    assert samples.creep_speed.tolist() == pytest.approx([0.1, 0.4, -0.9])
    assert samples.axle.tolist() == [1, 2, 3]
    assert table.segment.tolist() == [0, 0, 1]
    assert list(samples.covariates) == ["rail_temp_C"]
    assert samples.covariates["rail_temp_C"][[0, 2]].tolist() == [1.5, -3]
    assert np.isnan(samples.covariates["rail_temp_C"][1])
    assert table.ignored == ("driver",)


@pytest.mark.parametrize(
    "cells", [("nan", 0.1, 0.2), (0, "NaN", 0.2), (0, 0.1, ""), (0, "inf", 0.2), (0, 0.1, "-inf")]
)
def test_rows_without_a_finite_number_are_left_out_and_counted(tmp_path, cells):
    path = csv_of(
        tmp_path / "a.csv",
        ["time_s", "slip", "adhesion", "other"],
        [
            (*ROWS[0], 5),
            (*cells, 6),
            (*ROWS[1], 7),
        ],
    )
    table = read_table(path)
    assert (table.rows, table.left_out) == (3, 1)
    assert table.samples.slip.tolist() == [0.01, 0.02]
    assert table.samples.covariates["other"].tolist() == [5, 7], "columns stay together"


@pytest.mark.parametrize("stamp", ["1e18", "-1e300", "9.1e9"])
def test_a_stamp_that_is_no_time_is_left_out(tmp_path, stamp):
    path = csv_of(tmp_path / "a.csv", ["time_s", "slip", "adhesion"], [*ROWS, (stamp, 0.1, 0.1)])
    assert read_table(path).left_out == 1


def test_blank_lines_and_quoted_cells_are_read(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(
        '"time_s","slip","adhesion","note"\n\n0,0.1,0.2,"a, b"\n , ,\t, \n1,"0.2",0.3,"c\nd"\n'
    )
    assert is_table(path)
    table = read_table(path)
    assert table.samples.slip.tolist() == [0.1, 0.2]
    assert table.ignored == ("note",)


def test_a_byte_order_mark_is_no_part_of_the_first_name(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes("\ufefftime_s,slip,adhesion\n0,0.1,0.2\n".encode())
    assert len(read_table(path).samples) == 1


def test_rows_without_a_time_have_one_stamp(tmp_path):
    table = read_table(csv_of(tmp_path / "a.csv", ["slip", "adhesion"], [(0.1, 0.2), (0.2, 0.3)]))
    assert table.samples.t_us.tolist() == [0, 0]
    assert table.samples.adhesion.tolist() == [0.2, 0.3]


# --- what cannot be read -------------------------------------------------------------------------


@pytest.mark.parametrize("missing", ["slip", "adhesion"])
def test_a_missing_column_is_named(tmp_path, missing):
    header = [name for name in ("time_s", "slip", "adhesion") if name != missing]
    refused(csv_of(tmp_path / "a.csv", header, [(1, 2)]), missing)


@pytest.mark.parametrize("given_one", ["longitudinal_force_N", "normal_load_N"])
def test_force_without_load_does_not_do(tmp_path, given_one):
    path = csv_of(tmp_path / "a.csv", ["time_s", "slip", given_one], [(0, 0.1, 5)])
    refused(path, "adhesion", "longitudinal_force_N", "normal_load_N")


@pytest.mark.parametrize("text", ["time_s", "slip", "adhesion"])
def test_a_needed_column_of_text_is_named(tmp_path, text):
    header = ["time_s", "slip", "adhesion"]
    rows = [tuple("n/a" if name == text else 0.1 for name in header)]
    refused(csv_of(tmp_path / "a.csv", header, rows), text, "numeric")


@pytest.mark.parametrize("row", ["0,0.1", "0,0.1,0.2,0.3", "0"])
def test_a_ragged_row_is_named_by_its_line(tmp_path, row):
    path = tmp_path / "a.csv"
    path.write_text(f"time_s,slip,adhesion\n0,0.1,0.2\n\n{row}\n")
    refused(path, "a.csv:4", "3 columns")


@pytest.mark.parametrize(
    "content", ["", "\n", "time_s,slip,adhesion\n", "time_s,slip,adhesion\n\n"]
)
def test_a_table_without_rows_is_an_error(tmp_path, content):
    path = tmp_path / "a.csv"
    path.write_text(content)
    refused(path)


def test_a_table_without_a_usable_row_is_an_error(tmp_path):
    path = csv_of(tmp_path / "a.csv", ["time_s", "slip", "adhesion"], [("nan", 1, 1), (1, "", 1)])
    refused(path, "finite")


@pytest.mark.parametrize("share", [0.1, 0.6, 0.95])
def test_a_truncated_packed_table_is_an_error(tmp_path, share):
    text = "time_s,slip,adhesion\n" + "".join(f"{i},{i / 997},{i / 1009}\n" for i in range(500))
    packed = gzip.compress(text.encode())
    path = tmp_path / "a.csv.gz"
    path.write_bytes(packed[: int(len(packed) * share)])
    refused(path, "gzip")
    refused(path, "gzip", read=is_table)


def test_packed_and_plain_are_the_same(tmp_path):
    plain = simple(tmp_path / "a.csv", temp=[1, 2, 3])
    packed = tmp_path / "b.csv.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    assert_same(read_table(plain), read_table(packed))


def assert_same(a, b):
    for name in ("t_us", "axle", "slip", "adhesion", "creep_speed", "speed", "load"):
        np.testing.assert_array_equal(getattr(a.samples, name), getattr(b.samples, name))
    assert a.samples.covariates.keys() == b.samples.covariates.keys()
    for name, column in a.samples.covariates.items():
        np.testing.assert_array_equal(column, b.samples.covariates[name])
    assert (a.rows, a.left_out, a.ignored) == (b.rows, b.left_out, b.ignored)
    if a.segment is None or b.segment is None:
        assert a.segment is b.segment
    else:
        np.testing.assert_array_equal(a.segment, b.segment)


@pytest.mark.parametrize("cell", ["inf", "1e300", "-inf", "nan"])
@pytest.mark.parametrize("column", ["axle", "segment", "speed_mps", "normal_load_N", "other"])
def test_odd_numbers_in_optional_columns_neither_crash_nor_warn(tmp_path, column, cell):
    path = simple(tmp_path / "a.csv", **{column: [1, cell, 2]})
    try:
        table = read_table(path)
    except TableError:
        return
    assert len(table.samples) + table.left_out == 3


# --- Parquet -------------------------------------------------------------------------------------


def test_parquet_equals_csv(tmp_path):
    columns = {
        "time_s": [0.0, 0.5, None, 1.5],
        "slip": [0.1, 0.2, 0.3, 0.4],
        "longitudinal_force_N": [100, 200, 300, 400],
        "normal_load_N": [1000.0, 1000.0, 1000.0, 0.0],
        "speed_mps": [1.0, 2.0, 3.0, 4.0],
        "axle": [1, 2, 3, 4],
        "segment": [1, 1, 2, 2],
        "sanding": [True, False, True, None],
        "driver": ["a", "b", None, "d"],
    }
    parquet = read_table(parquet_of(tmp_path / "a.parquet", **columns))
    rows = zip(*columns.values(), strict=True)
    cells = [
        ["" if v is None else int(v) if v in (True, False) else v for v in row] for row in rows
    ]
    csv = read_table(csv_of(tmp_path / "a.csv", list(columns), cells))
    assert_same(parquet, csv)
    assert parquet.samples.adhesion.tolist() == [0.1, 0.2]
    assert (parquet.rows, parquet.left_out, parquet.ignored) == (4, 2, ("driver",))


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_parquet_stamps_may_be_dates_and_spans(tmp_path, unit):
    days = np.array(["2024-01-01", "2024-01-02"], f"datetime64[{unit}]")
    for stamps, first in ((days, 1_704_067_200), (days - days[0], 0)):
        path = parquet_of(
            tmp_path / "a.parquet", time_s=stamps, slip=[0.1, 0.2], adhesion=[0.2, 0.3]
        )
        expected = [first * 1_000_000, (first + 86_400) * 1_000_000]
        assert read_table(path).samples.t_us.tolist() == expected


def test_parquet_without_columns_or_rows_is_an_error(tmp_path):
    refused(parquet_of(tmp_path / "a.parquet", time_s=[1.0], slip=[0.1]), "adhesion")
    empty = np.array([], float)
    refused(parquet_of(tmp_path / "b.parquet", time_s=empty, slip=empty, adhesion=empty))


@pytest.mark.parametrize(
    "content", [b"", b"PAR1", b"PAR1" + bytes(100) + b"PAR1", b"time_s,slip\n"]
)
def test_what_is_no_parquet_is_an_error(tmp_path, content):
    pytest.importorskip("pyarrow")
    path = tmp_path / "a.parquet"
    path.write_bytes(content)
    refused(path, "Parquet")


def test_a_damaged_parquet_raises_our_own_error_alone(tmp_path):
    values = np.linspace(0.0, 1.0, 200)
    whole = parquet_of(tmp_path / "a.parquet", time_s=values, slip=values, adhesion=values)
    content = whole.read_bytes()
    rng = np.random.default_rng(3)
    for i in range(40):
        broken = bytearray(content)
        for position in rng.integers(0, len(broken), 3):
            broken[position] ^= int(rng.integers(1, 256))
        path = tmp_path / f"b{i}.parquet"
        path.write_bytes(broken[: rng.integers(10, len(broken))] if i % 4 == 0 else broken)
        only_our_own_error(read_table, path)


# --- anything at all -----------------------------------------------------------------------------

cells = st.one_of(
    st.floats(allow_nan=True).map(repr),
    st.integers(-(10**30), 10**30).map(str),
    st.sampled_from(["", " ", "x", '"', '"a,b"', "1e400", "-0", "1_0", "0x10", "٣", "\x00", "\r"]),
)
headers = st.lists(
    st.sampled_from(
        ["time_s", "slip", "adhesion", "normal_load_N", "longitudinal_force_N", "axle", "segment",
         "speed_mps", "x", "", " slip ", '"slip"', "#"]
    ),
    max_size=6,
)  # fmt: skip


@pytest.mark.filterwarnings("ignore:overflow encountered", "ignore:invalid value encountered")
@settings(max_examples=150, deadline=None)
@given(
    header=st.one_of(st.just(["time_s", "slip", "adhesion", "axle"]), headers),
    rows=st.lists(st.lists(cells, max_size=5), max_size=5),
    packed=st.booleans(),
)
def test_any_text_gives_a_table_or_our_own_error(tmp_path_factory, header, rows, packed):
    text = "\n".join([",".join(header), *(",".join(row) for row in rows)])
    path = tmp_path_factory.getbasetemp() / ("any.csv.gz" if packed else "any.csv")
    path.write_bytes(gzip.compress(text.encode()) if packed else text.encode())
    for read in (is_table, read_table):
        only_our_own_error(read, path)


@settings(max_examples=60, deadline=None)
@given(
    rows=st.lists(
        st.tuples(st.floats(0, 1e6), st.floats(-1, 1), st.floats(-1, 1), st.floats(-50, 60)),
        min_size=1,
        max_size=20,
    )
)
def test_numbers_come_back_to_the_last_bit(tmp_path_factory, rows):
    path = tmp_path_factory.getbasetemp() / "exact.csv"
    rows.sort(key=lambda row: row[0])
    csv_of(path, ["time_s", "slip", "adhesion", "temp"], [map(repr, row) for row in rows])
    samples = read_table(path).samples
    # What is smaller than anything that is measured counts as 0.
    rows = [[x if abs(x) >= 1e-30 else 0.0 for x in row] for row in rows]
    assert samples.slip.tolist() == [row[1] for row in rows]
    assert samples.adhesion.tolist() == [row[2] for row in rows]
    assert samples.covariates["temp"].tolist() == [row[3] for row in rows]
    assert samples.t_us.tolist() == [round(row[0] * 1e6) for row in rows]


def test_a_number_that_nothing_measures_is_missing_or_0(tmp_path):
    path = tmp_path / "t.csv"
    rows = [("0.1", "1e200"), ("1e-200", "0.3"), ("0.1", "inf"), ("0.2", "-0.1")]
    csv_of(path, ["slip", "adhesion"], rows)
    table = read_table(path)
    assert table.samples.slip.tolist() == [0.0, 0.2]
    assert table.left_out == 2


@pytest.mark.parametrize("packed", [False, True])
def test_a_small_file_that_unpacks_to_much_is_refused(tmp_path, monkeypatch, packed):
    monkeypatch.setattr(table_text, "LARGEST_TEXT", 1 << 20)
    path = tmp_path / "a.csv"
    text = b"slip,adhesion\n" + b"0.1,0.2\n" * 200_000
    path.write_bytes(gzip.compress(text, 1) if packed else text)
    assert is_table(path)  # by its head
    with pytest.raises(TableError, match="more than 1 MiB of text; split it"):
        read_table(path)
