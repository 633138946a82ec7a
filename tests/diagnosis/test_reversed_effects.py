"""Effects with time running backwards."""

import numpy as np
import pytest

from adhesion_can.diagnosis.inference.noise_averaging import Reversed
from adhesion_can.physics.effects import Contact, LagStates, effect_by_id
from adhesion_can.testing.effects import draw_contact


def test_backwards_in_time_is_the_mirror_image():
    effect = effect_by_id("creep_relaxation")
    rng = np.random.default_rng(1)
    n = 300
    t = np.cumsum(rng.uniform(0.005, 0.02, n))
    slip, rows = 0.05 * np.sin(7 * t), np.ones(n)
    contact = Contact(slip, slip * 10, 10 * rows, 1e5 * rows, t, rows, rows, 0.2 * rows)
    mirrored = Contact(
        slip[::-1], slip[::-1] * 10, 10 * rows, 1e5 * rows, -t[::-1], rows, rows, 0.2 * rows
    )
    back = Reversed(effect).change(contact, (0.5,), LagStates()).slip
    forward = effect.change(mirrored, (0.5,), LagStates()).slip
    np.testing.assert_array_equal(back, forward[::-1])
    assert not np.allclose(back, effect.change(contact, (0.5,), LagStates()).slip)


@pytest.mark.parametrize(
    ("name", "form", "values"),
    [("humidity", "", (-0.004,)), ("load_dependence", "power", (0.4,)),
     ("falling_friction", "burckhardt", (0.2,)), ("rail_cleaning", "", (0.03,)),
     ("curve_creep", "", (4.0,)), ("traction_braking_asymmetry", "", (0.1,))],
)  # fmt: skip
def test_what_does_not_depend_on_time_is_the_same_in_either_direction(name, form, values):
    """Each row keeps its own speed, load, place, covariates and slip."""
    effect, contact = effect_by_id(name, form), draw_contact(n=60)
    for symmetric in (False, True):
        turned = Reversed(effect, symmetric=symmetric)
        found, wanted = (one.change(contact, values, LagStates()) for one in (turned, effect))
        assert found.slip == pytest.approx(wanted.slip, rel=1e-12)
        assert found.factor == pytest.approx(wanted.factor, rel=1e-12)
    for part in ("id", "form", "title", "parameters", "literature", "requires", "observability"):
        assert getattr(turned, part) == getattr(effect, part)


def test_slip_work_counts_what_comes_after():
    """With a mirror image of power the memory runs the other way; its adhesion turns as well."""
    effect, contact = effect_by_id("adhesion_recovery"), draw_contact(n=60, axles=1)
    back = Reversed(effect).change(contact, (3e-6, 0.5), LagStates()).factor
    power = np.abs(contact.adhesion * contact.load * contact.creep_speed)
    work = 0.0
    for row in range(58, -1, -1):
        for part in range(200):
            p = power[row + 1] + (power[row] - power[row + 1]) * (part + 0.5) / 200
            work += 0.01 / 200 * (p - work / 0.5)
        assert back[row] == pytest.approx(1.0 + 3e-6 * work, rel=2e-4), row
    assert back[-1] == 1.0


def test_the_mean_of_both_directions_smooths_and_is_not_late():
    effect, t = effect_by_id("creep_relaxation"), np.arange(400) * 0.01
    rows = np.ones(400)
    slip = 0.05 * np.exp(-(((t - 1.995) / 0.3) ** 2))
    contact = Contact(slip, slip * 10, 10 * rows, 1e5 * rows, t, rows, rows, 0.2 * rows)
    found = Reversed(effect, symmetric=True).change(contact, (1.0,), LagStates()).slip
    assert found.max() < 0.98 * slip.max()
    assert found == pytest.approx(found[::-1], abs=2e-4)
    late = effect.change(contact, (1.0,), LagStates()).slip
    assert t[late.argmax()] > 2.02
