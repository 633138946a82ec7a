"""Objections: their numbers are on the bus, and logs of years hold them."""

from adhesion_can.physics.objection import NEEDS_RELIEF, WORDINGS, Objection

NAMES = [
    *("none", "speed_jump", "wheels_jump", "efforts_jump", "loads_jump", "speed_deviates"),
    *("loads_off", "beyond_ceiling", "slips_beyond_model", "no_relief", "radii_uncertain"),
    *("efforts_rose", "rail_changed"),
]


def test_each_number_keeps_its_meaning():
    assert [one.name.lower() for one in Objection] == NAMES
    assert [one.value for one in Objection] == list(range(13))
    assert [one.json_name for one in Objection] == [None, *NAMES[1:]]


def test_each_objection_says_what_is_wrong_and_what_to_do():
    assert set(WORDINGS) == set(Objection) - {Objection.NONE}
    assert all(one.what and one.fix for one in WORDINGS.values())
    assert {one.name.lower() for one in NEEDS_RELIEF} == set(NAMES[9:])
