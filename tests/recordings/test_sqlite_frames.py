"""SQLite files of python-can, and of strangers: plain tables are read, in bounded steps."""

import sqlite3
from contextlib import closing

import can
import pytest

from adhesion_can.errors import RecordingError
from adhesion_can.recordings.python_can_messages import from_message
from adhesion_can.recordings.recording import Recording

PLAIN = (
    "CREATE TABLE messages(ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, "
    "error INTEGER, dlc INTEGER, data BLOB)"
)
ROW = (1.5, 0x101, 0, 0, 0, 8, b"12345678")
ENDLESS = (
    "CREATE VIEW messages AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) "
    "SELECT x * 0.01, 257, 0, 0, 0, 8, zeroblob(8) FROM c"
)


def database(path, *statements, rows=()):
    with closing(sqlite3.connect(path)) as connection:
        for statement in statements:
            connection.execute(statement)
        if rows:
            connection.executemany("INSERT INTO messages VALUES(?,?,?,?,?,?,?)", rows)
        connection.commit()
    return path


def refused(path):
    with pytest.raises(RecordingError) as error:
        list(Recording(path).blocks())
    text = str(error.value)
    assert text.startswith(f"{path}: reading stops after ")
    assert "\n" not in text
    return text


def test_frames_are_those_of_python_cans_reader(tmp_path):
    rows = [
        ROW,
        (2, 0x18FEF100, 1, 0, 0, 3, b"abc"),
        (2.000_001, 0x7FF, 0, 1, 0, 4, None),
        (3.25, 0x20000004, 0, 0, 1, 8, bytes(8)),
        (4.0, 1, None, None, None, 0, b""),
        (5.0, 2, 0, 0, 0, 12, bytes(12)),
    ]
    path = database(tmp_path / "a.db", PLAIN, rows=rows)
    with can.SqliteReader(path) as reader:
        assert list(Recording(path)) == [from_message(message) for message in reader]


@pytest.mark.timeout(60)
@pytest.mark.parametrize(
    ("statement", "words"),
    [
        (ENDLESS, "is a view, not a table"),
        ("CREATE VIRTUAL TABLE messages USING fts4(a, b, c, d, e, f, g)", "not a table"),
        (PLAIN.replace("data BLOB", "data BLOB AS (zeroblob(9))"), "computed columns"),
        ("CREATE TABLE messages(ts, id)", "2 columns, not 7"),
        ("CREATE TABLE others(a)", "no such table"),
    ],
)
def test_what_is_no_plain_table_is_refused(tmp_path, statement, words):
    assert words in refused(database(tmp_path / "a.db", statement))


@pytest.mark.parametrize(
    "row",
    [
        (1.0, -1, 0, 0, 0, 8, bytes(8)),
        (1.0, 1 << 29, 0, 0, 0, 8, bytes(8)),
        (1.0, 2**62, 0, 0, 0, 2**40, bytes(8)),
        (1.0, "x", 0, 0, 0, 8, bytes(8)),
        (1.0, None, 0, 0, 0, 8, bytes(8)),
        (float("inf"), 1, 0, 0, 0, 8, bytes(8)),
        (1e308, 1, 0, 0, 0, 8, bytes(8)),
        (None, 1, 0, 0, 0, 8, bytes(8)),
        ("x", 1, 0, 0, 0, 8, bytes(8)),
        (1.0, 1, 0, 0, 0, 8, "12345678"),
        (1.0, 1, 0, 0, 0, 8, bytes(65)),
    ],
)
def test_a_row_that_is_no_frame_ends_the_reading(tmp_path, row):
    path = database(tmp_path / "a.db", PLAIN, rows=[ROW, row])
    assert "after 1 frames" in refused(path)


def test_a_payload_of_a_gigabyte_is_not_fetched(tmp_path):
    path = database(
        tmp_path / "a.db",
        PLAIN,
        "INSERT INTO messages VALUES(1, 257, 0, 0, 0, 8, zeroblob(99999999))",
    )
    assert "too big" in refused(path)


@pytest.mark.timeout(120)
def test_pages_that_lead_in_a_circle_end(tmp_path):
    path = database(tmp_path / "a.db", PLAIN, rows=[ROW] * 3000)
    pages = bytearray(path.read_bytes())
    size = int.from_bytes(pages[16:18], "big")
    root = size  # the second page
    assert pages[root] == 5, "the table has inner pages"
    leaf = pages[root + 12 : root + 14]  # place of the first cell, which begins with a page number
    first = pages[root + int.from_bytes(leaf, "big") :][:4]
    count = int.from_bytes(pages[root + 3 : root + 5], "big")
    # All cells lead to one page: more rows than the file has.
    for place in range(count):
        at = root + int.from_bytes(pages[root + 12 + 2 * place :][:2], "big")
        pages[at : at + 4] = first
    # And a page of leaves becomes one of the same inner cells, many levels deep.
    page = (int.from_bytes(first, "big") - 1) * size
    pages[page : page + size] = pages[root : root + size]
    path.write_bytes(pages)
    refused(path)


def test_a_file_with_a_log_beside_it_is_read_with_it_and_stays_as_it_is(tmp_path):
    path = tmp_path / "a.db"
    with closing(sqlite3.connect(path)) as writer:
        writer.execute("PRAGMA journal_mode = WAL")
        writer.execute(PLAIN)
        writer.executemany("INSERT INTO messages VALUES(?,?,?,?,?,?,?)", [ROW] * 5)
        writer.commit()
        assert path.with_name("a.db-wal").stat().st_size
        assert len(list(Recording(path))) == 5
    before = path.read_bytes()
    assert len(list(Recording(path))) == 5
    assert path.read_bytes() == before
    assert [one.name for one in tmp_path.iterdir()] == ["a.db"]
