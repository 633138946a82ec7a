"""When a switch was thrown, by the samples: its message may come a second later, or earlier.

Sand changes the adhesion when it lies on the rail. The bus reports it once a second, so that for
half a second on average the effect is removed with the wrong value. Each update compares both
values of the switch: with e = z − μ the residual of the value in force and d the difference that
the other value makes, a = Σ w d e / Σ w d² is 0 for the one and 1 for the other. Evidence is a
cumulative sum that does not fall below 0 (Page, Biometrika 41, 1954).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.extended.correction import build_contact
from adhesion_can.physics.burckhardt import adhesion, adhesion_slope
from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.effects import ActiveEffect, LagStates, compute_change
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.readings import Role
from adhesion_can.physics.samples import Samples

SWITCHES: Mapping[str, tuple[float, float]] = {COVARIATES[Role.SANDING]: (0.0, 1.0)}
"""Values of the covariates that are switches, by name."""
APART_US = 1_500_000
"""Longest time between a switch and its message, µs: the cycle of the message, and the way of the
sand. What lasts longer is another surface."""
TEMPERING = 4.0
"""Variance of an update's mean residual over that of independent errors."""
KNOWN = 0.1
"""Relative standard deviation of μ_max up to which the base curve can distinguish the values."""
SUSPECTED_LOG_RATIO, ACCEPTED_LOG_RATIO = 2.0, 16.0
"""Logarithms of the likelihood ratio from which samples count little, and from which the other
value holds."""


class _Evidence(NamedTuple):
    """What an update says of the other value of a switch.

    Attributes:
        logarithm: Logarithm of the likelihood ratio for the other value.
        difference: Adhesion with the other value less that with the value in force, shape (n,).

    """

    logarithm: float
    difference: Array


class SwitchTime:
    """Value of a switch under the wheels, where its message and the samples do not agree yet.

    Args:
        name: Name of the covariate.

    """

    def __init__(self, name: str) -> None:
        self._name, self._values = name, SWITCHES[name]
        self._told = np.nan
        self._since_us: int | None = None
        """Stamp from which on the samples have contradicted the message, µs; None: they do not."""
        self._gave_up = False
        self._sum = 0.0

    def apply(
        self,
        samples: Samples,
        base: Estimate,
        actives: Sequence[ActiveEffect],
        lags: LagStates,
        axles: int,
    ) -> Samples:
        """Samples with the value that they show, and less weight where that is not decided.

        Args:
            samples: Samples of an update, at least one, with all channels of the effects.
            base: Latest estimate of the base curve.
            actives: Effects in the contact with their values.
            lags: Lag states of a steady contact.
            axles: Number of axles of the vehicle.

        """
        now_us, told = int(samples.t_us[-1]), float(samples.covariates[self._name][-1])
        if told not in self._values or base.mu_max_std > KNOWN * base.mu_max:
            self._reset()
            return samples
        if told != self._told:
            # What the samples showed before its message: they agree from here on.
            self._reset()
            self._told = told
        if self._since_us is not None and now_us - self._since_us > APART_US:
            self._reset()
            self._gave_up = True
        if self._gave_up:
            return samples
        low, high = self._values
        held, shown = told, samples
        if self._since_us is not None:
            held = low + high - told
            shown = _with_value(samples, self._name, held)
        evidence = _compare(shown, self._name, low + high - held, base, actives, lags, axles)
        self._sum = max(self._sum + evidence.logarithm, 0.0)
        if self._sum > ACCEPTED_LOG_RATIO:
            self._sum = 0.0
            self._since_us = now_us if self._since_us is None else None
            return _with_value(samples, self._name, low + high - held)
        if self._sum > SUSPECTED_LOG_RATIO:
            further = evidence.difference**2
            return replace(shown, transient_var=shown.transient_var + further)
        return shown

    def _reset(self) -> None:
        self._since_us, self._gave_up, self._sum = None, False, 0.0


def _with_value(samples: Samples, name: str, value: float) -> Samples:
    """Samples with a covariate that has one value."""
    if (samples.covariates[name] == value).all():
        return samples
    column = np.full(len(samples), value)
    return replace(samples, covariates={**samples.covariates, name: column})


def _compare(
    samples: Samples,
    name: str,
    other: float,
    base: Estimate,
    actives: Sequence[ActiveEffect],
    lags: LagStates,
    axles: int,
) -> _Evidence:
    """Evidence of an update for another value of a switch."""
    now = build_contact(samples, int(samples.t_us[0]), axles)
    column = {name: np.full(len(samples), other)}
    then = replace(now, covariates={**now.covariates, **column})
    change, changed = (compute_change(actives, contact, lags) for contact in (now, then))
    factor = np.broadcast_to(change.factor, now.slip.shape)
    slip, sign = np.abs(change.slip), np.where(change.slip < 0.0, -1.0, 1.0)
    curve = sign * factor * adhesion(slip, *base.theta)
    difference = curve * (changed.factor / factor - 1.0)
    slope = factor * adhesion_slope(slip, *base.theta)
    var = (factor * base.noise_std) ** 2 + samples.transient_var + slope**2 * samples.slip_total_var
    weight = difference / var
    information = float(weight @ difference)
    if not information > 0.0:
        return _Evidence(0.0, difference)
    share = float(weight @ (samples.adhesion - curve)) / information
    # Beyond the other value the samples speak for neither.
    return _Evidence(information / TEMPERING * min(share - 0.5, 1.5 - share), difference)


def switches_of(actives: Sequence[ActiveEffect]) -> tuple[SwitchTime, ...]:
    """Switches on which effects depend, undecided."""
    names = {name for active in actives for name in active.effect.requires.covariates}
    return tuple(SwitchTime(name) for name in SWITCHES if name in names)
