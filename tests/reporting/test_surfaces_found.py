"""The sentence of a drive's page on the surfaces that were found."""

import pytest

from adhesion_can.plurals import in_words
from adhesion_can.reporting.drive.page import _surfaces_found


@pytest.mark.parametrize(
    ("count", "sure", "sentence"),
    [
        (
            3,
            [0.373, 0.245, 0.3],
            "Three surfaces found, μ_max 0.245 to 0.373, each known within 10 %.",
        ),
        (1, [0.245], "One surface found, μ_max 0.245, known within 10 %."),
        (
            3,
            [0.245, 0.3],
            "Three surfaces found; μ_max known within 10 % on two of them: 0.245 to 0.300.",
        ),
        (13, [0.3], "13 surfaces found; μ_max known within 10 % on one of them: 0.300."),
        (2, [], "Two surfaces found; no μ_max is known within 10 %."),
        (0, [], "No surfaces found; no μ_max is known within 10 %."),
    ],
)
def test_surfaces_are_counted_with_the_peaks_that_are_known(count, sure, sentence):
    assert _surfaces_found(count, sure) == sentence


def test_numbers_up_to_twelve_are_words():
    assert [in_words(number) for number in (0, 1, 12, 13)] == ["no", "one", "twelve", "13"]
