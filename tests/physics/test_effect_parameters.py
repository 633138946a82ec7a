"""Signs of sizes, times that are above 0, and what effects require by what they depend on."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from adhesion_can.physics.effects import EFFECTS, ContactEffect, LagStates, effect_by_id
from adhesion_can.physics.instruments import PERFECT
from adhesion_can.physics.parameter import Wheelset
from adhesion_can.testing.effects import draw_contact, typical_values

ONE_SIGN = {
    *(("load_dependence", "burckhardt"), ("falling_friction", "burckhardt")),
    *(("falling_friction", "polach"), ("adhesion_recovery", ""), ("contact_heating", "")),
    *(("creep_relaxation", ""), ("curve_creep", ""), ("speed_error", "low_pass")),
    *(("brake_blending", "constant"), ("brake_blending", "fade")),
}
"""Effects, with their form, whose size cannot be below 0: a loss, a memory or a length."""
SYMMETRIC = {
    *("humidity", "rail_temperature", "slow_drift", "wheel_radius", "speed_scale", "speed_error"),
    *("wheel_speed_delay", "effort_bias", "effort_gain", "wheel_once_per_turn"),
}
"""Effects whose size is as large upwards as downwards, where it may have both signs."""
LOSSES = {"humidity", "slow_drift", "traction_braking_asymmetry", "rain"}
"""Effects that take adhesion as a rule, by a size below 0."""
IN_CONTACT = [effect for effect in EFFECTS if isinstance(effect, ContactEffect)]


def named(effect):
    return f"{effect.id}:{effect.form}" if effect.form else effect.id


def test_a_size_has_both_signs_unless_it_is_a_loss_or_a_length():
    found = {(one.id, one.form) for one in EFFECTS if one.parameters[0].lower == 0.0}
    assert found == ONE_SIGN
    for effect in EFFECTS:
        size = effect.parameters[0]
        if (effect.id, effect.form) not in ONE_SIGN:
            assert size.lower < 0.0 < size.upper, named(effect)
            if effect.id in SYMMETRIC:
                assert size.upper == -size.lower, named(effect)


def test_typical_sizes_have_the_usual_sign():
    for effect in EFFECTS:
        assert (effect.parameters[0].typical < 0.0) == (effect.id in LOSSES), named(effect)


def test_times_and_speeds_beside_the_size_are_above_0_and_typical_ones_are_within():
    for effect in EFFECTS:
        for one in effect.parameters[1:]:
            if one.unit in {"s", "m/s"} and (effect.id, effect.form) != ("speed_error", "step"):
                assert 0.0 < one.lower <= 0.5 * one.typical, (named(effect), one.name)
                assert one.upper >= 2.0 * one.typical, (named(effect), one.name)


def test_axles_are_numbers_from_1_up_to_three_digits():
    axles = [one for effect in EFFECTS for one in effect.parameters if one.axle]
    assert {(one.lower, one.upper) for one in axles} == {(1.0, 999.0)}
    # The first axle, and of a Co-Co's sanders those of the second bogie.
    assert {one.typical for one in axles} == {1.0, 4.0}


def test_a_phase_may_be_any_angle():
    phase = effect_by_id("wheel_once_per_turn").parameters[1]
    assert (phase.lower, phase.upper) == (-2.0 * pi, 2.0 * pi)


@pytest.mark.parametrize("effect", IN_CONTACT, ids=named)
def test_what_depends_on_the_speed_at_one_slip_requires_it(effect):
    contact = draw_contact(n=60, axles=1)
    faster = replace(contact, speed=2.0 * contact.speed, creep_speed=2.0 * contact.creep_speed)
    changes = [effect.change(one, typical_values(effect), LagStates()) for one in (contact, faster)]
    alike = all(
        np.array_equal(*(getattr(one, name) for one in changes)) for name in ("slip", "factor")
    )
    assert effect.requires.speed != alike


def test_effects_that_show_over_load_or_axle_require_them():
    for effect in EFFECTS:
        channel, requires = effect.observability.channel, effect.requires
        assert requires.load == (channel == "axle_load"), named(effect)
        if channel == "axle" and effect.id != "wheel_once_per_turn":
            assert requires.several_axles, named(effect)
        assert requires.braking == (effect.id == "brake_blending"), named(effect)
    alone = {one.id for one in EFFECTS if one.requires.one_recording}
    assert alone == {"wheel_once_per_turn", "speed_error"}
    assert {one.id for one in EFFECTS if one.observability.drift} == {"slow_drift", "effort_gain"}


def test_an_inertia_is_neither_negative_nor_that_of_more_than_two_fifths_of_the_load():
    """A wheelset of 20 t with wheels of half a metre: 0.4 · 20 000 kg · 0.25 m² = 2000 kg m²."""
    plausible = effect_by_id("wheelset_inertia").parameters[0].plausible
    lower, upper = plausible(Wheelset(load=20e3 * 9.80665, radius=0.5, inertia=150.0))
    assert 150.0 + lower == 0.0
    assert 150.0 + upper == pytest.approx(2000.0)


def test_a_bias_is_at_most_a_tenth_of_the_load_and_adhesion_hardly_rises_with_speed():
    wheelset = Wheelset(load=2e5, radius=0.6, inertia=200.0)
    assert effect_by_id("effort_bias").parameters[0].plausible(wheelset) == (-2e4, 2e4)
    lower, upper = effect_by_id("speed_dependence").parameters[0].plausible(wheelset)
    assert -0.5 < lower < 0.0
    assert upper == effect_by_id("speed_dependence").parameters[0].upper


def test_single_errors_add_up_and_leave_the_others_alone():
    """As two effects of one kind do; of an axle's radius only its own."""
    for name in ("wheelset_inertia", "speed_scale", "speed_delay", "effort_delay", "effort_bias",
                 "wheel_speed_delay"):  # fmt: skip
        effect = effect_by_id(name)
        field = {
            "wheelset_inertia": "inertia_error", "speed_scale": "speed_error"
        }.get(name, name)  # fmt: skip
        first = effect.amend(PERFECT, (0.25,))
        assert first == replace(PERFECT, **{field: 0.25})
        assert effect.amend(first, (0.5,)) == replace(PERFECT, **{field: 0.75})
    radius = effect_by_id("wheel_radius")
    both = radius.amend(radius.amend(PERFECT, (0.01, 2.0)), (0.02, 3.0))
    assert dict(radius.amend(both, (0.03, 2.0)).radius_error) == pytest.approx({2: 0.04, 3: 0.02})


def test_at_a_steady_speed_an_effort_that_is_late_is_a_wheel_speed_that_is_early():
    """Both let the force follow the slip, as a relaxation length does; the other sign does not."""
    signs = {
        (effect.id, separation.rival): separation.one_speed_signs
        for effect in EFFECTS
        for separation in effect.observability.separations
        if separation.one_speed_signs
    }
    assert signs == {
        ("effort_delay", "creep_relaxation"): (1,),
        ("wheel_speed_delay", "creep_relaxation"): (-1,),
        ("wheel_speed_delay", "effort_delay"): (-1, 1),
    }
