"""Columns that are late: put back, and what has no value then."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.errors import TableError
from adhesion_can.recordings.tables.choice import parse_choice
from adhesion_can.recordings.tables.columns import Columns
from adhesion_can.recordings.tables.sample_table import read_table
from adhesion_can.recordings.tables.shift import shift_columns


def late(text, **values):
    columns = Columns({name: np.asarray(one, float) for name, one in values.items()})
    return shift_columns(columns, [parse_choice(text)], "t.csv")


@given(
    rows=st.integers(-20, 20),
    step=st.sampled_from([0.01, 0.02, 0.5, 1.0]),
    seed=st.integers(0, 99),
    axles=st.integers(1, 3),
)
@settings(derandomize=True)
def test_a_column_that_is_late_by_whole_rows_comes_back(rows, step, seed, axles):
    rng, n = np.random.default_rng(seed), 60
    true, t = rng.normal(size=(n, axles)), np.repeat(np.arange(n) * step, axles)
    recorded = np.roll(true, rows, axis=0)
    found = late(
        f"slip=slip,late_s={rows * step!r}",
        time_s=t,
        axle=np.tile(np.arange(axles), n),
        slip=recorded.ravel(),
    ).values["slip"].reshape(n, axles)  # fmt: skip
    there = np.arange(n) + rows
    known = (there >= 0) & (there < n)
    np.testing.assert_allclose(found[known], true[known], rtol=1e-6, atol=1e-9)
    assert np.isnan(found[~known]).all()


def test_between_rows_the_line_is_straight_and_in_a_gap_nothing_is_known():
    t = np.array([0.0, 1.0, 2.0, 3.0, 13.0, 14.0, 15.0])
    found = late("slip=slip,late_s=0.5", time_s=t, slip=10.0 * t)
    np.testing.assert_allclose(
        found.values["slip"], [5.0, 15.0, 25.0, np.nan, 135.0, 145.0, np.nan]
    )
    assert found.notes == ("slip shifted 0.5 s earlier; 2 rows at ends and gaps have no value",)


def test_an_early_column_is_put_later():
    found = late("slip=slip,late_s=-1", time_s=[0.0, 1.0, 2.0], slip=[5.0, 6.0, 7.0])
    np.testing.assert_allclose(found.values["slip"], [np.nan, 5.0, 6.0])
    assert "later" in found.notes[0]


def test_a_column_without_values_stays_without():
    found = late("slip=slip,late_s=1", time_s=[0.0, 1.0], slip=[np.nan, 2.0])
    assert np.isnan(found.values["slip"]).all()


@pytest.mark.parametrize(
    ("text", "values", "says"),
    [
        ("slip=slip,late_s=1", {"slip": [1.0]}, "needs the column 'time_s'"),
        ("time_s=time_s,late_s=1", {"time_s": [1.0]}, "'time_s' cannot have a delay"),
    ],
)
def test_what_cannot_be_shifted_is_an_error(text, values, says):
    with pytest.raises(TableError, match=says):
        late(text, **values)


def test_a_file_loses_the_rows_without_a_value(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,k,adhesion\n" + "".join(f"{i / 10},{i},0.2\n" for i in range(10)))
    table = read_table(path, [parse_choice("slip=k,unit=percent,late_s=0.2")])
    np.testing.assert_allclose(table.samples.slip, np.arange(2, 10) / 100)
    assert table.left_out == 2
