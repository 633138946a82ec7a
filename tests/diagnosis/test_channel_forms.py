"""Forms in which a channel of the user's may act, and channels that cannot be causes."""

from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.diagnosis.inference.channel_candidates import build_channel_candidates
from adhesion_can.physics.channels import UserChannel
from tests.diagnosis.diagnosis_helpers import burckhardt

N = 100
SLIP = np.random.default_rng(1).uniform(-0.1, 0.1, N)
ADHESION = burckhardt(SLIP)
LOAD = np.random.default_rng(2).uniform(1.8e5, 2.2e5, N)


def drive(name="a", **channels):
    """A table with channels, all of them the user's."""
    observed = SimpleNamespace(slip=SLIP, adhesion=ADHESION, load=LOAD)
    return SimpleNamespace(
        name=name,
        covariates={key: np.asarray(x, dtype=float) for key, x in channels.items()},
        user_channels=tuple(UserChannel(key, "mm", f"the {key}") for key in channels),
        observe=lambda *_: observed,
    )


def forms(values):
    """(form, reference) of the candidates of one channel."""
    found, _ = build_channel_candidates([drive(dew=values)])
    return [(one.effect.form or "linear", one.effect.reference) for one in found]


def levels(*counts, first=0.0):
    """So many rows of each of some values in a row."""
    return np.concatenate([np.full(count, first + k) for k, count in enumerate(counts)])


def test_a_quantity_has_a_slope_about_its_mean():
    x = np.random.default_rng(3).uniform(2.0, 9.0, N)
    (candidate,), untested = build_channel_candidates([drive(dew=x)])
    effect = candidate.effect
    assert (effect.id, effect.form, effect.unit, effect.label) == (
        *("channel:dew", "", "mm", "the dew"),
    )
    assert effect.reference == pytest.approx(x.mean())
    assert effect.spread == pytest.approx(x.std())
    assert effect.reach == pytest.approx(np.abs(x - x.mean()).max())
    assert untested == []


def test_of_two_values_there_is_a_step_at_the_second_one_alone():
    assert forms(levels(60, 40)) == [("step", 1.0)]
    assert forms(np.where(levels(60, 40) > 0, 3.7, -1.2)) == [("step", 3.7)]


def test_kinds_that_are_numbered_have_a_step_each_and_a_slope():
    assert forms(levels(20, 50, 30)) == [("linear", 1.1), *(("step", k) for k in (0.0, 1.0, 2.0))]
    six, seven = levels(20, 20, 20, 20, 10, 10), levels(20, 20, 20, 10, 10, 10, 10)
    assert [form for form, _ in forms(six)] == ["linear", *["step"] * 6]
    assert [form for form, _ in forms(seven)] == ["linear"]
    # A few readings of a quantity are no kinds.
    assert [form for form, _ in forms(levels(20, 50, 30, first=0.5))] == ["linear"]


@pytest.mark.parametrize(("rows", "steps"), [(4, [0.0, 1.0]), (5, [0.0, 1.0, 2.0])])
def test_a_value_needs_five_rows_for_a_step(rows, steps):
    found = forms(levels(50, 50 - rows, rows))
    assert [reference for form, reference in found if form == "step"] == steps


@pytest.mark.parametrize(("rows", "steps"), [(4, []), (5, [1.0])])
def test_and_so_do_the_rows_without_it(rows, steps):
    for values in (levels(rows, N - rows), levels(N - rows, rows)):
        assert [reference for _, reference in forms(values)] == steps


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.full(N, 3.0), "does not change"),
        (2.0 - 3.0 * SLIP, "follows the slip"),
        (5.0 * ADHESION, "follows the adhesion"),
        (np.abs(SLIP), "follows the size of the slip"),
        (-np.abs(ADHESION), "follows the size of the adhesion"),
        (ADHESION * LOAD, "follows the"),
        (LOAD, ""),
        (SLIP + 0.03 * np.random.default_rng(4).standard_normal(N), ""),
    ],
)
def test_another_measurement_of_slip_or_force_is_no_cause(values, words):
    candidates, untested = build_channel_candidates([drive(dew=values)])
    assert bool(candidates) is not bool(words)
    assert [one.what for one in untested] == ["channel:dew"] * bool(words)
    assert all(words in one.why for one in untested)


def test_every_recording_must_have_it_and_what_an_effect_takes_is_that_effects():
    x = levels(60, 40)
    both = [drive("a", dew=x, rain=x), drive("b", rain=x)]
    candidates, untested = build_channel_candidates(both)
    assert candidates == ()
    assert [(one.what, one.why[:17]) for one in untested] == [("channel:dew", "b does not have i")]
    twice, _ = build_channel_candidates([drive("a", dew=x), drive("b", dew=x + 5.0)])
    assert [one.effect.reference for one in twice] == [3.0 - 0.1, 0.0, 1.0, 5.0, 6.0]
