"""Tables of samples in CSV, in any dialect, packed or not."""

import numpy as np

from adhesion_can.recordings.tables.choice import parse_choice
from adhesion_can.recordings.tables.sample_table import is_table, read_table
from tests.fuzz.octets import Octets
from tests.fuzz.rule import file_of, value_or_refusal

_CHOICES = (
    (),
    ("slip=kappa,unit=percent,sign=-1",),
    ("slip=kappa", "time_s=t,unit=ms"),
    ("adhesion=mu,late_s=0.5",),
    ("longitudinal_force_N=Fx,unit=kN", "normal_load_N=Fz"),
)


def table(data):
    """A .csv file under some choices of columns, by the first byte: finite samples."""
    octets = Octets(data)
    choices = tuple(map(parse_choice, octets.among(_CHOICES)))
    path = file_of("fuzz.csv", octets.rest())
    if not value_or_refusal(is_table, path, choices):
        return
    found = value_or_refusal(read_table, path, choices)
    if found is None:
        return
    samples = found.samples
    assert 1 <= len(samples) <= found.rows
    assert found.left_out == found.rows - len(samples)
    for column in (samples.slip, samples.adhesion, samples.t_us):
        assert np.isfinite(column).all()
    assert all(len(column) == len(samples) for column in samples.covariates.values())


def choice(data):
    """A choice of a column as an option of the command line has it."""
    text = data.decode("utf-8", "replace")
    found = value_or_refusal(parse_choice, text)
    if found is not None:
        assert found.name
        assert found.column
        assert found.sign in (-1, 1)
