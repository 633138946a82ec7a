"""Adhesion over a channel of the user's: titles, factors by hand, and bounds of the size."""

from math import inf

import numpy as np
import pytest

from adhesion_can.physics.effects.channel_factor import LEAST_FACTOR, STEP, ChannelFactor
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.testing.effects import draw_contact

CONTACT = draw_contact(n=12)


def factors(effect, values, *numbers):
    x = np.array(numbers, dtype=float)
    contact = CONTACT.__class__(
        *(np.full(len(x), 0.02) for _ in range(8)), covariates={effect.channel: x}
    )
    change = effect.change(contact, values, LagStates())
    assert change.slip is contact.slip
    return np.asarray(change.factor).tolist()


@pytest.mark.parametrize(
    ("effect", "title"),
    [
        (ChannelFactor("dew"), "adhesion changes with dew"),
        (ChannelFactor("dew", label="dew point"), "adhesion changes with dew point"),
        (ChannelFactor("relative_humidity_percent"), "adhesion changes with relative humidity"),
        (ChannelFactor("dew", reference=1.0), "adhesion changes with dew"),
        (ChannelFactor("rail=wet", reference=1.0), "adhesion changes with rail=wet"),
        (ChannelFactor("dew", form=STEP, reference=2.5), "adhesion changes where dew is 2.5"),
        (ChannelFactor("dew", form=STEP, reference=1.0), "adhesion changes where dew is 1"),
        (ChannelFactor("rail=wet", form=STEP, reference=1.0),
         "adhesion changes where rail is wet"),
        (ChannelFactor("rail=wet", form=STEP), "adhesion changes where rail=wet is 0"),
        (ChannelFactor("rail=wet", label="water", form=STEP, reference=1.0),
         "adhesion changes where water is 1"),
    ],
)  # fmt: skip
def test_titles_say_with_what_or_where_adhesion_changes(effect, title):
    assert effect.title == title


def test_a_slope_counts_from_the_reference_and_keeps_a_twentieth():
    effect = ChannelFactor("dew", reference=10.0)
    assert factors(effect, (0.02, 10.0), 10.0, 15.0, 0.0) == pytest.approx([1.0, 1.1, 0.8])
    assert factors(effect, (-0.2, 8.0), 8.0, 10.0, 100.0) == pytest.approx([1.0, 0.6, 0.05])


def test_a_step_is_at_one_value_alone():
    effect = ChannelFactor("shop", form=STEP, reference=3.0)
    assert factors(effect, (0.4, 3.0), 2.0, 3.0, 4.0, 3.0) == pytest.approx([1.0, 1.4, 1.0, 1.4])
    assert factors(effect, (-0.99, 3.0), 3.0, 0.0) == pytest.approx([0.05, 1.0])


def test_at_the_bounds_of_its_size_the_least_factor_is_just_reached_in_the_data():
    effect = ChannelFactor("dew", reference=10.0, reach=4.0, spread=2.0)
    slope, given = effect.parameters
    assert slope.upper == -slope.lower
    assert factors(effect, (slope.lower, 10.0), 14.0) == pytest.approx([LEAST_FACTOR])
    assert factors(effect, (slope.upper, 10.0), 6.0) == pytest.approx([LEAST_FACTOR])
    assert (given.typical, given.given, given.free) == (10.0, True, False)
    step = ChannelFactor("shop", form=STEP, reference=3.0)
    assert factors(step, (step.parameters[0].lower, 3.0), 3.0) == pytest.approx([LEAST_FACTOR])
    assert step.parameters[0].upper > 1.0
    assert step.parameters[1].typical == 3.0


def test_without_a_reach_any_slope_is_possible_and_a_typical_one_shows_over_the_spread():
    slope, _ = ChannelFactor("dew", spread=4.0).parameters
    assert (slope.lower, slope.upper) == (-inf, inf)
    assert slope.typical * 4.0 == pytest.approx(ChannelFactor("dew").parameters[0].typical)


@pytest.mark.parametrize(
    ("effect", "unit"),
    [
        (ChannelFactor("dew", unit="mm"), "mm"),
        (ChannelFactor("relative_humidity_percent"), "%"),
        (ChannelFactor("dew"), "dew"),
    ],
)
def test_units_are_the_users_or_the_catalogues_or_the_channel_itself(effect, unit):
    slope, reference = effect.parameters
    assert (slope.unit, reference.unit) == (f"1/{unit}", unit)


def test_it_needs_its_channel_and_shows_over_it():
    effect = ChannelFactor("dew")
    assert effect.id == "channel:dew"
    assert effect.requires.covariates == (effect.observability.channel,) == ("dew",)
