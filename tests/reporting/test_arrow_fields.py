"""Arrow's arrays made from buffers: what `pyarrow.array` makes, without pandas."""

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from adhesion_can.reporting.export.arrow_fields import arrow_column, arrow_texts

NUMBERS = st.sampled_from([np.float64, np.float32, np.int64, np.int32, np.uint64, np.uint8])


@given(NUMBERS, st.integers(0, 40), st.data())
def test_numbers_are_those_of_pyarrow(kind, size, data):
    values = data.draw(hnp.arrays(kind, size))
    missing = data.draw(st.none() | hnp.arrays(np.bool_, size))
    found = arrow_column(values, missing)
    found.validate(full=True)
    expected = pa.array(values, mask=missing)
    assert found.type == expected.type
    assert found.is_null().equals(expected.is_null())
    kept = np.ones(size, np.bool_) if missing is None else ~missing
    assert np.array_equal(found.to_numpy(zero_copy_only=False)[kept], values[kept], equal_nan=True)


def test_numbers_of_every_other_row_are_copied():
    values = np.arange(10.0)[::2]
    assert arrow_column(values).to_pylist() == [0.0, 2.0, 4.0, 6.0, 8.0]


@given(st.lists(st.text()))
def test_texts_are_those_of_pyarrow(texts):
    found = arrow_texts(texts)
    found.validate(full=True)
    assert found.equals(pa.array(texts, pa.string()))


CONVERT = """
import sys
from adhesion_can.cli.main import main
sys.argv[1:] = ["convert", sys.argv[1], "--out", sys.argv[2]]
status = main()
print(status, sorted({"pandas", "asammdf", "scipy", "polars"} & set(sys.modules)))
"""


@pytest.mark.parametrize("out", ["folder/", "one.parquet", "one.arrow", "one.csv"])
def test_converting_text_imports_none_of_the_large_packages(tmp_path, out):
    log = tmp_path / "a.log"
    log.write_text("(1.000000) can0 111#2F00851311000000\n")
    words = [sys.executable, "-c", CONVERT, str(log), f"{tmp_path}/{out}"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "0 []"
