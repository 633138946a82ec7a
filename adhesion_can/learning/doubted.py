"""Whether a service says that something is wrong with its curve or its readings."""

from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.service.outputs import Outputs


def is_doubted(outputs: Outputs) -> bool | None:
    """Whether a setpoint carries a doubt or an objection; None: nothing is known of either.

    An instrument that goes off during a drive raises an objection, one that was off before a doubt.
    """
    if outputs.objection is not Objection.NONE:
        return True
    return None if outputs.doubt is Doubt.NOT_AVAILABLE else outputs.doubt is not Doubt.NONE
