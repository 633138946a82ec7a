"""Covariates of samples from columns of readings."""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.readings import Role
from adhesion_can.sampling.column_history import ColumnHistory, Stamps
from adhesion_can.sampling.equations import TRAVEL_DIRECTION, SampleEquations


class CovariateColumns:
    """Recent readings of all covariates.

    Args:
        equations: Settings and equations of the samples.

    """

    def __init__(self, equations: SampleEquations) -> None:
        self._equations = equations
        aids = [name for columns in equations.aids.values() for name in columns]
        names = (TRAVEL_DIRECTION, *COVARIATES.values(), *equations.channels, *aids)
        self.histories = {name: ColumnHistory(0.0) for name in names}
        """Readings by the name of the covariate."""

    def add(self, role: Role, number: int, stamps: Stamps, values: Array) -> None:
        """Add readings of a role, if samples carry it.

        Args:
            role: Meaning of the signal.
            number: Number of a channel of the user's.
            stamps: Stamps, µs, which do not run backwards, shape (n,).
            values: Values, SI; NaN where not available; shape (n,).

        """
        if aid := self._equations.aids.get(role):
            self.histories[aid.value].extend(stamps, values)
            known = np.where(np.isfinite(values), stamps.astype(np.float64), np.nan)
            self.histories[aid.stamp].extend(stamps, known)
        elif name := self._equations.covariate(role, number):
            self.histories[name].extend(stamps, values)

    def add_travel(self, stamps: Stamps, travel: Array) -> None:
        """Add directions of travel, 1 or −1, if samples carry them."""
        if self._equations.with_travel:
            self.histories[TRAVEL_DIRECTION].extend(stamps, travel)

    def at(self, t_us: Stamps, due_us: Stamps) -> dict[str, Array]:
        """Covariates of samples by their stamps and the times at which they were collected.

        Args:
            t_us: Stamps of the samples, µs, shape (n,).
            due_us: Times of collecting, µs, shape (n,).

        Returns:
            Values by name, NaN where not available, shape (n,) each.

        """
        out = {}
        for name, history in sorted(self.histories.items()):
            # Values at the time of collecting, unless samples had to wait for late readings.
            place = (
                np.searchsorted(history.t_us, t_us, side="right") - 1
                if self._equations.lag_us
                else history.before(due_us)
            )
            if len(history.t_us) and (place >= 0).any():
                out[name] = np.where(place >= 0, history.value[place], np.nan)
        return out
