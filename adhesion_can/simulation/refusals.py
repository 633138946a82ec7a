"""What of a configuration cannot be simulated, all of it at once."""

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

from adhesion_can.bus.roles import BoundMessage, SignalChoice
from adhesion_can.errors import ConfigError
from adhesion_can.physics.readings import Role


class Unsupported(NamedTuple):
    """Something that the simulation does not support.

    Attributes:
        what: Roles or messages, and what is wrong with them.
        fix: What to write instead.

    """

    what: str
    fix: str


def require_simulable(
    choices: Sequence[SignalChoice], messages: Sequence[BoundMessage], where: str
) -> None:
    """Raise one ConfigError with everything that cannot be simulated.

    Args:
        choices: Signals of the roles.
        messages: Messages that the simulation sends; empty for those of the packaged database.
        where: Name of the configuration file.

    """
    sent = [message for message in messages if message.roles - {Role.CHANNEL}]
    refusals = [*_shared_efforts(choices), *_multiplexed(sent), *_unknown_cycles(sent)]
    if len(refusals) == 1:
        raise ConfigError(f"{where}: roles", *refusals[0])
    if refusals:
        what = "; ".join(f"({n}) {refusal.what}" for n, refusal in enumerate(refusals, start=1))
        fix = "; ".join(f"({n}) {refusal.fix}" for n, refusal in enumerate(refusals, start=1))
        raise ConfigError(f"{where}: roles", what, fix)


def _shared_efforts(choices: Sequence[SignalChoice]) -> list[Unsupported]:
    """Axles that share an effort: each is simulated separately, with its own slip."""
    by_signal: dict[str, list[str]] = {}
    for choice in choices:
        if choice.role is Role.TRACTIVE_EFFORT:
            place = f"{choice.message}.{choice.signal}"
            by_signal.setdefault(place, []).append(choice.name)
    shared = [
        f"{' and '.join(names)} share {place}" for place, names in by_signal.items() if names[1:]
    ]
    if not shared:
        return []
    what = f"{', '.join(shared)}, and the simulation moves every axle separately"
    fix = "map one axle of each motor, in a file of its own for 'simulate', which 'init' offers"
    return [Unsupported(what, fix)]


def _multiplexed(sent: Sequence[BoundMessage]) -> list[Unsupported]:
    signals = chain.from_iterable(
        ((message, signal) for signal in message.signals) for message in sent
    )
    return [
        Unsupported(
            f"{signal.name}: {message.plan.name}.{signal.plan.name} is multiplexed, which the "
            "simulation does not support",
            "map the role to another signal, or remove it",
        )
        for message, signal in signals
        if message.plan.multiplexed.get(signal.plan.name)
    ]


def _unknown_cycles(sent: Sequence[BoundMessage]) -> list[Unsupported]:
    names = [message.plan.name for message in sent if message.cycle_us is None]
    if not names:
        return []
    what = f"the cycles of {', '.join(names)} are" if names[1:] else f"the cycle of {names[0]} is"
    fix = "write cycle_ms at their roles, or GenMsgCycleTime in the database"
    return [Unsupported(f"{what} unknown", fix)]
