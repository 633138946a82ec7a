"""Targets of fuzzing: each takes bytes, and raises what is a finding."""

from collections.abc import Callable
from dataclasses import dataclass

from tests.fuzz.targets.candump import candump_line, candump_text
from tests.fuzz.targets.databases import database, decoding, other_database, outputs
from tests.fuzz.targets.frames import acceptance, counter, secoc
from tests.fuzz.targets.service import service
from tests.fuzz.targets.settings import configuration, formula, model, state
from tests.fuzz.targets.tables import choice, table

_DATABASES = ("adhesion_can.bus", "cantools", "textparser")


@dataclass(frozen=True)
class Target:
    """A target.

    Attributes:
        run: Function of the bytes of an input.
        longest: Longest input that is tried, bytes.
        followed: Packages and modules whose branches guide the fuzzer.

    """

    run: Callable[[bytes], None]
    longest: int
    followed: tuple[str, ...]


TARGETS = {
    target.run.__name__: target
    for target in (
        Target(candump_line, 300, ("adhesion_can.recordings",)),
        Target(candump_text, 4000, ("adhesion_can.recordings",)),
        Target(database, 4000, _DATABASES),
        Target(other_database, 4000, _DATABASES),
        Target(outputs, 5000, (*_DATABASES, "adhesion_can.service")),
        Target(decoding, 200, ("adhesion_can.bus",)),
        Target(acceptance, 400, ("adhesion_can.bus",)),
        Target(counter, 300, ("adhesion_can.bus",)),
        Target(secoc, 200, ("adhesion_can.bus",)),
        Target(configuration, 4000, ("adhesion_can", "tomllib")),
        Target(model, 4000, ("adhesion_can", "tomllib")),
        Target(formula, 520, ("adhesion_can.physics",)),
        Target(state, 2000, ("adhesion_can.service",)),
        Target(table, 4000, ("adhesion_can.recordings",)),
        Target(choice, 200, ("adhesion_can.recordings",)),
        Target(service, 200, ("adhesion_can.service", "adhesion_can.sampling", "adhesion_can.bus")),
    )
}
