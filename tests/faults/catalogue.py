"""All kinds of the catalogue by name."""

from collections.abc import Mapping

from tests.faults import events, of_bus, of_effort, of_load, of_speed, of_wheels
from tests.faults.kinds import Kind

KINDS: Mapping[str, Kind] = {
    name: kind
    for table in (of_wheels, of_speed, of_effort, of_load, of_bus, events)
    for name, kind in table.KINDS.items()
}
