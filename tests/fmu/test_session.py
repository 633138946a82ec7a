"""Requests of the library and their answers."""

from math import isnan, nan

import pytest

from adhesion_can.errors import InputError
from adhesion_can.fmu.session import SETUP, STEP, Session, hello
from adhesion_can.fmu.variables import (
    DOUBT,
    Causality,
    Variable,
    VariableType,
    enumerated,
    in_order,
    with_integers,
)

VARIABLES = in_order(
    [
        Variable("y", Causality.OUTPUT, "sum", "m"),
        enumerated("d", Causality.INPUT, DOUBT, "doubt", 15),
        Variable("u", Causality.INPUT, "one", "m"),
        Variable("k", Causality.PARAMETER, "two", "m", 2.0, VariableType.INTEGER),
    ]
)


class Adder:
    """Slave that adds; it notes its calls."""

    variables = VARIABLES

    def __init__(self):
        self.calls = []

    def setup(self, values, start_us):
        self.calls.append(("setup", start_us))
        return {"y": values["k"]}

    def step(self, from_us, until_us, values):
        self.calls.append((from_us, until_us))
        if values["u"] < 0:
            raise InputError("u", "is negative", "give 0 or more")
        return {"y": values["k"] + values["u"]}


def test_parameters_come_first_and_outputs_last():
    assert [one.name for one in VARIABLES] == ["k", "d", "u", "y"]
    assert hello(VARIABLES)[:9] == [1.0, 0.0, 2.0, 3.0, 1.0, 15.0, 0.0, 1.0, hello(VARIABLES)[8]]
    assert isnan(hello(VARIABLES)[8])


def test_an_enumeration_as_integer_keeps_its_numbers_in_words():
    one = with_integers(VARIABLES)[1]
    assert one.type is VariableType.INTEGER
    assert one.start == 15.0
    assert "2 SPEED" in one.description
    assert "15 NOT_AVAILABLE" in one.description


def test_steps_follow_each_other():
    slave = Adder()
    session = Session(slave)
    assert session.request_length == 6
    assert session.answer([SETUP, 1.5, 0.0, 2.0, 15.0, nan]).outputs == [2.0]
    assert session.answer([STEP, 1.5, 0.1, 2.0, 15.0, 3.0]).numbers == [0.0, 0.0, 5.0]
    assert session.answer([STEP, 1.5 + 0.1, 0.1, 2.0, 15.0, 4.0]).outputs == [6.0]
    assert slave.calls == [("setup", 1_500_000), (1_500_000, 1_600_000), (1_600_000, 1_700_000)]


def test_many_short_steps_do_not_drift():
    slave = Adder()
    session = Session(slave)
    session.answer([SETUP, 0.0, 0.0, 2.0, 15.0, 0.0])
    t_s = 0.0
    for _ in range(5000):
        assert not session.answer([STEP, t_s, 0.0001, 2.0, 15.0, 0.0]).error
        t_s += 0.0001  # a master adds up as it likes
    assert slave.calls[-1] == (499_900, 500_000)


@pytest.mark.parametrize(
    ("time_s", "step_s", "said"),
    [
        (0.3, 0.1, "the step before ended at 0.2 s"),
        (0.1, 0.1, "cannot go back"),
        (0.2, 1e-9, "shorter than a microsecond"),
        (0.2, -0.1, "shorter than a microsecond"),
        (0.2, 1e12, "is no time"),
    ],
)
def test_a_step_that_does_not_follow_is_refused(time_s, step_s, said):
    session = Session(Adder())
    session.answer([SETUP, 0.2, 0.0, 2.0, 15.0, 0.0])
    answer = session.answer([STEP, time_s, step_s, 2.0, 15.0, 0.0])
    assert said in answer.error
    assert isnan(answer.outputs[0])
    assert answer.numbers[:2] == [1.0, float(len(answer.error.encode()))]


def test_a_long_error_is_cut_to_the_room_of_the_library():
    numbers = Session(Adder()).failure("\u00e4" * 5000).numbers
    assert 1000 < numbers[1] < 4000


def test_a_fault_of_an_input_is_an_answer():
    session = Session(Adder())
    session.answer([SETUP, 0.0, 0.0, 2.0, 15.0, 0.0])
    assert session.answer([STEP, 0.0, 0.1, 2.0, 15.0, -1.0]).error.startswith("u: is negative")


@pytest.mark.parametrize("step_s", [62.5e-6, 312.5e-6, 1 / 48_000, 1 / 44_100, 1 / 300])
def test_times_may_be_rounded_by_how_a_master_computes_them(step_s):
    multiplied, summed = Session(Adder()), Session(Adder())
    start, now = [SETUP, 100.0, 0.0, 2.0, 0.0, 0.0], 100.0
    assert not multiplied.answer(start).error
    assert not summed.answer(start).error
    for k in range(2000):
        assert not multiplied.answer([STEP, 100.0 + k * step_s, step_s, 2.0, 0.0, 0.0]).error
        assert not summed.answer([STEP, now, step_s, 2.0, 0.0, 0.0]).error
        now += step_s
