"""Data of the default vehicle that another vehicle was not given."""

from dataclasses import replace

from adhesion_can.bus.block import Block
from adhesion_can.config import load_configuration
from adhesion_can.offline.check import check
from adhesion_can.physics.vehicle import Locomotive

CONFIG = load_configuration()


def warnings_for(vehicle):
    return check([Block.from_frames([])], replace(CONFIG, vehicle=vehicle)).warnings


def test_what_was_not_given_of_another_vehicle_is_told():
    (warning,) = warnings_for(Locomotive(wheel_radius=(0.33,) * 6))
    assert warning.startswith("axle_load_N = 245000, wheelset_inertia_kgm2 = 200: ")
    assert "[vehicle]" in warning


def test_the_default_vehicle_and_one_that_is_given_are_no_matter():
    assert warnings_for(Locomotive()) == []
    given = Locomotive(wheel_radius=(0.33,) * 6, axle_load=(9e4,) * 6, wheelset_inertia=60.0)
    assert warnings_for(given) == []
