"""What a diagnosis says of a residual that nothing explains, and of what is needed."""

from dataclasses import replace

import numpy as np

from adhesion_can.diagnosis.inference.sensor_noise import NoiseComparison
from adhesion_can.diagnosis.result import FamilyResult
from adhesion_can.diagnosis.sentences import unexplained_clause
from adhesion_can.reporting.diagnosis import needed_sentence, verdict_sentences
from adhesion_can.reporting.diagnosis_tables import SHAPE_NOTE
from tests.reporting.test_diagnosis_report import named, printed, unexplained
from tests.reporting.test_next_steps import NO_PLAN, PLANNED, WHEEL, cause, line, of

EXCEEDED = NoiseComparison(0.02, 0.01, usual=2.0, left=2.0)


def test_more_than_noise_is_said_only_where_noise_was_compared():
    found = replace(unexplained(), channel=None, noise=None)
    assert unexplained_clause(found) == "the plain curve does not explain the data"
    assert "an effect that helps" in unexplained_clause(replace(found, closest=named().closest))
    above = replace(found, noise=EXCEEDED)
    assert unexplained_clause(above) == "more is left than sensor noise explains"
    swinging = replace(above, oscillates=True)
    first = verdict_sentences(swinging)[0]
    assert first.startswith("Unexplained: the wheel speeds oscillate, and neither a known effect")
    assert line(swinging).startswith("The wheel speeds oscillate, and no known effect")


def test_what_is_needed_is_one_way_with_the_plan():
    found = replace(named(), needed="to distinguish a from b, record coasting")
    assert needed_sentence(replace(found, next_drive=PLANNED)) == ""
    assert needed_sentence(replace(found, next_drive=NO_PLAN)).startswith("Needed: to distinguish")
    both = "Needed, by the plan of --next-drive or by hand: to distinguish a from b"
    assert needed_sentence(replace(found, next_drive=None)).startswith(both)
    of_a_table = replace(found, tables=True, next_drive=None)
    assert needed_sentence(of_a_table).startswith("Needed: to distinguish")
    assert needed_sentence(replace(found, needed=None)) == ""


def test_two_peaks_of_a_family_are_explained_where_a_shape_is_named():
    shape = replace(cause("slow_drift", "", (-0.0005, 1e-5)), effect="curve_shape")
    curve = np.zeros(2)
    family = FamilyResult("polach", "Polach", 5, 1.0, 0.01, 0.37, 0.07, True, curve, curve)
    assert SHAPE_NOTE in " ".join(printed(of(shape, families=(family,))).split())
    assert SHAPE_NOTE not in " ".join(printed(of(WHEEL, families=(family,))).split())
