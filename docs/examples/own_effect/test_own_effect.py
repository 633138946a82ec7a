"""What adhesion-can asks of every effect: `pip install pytest`, then `pytest`."""

from own_effect import FlangeLubrication

from adhesion_can.testing import EffectSuite


class TestFlangeLubrication(EffectSuite):
    """The tests are inherited."""

    effect = FlangeLubrication()
