"""Effects against eq. 4 written out, and the registry against the contract."""

import math

import numpy as np
import pytest

from adhesion_can.physics.effects import EFFECTS, Contact, effect_by_id

CONTRACT_IDS = {
    *("speed_dependence", "load_dependence", "falling_friction", "wheelset_inertia"),
    *("wheel_radius", "speed_scale", "speed_delay", "effort_delay", "effort_bias"),
    *("creep_relaxation", "curve_creep", "rail_cleaning", "adhesion_recovery", "humidity"),
    *("rail_temperature", "sanding", "slow_drift", "traction_braking_asymmetry"),
}


def contact(shape=(7,), seed=3):
    rng = np.random.default_rng(seed)
    slip, speed = rng.uniform(-0.3, 0.3, shape), rng.uniform(1.0, 40.0, shape)
    return Contact(slip, slip * speed, speed, rng.uniform(1.5e5, 2.6e5, shape))


def eq_5(slip):
    return np.array([math.copysign(0.4 * (1 - math.exp(-60 * abs(x))) - 0.3 * abs(x), x)
                     for x in np.ravel(slip)]).reshape(np.shape(slip))  # fmt: skip


def test_ids_are_unique_and_the_contracts():
    ids = [effect.id for effect in EFFECTS]
    assert len(ids) == len(set(ids))
    assert set(ids) <= CONTRACT_IDS
    for name in ids:
        assert effect_by_id(name).id == name


def test_unknown_id_names_the_known_ones():
    with pytest.raises(KeyError, match="falling_friction"):
        effect_by_id("phlogiston")


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.id)
def test_definition_is_complete(effect):
    assert effect.literature.strip()
    assert effect.parameters
    for parameter in effect.parameters:
        assert parameter.name.strip()
        assert parameter.unit.strip()
        assert parameter.meaning.strip()
        assert parameter.lower <= parameter.typical <= parameter.upper
        assert parameter.typical != 0.0
        assert math.isfinite(parameter.lower)
        assert math.isfinite(parameter.upper)


@pytest.mark.parametrize("shape", [(), (6,), (4, 6)])
@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.id)
def test_zero_size_changes_nothing(effect, shape):
    at = contact(shape)
    mu = eq_5(at.slip)
    values = (0.0, *(p.typical for p in effect.parameters[1:]))
    out = effect.apply(mu, at, values)
    assert np.shape(out) == shape
    assert np.array_equal(out, mu)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.id)
def test_typical_size_is_seen_and_leaves_its_inputs_alone(effect):
    at = contact()
    mu = eq_5(at.slip)
    kept = (mu.copy(), at.slip.copy(), at.load.copy())
    out = effect.apply(mu, at, tuple(p.typical for p in effect.parameters))
    assert np.abs(out - mu).max() > 1e-3
    assert np.array_equal(mu, kept[0])
    assert np.array_equal(at.slip, kept[1])
    assert np.array_equal(at.load, kept[2])


def test_falling_friction_is_the_c4_factor_of_eq_4():
    at = contact()
    out = effect_by_id("falling_friction").apply(eq_5(at.slip), at, (0.17,))
    for k in range(7):
        factor = math.exp(-0.17 * abs(at.slip[k] * at.speed[k]))
        assert out[k] == pytest.approx(eq_5(at.slip[k : k + 1])[0] * factor, rel=1e-12)


def test_load_dependence_is_the_c5_factor_of_eq_4():
    at = contact()
    out = effect_by_id("load_dependence").apply(eq_5(at.slip), at, (3e-12,))
    for k in range(7):
        factor = 1 - 3e-12 * at.load[k] ** 2
        assert out[k] == pytest.approx(eq_5(at.slip[k : k + 1])[0] * factor, rel=1e-12)


def test_load_dependence_typical_size_is_what_its_comment_says():
    typical = effect_by_id("load_dependence").parameters[0].typical
    assert 1 - typical * 245e3**2 == pytest.approx(0.88, abs=0.005)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.id)
def test_no_size_within_its_bounds_turns_adhesion_round(effect):
    # 'lower' and 'upper' are what makes sense: a rail that drives the wheel does not.
    at = Contact(*(np.array([x]) for x in (0.1, 1.0, 10.0, 245e3)))
    mu = eq_5(at.slip)
    for bound in ("lower", "upper"):
        values = tuple(getattr(p, bound) for p in effect.parameters)
        assert effect.apply(mu, at, values)[0] >= 0.0
