"""All kinds of the catalogue by name, and pairs of them."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from tests.faults import events, of_bus, of_effort, of_load, of_speed, of_wheels
from tests.faults.case import Case
from tests.faults.kinds import Kind

KINDS: Mapping[str, Kind] = {
    name: kind
    for table in (of_wheels, of_speed, of_effort, of_load, of_bus, events)
    for name, kind in table.KINDS.items()
}
FAULTS = tuple(name for name, kind in KINDS.items() if kind.event is None)
PAIR = "pair-"
SECOND_LATER_S = 3.0
"""Longest time by which the second fault of a pair begins after the first one, s."""


def pair_name(number: int) -> str:
    """Name of a drawn pair."""
    return f"{PAIR}{number}"


@cache
def find(name: str) -> Kind:
    """Kind of that name; a pair by its number."""
    if not name.startswith(PAIR):
        return KINDS[name]
    number = int(name[len(PAIR) :])
    (first, one), (second, other) = members(number)
    later_s = float(np.random.default_rng([number, 4408]).uniform(0.0, SECOND_LATER_S))

    def of_first(case: Case) -> Case:
        return replace(case, size=one)

    def of_second(case: Case) -> Case:
        onset_s = min(case.onset_s + later_s, case.until_s)
        return replace(case, size=other, onset_s=onset_s)

    chosen = [(KINDS[first], of_first), (KINDS[second], of_second)]

    def after_each_other(stage: str):
        steps = [
            (getattr(kind, stage), case_of) for kind, case_of in chosen if getattr(kind, stage)
        ]
        if not steps:
            return None

        def apply(given, case):
            for change, case_of in steps:
                given = change(given, case_of(case))
            return given

        return apply

    return Kind(
        spoil=after_each_other("spoil"),
        queue=after_each_other("queue"),
        wire=after_each_other("wire"),
        unseen=any(kind.unseen for kind, _ in chosen),
    )


def members(number: int) -> tuple[tuple[str, float], tuple[str, float]]:
    """Names and sizes of the two faults of a pair."""
    rng = np.random.default_rng([number, 4407])
    first, second = (str(name) for name in rng.choice(FAULTS, 2, replace=False))
    return tuple((name, float(rng.choice(KINDS[name].sizes))) for name in (first, second))


def title(name: str) -> str:
    """Name of a kind, and of a pair what it consists of."""
    if not name.startswith(PAIR):
        return name
    return " + ".join(f"{one} {size:g}" for one, size in members(int(name[len(PAIR) :])))
