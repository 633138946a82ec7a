"""What a master steps: a part of the co-simulation with its variables.

A slave knows no master and no file. All times are integer microseconds on the master's clock.
"""

from typing import Protocol

from adhesion_can.errors import InputError
from adhesion_can.fmu.variables import Values, Variable


class Slave(Protocol):
    """A part of a co-simulation."""

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Parameters, then inputs, then outputs."""

    def setup(self, values: Values, start_us: int) -> Values:
        """Start, or start again as if nothing had been; returns the outputs at the start.

        Args:
            values: Parameters and inputs by name.
            start_us: Time of the start, µs.

        Raises:
            InputError: A parameter has a value that it cannot have.

        """

    def step(self, from_us: int, until_us: int, values: Values) -> Values:
        """Advance to a time; returns the outputs then.

        Args:
            from_us: Time to which the slave has come, µs.
            until_us: Time to advance to, µs, later than that.
            values: Parameters and inputs by name; inputs are those of `from_us`.

        Raises:
            InputError: The step or an input is not possible.

        """


class Cycle:
    """Times at which a signal is read: the start and each whole cycle after it.

    Args:
        name: Name of the parameter with the cycle, for errors.
        cycle_s: Time from one reading to the next, s.
        start_us: Time of the first reading, µs.

    Raises:
        InputError: The cycle is shorter than a microsecond.

    """

    def __init__(self, name: str, cycle_s: float, start_us: int) -> None:
        if not 1e-6 <= cycle_s <= LONGEST_S:
            what = f"{cycle_s:g} s is no cycle"
            raise InputError(name, what, f"give seconds from 1e-6 to {LONGEST_S:g}")
        self._name = name
        self.cycle_us = round(cycle_s * 1e6)
        """Time from one reading to the next, µs."""
        self._due_us = start_us

    def is_due(self, from_us: int, until_us: int) -> bool:
        """Whether the signal is to be read at the start of a step; times ascend.

        InputError where the step is longer than the cycle, so that readings would be missing.
        """
        if until_us - from_us > self.cycle_us:
            raise InputError(
                self._name,
                f"a step of {(until_us - from_us) / 1e6:g} s misses readings, which come each "
                f"{self.cycle_us / 1e6:g} s",
                "step in shorter steps, or set this parameter to the step",
            )
        if from_us < self._due_us:
            return False
        cycles = (from_us - self._due_us) // self.cycle_us + 1
        self._due_us += cycles * self.cycle_us
        return True


LONGEST_S = 86_400.0
"""Longest cycle, s: a day."""
