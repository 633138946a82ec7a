"""A spline of adhesion over a channel: values by hand, and what is no cubic spline."""

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from adhesion_can.physics.effects.empirical import Empirical
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.testing.effects import draw_contact

ENDS = (0.0,) * 4 + (2.0,) * 4
INNER = (0.0,) * 4 + (0.5, 1.2) + (2.0,) * 4
SPLINE = Empirical("dew", "factor", ENDS, (0.1, -0.2, 0.4, 0.3))


def test_without_inner_knots_it_is_bernsteins_polynomial():
    x = np.linspace(0.0, 2.0, 9)
    u = x / 2.0
    wanted = 0.1 * (1 - u) ** 3 - 0.2 * 3 * u * (1 - u) ** 2 + 0.4 * 3 * u**2 * (1 - u) + 0.3 * u**3
    assert SPLINE.at(x) == pytest.approx(wanted, abs=1e-12)


def test_with_inner_knots_a_straight_line_has_its_values_at_the_means_of_three_knots():
    means = tuple(np.mean(INNER[k + 1 : k + 4]) for k in range(6))
    x = np.linspace(0.0, 2.0, 23)
    assert Empirical("dew", "factor", INNER, means).at(x) == pytest.approx(x, abs=1e-12)


def test_beyond_the_knots_it_stays_as_it_is_there():
    assert SPLINE.at(np.array([-5.0, 0.0, 2.0, 7.0])) == pytest.approx([0.1, 0.1, 0.3, 0.3])


@pytest.mark.parametrize("channel", ["slip", "creep_speed", "speed", "load", "time_s", "dew"])
def test_the_factor_is_one_more_than_the_spline_of_the_channel(channel):
    """Slip and creep speed count without their sign."""
    contact = draw_contact(n=60)
    x = np.linspace(-3.0, 3.0, 60)
    if channel == "dew":
        contact = replace(contact, covariates={"dew": x})
    else:
        contact = replace(contact, **{channel: x})
    change = replace(SPLINE, channel=channel).change(contact, (), LagStates())
    seen = np.abs(x) if channel in {"slip", "creep_speed"} else x
    assert change.factor == pytest.approx(1.0 + SPLINE.at(seen), abs=1e-15)
    assert change.slip is contact.slip


def test_only_a_covariate_is_required_and_only_time_is_a_drift():
    names = ("slip", "axle", "time_s", "dew", "wind", "zinc")
    splines = [replace(SPLINE, channel=name) for name in names]
    assert [one.requires.covariates for one in splines] == [
        *((), (), (), ("dew",), ("wind",), ("zinc",))
    ]
    assert [one.observability.drift for one in splines] == [name == "time_s" for name in names]
    assert [one.form for one in splines] == list(names)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"channel": ""}, "name of its channel"),
        ({"kind": "slip"}, "kind 'slip'"),
        ({"coefficients": (0.1, 0.2, 0.3), "knots": (0.0,) * 4 + (2.0,) * 3}, "cubic spline"),
        ({"coefficients": (0.1,) * 5}, "8 knots and 5 coefficients"),
        ({"coefficients": (0.1,) * 3}, "8 knots and 3 coefficients"),
        ({"knots": ENDS[:4]}, "4 knots and 4 coefficients"),
        ({"knots": INNER}, "10 knots and 4 coefficients"),
        ({"coefficients": (0.1, nan, 0.2, 0.3)}, "finite"),
        ({"knots": (*ENDS[:4], *(inf,) * 4)}, "finite"),
        ({"knots": (0.0,) * 8}, "span a range"),
        ({"knots": ENDS[::-1]}, "must not descend"),
        ({"knots": (0.0, 1.0, *(1.0,) * 6)}, "first four knots must be equal"),
        ({"knots": (0.0, 0.0, 0.0, 1.0, *ENDS[4:])}, "first four knots must be equal"),
        ({"knots": (*ENDS[:4], 1.0, 2.0, 2.0, 2.0)}, "first four knots must be equal"),
    ],
)
def test_what_is_no_cubic_spline_says_why(change, words):
    with pytest.raises(ValueError, match=words):
        replace(SPLINE, **change)
