"""Targets of fuzzing: each takes bytes, and raises what is a finding."""

from collections.abc import Callable
from dataclasses import dataclass

from tests.fuzz.targets.candump import candump_line, candump_text
from tests.fuzz.targets.databases import database, decoding, other_database
from tests.fuzz.targets.frames import acceptance, counter, secoc
from tests.fuzz.targets.outputs import outputs
from tests.fuzz.targets.service import service
from tests.fuzz.targets.settings import configuration, formula, model, state
from tests.fuzz.targets.tables import choice, table
from tests.fuzz.targets.traces import asc, blf, trc

_DATABASES = ("adhesion_can", "cantools", "textparser")
_TOML = ("adhesion_can", "tomllib")


@dataclass(frozen=True)
class Target:
    """A target.

    Attributes:
        run: Function of the bytes of an input.
        longest: Longest input that is tried, bytes.
        followed: Packages whose branches guide the fuzzer.
        has_arrays: Whether arrays are compared: comparisons then guide the fuzzer no more than by
            their branches.

    """

    run: Callable[[bytes], None]
    longest: int
    followed: tuple[str, ...] = ("adhesion_can",)
    has_arrays: bool = False


TARGETS = {
    target.run.__name__: target
    for target in (
        Target(candump_line, 300),
        Target(candump_text, 2000, has_arrays=True),
        Target(blf, 2000, has_arrays=True),
        Target(asc, 2000, has_arrays=True),
        Target(trc, 2000, has_arrays=True),
        Target(database, 2000, _DATABASES, has_arrays=True),
        Target(other_database, 4000, _DATABASES),
        Target(outputs, 40),
        Target(decoding, 200, has_arrays=True),
        Target(acceptance, 400, has_arrays=True),
        Target(counter, 160, has_arrays=True),
        Target(secoc, 200),
        Target(configuration, 4000, _TOML),
        Target(model, 4000, _TOML, has_arrays=True),
        Target(formula, 520, has_arrays=True),
        Target(state, 2000),
        Target(table, 4000, has_arrays=True),
        Target(choice, 200),
        Target(service, 200, has_arrays=True),
    )
}
