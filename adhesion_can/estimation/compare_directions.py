"""Whether one curve holds for traction and for braking, and slip and adhesion have one sign.

A slip that is none of the contact (of wheels that run another way in a bend, or of a friction brake
whose force is not measured) looks like a fall beyond a peak, and no noise is as systematic.
"""

from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.likelihood import innovation
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples

NEAR_PEAK = 0.5
"""Slip, in λ_m, from which samples count: they decide where the peak is."""
DIFFERENT = 0.2
"""Difference of the directions, as a share of μ_max, from which one curve holds for neither."""
CERTAIN = 4.0
"""Difference in its standard errors from which it is certain."""
OPPOSITE = 0.25
"""Share of the samples beyond the peak whose adhesion is against their slip, from which these are
no samples of one contact. A noise as large as μ_max causes a sixth."""
FEWEST, LEAST_SHARE = 30, 0.05
"""Least number of samples of each direction near the peak and beyond it, and their least share."""


class Directions(NamedTuple):
    """What speaks against one curve for traction and braking.

    Attributes:
        difference: Mean adhesion of traction less that of braking near the peak, as a share of
            μ_max; 0 where it is not certain, or too small to matter.
        opposite: Share of the samples beyond the peak whose adhesion is against their slip; 0 where
            noise may cause it.

    """

    difference: float = 0.0
    opposite: float = 0.0

    @property
    def agree(self) -> bool:
        """Whether nothing speaks against one curve."""
        return not (self.difference or self.opposite)

    @property
    def sentence(self) -> str:
        """What speaks against one curve, with what may cause it; '' where nothing does."""
        contradictions = []
        if self.opposite:
            share = f"{100 * self.opposite:.0f} % of the samples beyond the peak"
            contradictions.append(f"slip and adhesion have opposite signs in {share}")
        if self.difference:
            way = "above" if self.difference > 0.0 else "below"
            share = f"{100 * abs(self.difference):.0f} % of mu_max"
            contradictions.append(
                f"near the peak, adhesion in traction is {share} {way} adhesion in braking"
            )
        if not contradictions:
            return ""
        return (
            f"{', and '.join(contradictions)}: one curve does not fit both, so its peak is not "
            "identified. Friction brakes that the effort does not contain, or slip in bends, "
            "may be the reason; 'adhesion-can diagnose' looks for it"
        )


def compare_directions(estimate: Estimate, samples: Samples) -> Directions:
    """What speaks against one curve for traction and braking.

    Args:
        estimate: Curve of both directions.
        samples: Samples that it was fitted to.

    """
    if not estimate.mu_max > 0.0:
        return Directions()
    size, aligned = samples.folded()
    opposite = share_opposite(aligned[size > estimate.lambda_m])
    near = size > NEAR_PEAK * estimate.lambda_m
    residual = innovation(estimate.theta, size, aligned)
    sides = [residual[near & (np.sign(samples.slip) == sign)] for sign in (1.0, -1.0)]
    difference = 0.0
    if min(map(len, sides)) >= max(FEWEST, LEAST_SHARE * np.count_nonzero(near)):
        difference = float(sides[0].mean() - sides[1].mean())
        error = float(np.hypot(*(side.std() / np.sqrt(len(side)) for side in sides)))
        certain = abs(difference) >= max(CERTAIN * error, DIFFERENT * estimate.mu_max)
        difference = difference / estimate.mu_max if certain else 0.0
    return Directions(difference, opposite)


def share_opposite(aligned: Array) -> float:
    """Share of samples beyond the peak whose adhesion is against their slip; 0 where noise may be.

    Args:
        aligned: Adhesion of the samples beyond the peak, positive along the slip; shape (n,).

    """
    share = float(np.mean(aligned < 0.0)) if len(aligned) >= FEWEST else 0.0
    return share if share >= OPPOSITE else 0.0
