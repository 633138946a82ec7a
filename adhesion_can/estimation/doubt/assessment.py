"""What is known of the model's error after a block of the drive."""

from dataclasses import dataclass

from adhesion_can.estimation.curves.online_comparison import FamilyComparison
from adhesion_can.estimation.doubt.lasting_errors import NONE, LastingErrors
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.estimate import PeakEstimate
from adhesion_can.values import Value


@dataclass(frozen=True, slots=True)
class Assessment(Value):
    """What is known of the model's error after a block.

    Attributes:
        doubt: Condition that the residual depends on.
        names: Names of the directions that decided.
        lasting: Errors that last about the pooled curve.
        remaining: Errors that last about the full model.
        plain: Peak of the pooled curve.
        full: Peak with the selected directions and the instruments' errors.
        families: Curve families weighed against each other; None while there is no reason to doubt
            Burckhardt's, or too little is known.
        instrument_std: Standard deviations of μ_max and λ_m by what the instruments may be wrong
            by and the data have not excluded, as shares of them.
        lambda_m_scatter: Standard deviation of λ_m by the scatter of the blocks, as a share of it.

    """

    doubt: Doubt
    names: tuple[str, ...]
    lasting: LastingErrors
    remaining: LastingErrors
    plain: PeakEstimate | None = None
    full: PeakEstimate | None = None
    families: FamilyComparison | None = None
    instrument_std: tuple[float, float] = (0.0, 0.0)
    lambda_m_scatter: float = 0.0


UNKNOWN = Assessment(Doubt.NONE, (), NONE, NONE)
"""Assessment before there are enough blocks."""
