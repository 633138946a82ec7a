"""Contents of the setpoint messages: one value object, and its choice in each status."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import inf
from typing import NamedTuple

from adhesion_can.config import Configuration
from adhesion_can.physics.burckhardt import slip_at_share
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.readings import Role
from adhesion_can.physics.status import Status
from adhesion_can.service.states import VALUES, Values


class Setpoint(NamedTuple):
    """Setpoint of one axle, or of all axles together; None means 'not available'.

    Attributes:
        mu_max: Largest adhesion coefficient μ_max.
        lambda_m: Slip ratio λ_m at μ_max.
        creep_speed: Creep speed r·ω − v to control to, m/s.

    """

    mu_max: float | None = None
    lambda_m: float | None = None
    creep_speed: float | None = None


@dataclass(frozen=True, slots=True)
class Outputs:
    """Contents of the output messages at a due time; None means 'not available'.

    Attributes:
        status: Status of the service.
        setpoint: Setpoint of all axles together.
        axles: Setpoints by axle number, of the axles whose wheel speed and effort are received.
        theta: Curve parameters (c1, c2, c3).
        mu_max_std: Standard deviation of μ_max; inf where μ_max is not identifiable.
        lambda_m_std: Standard deviation of λ_m; inf where λ_m is not identifiable.
        surface_age_s: Time since the last change of the surface, s.
        doubt: Condition that the residual depends on, where the curve cannot explain it.
        family: Name of the most probable curve family; None where none are compared.
        speed: Vehicle speed, m/s; None where it is not available.
        objection: What the readings cannot be, where that is why nobody vouches for the peak.
        speed_observed: Whether wheels and efforts show the speed: no instrument measures it.

    """

    status: Status = Status.INIT
    setpoint: Setpoint = field(default_factory=Setpoint)
    axles: Mapping[int, Setpoint] = field(default_factory=dict)
    theta: tuple[float, float, float] | None = None
    mu_max_std: float | None = None
    lambda_m_std: float | None = None
    surface_age_s: float | None = None
    doubt: Doubt = Doubt.NOT_AVAILABLE
    family: str | None = None
    speed: float | None = None
    objection: Objection = Objection.NONE
    speed_observed: bool = False


LEAST_MU = 0.005
"""Smallest μ_max that a rail may have: half of the 0.01 that crushed leaves come down to."""


@lru_cache(maxsize=8)
def compute_target_slip(theta: tuple[float, float, float], share: float, slip_max: float) -> float:
    """Smallest slip ratio λ with μ(λ) ≥ share · μ_max."""
    return slip_at_share(share, *theta, slip_max=slip_max)


def build_outputs(
    estimate: Estimate,
    status: Status,
    t_us: int,
    creep_per_slip: float,
    target_slip: float,
    axles: tuple[int, ...],
    speed: float | None,
    mu_ceiling: float,
) -> Outputs:
    """Outputs that carry an estimate.

    A peak that no rail has is 'not available' in any status, and its curve too: efforts that all
    read 0, or the end of their range, make one near 0 or above the ceiling.

    Args:
        estimate: Estimate of the curve.
        status: Status of the service.
        t_us: Due time, µs.
        creep_per_slip: Creep speed per unit of slip ratio, max(v, v_min), m/s.
        target_slip: Slip ratio that the creep speed of all axles together aims at.
        axles: Numbers of the axles that have a setpoint.
        speed: Vehicle speed, m/s; None where it is not available.
        mu_ceiling: Largest μ_max that is believed; inf: any.

    """

    def is_of_a_rail(mu_max: float, lambda_m: float) -> bool:
        return LEAST_MU <= mu_max <= mu_ceiling and lambda_m > 0.0

    def setpoint(mu_max: float, lambda_m: float) -> Setpoint:
        if not is_of_a_rail(mu_max, lambda_m):
            return Setpoint()
        # An axle's own curve has the pooled shape: its target slip scales with its λ_m.
        scale = lambda_m / estimate.lambda_m
        return Setpoint(mu_max, lambda_m, target_slip * scale * creep_per_slip)

    pooled = (estimate.mu_max, estimate.lambda_m)
    if not is_of_a_rail(*pooled):
        return Outputs(
            status,
            speed=speed,
            objection=estimate.objection,
            speed_observed=estimate.observed_speed is not None,
        )
    return Outputs(
        status=status,
        setpoint=setpoint(*pooled),
        axles={axle: setpoint(*estimate.per_axle.get(axle, pooled)) for axle in axles},
        theta=estimate.theta,
        mu_max_std=estimate.mu_max_std,
        lambda_m_std=estimate.lambda_m_std,
        surface_age_s=max(t_us - estimate.surface_since_us, 0) / 1e6,
        doubt=estimate.doubt,
        family=estimate.family,
        speed=speed,
        objection=estimate.objection,
        speed_observed=estimate.observed_speed is not None,
    )


class _Current(NamedTuple):
    """What the outputs follow from where current values are sent: arguments of `build`."""

    status: Status
    t_us: int
    estimate: Estimate
    speed: float | None
    speed_derived: bool

    def is_same(self, other: "_Current") -> bool:
        """Whether the outputs are the same: with the very same estimate, which is a value."""
        return self.estimate is other.estimate and self == other


class OutputBuilder:
    """Builds the outputs of each due time: current values, values held from before, or none.

    Args:
        configuration: Axles, smallest speed and share of μ_max that the creep speed aims at.

    """

    def __init__(self, configuration: Configuration) -> None:
        self._v_min = configuration.sampling.v_min
        self._share = configuration.service.target_share
        self._mu_ceiling = configuration.estimators.plausibility.largest_mu
        self._slip_max = configuration.estimators.identifiability.slip_max
        signals = {(choice.role, choice.axle) for choice in configuration.choices}
        self._axles = tuple(
            axle
            for role, axle in sorted(signals)
            if role is Role.WHEEL_SPEED and (Role.TRACTIVE_EFFORT, axle) in signals
        )
        self._last_current: Outputs | None = None
        self._ahead: tuple[_Current, Outputs] | None = None
        """What was computed ahead, and of what."""

    def restart(self) -> None:
        """Forget the values that could be held."""
        self._last_current = self._ahead = None

    def prepare(
        self,
        status: Status,
        t_us: int,
        estimate: Estimate,
        speed: float | None,
        *,
        speed_derived: bool,
    ) -> Outputs | None:
        """Compute ahead what `build` gives if its arguments are these; None: no current values.

        Args:
            status: Status to be expected.
            t_us: Due time, µs.
            estimate: Estimate to be expected.
            speed: Vehicle speed to be expected, m/s; None where it is not available.
            speed_derived: Whether the vehicle speed is derived from the driven axles.

        """
        if VALUES[status] is not Values.CURRENT:
            return None
        current = _Current(status, t_us, estimate, speed, speed_derived)
        outputs = self._build_current(current)
        self._ahead = current, outputs
        return outputs

    def build(
        self,
        status: Status,
        t_us: int,
        estimate: Estimate | None,
        speed: float | None,
        *,
        speed_derived: bool,
        may_hold: bool,
    ) -> Outputs:
        """Outputs of a due time.

        Args:
            status: Status of the service.
            t_us: Due time, µs.
            estimate: Latest estimate of the curve; None where there is none.
            speed: Vehicle speed, m/s; None where it is not available.
            speed_derived: Whether the vehicle speed is derived from the driven axles.
            may_hold: Whether the last current values may be sent in a status that holds them.

        """
        values = VALUES[status]
        ahead, self._ahead = self._ahead, None
        if values is Values.CURRENT and estimate is not None:
            current = _Current(status, t_us, estimate, speed, speed_derived)
            if ahead is not None and ahead[0].is_same(current):
                self._last_current = ahead[1]
            else:
                self._last_current = self._build_current(current)
            return self._last_current
        if values is Values.HELD and self._last_current is not None and may_hold:
            return replace(self._last_current, status=status, speed=speed)
        return Outputs(status, speed=speed)

    def _build_current(self, current: _Current) -> Outputs:
        estimate, speed = current.estimate, current.speed
        if estimate.observed_speed is not None:
            speed = estimate.observed_speed
        if current.speed_derived:
            # Sent as an estimate whose peak is not identifiable.
            estimate = replace(estimate, mu_max_std=inf, lambda_m_std=inf)
        return build_outputs(
            estimate,
            current.status,
            current.t_us,
            max(speed or 0.0, self._v_min),
            compute_target_slip(estimate.theta, self._share, self._slip_max),
            self._axles,
            speed,
            self._mu_ceiling,
        )
