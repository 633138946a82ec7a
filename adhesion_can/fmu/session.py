"""Requests of the FMU's library and their answers, all of them lists of numbers.

`source/fmu.c` has the other end, and says what the numbers are.
"""

from collections.abc import Sequence
from math import isfinite, nan
from typing import NamedTuple

from adhesion_can.errors import InputError
from adhesion_can.fmu.slave import ROUNDING_US, Slave
from adhesion_can.fmu.variables import Causality, Values, Variable, VariableType

PROTOCOL = 1.0
"""Number of this protocol."""
SETUP, STEP = 1.0, 2.0
"""Commands."""
LONGEST_ERROR = 900
"""Number of letters of an error that the library has room for."""
HEAD = 3
"""Numbers of a request before the values: command, time, step."""
_TYPES, _CAUSALITIES = list(VariableType), list(Causality)


class Answer(NamedTuple):
    """Answer to a request.

    Attributes:
        outputs: Value of each output.
        error: What is wrong; '' for nothing.

    """

    outputs: list[float]
    error: str = ""

    @property
    def numbers(self) -> list[float]:
        """Whether it failed, length of the error in UTF-8, and the outputs."""
        return [float(bool(self.error)), float(len(self.error.encode())), *self.outputs]


class Session:
    """A slave that answers requests.

    Args:
        slave: The slave.

    """

    def __init__(self, slave: Slave) -> None:
        self._slave = slave
        self._given = [variable.name for variable in slave.variables if variable.is_set]
        self._outputs = [variable.name for variable in slave.variables if not variable.is_set]
        self._now_us: int | None = None

    @property
    def request_length(self) -> int:
        """Number of numbers of a request."""
        return HEAD + len(self._given)

    def answer(self, request: Sequence[float]) -> Answer:
        """Carry out a request; an input that cannot be is an answer with an error."""
        command, time_s, step_s = request[:HEAD]
        values = dict(zip(self._given, request[HEAD:], strict=True))
        try:
            outputs = self._carry_out(command, time_s, step_s, values)
        except InputError as error:
            return self.failure(str(error))
        return Answer([outputs[name] for name in self._outputs])

    def failure(self, error: str) -> Answer:
        """Answer that reports an error."""
        return Answer([nan] * len(self._outputs), error[:LONGEST_ERROR])

    def _carry_out(self, command: float, time_s: float, step_s: float, values: Values) -> Values:
        from_us = _to_us(time_s)
        if command == SETUP:
            self._now_us = from_us
            return self._slave.setup(values, from_us)
        if self._now_us is None:
            raise InputError("step", "the FMU is not initialised", "initialise it first")
        until_us = _to_us(time_s + step_s)
        # Some masters add their steps up, some multiply them.
        if abs(from_us - self._now_us) > ROUNDING_US:
            raise InputError(
                f"step at {time_s:g} s",
                f"the step before ended at {self._now_us / 1e6:g} s",
                "step forward without a gap; this FMU cannot go back",
            )
        from_us = self._now_us
        if until_us <= from_us:
            what = "shorter than a microsecond"
            raise InputError(f"step of {step_s:g} s", what, "take a longer step")
        self._now_us = until_us
        return self._slave.step(from_us, until_us, values)


def hello(variables: Sequence[Variable]) -> list[float]:
    """Type, causality and start value of each variable, as the library numbers them."""
    return [
        number
        for variable in variables
        for number in (
            float(_TYPES.index(variable.type)),
            float(_CAUSALITIES.index(variable.causality)),
            variable.start,
        )
    ]


def _to_us(time_s: float) -> int:
    """Time in whole microseconds."""
    if not isfinite(time_s) or abs(time_s) > LATEST_S:
        raise InputError("time", f"{time_s:g} s is no time", f"at most {LATEST_S:g} s")
    return round(time_s * 1e6)


LATEST_S = 1e9
"""Latest time, s: to it a double still has microseconds."""
