"""Targets of fuzzing: each takes bytes, and raises what is a finding."""

from collections.abc import Callable
from dataclasses import dataclass

from tests.fuzz.targets.candump import candump_line, candump_text
from tests.fuzz.targets.databases import database, decoding, other_database, outputs
from tests.fuzz.targets.frames import acceptance, counter, secoc
from tests.fuzz.targets.service import service
from tests.fuzz.targets.settings import configuration, formula, model, state
from tests.fuzz.targets.tables import choice, table


@dataclass(frozen=True)
class Target:
    """A target.

    Attributes:
        run: Function of the bytes of an input.
        longest: Longest input that is tried, bytes.

    """

    run: Callable[[bytes], None]
    longest: int


TARGETS = {
    target.run.__name__: target
    for target in (
        Target(candump_line, 300),
        Target(candump_text, 4000),
        Target(database, 4000),
        Target(other_database, 4000),
        Target(outputs, 5000),
        Target(decoding, 200),
        Target(acceptance, 400),
        Target(counter, 300),
        Target(secoc, 200),
        Target(configuration, 4000),
        Target(model, 4000),
        Target(formula, 520),
        Target(state, 2000),
        Target(table, 4000),
        Target(choice, 200),
        Target(service, 200),
    )
}
