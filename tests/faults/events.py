"""Real events of a drive that are no fault and must not be taken for one."""

from collections.abc import Mapping
from dataclasses import replace

from tests.faults.case import Case
from tests.faults.kinds import Kind
from tests.faults.locomotive import World
from tests.faults.rail import Rail


def _other(world: World) -> Rail:
    """A wet rail."""
    own = world.rails[0][1]
    return replace(own, level=own.level * 0.67, rise=own.rise * 0.9)


def _slide(world: World, case: Case) -> World:
    """All axles brake from the onset on, and two seconds later one slides."""
    return replace(world, braking=((case.onset_s, world.seconds),), slide_s=case.onset_s + 2.0)


def _sand(world: World, case: Case) -> World:
    return replace(world, sanding=((case.onset_s, case.onset_s + 6.0),))


def _patch(world: World, case: Case) -> World:
    """A wet patch, some 30 to 50 m long."""
    _, own = world.rails[0]
    wet, again = (case.onset_s, _other(world)), (case.onset_s + 3.0, own)
    return replace(world, rails=(*world.rails[:1], wet, again))


def _climb(world: World, case: Case) -> World:
    return replace(world, climb=0.008 * case.size, climb_s=case.onset_s)


def _reverse(world: World, case: Case) -> World:
    """From traction to braking, or back."""
    if world.braking:
        return replace(world, braking=((0.0, case.onset_s),))
    return replace(world, braking=((case.onset_s, world.seconds),))


def _coast(world: World, case: Case) -> World:
    """Ten seconds without effort, and the next rail when it comes back."""
    return replace(
        world,
        coasting=((case.onset_s, case.onset_s + 10.0),),
        rails=(*world.rails[:1], (case.onset_s + 5.0, _other(world))),
    )


def _wet(world: World, case: Case) -> World:
    return replace(world, rails=(*world.rails[:1], (case.onset_s, _other(world))))


def _nothing(world: World, _: Case) -> World:
    return world


KINDS: Mapping[str, Kind] = {
    "nothing": Kind(event=_nothing),
    "real_slide": Kind(event=_slide),
    "real_sand": Kind(event=_sand),
    "real_wet_rail": Kind(event=_wet),
    "real_wet_patch": Kind(event=_patch),
    "real_climb": Kind((1.0, 2.0), "8 permille", event=_climb),
    "real_reversal": Kind(event=_reverse),
    "real_coasting": Kind(event=_coast),
}
