"""The catalogue: each kind is there from its onset to its end, and nowhere else."""

from math import inf

import numpy as np
import pytest

from tests.faults.catalogue import FAULTS, KINDS, find, members, pair_name
from tests.faults.locomotive import simulate
from tests.faults.play import cases, find_error, make_case, on_the_bus
from tests.faults.sensors import draw_noise, read

SEED = 5
LATE = {"speed_low_passed", "speed_late", "speed_drifts_up", "speed_drifts_down", "wheel_drifts"}
"""Kinds whose error grows slowly, or depends on how the speed changes."""
SMALL = {
    "loads_frozen", "wheel_tooth", "wheel_spikes", "speed_spikes", "wheel_noisy", "wheels_noisy"
}  # fmt: skip
"""Kinds whose error may never be big: rare, as small as loads change, or noise of the wheels."""


def played(name, size, stays=False):
    case = make_case(name, size, SEED, stays=stays)
    truth = simulate(case.world)
    return case, truth, read(truth, draw_noise(SEED))


def test_there_are_kinds_enough():
    assert len(FAULTS) >= 54
    assert len(KINDS) - len(FAULTS) >= 7


@pytest.mark.costly
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_on_the_bus_from_its_onset_to_its_end(name):
    sizes = KINDS[name].sizes
    given = {}
    for size in sizes:
        case, _, readings = played(name, size)
        sound = on_the_bus(KINDS["nothing"], case, readings)
        spoilt = on_the_bus(KINDS[name], case, readings)
        content = [
            {(f.t_us, f.arbitration_id, f.data[2:]) for f in frames} for frames in (sound, spoilt)
        ]
        other = content[0] ^ content[1]
        times = np.array([t_us for t_us, _, _ in other]) / 1e6
        doubled = len(spoilt) - len(content[1])
        assert doubled > 0 or len(other) > 1
        if len(other):
            assert times.min() >= case.onset_s
            # A reading takes effect at once, a queue of frames has to run dry.
            assert times.max() < case.until_s + (0.5 if KINDS[name].wire else 0.0)
        assert [f.t_us for f in spoilt] == sorted(f.t_us for f in spoilt)
        given[size] = frozenset(content[1])
    assert len(set(given.values())) == len(sizes)


@pytest.mark.parametrize("name", [name for name in FAULTS if KINDS[name].spoil])
def test_the_error_of_a_fault_is_big_soon(name):
    for size in KINDS[name].sizes:
        case, truth, _ = played(name, size, stays=True)
        error_s = find_error(KINDS[name], case, truth)
        if error_s is None:
            assert name in SMALL
        else:
            assert case.onset_s <= error_s < case.onset_s + (inf if name in LATE | SMALL else 2.0)


@pytest.mark.parametrize("number", range(20))
def test_a_pair_is_two_faults(number):
    """What the first does alone is a part of what both do, but where the second hides it."""
    (first, size), (second, _) = members(number)
    assert first != second
    case, _, readings = played(first, size)
    sound = set(on_the_bus(KINDS["nothing"], case, readings))
    together = set(on_the_bus(find(pair_name(number)), case, readings))
    assert together != sound
    early = {f for f in sound if f.t_us < case.onset_s * 1e6}
    assert early <= together


def test_cases_of_a_round():
    assert [(c.size, c.until_s < inf) for c in cases("speed_low", 1)] == [
        (-0.05, False),
        (-0.05, True),
        (-0.10, False),
        (-0.10, True),
    ]
    assert len(cases("real_sand", 1)) == 1
    world = cases("speed_low", 1)[0].world
    assert world.rails[1][0] == cases("speed_low", 1)[0].onset_s + 5.0
    assert len(cases("speed_low", 1)[1].world.rails) == 1
