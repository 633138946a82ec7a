"""What a creep controller knows at a step: measurements, and the service's latest setpoints."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import (
    SLIP_MAX,
    CurveParameters,
    adhesion,
    adhesion_slope,
    slip_at_share,
)
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status

LEAST_ADHESION = 1e-3
"""Smallest adhesion that an elasticity divides by."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """Measured state of the vehicle.

    Attributes:
        time_s: Time, s.
        speed: Vehicle speed that was received since the last step, m/s; None: none was.
        rim_speed: Speed of each wheel's rim, m/s, shape (axles,); NaN: not available.
        effort: Effort at the rim of each axle, N, shape (axles,).
        load: Load of each axle, N, shape (axles,).

    """

    time_s: float
    speed: float | None
    rim_speed: Array
    effort: Array
    load: Array


@dataclass(frozen=True, slots=True)
class Advice:
    """Latest contents of the service's messages; None means 'not available'.

    Attributes:
        status: Status of the service.
        doubt: Condition that the residual depends on.
        lambda_m: Slip ratio of the peak.
        lambda_m_std: Standard deviation of `lambda_m`.
        theta: Curve parameters (c1, c2, c3).
        axles: Slip ratio of the peak by axle number.
        objection: What the readings cannot be.
        relief_wanted: Whether the filter of the speed needs an axle to be relieved now.

    """

    status: Status = Status.INIT
    doubt: Doubt = Doubt.NOT_AVAILABLE
    lambda_m: float | None = None
    lambda_m_std: float | None = None
    theta: CurveParameters | None = None
    axles: Mapping[int, float] = field(default_factory=dict)
    objection: Objection = Objection.NONE
    relief_wanted: bool = False

    def trusted_curve(self, largest_std: float) -> "KnownCurve | None":
        """Curve of the surface, where the service states it and nothing speaks against it.

        A doubt that is not available (too few data to test the curve) does not: the controller
        holds a curve only where its own search agrees with it.

        Args:
            largest_std: Largest relative standard deviation of λ_m.

        """
        if self.status not in (Status.TRACKING, Status.LOW_EXCITATION):
            return None
        if self.objection is not Objection.NONE:
            return None
        if self.doubt not in (Doubt.NONE, Doubt.NOT_AVAILABLE):
            return None
        if not self.theta or not self.lambda_m or self.lambda_m_std is None:
            return None
        std = self.lambda_m_std / self.lambda_m
        c1, c2, _ = self.theta
        if std > largest_std or not (c1 > 0.0 and c2 > 0.0):
            return None
        return KnownCurve(self.theta, self.lambda_m, std, dict(self.axles))


@dataclass(frozen=True, slots=True)
class KnownCurve:
    """Curve that a controller may hold a point of.

    Attributes:
        theta: Curve parameters (c1, c2, c3).
        lambda_m: Slip ratio of the peak.
        std: Relative standard deviation of λ_m.
        axles: Slip ratio of the peak by axle number.

    """

    theta: CurveParameters
    lambda_m: float
    std: float
    axles: Mapping[int, float]

    def slips(self, share: float, axles: int) -> Array:
        """Smallest slip ratio of each axle with that share of its peak, shape (axles,)."""
        c1, c2, c3 = self.theta
        slip = min(slip_at_share(share, c1, c2, c3, slip_max=SLIP_MAX), self.lambda_m)
        peak_slips = [self.axles.get(axle, self.lambda_m) for axle in range(1, axles + 1)]
        return np.asarray(slip * np.array(peak_slips) / self.lambda_m)

    def adhesion(self, slip: Array | float) -> Array:
        """Adhesion at slip ratios (eq. 5), same shape."""
        return adhesion(np.asarray(slip), *self.theta)

    def elasticity(self, slip: Array) -> Array:
        """Elasticity d ln μ/d ln λ at slip ratios, same shape."""
        slope = adhesion_slope(slip, *self.theta)
        return np.asarray(slip * slope / np.maximum(self.adhesion(slip), LEAST_ADHESION))
