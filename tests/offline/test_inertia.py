"""Adhesion that a wrong inertia of the wheelset makes, and one that a wrong load makes."""

from dataclasses import replace

import pytest

from adhesion_can.offline.plausibility import inspect_samples
from tests.tram import AXLES, VEHICLE, Tram


def findings(seed, **configured):
    """Sentences on samples of the tram, by a vehicle that is configured differently."""
    vehicle = replace(VEHICLE, **configured)
    samples = Tram(seconds=30.0).samples(seed, vehicle=vehicle)
    return [one.sentence for one in inspect_samples(samples, table=False, vehicle=vehicle)]


@pytest.mark.parametrize("seed", range(3))
def test_an_inertia_that_dominates_is_named_and_nothing_else(seed):
    said = findings(seed, wheelset_inertia=92e3)
    assert len(said) == AXLES
    for axle, sentence in enumerate(said, start=1):
        assert sentence.startswith(f"axle {axle}: the adhesion reaches ")
        assert ", most of it wheelset_inertia_kgm2 = 92000 times the angular" in sentence
        assert "correct the inertia in [vehicle]" in sentence
        assert "load" not in sentence


@pytest.mark.parametrize("seed", range(3))
def test_a_load_in_another_unit_is_not_blamed_on_the_inertia(seed):
    said = findings(seed, axle_load=(90.0,) * AXLES)
    assert len(said) == AXLES
    assert all("check the axle load and the unit of the tractive effort" in one for one in said)
    assert not any("inertia" in one for one in said)


def test_the_right_numbers_have_no_finding():
    assert findings(1) == []
