"""The estimator at work: an update at each due time, and a fresh estimator where one is needed.

An update takes some milliseconds now and then, and a setpoint should not wait for it. So `prepare`
makes the next update ahead of its due time, on a copy of the estimator, with the samples that there
are (speculative execution). Where these are all when the time comes, the copy takes the estimator's
place; where more came, it is dropped. Either way the estimates are those of `update` alone. An
estimator that cannot be copied is updated at its due times.
"""

import copy
from collections.abc import Callable
from math import isfinite, isnan
from typing import NamedTuple

from adhesion_can.estimation.estimator import Estimator, ReplacingStage
from adhesion_can.estimation.extended.estimator import ExtendedEstimator
from adhesion_can.estimation.plausibility.estimator import WatchedEstimator
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples


class EstimatorFailure(Exception):  # noqa: N818  it reports a failure of the estimator, not of us
    """Failure of an estimator. It is in no known state, and has to be discarded."""


class _Prepared(NamedTuple):
    """An update made ahead of its due time.

    Attributes:
        samples: Samples of the update.
        t_us: Due time, µs.
        estimator: Estimator that has had the update.
        outcome: Estimate, or the failure of the estimator.

    """

    samples: Samples
    t_us: int
    estimator: Estimator
    outcome: Estimate | EstimatorFailure | None

    def serves(self, samples: Samples, t_us: int) -> bool:
        """Whether it is the update with these samples at this due time, µs."""
        return self.t_us == t_us and (self.samples is samples or self.samples.equals(samples))


class EstimationLoop:
    """Estimator with its latest estimate.

    Args:
        make_estimator: Maker of a fresh estimator, called at the start and at each `discard`.

    """

    def __init__(self, make_estimator: Callable[[], Estimator]) -> None:
        self._make_estimator = make_estimator
        self.can_prepare = True
        """Whether updates can be made ahead: the estimator can be copied, as far as is known."""
        self.was_prepared = False
        """Whether the latest update was made ahead of its due time."""
        self.discard()

    def discard(self) -> None:
        """Drop estimator and estimate, and start with a fresh estimator."""
        self._estimator = self._make_estimator()
        self._prepared: _Prepared | None = None
        self._replaced: Estimator | None = None
        self.estimate: Estimate | None = None
        """Latest estimate of the curve; None where there is none."""

    @property
    def left_out(self) -> dict[str, int]:
        """Number of samples to which the extended model could not be applied, by reason."""
        estimator = self._estimator
        if isinstance(estimator, ReplacingStage):
            estimator = estimator.inner
        if isinstance(estimator, WatchedEstimator):
            estimator = estimator.inner
        return dict(estimator.left_out) if isinstance(estimator, ExtendedEstimator) else {}

    @property
    def replaced_samples(self) -> Samples | None:
        """Samples of the latest update as a stage made them; None where none makes others."""
        estimator = self._estimator
        return estimator.used if isinstance(estimator, ReplacingStage) else None

    def update(self, samples: Samples, t_us: int) -> bool:
        """Bring the estimate to a due time.

        Args:
            samples: Samples that became complete since the due time before; may be empty.
            t_us: Due time, µs.

        Returns:
            Whether the estimator gave another estimate than the one before.

        Raises:
            EstimatorFailure: The estimator raised an error, or its estimate is not finite.

        """
        prepared, self._prepared = self._prepared, None
        self.was_prepared = prepared is not None and prepared.serves(samples, t_us)
        if prepared is not None and self.was_prepared:
            # Taking the old one apart takes a while: that is left to the next idle time.
            self._replaced = self._estimator
            self._estimator, outcome = prepared.estimator, prepared.outcome
        else:
            outcome = _outcome(self._estimator, samples, t_us)
        if isinstance(outcome, EstimatorFailure):
            raise outcome
        is_new = outcome is not None and outcome is not self.estimate
        self.estimate = outcome
        return is_new

    def is_prepared(self, samples: Samples, t_us: int) -> bool:
        """Whether an update with these samples has been made ahead of its due time, µs."""
        return self._prepared is not None and self._prepared.serves(samples, t_us)

    @property
    def prepared(self) -> Estimate | None:
        """Estimate of the update made ahead; None where there is none."""
        outcome = None if self._prepared is None else self._prepared.outcome
        return None if isinstance(outcome, EstimatorFailure) else outcome

    def prepare(self, samples: Samples, t_us: int) -> None:
        """Make the update of the next due time ahead of it, where the estimator can be copied.

        Args:
            samples: Samples that became complete since the due time before, as far as is known.
            t_us: Due time, µs.

        """
        self._replaced = None
        try:
            estimator = copy.deepcopy(self._estimator)
        except TypeError:  # a lock, a file or a generator is in it
            self.can_prepare = False
            return
        outcome = _outcome(estimator, samples, t_us)
        self._prepared = _Prepared(samples, t_us, estimator, outcome)


def _outcome(
    estimator: Estimator, samples: Samples, t_us: int
) -> Estimate | EstimatorFailure | None:
    """Estimate of an update, or the failure of the estimator."""
    try:
        estimate = estimator.update(samples, t_us)
    except (ArithmeticError, ValueError) as error:
        failure = EstimatorFailure(f"the estimator failed: {error}")
        failure.__cause__ = error
        return failure
    if estimate is not None and not _is_finite(estimate):
        return EstimatorFailure("the estimate is not finite")
    return estimate


def _is_finite(estimate: Estimate) -> bool:
    """Whether all numbers can be sent; a standard deviation may be infinite."""
    numbers = (*estimate.theta, estimate.mu_max, estimate.lambda_m)
    return all(map(isfinite, numbers)) and not any(
        map(isnan, (estimate.mu_max_std, estimate.lambda_m_std))
    )
