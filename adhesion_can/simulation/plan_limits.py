"""Limits of a planned drive: `[limits]`, the vehicle's loads and the ranges of its signals.

A plan must not demand efforts or speeds that the vehicle does not have or its signals cannot carry.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from adhesion_can.bus.roles import BoundMessage
from adhesion_can.physics.driving_plan import PlanLimits
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.drive import DriveSettings
from adhesion_can.simulation.own_vehicle import (
    describe_ends,
    effort_ranges,
    no_room_error,
    noise_of,
    speed_ranges,
)
from adhesion_can.simulation.sensors import NOISE_ROOM

SECTION, DEFAULT = "[limits]", "default of [limits]"
OF_LONGEST = "three quarters of the longest drive"


def source_in_section(limits: PlanLimits, key: str) -> str:
    """Where a limit comes from that the vehicle does not narrow: the section, or its default."""
    return DEFAULT if getattr(limits, key) == getattr(PlanLimits(), key) else SECTION


@dataclass(frozen=True)
class SourcedLimits:
    """Limits of a planned drive and where they come from.

    Attributes:
        limits: Limits.
        sources: Where each limit comes from, by its key.

    """

    limits: PlanLimits
    sources: Mapping[str, str]

    def sources_of(self, planned: PlanLimits) -> dict[str, str]:
        """Where the limits of a plan come from, by key: a plan shortens the duration."""
        changed = planned.duration_max != self.limits.duration_max
        return {**self.sources, **({"duration_max": OF_LONGEST} if changed else {})}


def limits_of(
    vehicle: Locomotive, given: PlanLimits, messages: Sequence[BoundMessage]
) -> SourcedLimits:
    """Limits of a planned drive of a vehicle, no wider than those given.

    Args:
        vehicle: Configured vehicle.
        given: Section `[limits]`, or its defaults.
        messages: Input messages with the ranges of their signals.

    Raises:
        InputError: The range of an effort or speed signal has no room for a drive.

    """
    limits = given
    sources = {field.name: source_in_section(given, field.name) for field in fields(given)}

    def narrow(key: str, value: float | bool, source: str) -> None:
        nonlocal limits
        if value < getattr(limits, key):
            change: dict[str, Any] = {key: value}
            limits = replace(limits, **change)
            sources[key] = source

    usual = DriveSettings().effort_max
    share = usual / Locomotive().axle_load[0]
    narrow("effort_max", usual * vehicle.relative_load, f"{share:.2f} of the mean axle load")
    room = NOISE_ROOM * noise_of(vehicle).effort
    for signal_range in effort_ranges(messages):
        source = f"the range of {signal_range.signal.name} ({describe_ends(signal_range.signal)})"
        if signal_range.high <= room:
            raise no_room_error(signal_range.signal, "traction")
        narrow("effort_max", signal_range.high - room, source)
        if signal_range.low < -room:
            narrow("effort_max", -signal_range.low - room, source)
        else:
            narrow("braking", False, source)
    for signal_range in speed_ranges(vehicle, messages, given.slip_max):
        if signal_range.high <= given.speed_min:
            raise no_room_error(signal_range.signal, f"speeds above {3.6 * given.speed_min:g} km/h")
        source = f"the range of {signal_range.signal.name} ({describe_ends(signal_range.signal)})"
        narrow("speed_max", signal_range.high, source)
    return SourcedLimits(limits, sources)
