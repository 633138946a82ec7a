"""What an estimator is to the service: samples in, an estimate out."""

from typing import Protocol

from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples


class Estimator(Protocol):
    """Follows the adhesion curve through a stream of samples.

    `update` is called once per setpoint cycle with whatever samples came in it, possibly none.
    An estimator is deterministic: its random numbers come from a seed in its settings.
    """

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Take samples and give the present estimate.

        Args:
            samples: new ones, in the order of their stamps; may be empty.
            now_us: present time, µs.

        Returns:
            The estimate; None as long as there is none.

        """
        ...
