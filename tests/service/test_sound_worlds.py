"""Sound drives of worlds that share nothing with the watch: it objects to none of them."""

import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.config import load_configuration
from adhesion_can.physics.objection import Objection
from adhesion_can.recordings.candump import ReadReport, read_candump
from adhesion_can.service.core import ServiceCore
from tests.seeds import first_quick
from tests.worlds.encoding import write_log
from tests.worlds.plant import drive
from tests.worlds.world import World


@pytest.mark.costly
@pytest.mark.parametrize("seed", first_quick([6, *range(1, 6), *range(7, 13)]))
def test_sound_readings_raise_no_objection(seed, tmp_path):
    """Seed 6 coasts at 5 m/s after a light train was pulled hard."""
    world = World("null:0", seed, 0, 30.0)
    log = tmp_path / "drive.log"
    write_log(drive(world.profile, world.vehicle, world.rail, (), world.noise), log)
    found = []
    core = ServiceCore(
        load_configuration(), on_setpoint=lambda _, outputs: found.append(outputs.objection)
    )
    with log.open("rb") as lines:
        for item in read_candump(lines, ReadReport()):
            if isinstance(item, Frame):
                core.feed(item)
    # The wait for the answer to a step of all efforts ends within a second.
    assert set(found) <= {Objection.NONE, Objection.EFFORTS_JUMP}
    assert found.count(Objection.EFFORTS_JUMP) <= 50
