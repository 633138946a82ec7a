"""Interface of all estimators: samples in, an estimate out; and of a stage that changes samples."""

from typing import Protocol

from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import NO_SAMPLES, Samples
from adhesion_can.values import Stateful


class Estimator(Protocol):
    """Estimator of the adhesion curve from a stream of samples.

    `update` is called once per setpoint cycle with the samples of that cycle, possibly none.
    An estimator is deterministic: its random numbers come from a seed in its settings. On a bus
    one that `copy.deepcopy` can copy is updated ahead of its due time, so that no setpoint waits.
    """

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process new samples.

        Args:
            samples: New samples in the order of their stamps; may be empty.
            now_us: Current time, µs.

        Returns:
            Current estimate; None before the first one.

        """


class ReplacingStage(Stateful):
    """Stage in front of an estimator that gives it other samples than it gets itself.

    Args:
        inner: Estimator of the curve.

    """

    def __init__(self, inner: Estimator) -> None:
        self.inner = inner
        """Estimator of the curve."""
        self.used = NO_SAMPLES
        """Samples that the latest update gave to it."""
