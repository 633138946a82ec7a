"""Phases of a simulated run: their doubts in the table and in JSON."""

import io
from dataclasses import replace

import pytest
from rich.console import Console

from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.status import Status
from adhesion_can.reporting.phases import Row, phase_table, phases
from adhesion_can.service.outputs import Outputs, Setpoint

SURFACES = [
    {"name": name, "from_s": start, "to_s": start + 1.0, "mu_max": 0.3, "lambda_m": 0.05}
    for name, start in (("dry", 0.0), ("wet", 1.0), ("greasy", 2.0))
]
OUTPUTS = Outputs(Status.TRACKING, Setpoint(0.3, 0.05, 0.4), mu_max_std=0.01, lambda_m_std=0.001)


def found(doubts):
    """Phases with a doubt each at their ends; the last surface is never reached."""
    rows = []
    for place, doubt in enumerate(doubts):
        at_end = replace(OUTPUTS, doubt=doubt)
        rows += [Row(place * 10**6 + 500_000, OUTPUTS, 0.2), Row((place + 1) * 10**6, at_end, 0.2)]
    return phases({"surfaces": SURFACES}, rows)


def headings(table):
    return table.columns


def test_json_has_the_doubt_at_the_end_of_each_surface():
    documents = [phase.to_dict() for phase in found([Doubt.RATE_OF_SLIP, Doubt.NONE])]
    assert [document["doubt"] for document in documents] == ["rate_of_slip", "none", None]
    assert found([Doubt.NOT_AVAILABLE])[0].to_dict()["doubt"] is None


@pytest.mark.parametrize("doubt", [Doubt.NONE, Doubt.NOT_AVAILABLE])
def test_the_table_has_no_column_of_doubts_where_there_is_none(doubt):
    assert headings(phase_table(found([doubt, doubt])))[:4] == [
        "surface", "from s", "found", "mu_max",
    ]  # fmt: skip


def test_the_table_has_a_column_of_doubts_where_there_is_one():
    """It is among the first columns, which 80 columns of a terminal show beside the surface."""
    table = phase_table(found([Doubt.AXLE_LOAD, Doubt.NONE]))
    assert headings(table)[:4] == ["surface", "from s", "found", "doubt"]
    assert [row[3] for row in table.rows] == ["axle load", "-", "-"]
    out = io.StringIO()
    Console(file=out, width=80, highlight=False).print(table)
    (first,) = [line for line in out.getvalue().splitlines() if "doubt" in line]
    assert "estimated" in first
