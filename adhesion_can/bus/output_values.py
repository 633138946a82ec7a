"""Values of the service's messages for their receivers, by the names of their signals."""

from adhesion_can.bus.checked_message import SignalValues
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status


def status_in(values: SignalValues) -> Status:
    """Status of `AdhesionSetpoint`; one that is missing or not known counts as a fault."""
    number = values.get("Status")
    return Status(int(number)) if number is not None and number in set(Status) else Status.FAULT


def theta_in(values: SignalValues) -> tuple[float, float, float] | None:
    """Curve parameters (c1, c2, c3) of `AdhesionModel`; None where one is not available."""
    known = [x for x in (values.get(name) for name in ("C1", "C2", "C3")) if x is not None]
    return (known[0], known[1], known[2]) if len(known) == 3 else None


def objection_in(values: SignalValues) -> Objection:
    """Objection of `AdhesionModel`; one that is missing or that a newer service knows: none."""
    number = values.get("Objection")
    known = number is not None and number in set(Objection)
    return Objection(int(number)) if number is not None and known else Objection.NONE
