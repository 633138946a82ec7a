"""Columns that a user types with or without their units."""

import pytest

from adhesion_can.errors import TableError
from adhesion_can.recordings.reference_speed import read_reference
from adhesion_can.recordings.tables.choice import parse_choice
from adhesion_can.recordings.tables.headings import loose_unit, name_columns
from adhesion_can.recordings.tables.sample_table import is_table, read_table

HEADINGS = (
    "Zeit [s]",
    "Schlupf [%]",
    "Kraftschluss",
    "v [km/h]",
    "Geschwindigkeit (km/h)",
    "U / kV",
)
BASE = ("time_s=Zeit", "slip=Schlupf", "adhesion=Kraftschluss")
ROWS = [(0.1 * n, 1.0 + n, 0.1, 36.0, 72.0, 9.0) for n in range(12)]


def written(path, headings=HEADINGS, rows=ROWS):
    path.write_text("\n".join(",".join(map(str, row)) for row in (headings, *rows)) + "\n")
    return path


def speed(path, *texts):
    """Speed of the first row, m/s, by these choices."""
    choices = [parse_choice(text) for text in texts]
    assert is_table(path, choices)
    return read_table(path, choices).samples.speed[0]


@pytest.mark.parametrize(
    ("typed", "wanted"),
    [("v", 10.0), ("v [km/h]", 10.0), ("v (km/h)", 10.0), ("V", 10.0), ("Geschwindigkeit", 20.0),
     ("geschwindigkeit [KM/H]", 20.0)],
)  # fmt: skip
def test_a_column_is_typed_with_or_without_its_unit(tmp_path, typed, wanted):
    path = written(tmp_path / "a.csv")
    assert speed(path, *BASE, f"speed_mps={typed}") == pytest.approx(wanted)


def test_the_slip_is_typed_as_the_heading_has_it(tmp_path):
    path = written(tmp_path / "a.csv")
    choices = [parse_choice(text) for text in ("slip=SCHLUPF [%]", BASE[0], BASE[2])]
    assert is_table(path, choices)
    assert read_table(path, choices).samples.slip[0] == pytest.approx(0.01)


@pytest.mark.parametrize("heading", ["v in km/h", "v / km/h", "v/km/h", "v / (km/h)", "v_(km/h)"])
def test_units_that_follow_a_word_or_a_stroke_are_taken(tmp_path, heading):
    path = written(tmp_path / "a.csv", (*HEADINGS[:3], heading, "w", "x"))
    for typed in ("v", heading):
        assert speed(path, *BASE, f"speed_mps={typed}") == pytest.approx(10.0)


def test_what_follows_a_stroke_may_be_no_unit():
    assert loose_unit("a/b") == ("a/b", "")
    assert loose_unit("F/kN") == ("F", "kN")


def test_headings_that_differ_in_the_unit_alone_keep_it(tmp_path):
    path = written(tmp_path / "a.csv", (*HEADINGS[:3], "v [km/h]", "v [mph]", "x"))
    assert speed(path, *BASE, "speed_mps=v [km/h]") == pytest.approx(10.0)
    assert speed(path, *BASE, "speed_mps=v [mph]") == pytest.approx(72 * 0.44704)
    with pytest.raises(
        TableError, match=r"'v' for 'speed_mps' may be 'v \[km/h\]', 'v \[mph\]'; wr"
    ):
        speed(path, *BASE, "speed_mps=v")


def test_a_known_name_never_occurs_twice(tmp_path):
    assert name_columns(["slip [%]", "slip"]) == [("slip", "%"), ("slip", "")]
    path = tmp_path / "a.parquet"
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    columns = {"slip [%]": [1.0], "slip": [0.1], "adhesion": [0.1]}
    parquet.write_table(pyarrow.table(columns), path)
    with pytest.raises(TableError, match="two columns have the name 'slip'; rename one"):
        read_table(path)


def test_a_unit_that_is_not_the_columns_does_not_match(tmp_path):
    with pytest.raises(
        TableError, match=r"no column 'v \[m/s\]' for 'speed_mps'; similar names: v"
    ):
        speed(written(tmp_path / "a.csv"), *BASE, "speed_mps=v [m/s]")


@pytest.mark.parametrize(
    ("typed", "said"),
    [("Geschw", r"similar names: Geschwindigkeit \[km/h\]"),
     ("Geschwindikeit", r"similar names: Geschwindigkeit \[km/h\]"),
     ("tempo", r"its columns are Zeit \[s\], Schlupf \[%\], Kraftschluss, v \[km/h\]")],
)  # fmt: skip
def test_an_error_lists_the_nearest_headings(tmp_path, typed, said):
    with pytest.raises(TableError, match=rf"no column '{typed}' for 'speed_mps'; {said}"):
        speed(written(tmp_path / "a.csv"), *BASE, f"speed_mps={typed}")


def test_a_long_heading_is_listed_in_part(tmp_path):
    headings = (*HEADINGS[:3], *(f"c{n}" for n in range(20)))
    rows = [(0.1 * n, 1.0, 0.1, *(1.0,) * 20) for n in range(12)]
    with pytest.raises(TableError, match=r"c8, and 11 more$"):
        speed(written(tmp_path / "a.csv", headings, rows), *BASE, "speed_mps=Tempo")


@pytest.mark.parametrize("typed", ["", ":v", ":V", ":v [km/h]"])
def test_a_reference_speed_is_converted_by_the_unit_in_its_heading(tmp_path, typed):
    path = tmp_path / "gnss.csv"
    path.write_text("time_s,v [km/h]\n0,36\n1,72\n")
    assert read_reference(f"{path}{typed}")[1].tolist() == pytest.approx([10.0, 20.0])


def test_a_reference_speed_of_an_unknown_unit_is_refused(tmp_path):
    path = tmp_path / "gnss.csv"
    path.write_text("time_s,v [knots]\n0,36\n1,72\n")
    with pytest.raises(
        TableError, match=r"'v' has the unknown unit 'knots'; write one of m/s, km/h"
    ):
        read_reference(str(path))
