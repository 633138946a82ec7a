"""Coordinates, priors and evidence of curve families that are weighed online."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from adhesion_can.estimation.curves.binned_points import BinnedPoints
from adhesion_can.estimation.curves.coordinates import coordinates_of
from adhesion_can.estimation.curves.evidence import WEIGHED, fit_posterior, weigh_families
from adhesion_can.physics.curves import FAMILIES, Conditions
from adhesion_can.physics.parameter import Parameter

SLIP = np.linspace(0.01, 0.2, 12)
CONDITIONS = Conditions(np.full(12, 10.0), np.full(12, 2e5))


def points_of(adhesion, weight):
    return BinnedPoints(np.arange(12), SLIP, np.zeros(12), adhesion, weight, CONDITIONS)


@dataclass(frozen=True)
class Line:
    """Adhesion a λ + b λ², in linear coordinates: its evidence is known in closed form."""

    name: str = "line"
    title: str = "line"
    prior_weight: float = 0.25
    parameters: tuple = (
        Parameter("a", "1", 1.0, -99.0, 99.0, "slope").normal(1.0, 2.0),
        Parameter("b", "1", 0.0, -99.0, 99.0, "bend").normal(0.0, 3.0),
    )

    def adhesion(self, slip, values, conditions):
        del conditions
        return values[0] * slip + values[1] * slip**2

    def gradient(self, slip, values, conditions):
        del values, conditions
        return np.stack([slip, slip**2])


def test_the_evidence_of_a_linear_family_is_that_of_a_normal_distribution():
    """The marginal of the points is normal: differences of its logarithm are those of the fit."""
    rng = np.random.default_rng(1)
    weight = rng.uniform(100.0, 900.0, 12)
    adhesion = 0.9 * SLIP + 0.05 * rng.standard_normal(12)
    rows = Line().gradient(SLIP, None, None)

    def marginal(family):
        mean = np.array([p.prior.mean for p in family.parameters]) @ rows
        std = np.array([p.prior.std for p in family.parameters])
        covariance = np.diag(4.0 / weight) + (rows.T * std**2) @ rows
        left = adhesion - mean
        determined = np.linalg.slogdet(covariance)[1]
        return np.log(family.prior_weight) - 0.5 * (
            left @ np.linalg.solve(covariance, left) + determined
        )

    line = Line()
    narrow = replace(line, name="narrow", prior_weight=0.75, parameters=(
        line.parameters[0].normal(1.1, 0.1), line.parameters[1].normal(0.2, 0.3),
    ))  # fmt: skip
    fits = [
        fit_posterior(points_of(adhesion, weight), one, np.zeros(2), 4.0) for one in (line, narrow)
    ]
    by_fit = fits[0].log_evidence - fits[1].log_evidence
    assert by_fit == pytest.approx(marginal(line) - marginal(narrow), abs=0.02)
    shares = weigh_families(fits)
    assert shares["line"] / shares["narrow"] == pytest.approx(np.exp(by_fit))


def test_drawn_curves_scatter_as_the_posterior_says():
    adhesion, weight = 0.9 * SLIP, np.full(12, 400.0)
    fit = fit_posterior(points_of(adhesion, weight), Line(), np.array([0.9, 0.0]), 1.0)
    curves = fit.draw_curves(SLIP, CONDITIONS)
    rows = Line().gradient(SLIP, None, None)
    std = np.sqrt(np.sum(rows * np.linalg.solve(fit.precision, rows), axis=0))
    # 64 draws: their standard deviation is known to 9 %.
    np.testing.assert_allclose(curves.std(axis=0), std, rtol=0.3)


@pytest.mark.parametrize("family", WEIGHED, ids=lambda one: one.name)
def test_coordinates_there_and_back(family):
    coordinates = coordinates_of(family)
    values = np.array([p.typical for p in family.parameters])
    there = coordinates.from_values(values)
    assert coordinates.to_values(there) == pytest.approx(values)
    several = np.stack([there, there + 0.1], axis=1)
    assert coordinates.to_values(several)[:, 1] == pytest.approx(
        [
            value * np.exp(0.1) if p.prior.logarithmic else value + 0.1
            for p, value in zip(family.parameters, values, strict=True)
        ]
    )
    assert ((coordinates.lower <= there) & (there <= coordinates.upper)).all()
    assert coordinates.to_values(coordinates.centre) == pytest.approx(
        [p.prior.mean for p in family.parameters]
    )


def test_burckhardts_curve_is_the_first_and_likelier_than_all_others_beforehand():
    first, *others = WEIGHED
    assert first.name == "burckhardt"
    assert first.prior_weight > sum(family.prior_weight for family in others)
    assert FAMILIES["free"] not in WEIGHED


def test_a_family_without_priors_has_no_coordinates():
    with pytest.raises(ValueError, match="not every parameter has a prior"):
        coordinates_of(FAMILIES["free"])
