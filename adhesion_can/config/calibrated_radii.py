"""A configuration with calibrated wheel radii."""

from collections.abc import Mapping
from dataclasses import replace

from adhesion_can.bus.roles import SignalChoice
from adhesion_can.config.configuration import Configuration
from adhesion_can.physics.readings import Role


def rim_axles(configuration: Configuration) -> set[int]:
    """Axles whose wheel speed is given as speed of the rim.

    Its sender computed it with a radius of its own. The configured radius, which converts it into
    rad/s, cancels out of the slip ratio, so that the role's `factor` has to correct it.
    """
    return {
        signal.axle
        for message in configuration.messages
        for signal in message.signals
        if signal.role is Role.WHEEL_SPEED and signal.at_rim
    }


def with_radii(configuration: Configuration, ratio: Mapping[int, float]) -> Configuration:
    """The configuration with other wheel radii.

    Args:
        configuration: Configuration as it was loaded.
        ratio: New over configured radius by axle; the other axles stay as they are.

    """
    at_rim = rim_axles(configuration)
    vehicle = configuration.vehicle
    radii = tuple(
        radius * (1.0 if axle in at_rim else ratio.get(axle, 1.0))
        for axle, radius in enumerate(vehicle.wheel_radius, start=1)
    )

    def corrected(choice: SignalChoice) -> SignalChoice:
        if choice.role is not Role.WHEEL_SPEED or choice.axle not in at_rim:
            return choice
        axle_ratio = ratio.get(choice.axle, 1.0)
        return replace(
            choice, factor=choice.used_factor * axle_ratio, offset=choice.offset * axle_ratio
        )

    return replace(
        configuration,
        vehicle=replace(vehicle, wheel_radius=radii),
        choices=tuple(map(corrected, configuration.choices)),
    )
