"""The doubt of an estimate in its JSON, and whether its curve has a peak."""

import json

import numpy as np
import pytest

from adhesion_can.physics.doubt import DESCRIPTIONS, Doubt
from adhesion_can.physics.estimate import Estimate, Identifiable, PeakEstimate, has_peak


def estimate(**doubt):
    return Estimate(
        c1=0.4, c2=60.0, c3=0.3, covariance=np.eye(3), mu_max=0.373, mu_max_std=0.001,
        lambda_m=0.073, lambda_m_std=0.002, noise_std=0.01, samples=500,
        identifiable=Identifiable(mu_max=True, lambda_m=True), surface_since_us=0, **doubt,
    )  # fmt: skip


def test_an_estimator_that_looks_for_no_doubt_leaves_json_as_it_was():
    keys = ["c1", "c2", "c3", "mu_max", "lambda_m", "noise_std", "samples", "identifiable"]
    assert list(estimate().to_dict()) == keys
    assert list(estimate(doubt=Doubt.NOT_AVAILABLE).to_dict()) == keys


@pytest.mark.parametrize(
    ("doubt", "name"),
    [
        (Doubt.NONE, "none"),
        (Doubt.SHAPE, "shape"),
        (Doubt.SPEED, "speed"),
        (Doubt.AXLE_LOAD, "axle_load"),
        (Doubt.DIRECTION, "direction"),
        (Doubt.AXLE, "axle"),
        (Doubt.TIME, "time"),
        (Doubt.RATE_OF_SLIP, "rate_of_slip"),
        (Doubt.SURROUNDINGS, "surroundings"),
    ],
)
def test_a_doubt_stands_in_json_by_its_name_and_changes_nothing_else(doubt, name):
    document = json.loads(json.dumps(estimate(doubt=doubt).to_dict()))
    assert document.pop("doubt") == name
    assert document == estimate().to_dict()


def test_every_doubt_has_a_sentence_and_none_has_not():
    assert set(DESCRIPTIONS) == set(Doubt) - {Doubt.NONE, Doubt.NOT_AVAILABLE}
    assert all(text and text[-1] != "." for text in DESCRIPTIONS.values())


@pytest.mark.parametrize(
    ("mu_max", "lambda_m", "wanted"),
    [(0.3, 0.02, True), (1e-6, 1e-6, True), (0.0, 0.02, False), (0.3, 0.0, False),
     (-0.1, 0.02, False), (0.3, -0.02, False)],
)  # fmt: skip
def test_a_flat_curve_and_one_that_falls_from_the_start_have_no_peak(mu_max, lambda_m, wanted):
    assert has_peak(PeakEstimate(mu_max, lambda_m, 0.01, 0.01)) is wanted
