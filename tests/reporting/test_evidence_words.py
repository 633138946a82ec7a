"""Words of the evidence and of figures: what a column means, what was refuted, units of an axis."""

from dataclasses import replace
from math import inf

import pytest

from adhesion_can.diagnosis.evidence import Decision, Untested
from adhesion_can.diagnosis.formatting import axis_scale, three_digits
from adhesion_can.reporting.diagnosis import terminal
from adhesion_can.reporting.diagnosis_figures import gain_figure, model_figure
from adhesion_can.reporting.diagnosis_page import page
from adhesion_can.reporting.diagnosis_tables import (
    EVIDENCE_COLUMNS,
    EVIDENCE_NOTE,
    untested_outcome,
)
from tests.reporting.test_diagnosis_report import named, printed


def test_every_column_of_the_evidence_is_explained_on_the_terminal():
    lines = [part for part in terminal(named()) if isinstance(part, str)]
    (note,) = (line for line in lines if line == EVIDENCE_NOTE)
    for column in EVIDENCE_COLUMNS[1:-1]:
        assert column in note
    assert any(line.startswith("decision: ") for line in lines)


def test_what_the_evidence_calls_refuted_is_refuted_in_every_list():
    one = replace(named().evidence[0], decision=Decision.REFUTED)
    why = "its p-value is 3 %"
    untested = (Untested(one.effect, why, rejected=True), Untested("x", "no signal"))
    assert untested_outcome(untested[0], (one,)) == "refuted"
    assert untested_outcome(untested[0], ()) == "rejected"
    assert untested_outcome(untested[1], (one,)) == "not tested"
    found = replace(named(), evidence=(one,), untested=untested)
    assert f"Refuted: {one.effect}: {why}" in printed(found)
    sections = page(found, {}).sections
    (table,) = sections["Not tested or rejected"]
    assert [row[1] for row in table.rows] == ["refuted", "not tested"]


def test_an_rmse_has_its_model_and_its_data():
    figure = gain_figure(named().gain, extended=True)
    assert figure.data[0]["y"] == ["plain curve", "extended model", "splines, deciding data"]
    assert "on held-out data" in figure.caption
    assert "RMSE on other rows, the deciding data" in figure.caption
    assert "on the deciding data" in model_figure(named().models).caption


@pytest.mark.parametrize(
    ("value", "text"), [(0.01, "0.0100"), (0.0157, "0.0157"), (123.4, "123"), (inf, "-")]
)
def test_three_digits_stay(value, text):
    assert three_digits(value) == text


@pytest.mark.parametrize(
    ("size", "unit", "factor", "text"),
    [
        (3.999e-12, "1/N^2", 1e12, "× 10⁻¹² 1/N²"),
        (-4.2e-4, "1/s", 1e4, "× 10⁻⁴ 1/s"),
        (0.05, "s", 1.0, "s"),
        (3e6, "N", 1e-6, "× 10⁶ N"),
        (0.0, "1", 1.0, ""),
    ],
)
def test_an_axis_says_the_power_of_ten_that_its_numbers_leave_out(size, unit, factor, text):
    scale, shown = axis_scale(size, unit)
    assert (scale, shown) == (pytest.approx(factor), text)
