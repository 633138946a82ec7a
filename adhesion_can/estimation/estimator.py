"""Interface of all estimators: samples in, an estimate out."""

from typing import Protocol

from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples


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
        ...
