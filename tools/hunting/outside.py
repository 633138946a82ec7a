"""Worlds by others: which names are false, which are kept, and which sizes are right.

A name is a cause that a diagnosis lists, whatever its verdict. It is false where it is neither what
is hidden nor, by the table `same` of each mechanism, physically the same; a cause that the
diagnosis itself cannot tell from such a one (its rival) is not false.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from plan import find_group

from tests.worlds.outside.car import SAME_IN_CAR
from tests.worlds.outside.registry import MECHANISMS

Record = dict[str, Any]
Answer = tuple[str, tuple[str, ...]]
MECHANISM_GROUPS = ("outside:open", "outside:aside", "outside:second")
OUTSIDE_GROUPS = (*MECHANISM_GROUPS, "memory", "mech", "beside", "car")
FUNCTIONS = {"exp", "log", "sqrt", "tanh", "abs", "min", "max", "lag"}
"""Words of a formula that are neither a channel nor a constant."""
SIZE_SHARE, SIZE_STDS = 0.20, 3.0
"""A size is right within this share of the true one or this many standard deviations."""


def outside_outcome(record: Record, diagnosis: Record) -> Answer:
    """Outcome and answer.

    'wrong': a false name. 'same': every name is physically what is hidden. 'unexplained',
    'nothing': no name. Families (`mech:`): 'named' alone with the right size, 'wrong size',
    'size unknown' where the diagnosis has no parameter of that name, 'with others'. Beside a
    mechanism: 'kept' where the true effect is named, 'kept with a false one', 'lost', 'wrong'.
    """
    causes = diagnosis["causes"]
    channel = (f"[{diagnosis['channel']}]",) if diagnosis["verdict"] == "unexplained" else ()
    answer = (*(_text(cause) for cause in causes), *channel)
    group = find_group(record["kind"])
    hidden = record["truth"]["effects"]
    if group == "mech":
        return _family(hidden[0], diagnosis), answer
    if group == "beside":
        return _beside(hidden, diagnosis), answer
    if causes:
        right = all(_is_same(cause, same_as(record)) for cause in causes)
        return ("same" if right else "wrong"), answer
    return _silence(diagnosis), answer


def same_as(record: Record) -> frozenset[str]:
    """What it is no false name to call what is hidden in a world."""
    if record["kind"] in SAME_IN_CAR:
        return frozenset(SAME_IN_CAR[record["kind"]])
    names = (e["effect"].removeprefix("outside:") for e in record["truth"]["effects"])
    return frozenset().union(*(MECHANISMS[name].acceptable for name in names if name in MECHANISMS))


def formula_channels(cause: Record) -> set[str]:
    """Channels that a formula depends on."""
    words = set(re.findall(r"[A-Za-z_]\w*", cause.get("form") or ""))
    return words - set(cause["parameters"] or ()) - FUNCTIONS


def has_right_size(true: Mapping[str, float], found: Mapping[str, Any]) -> bool | None:
    """Whether every parameter in both is right; None: there is none in both."""
    hits = []
    for name, value in true.items():
        cell = found.get(name)
        if cell is None or cell.get("value") is None:
            continue
        if name == "axle":
            hits.append(round(cell["value"]) == round(value))
            continue
        room = max(SIZE_SHARE * abs(value), SIZE_STDS * (cell.get("std") or 0.0))
        hits.append(abs(cell["value"] - value) <= room)
    return all(hits) if hits else None


def _text(cause: Record) -> str:
    if cause["effect"] == "formula":
        return f"formula({', '.join(sorted(formula_channels(cause)))})"
    return str(cause["effect"])


def _ids(cause: Record) -> set[str]:
    return {cause["effect"], *(cause["rivals"] or ())}


def _is_same(cause: Record, same: frozenset[str]) -> bool:
    if cause["effect"] == "formula":
        channels = {f"channel:{name}" for name in formula_channels(cause)}
        return bool(channels) and channels <= same
    return bool(_ids(cause) & same)


def _silence(diagnosis: Record) -> str:
    return "nothing" if diagnosis["verdict"] == "nothing_found" else "unexplained"


def _family(hidden: Record, diagnosis: Record) -> str:
    causes = diagnosis["causes"]
    true = hidden["effect"]
    right = [cause for cause in causes if true in _ids(cause)]
    if not right:
        return "wrong" if causes else _silence(diagnosis)
    rivals = {rival for cause in right for rival in _ids(cause)}
    if any(cause["effect"] not in rivals for cause in causes):
        return "with others"
    if diagnosis["verdict"] != "named":
        return "unexplained"
    own = [cause for cause in right if cause["effect"] == true]
    if not own:
        return "rival"
    size = has_right_size(hidden["parameters"], own[0]["parameters"] or {})
    return {True: "named", False: "wrong size", None: "size unknown"}[size]


def _beside(hidden: Sequence[Record], diagnosis: Record) -> str:
    causes = diagnosis["causes"]
    effect = hidden[0]["effect"]
    same = MECHANISMS[hidden[1]["effect"].removeprefix("outside:")].acceptable
    others = [cause for cause in causes if effect not in _ids(cause)]
    has_false = not all(_is_same(cause, same) for cause in others)
    if len(others) < len(causes):
        return "kept with a false one" if has_false else "kept"
    return "wrong" if has_false else "lost"
