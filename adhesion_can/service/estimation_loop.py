"""The estimator at work: an update at each due time, and a fresh estimator where one is needed."""

from collections.abc import Callable
from math import isfinite, isnan

from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.extended.estimator import ExtendedEstimator
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples


class EstimatorFailure(Exception):  # noqa: N818  it reports a failure of the estimator, not of us
    """Failure of an estimator. It is in no known state, and has to be discarded."""


class EstimationLoop:
    """Estimator with its latest estimate.

    Args:
        make_estimator: Maker of a fresh estimator, called at the start and at each `discard`.

    """

    def __init__(self, make_estimator: Callable[[], Estimator]) -> None:
        self._make_estimator = make_estimator
        self.discard()

    def discard(self) -> None:
        """Drop estimator and estimate, and begin with a fresh estimator."""
        self._estimator = self._make_estimator()
        self.estimate: Estimate | None = None
        """Latest estimate of the curve; None where there is none."""

    @property
    def left_out(self) -> dict[str, int]:
        """Number of samples to which the extended model could not be applied, by reason."""
        estimator = self._estimator
        return dict(estimator.left_out) if isinstance(estimator, ExtendedEstimator) else {}

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
        try:
            estimate = self._estimator.update(samples, t_us)
        except (ArithmeticError, ValueError) as error:
            raise EstimatorFailure(f"the estimator failed: {error}") from error
        if estimate is not None and not _is_finite(estimate):
            raise EstimatorFailure("the estimate is not finite")
        is_new = estimate is not None and estimate is not self.estimate
        self.estimate = estimate
        return is_new


def _is_finite(estimate: Estimate) -> bool:
    """Whether all numbers can be sent; a standard deviation may be infinite."""
    numbers = (*estimate.theta, estimate.mu_max, estimate.lambda_m)
    return all(map(isfinite, numbers)) and not any(
        map(isnan, (estimate.mu_max_std, estimate.lambda_m_std))
    )
