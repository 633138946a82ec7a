"""Test suites for effects and estimators, for pytest: inherit one and name yours.

    from adhesion_can.testing import EffectSuite
    from own_effect import FlangeLubrication

    class TestFlangeLubrication(EffectSuite):
        effect = FlangeLubrication()

The effects and estimators of this package pass the same tests.
"""

from adhesion_can.testing.effects import EffectSuite
from adhesion_can.testing.estimators import EstimatorSuite

__all__ = ["EffectSuite", "EstimatorSuite"]
