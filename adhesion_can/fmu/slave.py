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
        # Not rounded: a step of 1/150 s for each cycle of 1/150 s stays one for hours.
        self._exact_us = cycle_s * 1e6
        self._start_us = start_us
        self._read = 0
        """Number of cycles that have begun before the next reading."""

    def is_due(self, from_us: int, until_us: int) -> bool:
        """Whether the signal is to be read at the start of a step; times ascend.

        InputError where the step is longer than the cycle, so that readings would be missing.
        """
        # The ends of the step and the cycle are rounded.
        if until_us - from_us > self.cycle_us + ROUNDING_US:
            raise InputError(
                self._name,
                f"a step of {(until_us - from_us) / 1e6:g} s misses readings, which come each "
                f"{self.cycle_us / 1e6:g} s",
                "step in shorter steps, or set this parameter to the step",
            )
        begun = int((from_us - self._start_us + _HALF_US) // self._exact_us) + 1
        if begun <= self._read:
            return False
        self._read = begun
        return True


ROUNDING_US = 1
"""Largest error of a duration between times in whole microseconds, µs."""
_HALF_US = 0.501
"""Largest error of such a time, µs, and of its sums."""
LONGEST_S = 86_400.0
"""Longest cycle, s: a day."""
