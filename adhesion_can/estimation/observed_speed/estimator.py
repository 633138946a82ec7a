"""Stage in front of an estimator whose samples get the vehicle speed that the wheels show."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import hypot, inf

from adhesion_can.estimation.estimator import Estimator, ReplacingStage
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings
from adhesion_can.estimation.observed_speed.speed_observer import ObservedBlock, SpeedObserver
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.samples import NO_SAMPLES, Samples
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.values import Value

_OF_THE_CURVE = (Doubt.NONE, Doubt.SHAPE)
"""Doubts with which the axles agree on one curve."""


@dataclass(frozen=True, slots=True)
class _Maker(Value):
    """What makes an estimator; copies of the stage share it."""

    make: Callable[[], Estimator]


class ObservedSpeedEstimator(ReplacingStage):
    """Estimator whose samples get an observed vehicle speed.

    Until the slips are known for the first time, samples reach the estimator all the same, since
    numbers of LOW_EXCITATION are what a careful drive begins with; then it starts again. Later the
    samples of unknown slips are left out, and the estimate stays as it was.

    Slips of single axles that are off by their radii look like a peak to a curve that was never
    tested against the axles, and like axles or loads that differ to one that was. So no peak is
    identifiable before the test, nor with a doubt other than about the curve's shape, nor where it
    is at slips that are not much larger than their errors.

    Args:
        make_inner: Maker of an estimator of the curve.
        vehicle: Vehicle that the samples come from.
        settings: Settings of the filter.
        cycle_us: Cycle of the wheel speeds, µs.
        largest_std: Largest relative standard deviation of an identifiable λ_m, 1.
        tests_curve: Whether the estimator tests its curve, so that it states a doubt or none.

    """

    def __init__(
        self,
        make_inner: Callable[[], Estimator],
        vehicle: Locomotive,
        settings: ObservedSpeedSettings,
        cycle_us: int,
        *,
        largest_std: float,
        tests_curve: bool,
    ) -> None:
        super().__init__(make_inner())
        self._observer = SpeedObserver(vehicle, settings, cycle_us)
        self._maker = _Maker(make_inner)
        self._largest_std = largest_std
        self._tests_curve = tests_curve
        self._has_begun = False
        """Whether slips were known once."""
        self._objection = Objection.NO_RELIEF
        """Why the estimate does not rest on known slips; none where it does."""
        self._block: ObservedBlock | None = None
        self._given: Estimate | None = None
        self._current: Estimate | None = None

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it."""
        self.used = self._use(samples) if len(samples) else NO_SAMPLES
        self._observer.expire(now_us)
        if self._observer.block is None:
            self._objection = Objection.NO_RELIEF
        given, block = self.inner.update(self.used, now_us), self._observer.block
        if given is not self._given or block is not self._block:
            self._given, self._block = given, block
            self._current = None if given is None else self._vouched(given, block)
        return self._current

    def _use(self, samples: Samples) -> Samples:
        """Samples for the estimator; with the first known slips it starts again."""
        parts: list[Samples] = []
        for observed in self._observer.add(samples):
            if observed.is_known and not self._has_begun:
                self.inner, self._has_begun = self._maker.make(), True
                parts = []
            if observed.is_known or not self._has_begun:
                parts.append(observed.samples)
            if observed.is_known:
                self._objection = Objection.NONE
        block = self._observer.block
        if block is not None and block.objection is not Objection.NONE:
            self._objection = block.objection
        return Samples.concatenate(parts) if parts else NO_SAMPLES

    def _vouched(self, estimate: Estimate, block: ObservedBlock | None) -> Estimate:
        """The estimate with the observed speed, and with the objection to it."""
        if self._objection is not Objection.NONE:
            # What seems to be a change may be one of the slips alone.
            estimate = replace(estimate.objected(self._objection), change_probability=0.0)
        elif block is not None:
            estimate = self._with_slip_error(estimate, block.slip_std)
        return replace(estimate, observed_speed=None if block is None else block.speed)

    def _with_slip_error(self, estimate: Estimate, slip_std: float) -> Estimate:
        """The estimate with the errors of the slips in the standard deviation of λ_m."""
        std = hypot(estimate.lambda_m_std, slip_std)
        is_tested = estimate.doubt in _OF_THE_CURVE or not self._tests_curve
        if is_tested and std <= self._largest_std * estimate.lambda_m:
            return replace(estimate, lambda_m_std=std)
        unknown = Identifiable(mu_max=False, lambda_m=False)
        return replace(estimate, mu_max_std=inf, lambda_m_std=inf, identifiable=unknown)
