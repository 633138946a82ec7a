"""Expressions of formulas: what Python's own arithmetic says of them, and what is refused."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.physics.effects.expression import (
    FUNCTIONS,
    Expression,
    ExpressionError,
    channel_text,
)

FIXED = settings(derandomize=True, deadline=None, max_examples=200)
CHANNELS = {"wind": np.array([0.5, 2.0, 3.5]), "tyre pressure": np.array([80.0, 90.0, 100.0])}
CONSTANTS = {"a": 0.25, "b": 3.0}
PYTHON = {
    "exp": math.exp, "log": math.log, "sqrt": math.sqrt, "tanh": math.tanh, "abs": abs,
    "min": min, "max": max,
}  # fmt: skip

leaves = st.sampled_from(["wind", "'tyre pressure'", "a", "b", "0.5", "2", "1e-3"])


def grown(inner):
    operators = st.sampled_from(["+", "-", "*", "/", "**"])
    functions = st.sampled_from(["exp", "log", "sqrt", "tanh", "abs"])
    binary = st.builds("({} {} {})".format, inner, operators, inner)
    single = st.builds("{}({})".format, functions, inner)
    double = st.builds("{}({}, {})".format, st.sampled_from(["min", "max"]), inner, inner)
    return st.one_of(binary, single, double, st.builds("-{}".format, inner))


texts = st.recursive(leaves, grown, max_leaves=6)


def no_lag(_name, target, _time):
    return target


def by_python(text, row):
    """Value of one row by Python's own arithmetic on floats; None where it has none."""
    words = {"wind": float(CHANNELS["wind"][row]), **CONSTANTS, **PYTHON}
    plain = text.replace("'tyre pressure'", repr(float(CHANNELS["tyre pressure"][row])))
    try:
        value = eval(plain, {"__builtins__": {}}, words)  # noqa: S307  a text of this test
    except (ArithmeticError, ValueError):
        return None
    return value if isinstance(value, int | float) and math.isfinite(value) else None


@FIXED
@given(texts)
def test_the_value_is_that_of_python(text):
    got = np.broadcast_to(Expression(text).evaluate(CHANNELS, CONSTANTS, no_lag), 3)
    for row, value in enumerate(got):
        expected = by_python(text, row)
        if expected is not None:
            assert value == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_all_functions_are_in_the_test():
    assert set(FUNCTIONS) == set(PYTHON)


def test_what_is_not_defined_is_no_number():
    value = Expression("log(wind - 1)").evaluate(CHANNELS, {}, no_lag)
    assert np.isnan(value[0])
    assert np.isfinite(value[1:]).all()


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("1 + a * (wind - b)", (("a", False), ("wind", False), ("b", False))),
        ("exp(wind) * wind", (("wind", False),)),
        ("'tyre pressure' / b", (("tyre pressure", True), ("b", False))),
        ("a * 'a'", (("a", False), ("a", True))),
        ("2 ** 3", ()),
    ],
)
def test_names_stand_in_the_order_of_the_text(text, names):
    assert Expression(text).names == names


def test_a_channel_may_have_the_name_of_a_constant():
    channels = {"a": np.array([10.0, 20.0])}
    value = Expression("a * 'a'").evaluate(channels, {"a": 0.5}, no_lag)
    assert value.tolist() == [5.0, 10.0]


@pytest.mark.parametrize("name", ["wind", "tyre pressure", "a", "exp", "lambda", "it's", "5th"])
def test_any_name_of_a_channel_can_be_written(name):
    text = f"1 + a * {channel_text(name, ['a', 'b'])}"
    value = Expression(text).evaluate({name: np.array([1.0, 2.0])}, {"a": 2.0}, no_lag)
    assert value.tolist() == [3.0, 5.0]


def test_a_lag_is_asked_for_by_a_name_of_its_own():
    asked = []

    def lag(name, target, time):
        asked.append((name, target.tolist(), time))
        return target

    Expression("lag(wind, b) + lag(2 * wind, a)").evaluate(CHANNELS, CONSTANTS, lag)
    assert [(target, time) for _, target, time in asked] == [
        ([0.5, 2.0, 3.5], 3.0),
        ([1.0, 4.0, 7.0], 0.25),
    ]
    assert len({name for name, _, _ in asked}) == 2


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("1 +", "not an expression"),
        ("__import__('os')", "no function '__import__'"),
        ("wind.real", "wind.real"),
        ("wind[0]", "wind"),
        ("a if b else wind", "if"),
        ("lambda: 1", "lambda"),
        ("[wind]", "wind"),
        ("1 < wind", "<"),
        ("exp(x=1)", "exp"),
        ("exp(1, 2)", "exp takes 1 values, not 2"),
        ("max(*wind, 1)", "*wind"),
        ("lag(wind)", "lag takes 2 values, not 1"),
        ("wind @ a", "@"),
        ("True", "True"),
        ("1j", "1j"),
        ("(" * 300 + "1" + ")" * 300, "longer than 500"),
        ("(" * 240 + "1" + ")" * 240, "not an expression"),
        ("a\0b", "not an expression"),
        ("", "not an expression"),
        ("import os", "not an expression"),
        ("1" * 400, "number out of range"),
        ("1e400", "number out of range"),
        ("-" * 400 + "wind", "nested operations"),
        ("[" + "-" * 400 + "wind]", "nested operations"),
        ("+".join(["a"] * 200), "nested operations"),
    ],
)
def test_nothing_else_is_accepted(text, part):
    with pytest.raises(ExpressionError) as error:
        Expression(text)
    assert part in str(error.value)


def test_as_deep_as_it_may_be_it_is_evaluated():
    value = Expression("-" * 98 + "wind").evaluate(CHANNELS, {}, no_lag)
    np.testing.assert_array_equal(value, CHANNELS["wind"])


def test_names_in_the_times_of_lags():
    expression = Expression("lag(wind, a * lag('rain', b)) + c")
    assert expression.names_of_lag_times == (("a", False), ("rain", True), ("b", False))
