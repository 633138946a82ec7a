"""A formula as an effect: beside effects of the library that say the same."""

import numpy as np
import pytest

from adhesion_can.physics.effects import (
    ActiveEffect,
    Contact,
    LagStates,
    build_instruments,
    compute_change,
    effect_by_id,
)
from adhesion_can.physics.effects.expression import ExpressionError
from adhesion_can.physics.effects.formula import LEAST_FACTOR, formula_of, parse_formula
from adhesion_can.physics.instrument_laws import Situation, remove_errors

N = 40
RNG = np.random.default_rng(4)


def contact(**covariates):
    slip = np.linspace(-0.1, 0.1, N)
    speed = np.linspace(5.0, 20.0, N)
    return Contact(
        slip=slip,
        creep_speed=slip * speed,
        speed=speed,
        load=np.linspace(2e5, 2.4e5, N),
        time_s=0.02 * np.arange(N),
        axle=np.arange(N) % 2 + 1.0,
        place=np.arange(N) % 2 + 1.0,
        adhesion=0.2 * np.sign(slip),
        covariates=covariates,
    )


def factor(effect, values, where):
    return compute_change([ActiveEffect(effect, values)], where, LagStates()).factor


def test_a_formula_does_what_the_effect_does_that_it_describes():
    where = contact(relative_humidity_percent=RNG.uniform(40, 90, N))
    formula = formula_of("1 + a * (relative_humidity_percent - 60)", {"a": -0.003})
    known = effect_by_id("humidity")
    np.testing.assert_allclose(
        factor(formula, (-0.004,), where), factor(known, (-0.004,), where), rtol=1e-14
    )
    assert formula.requires.covariates == ("relative_humidity_percent",)


@pytest.mark.parametrize(
    ("name", "values"),
    [("slip", lambda c: abs(c.slip)), ("creep_speed", lambda c: abs(c.creep_speed)),
     ("speed", lambda c: c.speed), ("load", lambda c: c.load)],
)  # fmt: skip
def test_channels_of_every_contact_need_no_signal(name, values):
    where = contact()
    formula = formula_of(f"exp(a * {name})", {"a": 1.0})
    size = 1e-6
    np.testing.assert_allclose(factor(formula, (size,), where), np.exp(size * values(where)))
    assert formula.requires.covariates == ()
    assert (formula.requires.speed, formula.requires.load) == (
        name in {"speed", "creep_speed"},
        name == "load",
    )


def test_a_lag_follows_each_axle_and_goes_on_from_step_to_step():
    wind = RNG.uniform(0, 10, N)
    where = contact(wind=wind)
    formula = formula_of("1 + a * lag(wind, b)", {"a": 0.01, "b": 0.3})
    whole = factor(formula, (0.01, 0.3), where)
    # By hand: dx/dt = (wind - x)/b with the wind a straight line between the rows of an axle.
    for axle in (1.0, 2.0):
        own = where.axle == axle
        x, fine = wind[own][0], 2000
        expected = [x]
        steps = np.diff(where.time_s[own])
        for step, before, after in zip(steps, wind[own][:-1], wind[own][1:], strict=True):
            for k in range(fine):
                x += step / fine / 0.3 * (before + (after - before) * (k + 0.5) / fine - x)
            expected.append(x)
        np.testing.assert_allclose(whole[own], 1 + 0.01 * np.array(expected), rtol=1e-5)


def test_no_factor_is_below_the_least_and_what_is_no_number_stays_so():
    where = contact(wind=np.linspace(-1, 1, N))
    formula = formula_of("1 + a * log(wind)", {"a": 1.0})
    got = factor(formula, (5.0,), where)
    assert np.isnan(got[where.covariates["wind"] < 0]).all()
    assert np.nanmin(got) >= LEAST_FACTOR


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("1 + a * wind", "names no constants"),
        ("1 + a * wind where a", "not a constant with a number"),
        ("1 + a * wind where a=0", "other than 0"),
        ("1 + a * wind where a=inf", "other than 0"),
        ("1 + a * wind where a=1, k=2", "'k' does not occur"),
        ("1 + a where a=1", "no channel"),
        ("1 + a * wind where a=1, = 1", "'' does not occur"),
        ("1 + a * sin(wind) where a=1", "no function 'sin'"),
        ("1 + a * lag(wind, speed) where a=1", "lag depends on 'speed'"),
        ("1 + a * lag(wind, 'a') where a=1", "lag depends on 'a'"),
        ("1 + a * wind where a=1, a=2", "'a' has two values"),
        ("1 + a * lag(wind, -1) where a=1", "time constant of lag(wind, -1) is -1"),
        ("1 + a * lag(wind, b) where a=1, b=1.1e9", "it must be 0 to"),
        ("1 + a * max(lag(wind, 1), lag(wind, 2e9)) where a=1", "is 2e+09"),
    ],
)
def test_what_a_user_may_write_wrong(text, part):
    with pytest.raises(ExpressionError) as error:
        parse_formula(text)
    assert part in str(error.value)


def test_what_a_user_writes():
    formula = parse_formula("1 + size * max('wind speed' - begin, 0) where size=0.1, begin = 5")
    assert [(p.name, p.typical) for p in formula.parameters] == [("size", 0.1), ("begin", 5.0)]
    assert formula.channels == ("wind speed",)


def test_a_constant_lags_behind_nothing():
    where = contact(wind=np.linspace(0, 1, N))
    formula = formula_of("1 + a * lag(b, 2) * wind", {"a": 0.1, "b": 3.0})
    np.testing.assert_allclose(factor(formula, (0.1, 3.0), where), 1 + 0.3 * np.linspace(0, 1, N))


def test_a_formula_acts_on_a_reading():
    formula = parse_formula("speed: 1 + a * max(wind - 1, 0) where a=0.1")
    assert formula.acts_on == "speed"
    assert formula.requires.covariates == ("wind",)
    instruments = build_instruments([ActiveEffect(formula, (0.1,))])
    ones = np.ones(3)
    read = Situation(
        time_s=0.0 * ones, axle=ones, wheel_speed=20 * ones, wheel_accel=0.0 * ones,
        speed=12.0 * ones, effort=1e4 * ones, load=1e5 * ones,
        covariates={"wind": np.array([0.0, 2.0, 3.0])},
    )  # fmt: skip
    true = remove_errors(instruments.laws, read, LagStates()).values
    assert true.speed == pytest.approx([12.0, 12.0 / 1.1, 12.0 / 1.2])
    assert true.effort is read.effort
    assert parse_formula('1 + a * "wind: gusts" where a=0.1').channels == ("wind: gusts",)
    with pytest.raises(ExpressionError, match="known: adhesion, speed, effort"):
        parse_formula("load: 1 + a * wind where a=0.1")
