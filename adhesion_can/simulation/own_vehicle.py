"""A run for a vehicle of any size: noise, efforts and speeds that it and its signals have.

The scenarios are laid out for the default locomotive. Another vehicle runs them with

- noise of effort and load in proportion to its static loads;
- efforts in proportion to its loads and gains in proportion to the inertia of its wheelsets, within
  `[limits]` and the range of its effort signals;
- a second vehicle where the track alone cannot keep its speed;
- speeds within `[limits]` and the range of its speed signals.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import ceil, floor, log10
from statistics import fmean
from typing import NamedTuple

from adhesion_can.bus.roles import BoundMessage, BoundSignal
from adhesion_can.errors import InputError
from adhesion_can.physics.driving_plan import PlanLimits
from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import GRAVITY, Locomotive
from adhesion_can.simulation.drive import DriveSettings
from adhesion_can.simulation.scenarios import Scenario
from adhesion_can.simulation.sensors import NOISE_ROOM, SensorNoiseSettings

HELD_SHARE = 0.1
"""Share of the train's weight on driven wheels up to which the track alone keeps the speed: its
steepest gradient, 0.035, balances an adhesion of 0.35 there."""
SWINGING_SHARE = 1.1 * HELD_SHARE
"""The same share where the speed of the scenario varies. No second vehicle helps there: it would
stop the vehicle or turn its acceleration over within a second, and a stronger one would make the
speed ignore the efforts, which contradicts the mass."""
OVERSHOOT = 0.1
"""Room for the wheel speeds above that of the largest slip, as a share."""
SLOWEST_RUN = 2.0
"""Smallest mean speed of a run, m/s: samples need 1 m/s."""
_DEFAULT = Locomotive()


class QuantityRange(NamedTuple):
    """Range of a quantity, SI; infinite where a float has no limit.

    Attributes:
        low: Lowest value.
        high: Highest value.
        signal: Signal that sets the limits.

    """

    low: float
    high: float
    signal: BoundSignal


def noise_of(vehicle: Locomotive) -> SensorNoiseSettings:
    """Noise of the sensors of a vehicle; effort and load in proportion to its static loads."""
    size, usual = vehicle.relative_load, SensorNoiseSettings()
    return replace(usual, effort=usual.effort * size, load=usual.load * size)


def drive_of(
    vehicle: Locomotive, limits: PlanLimits, messages: Sequence[BoundMessage]
) -> tuple[DriveSettings, tuple[str, ...]]:
    """Gains and largest efforts of a vehicle's drive; a sentence where a signal limits them.

    Args:
        vehicle: Configured vehicle.
        limits: Limits of the drive.
        messages: Input messages, whose effort signals limit the efforts, too.

    Raises:
        InputError: The range of an effort signal has no room for traction.

    """
    usual, noise = DriveSettings(), noise_of(vehicle)
    inertia = _rim_mass(vehicle) / _rim_mass(_DEFAULT)
    largest = min(usual.effort_max * vehicle.relative_load, limits.effort_max)
    traction = braking = largest
    notes: tuple[str, ...] = ()
    for limit in effort_ranges(messages):
        if (room := limit.high - NOISE_ROOM * noise.effort) < traction:
            traction, notes = room, (_describe_limit(limit, room, vehicle),)
        braking = min(braking, max(-limit.low - NOISE_ROOM * noise.effort, 0.0))
        if not traction > 0:
            raise no_room_error(limit.signal, "traction")
    settings = replace(
        usual,
        gain=usual.gain * inertia,
        integral_gain=usual.integral_gain * inertia,
        effort_max=traction,
        braking_max=braking,
    )
    return settings, notes


def scenario_of(
    scenario: Scenario,
    vehicle: Locomotive,
    limits: PlanLimits,
    messages: Sequence[BoundMessage],
    slip_high: float,
) -> tuple[Scenario, tuple[str, ...]]:
    """A scenario at speeds that a vehicle and its signals have, and sentences on what is changed.

    Args:
        scenario: Scenario as it is for the default locomotive.
        vehicle: Configured vehicle.
        limits: Limits of the drive.
        messages: Input messages with the ranges of their signals.
        slip_high: Largest slip ratio of the drive.

    Raises:
        InputError: The range of a speed signal has no room for a run, or the speed of a light train
            would not follow the scenario's.

    """
    notes = []
    share = sum(vehicle.axle_load) / (GRAVITY * vehicle.train_mass)
    if scenario.speed_swing and share > SWINGING_SHARE:
        raise _too_light(scenario, vehicle)
    if scenario.gradient is None and share > HELD_SHARE:
        scenario = replace(scenario, help=share / HELD_SHARE - 1.0)
        notes.append(
            "a coupled second vehicle brakes or pushes the simulated train, as in adhesion tests: "
            f"with {vehicle.train_mass / 1e3:.3g} t (train_mass_kg) the train would not keep the "
            "scenario's speeds"
        )
    fastest = limits.speed_max
    is_default = fastest == PlanLimits().speed_max
    reason = f"speed_max {'(default of [limits])' if is_default else 'in [limits]'}"
    for limit in speed_ranges(vehicle, messages, slip_high):
        if limit.high < fastest:
            signal = limit.signal
            fastest, reason = limit.high, f"the range of {signal.name} ({describe_ends(signal)})"
            if fastest / scenario.top_speed * scenario.speed < SLOWEST_RUN:
                raise no_room_error(signal, f"a mean speed of {3.6 * SLOWEST_RUN:g} km/h")
    pace = fastest / scenario.top_speed
    if pace >= 1.0:
        return scenario, tuple(notes)
    notes.append(
        f"speeds are {pace:.2f} times those of '{scenario.name}': up to {3.6 * fastest:.0f} km/h, "
        f"by {reason}"
    )
    return scenario.at_pace(pace), tuple(notes)


def _rim_mass(vehicle: Locomotive) -> float:
    """Inertia of a wheelset as a mass at its rim, kg."""
    return vehicle.wheelset_inertia / fmean(vehicle.wheel_radius) ** 2


def _ranges(messages: Sequence[BoundMessage], role: Role) -> Iterator[QuantityRange]:
    for message in messages:
        for signal in message.signals:
            if signal.role is role:
                ends = [end * signal.scale - signal.offset for end in signal.plan.sendable]
                yield QuantityRange(min(ends), max(ends), signal)


def effort_ranges(messages: Sequence[BoundMessage]) -> Iterator[QuantityRange]:
    """Range of each effort signal, N."""
    return _ranges(messages, Role.TRACTIVE_EFFORT)


def speed_ranges(
    vehicle: Locomotive, messages: Sequence[BoundMessage], slip_high: float
) -> Iterator[QuantityRange]:
    """Range of the vehicle speed that each speed signal has room for, m/s.

    Args:
        vehicle: Configured vehicle.
        messages: Input messages with the ranges of their signals.
        slip_high: Largest slip ratio of the wheels.

    """
    noise = SensorNoiseSettings()
    for limit in _ranges(messages, Role.VEHICLE_SPEED):
        yield limit._replace(high=limit.high - NOISE_ROOM * noise.vehicle_speed)
    for limit in _ranges(messages, Role.WHEEL_SPEED):
        radius, most = vehicle.wheel_radius[limit.signal.axle - 1], (1.0 + slip_high)
        yield limit._replace(high=limit.high * radius / (most * (1.0 + OVERSHOOT)))


def _describe_limit(limit: QuantityRange, effort: float, vehicle: Locomotive) -> str:
    signal = limit.signal
    share = effort / fmean(vehicle.axle_load)
    return (
        f"efforts are up to {effort / 1e3:.3g} kN, by the range of {signal.name} "
        f"({describe_ends(signal)}): an adhesion of {share:.2f}; a surface with a higher peak does "
        "not show it"
    )


def describe_ends(signal: BoundSignal) -> str:
    """Ends of a signal's range in its own unit, for a reader."""
    low, high = signal.plan.sendable
    return f"{low:g} to {high:g} in the database"


def _too_light(scenario: Scenario, vehicle: Locomotive) -> InputError:
    """Error where a scenario needs a heavier train."""
    least = sum(vehicle.axle_load) / (GRAVITY * HELD_SHARE)
    step = 10.0 ** (floor(log10(least)) - 1)
    return InputError(
        "vehicle.train_mass_kg",
        f"a train of {vehicle.train_mass / 1e3:.3g} t is too light for '{scenario.name}', in which "
        "all axles pull and brake with up to 35 % of the weight on them",
        "simulate the vehicle coupled to others, as in adhesion tests: write train_mass_kg = "
        f"{ceil(least / step) * step:.0f} in a copy of the configuration, and use this copy for "
        "the recording, too",
    )


def no_room_error(signal: BoundSignal, what: str) -> InputError:
    """Error of a signal whose range has no room for what a drive needs."""
    return InputError(
        f"roles.{signal.name}",
        f"{signal.plan.name} has no room for {what}: its range is {describe_ends(signal)}",
        "correct the range, the unit of the role or its sign",
    )
