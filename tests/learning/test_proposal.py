"""What is proposed: causes that the whole record and both halves name with one size."""

from dataclasses import replace

import pytest

from adhesion_can.diagnosis.result import Verdict
from adhesion_can.learning.proposal import find_disagreement, find_objection
from adhesion_can.learning.sentences import describe_cause, describe_causes
from tests.learning.learning_helpers import cause, diagnosis

BIAS = cause("effort_bias", (9e3,), (300.0,))


def test_a_cause_that_all_three_name_is_proposed():
    whole = diagnosis(cause())
    assert find_objection(whole) == ""
    assert find_disagreement(whole, [diagnosis(cause(values=(-0.0105,)))] * 2) == ""


@pytest.mark.parametrize(
    ("whole", "why"),
    [
        (diagnosis(), "no cause"),
        (diagnosis(cause(), verdict=Verdict.UNEXPLAINED), "unexplained"),
        (diagnosis(cause(rivals=("effort_bias",))), "effort_bias"),
    ],
)
def test_a_record_that_names_nothing_for_certain_is_not_divided(whole, why):
    assert why in find_objection(whole)


def test_a_size_at_the_end_of_its_range_is_none():
    one = cause()
    at_bound = replace(one.parameters[0], at_bound=True, std=None)
    assert "end of its range" in find_objection(diagnosis(replace(one, parameters=(at_bound,))))


@pytest.mark.parametrize(
    ("first", "second", "why"),
    [
        (diagnosis(), diagnosis(cause()), "the first half names no cause"),
        (diagnosis(cause()), diagnosis(), "the second half names no cause"),
        (diagnosis(cause()), diagnosis(BIAS), "the second half names effort_bias"),
        (diagnosis(BIAS, cause()), diagnosis(cause()), "the first half names effort_bias"),
        (diagnosis(cause()), diagnosis(cause(values=(-0.015,))), "different sizes"),
        (diagnosis(cause()), diagnosis(cause(values=(0.01,))), "different sizes"),
        (
            diagnosis(cause()),
            diagnosis(cause(), verdict=Verdict.UNEXPLAINED),
            "the second half names no cause",
        ),
    ],
)
def test_one_half_is_not_enough(first, second, why):
    assert why in find_disagreement(diagnosis(cause()), [first, second])


def test_what_a_size_may_differ_by_is_that_of_its_standard_deviations():
    sure = [diagnosis(cause(values=(v,), stds=(1e-4,))) for v in (-0.01, -0.0125)]
    unsure = [diagnosis(cause(values=(v,), stds=(6e-4,))) for v in (-0.01, -0.0125)]
    assert "different sizes" in find_disagreement(diagnosis(cause()), sure)
    assert find_disagreement(diagnosis(cause()), unsure) == ""


def test_a_second_cause_needs_both_halves_too():
    whole = diagnosis(cause(), BIAS)
    both = diagnosis(cause(), BIAS)
    assert find_disagreement(whole, [both, both]) == ""
    assert "only one half names effort_bias" in find_disagreement(whole, [both, diagnosis(cause())])


def test_the_number_of_an_axle_is_no_size():
    one, other = (cause("wheel_radius", (0.01, axle), (5e-4, None)) for axle in (3, 4))
    assert find_disagreement(diagnosis(one), [diagnosis(one), diagnosis(one)]) == ""
    assert "different sizes" in find_disagreement(
        diagnosis(one), [diagnosis(one), diagnosis(other)]
    )


@pytest.mark.parametrize(
    ("one", "text"),
    [
        (cause(values=(-0.01,), stds=(0.001,)), "vehicle speed reads 1.00 ± 0.10 % low"),
        (cause(values=(0.002,), stds=(0.0003,)), "vehicle speed reads 0.200 ± 0.030 % high"),
        (BIAS, "efforts read 9.00 ± 0.30 kN high"),
        (
            cause("wheel_radius", (-0.01, 3), (0.001, None)),
            "the wheels of axle 3 are 1.00 ± 0.10 % smaller than configured",
        ),
        (
            cause("rail_cleaning", (0.02,), (0.002,)),
            "each axle finds 2.00 ± 0.20 % more adhesion than the axle ahead",
        ),
    ],
)
def test_causes_in_words(one, text):
    assert describe_cause(one) == text


def test_a_cause_without_words_of_its_own_has_its_title_and_sizes():
    words = describe_cause(cause("adhesion_recovery", (4e-7, 3.0), (1e-8, 0.2)))
    assert "gain" in words
    assert "3.00 ± 0.20 s" in words
    assert describe_causes([BIAS, cause()]).count(" and ") == 1
