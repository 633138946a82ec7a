"""Cells, headings and times of tables, as spreadsheets and loggers of others write them.

One table of twelve rows is written in each way; its numbers must come back.
"""

import csv
import io
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.errors import TableError
from adhesion_can.recordings.tables.cells import NumberMark, decimal_marks, mark_of, number_column
from adhesion_can.recordings.tables.choice import parse_choice
from adhesion_can.recordings.tables.sample_table import is_table, read_table
from adhesion_can.recordings.tables.times import read_times

NAMES = ("time_s", "slip", "longitudinal_force_N", "normal_load_N")
ROWS = [
    (0.05 * n, 0.001 * (n + 1) * (-1) ** n, 1234.5 * (n + 1) * (-1) ** n, 60_000.5 + 100 * n)
    for n in range(12)
]
BEGIN = datetime(2024, 3, 1, 23, 59, 59, 800_000, tzinfo=UTC)


def number(value, decimals, *, point=".", thousands=""):
    text = f"{value:,.{decimals}f}"
    return text.replace(",", "\0").replace(".", point).replace("\0", thousands)


def cells(row, **marks):
    return [number(value, places, **marks) for value, places in zip(row, (3, 4, 1, 1), strict=True)]


def text_of(rows, delimiter=",", heading=NAMES, end="\n"):
    file = io.StringIO()
    writer = csv.writer(file, delimiter=delimiter, lineterminator=end)
    writer.writerow(heading)
    writer.writerows(rows)
    return file.getvalue()


PLAIN = [cells(row) for row in ROWS]
COMMAS = [cells(row, point=",") for row in ROWS]


def assert_is_the_table(path, rows=ROWS):
    assert is_table(path)
    samples = read_table(path).samples
    _, slip, force, load = np.array(rows).T
    np.testing.assert_allclose(samples.slip, np.round(slip, 4), rtol=1e-12)
    np.testing.assert_allclose(samples.adhesion, np.round(force, 1) / load, rtol=1e-12)
    np.testing.assert_allclose(samples.load, load, rtol=1e-12)
    np.testing.assert_allclose(np.diff(samples.t_us), 50_000, atol=1)
    return samples


def written(tmp_path, text, name="a.csv", encoding="utf-8"):
    path = tmp_path / name
    path.write_text(text, encoding=encoding, newline="")
    return path


WAYS = {
    "plain": text_of(PLAIN),
    "CR LF": text_of(PLAIN, end="\r\n"),
    "semicolons, decimal commas": text_of(COMMAS, ";"),
    "decimal commas in quotes between commas": text_of(COMMAS),
    "thousands as in English": text_of([cells(r, thousands=",") for r in ROWS]),
    "thousands as in German": text_of([cells(r, point=",", thousands=".") for r in ROWS], ";"),
    "thousands as in French": text_of([cells(r, point=",", thousands="\u202f") for r in ROWS], ";"),
    "thousands as in Switzerland": text_of([cells(r, thousands="'") for r in ROWS], ";"),
    "a minus of typographers": text_of(PLAIN).replace("-", "\u2212"),
    "a delimiter at the end of each row": text_of([[*row, ""] for row in COMMAS], ";"),
    "and at that of the heading": text_of([[*r, ""] for r in PLAIN], heading=(*NAMES, "")),
    "the delimiter said first": "sep=;\n" + text_of(COMMAS, ";"),
    "a title above": "Run 7; 12 psi, wet\n" + text_of(PLAIN, "\t"),
    "lines about the rig above": '"Format","Rig CSV"\n"Rate","20.0","Hz",,\n\n' + text_of(PLAIN),
    "names, units": text_of([("s", "-", "N", "N"), *PLAIN]),
    "names, units, kinds": text_of([("s", "none", "N", "N"), ("Raster",) * 4, *PLAIN]),
    "spaces": text_of(PLAIN, " "),
    "many spaces": "\n".join("   ".join(row) for row in [NAMES, *PLAIN]) + "\n",
    "a comment between the rows": text_of(PLAIN[:5])
    + "# slower now\n"
    + text_of(PLAIN).split("\n", 6)[6],
    "a line below": text_of(PLAIN) + "\nEnd of file\n",
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["a.csv", "a.tsv", "a.dat", "a.txt", "a"])
def test_every_way_of_writing_it_gives_the_same_table(tmp_path, way, name):
    assert_is_the_table(written(tmp_path, WAYS[way], name))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_encodings_with_a_mark(tmp_path, encoding):
    assert_is_the_table(written(tmp_path, WAYS["a minus of typographers"], encoding=encoding))


def test_percent_signs_are_a_unit(tmp_path):
    rows = [[r[0], f"{100 * float(r[1]):.2f}%", *r[2:]] for r in PLAIN]
    assert_is_the_table(written(tmp_path, text_of(rows)))


def test_whole_thousands_in_a_file_of_decimal_commas(tmp_path):
    """`1.989` alone is 1.989 in most files; beside decimal commas it is 1989."""
    rows = [(r[0], r[1], round(r[2], -1), round(r[3])) for r in ROWS]
    texts = [
        [*cells(r, point=",")[:2], *(number(x, 0, thousands=".") for x in r[2:])] for r in rows
    ]
    samples = read_table(written(tmp_path, text_of(texts, ";"))).samples
    assert samples.load.tolist() == [r[3] for r in rows]


@pytest.mark.parametrize(
    ("texts", "delimiter", "decimal"),
    [
        (["1.989", "60.000"], ",", "."),
        (["1,989", "60,000"], ";", ","),
        (["1.989,5", "60.000"], ";", ","),
        (["1,989.5", "60,000"], ";", "."),
        (["1.234.567"], ",", ","),
        (["1,234,567"], ";", "."),
        (["0,500"], ";", ","),
        (["0.500", "12.125"], ";", "."),
        (["1234,567"], ";", ","),
        (["5", "7"], ";", "."),
    ],
)
def test_marks_of_one_column(texts, delimiter, decimal):
    assert decimal_marks({"x": number_column(texts)}, delimiter, "a.csv") == {"x": decimal}


@pytest.mark.parametrize(
    ("columns", "delimiter"),
    [
        ({"x": ["1,989"]}, ","),
        ({"x": ["1.989"], "a": ["0,5"], "b": ["0.5"]}, ";"),
        ({"x": ["1.989", "2,125"]}, ";"),
    ],
)
def test_numbers_that_may_be_two_are_an_error(columns, delimiter):
    numbers = {name: number_column(texts) for name, texts in columns.items()}
    with pytest.raises(TableError, match=r"'1[.,]989' may be 1989 or 1\.989"):
        decimal_marks(numbers, delimiter, "a.csv")


@pytest.mark.parametrize("texts", [["0,5", "0.5"], ["1", "x"], ["5%", "5"], ["1.98,5"], ["1_0"]])
def test_what_is_no_column_of_numbers(texts):
    assert number_column(texts) is None


@settings(max_examples=200)
@given(value=st.floats(-1e9, 1e9), decimals=st.integers(0, 6))
def test_a_mark_is_never_taken_for_the_other(value, decimals):
    """Whatever a number is, what its marks say must be possible for how it was written."""
    for point, thousands in ((".", ","), (",", "."), (".", ""), (",", "")):
        mark = mark_of(number(value, decimals, point=point, thousands=thousands))
        wrong = NumberMark.COMMA if point == "." else NumberMark.POINT
        assert mark is not None
        assert wrong not in mark


# --- nothing is lost that is not told ------------------------------------------------------------


def test_errors_of_a_spreadsheet_are_empty_and_counted(tmp_path):
    texts = ["#DIV/0!", "#N/A", "#NV", "#WERT!"]
    rows = [
        [text if n < len(texts) else row[1] for n, text in enumerate([row[0]])] for row in PLAIN
    ]
    rows = [[text, *row[1:]] for text, row in zip(texts, PLAIN, strict=False)] + PLAIN[4:]
    heading = ("ratio", *NAMES[1:])
    table = read_table(written(tmp_path, text_of(rows, heading=heading)))
    assert table.rows == 12
    assert any(
        "4 cells with a spreadsheet's error count as empty, in 'ratio'" in n for n in table.notes
    )


def test_rows_whose_first_cell_begins_as_a_comment_are_rows(tmp_path):
    rows = [[f"#{n % 3}", *row[1:]] for n, row in enumerate(PLAIN)]
    table = read_table(written(tmp_path, text_of(rows, heading=("run", *NAMES[1:]))))
    assert (table.rows, table.left_out) == (12, 0)


def test_comments_and_lines_below_are_told(tmp_path):
    lines = text_of(PLAIN).splitlines()
    lines[4:4] = ["# sand from here", "// twice"]
    notes = read_table(written(tmp_path, "\n".join([*lines, "", "Total: 12", "End"]))).notes
    assert "skipped 2 lines of comment between the rows" in notes
    assert any("skipped 2 lines below the rows" in note and "Total: 12" in note for note in notes)


@pytest.mark.parametrize("end", ["0.6,0.013", "0.6,0.013,5,6,7"])
def test_a_row_that_is_cut_is_no_line_below(tmp_path, end):
    with pytest.raises(TableError, match=r"a\.csv:14: \d fields under 4 columns"):
        read_table(written(tmp_path, text_of(PLAIN) + end + "\n"))


@pytest.mark.parametrize(
    ("heading", "said"),
    [
        ((*NAMES, "slip"), r"columns 2 \('slip'\) and 5 \('slip'\) have the same name"),
        (("time_s", "slip [%]", *NAMES[2:], "slip"), r"2 \('slip \[%\]'\) and 5 \('slip'\)"),
        ((*NAMES, "a", "a"), r"columns 5 \('a'\) and 6 \('a'\)"),
    ],
)
def test_a_name_that_stands_twice_is_an_error(tmp_path, heading, said):
    rows = [[*row, *["0.5"] * (len(heading) - 4)] for row in PLAIN]
    path = written(tmp_path, text_of(rows, heading=heading))
    with pytest.raises(TableError, match=said):
        read_table(path)


# --- times ---------------------------------------------------------------------------------------


def stamps(form):
    return [form(BEGIN + timedelta(milliseconds=50 * n)) for n in range(12)]


def iso(moment):
    return moment.isoformat(sep=" ", timespec="milliseconds")


def with_millis(moment, form, mark):
    return f"{moment:{form}}{mark}{moment.microsecond // 1000:03d}"


BEGINS = BEGIN.timestamp()
IN_MARCH = datetime(2024, 3, 15, tzinfo=UTC).timestamp()
TIMES = {
    "ISO with a zone": (stamps(iso), BEGINS),
    "ISO with Z and T": (
        stamps(lambda m: iso(m).replace(" ", "T").replace("+00:00", "Z")),
        BEGINS,
    ),
    "ISO without a zone": (stamps(lambda m: iso(m)[:-6]), BEGINS),
    "ISO of another zone": (
        [f"2024-03-02 01:29:59.{800 + 50 * n}+01:30" for n in range(4)],
        BEGINS,
    ),
    "German": (stamps(lambda m: with_millis(m, "%d.%m.%Y %H:%M:%S", ",")), BEGINS),
    "American": ([f"03/15/2024 11:59:5{n}.500 PM" for n in range(5)], IN_MARCH + 86_390.5),
    "British": ([f"15/03/2024 08:00:0{n}" for n in range(5)], IN_MARCH + 8 * 3600),
    "time of day": (stamps(lambda m: with_millis(m, "%H:%M:%S", ".")), 86_399.8),
    "spans": (["0 days 00:00:00.5", "1 days 00:00:00.5"], 0.5),
}


@pytest.mark.parametrize("kind", TIMES)
def test_times_of_others(kind):
    texts, first = TIMES[kind]
    seconds, note = read_times(texts, "a.csv")
    assert seconds[0] == pytest.approx(first, abs=1e-6)
    assert note.startswith("times are read as")
    steps = np.diff(seconds)
    assert (steps > 0).all()
    assert np.ptp(steps) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["03/04/2024 08:00:00", "03/05/2024 08:00:00"], "day or month first"),
        (["2024-13-01 08:00:00"], "no date"),
        (["soon"], "it has 'soon'"),
        (["n/a", "-"], "is not numeric"),
        (["2024-03-01 08:00:00", "12.5"], "it has '12.5'"),
    ],
)
def test_times_that_nobody_can_read(texts, said):
    with pytest.raises(TableError, match=said):
        read_times(texts, "a.csv")


@pytest.mark.parametrize("name", ["ISO with a zone", "German", "time of day"])
def test_a_table_with_dates(tmp_path, name):
    rows = [[text, *row[1:]] for text, row in zip(TIMES[name][0], PLAIN, strict=True)]
    assert_is_the_table(written(tmp_path, text_of(rows, ";")))


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1_000), ("us", 10**6), ("ns", 10**9)])
def test_counts_since_1970_by_their_size(tmp_path, unit, factor):
    counts = [str(round(BEGIN.timestamp() * 1000) * factor // 1000 + 50 * n * factor // 1000)
              for n in range(12)]  # fmt: skip
    rows = [[text, *row[1:]] for text, row in zip(counts, PLAIN, strict=True)]
    path = written(tmp_path, text_of(rows))
    assert_is_the_table(path)
    assert f"'time_s' is read as {unit} since 1970: 2024-03-01" in read_table(path).notes


def test_a_count_of_no_known_unit_names_the_fix(tmp_path):
    rows = [[f"{1e11 + 50 * n:.0f}", *row[1:]] for n, row in enumerate(PLAIN)]
    path = written(tmp_path, text_of(rows))
    with pytest.raises(TableError, match="--column time_s=time_s,unit=ms"):
        read_table(path)
    table = read_table(path, [parse_choice("time_s=time_s,unit=ms")])
    assert np.diff(table.samples.t_us).tolist() == [50_000] * 11
