"""Axle loads move under effort, and the loads that are known do not show it."""

from adhesion_can.physics.effects.base import Observability, Requirements, Separation
from adhesion_can.physics.effects.rows import LawEffect
from adhesion_can.physics.instrument_laws import LoadShift
from adhesion_can.physics.parameter import Parameter

_SIZE = Parameter("size", "1", 1.0, -1.5, 2.5, "missing transfer, relative to that of the geometry")
"""Of a geometry that is right it is 1 with static loads, 0 with loads that move; half as much
again is left to a geometry that is wrong. Below 0 the known loads move too far."""
_REQUIRES = Requirements(several_axles=True, all_efforts=True)
_OBSERVABILITY = Observability(
    channel="axle",
    excitation="effort of all axles, in traction and in braking",
    separations=(
        Separation(
            "rail_cleaning",
            "strong braking and strong traction: the transferred load changes sign with the effort",
        ),
        Separation(
            "load_dependence",
            "one axle at full effort while the others coast: the load of every axle moves",
        ),
        Separation(
            "traction_braking_asymmetry",
            "the leading axle alone and the trailing axle alone, in traction and in braking",
        ),
    ),
)
_TITLE = "effort moves the axle loads by more than the known loads show"
_LITERATURE = (
    "Garg and Dukkipati, Dynamics of Railway Vehicle Systems, 1984, on weight transfer in traction"
)


LOAD_TRANSFER = LawEffect(
    id="load_transfer",
    form="geometry",
    title=_TITLE,
    parameters=(_SIZE,),
    literature=_LITERATURE,
    requires=_REQUIRES,
    observability=_OBSERVABILITY,
    law=LoadShift,
)
"""N = known N + size · transfer by the geometry, or that of a usual vehicle."""


LOAD_TRANSFER_HEIGHTS = LawEffect(
    id="load_transfer",
    form="heights",
    title=_TITLE,
    parameters=(
        _SIZE,
        Parameter(
            "traction",
            "1",
            1.0,
            0.0,
            3.0,
            "height of the link that pulls the body, above the configured one",
            starts=(1.0,),
        ),
    ),
    literature=_LITERATURE,
    requires=_REQUIRES,
    observability=_OBSERVABILITY,
    law=LoadShift,
)
"""N = known N + size · transfer, the body pulled at another height than the geometry's."""
