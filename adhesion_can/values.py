"""Objects that are copied often: values, which need no copy, and objects with a state."""

from collections import deque
from collections.abc import Iterable
from copy import copy, deepcopy
from itertools import chain
from typing import Any, Self

import numpy as np


class Value:
    """A frozen object whose arrays are not written to either: its deep copy is itself.

    So a copy of an estimator, which is made for every update, copies what changes and no more.
    """

    __slots__ = ()

    def __deepcopy__(self, _: dict[int, object]) -> Self:
        return self


_CONTAINERS = frozenset({list, dict, deque})


class Stateful:
    """An object whose deep copy is made attribute by attribute.

    The same as `copy.deepcopy` makes, at a fraction of its cost, which is that of taking an object
    to pieces in general.
    """

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        twin = object.__new__(type(self))
        memo[id(self)] = twin
        state = vars(twin)
        state.update(vars(self))
        for name, value in state.items():
            if type(value) not in _shared:
                state[name] = _copy(value, memo)
        return twin


_shared: set[type] = {bool, int, float, str, bytes, type(None)}
"""Classes seen so far whose objects need no copies."""
_others: set[type] = {*_CONTAINERS, tuple, np.ndarray}
"""Classes seen so far whose objects are copied."""


def _is_shared(kind: type) -> bool:
    """Whether objects of a class need no copies."""
    if kind not in _shared and kind not in _others:
        (_shared if issubclass(kind, Value) else _others).add(kind)
    return kind in _shared


def _are_shared(items: Iterable[Any]) -> bool:
    """Whether none of the items needs a copy; by their classes, which are few."""
    kinds = set(map(type, items))
    if all(map(_is_shared, kinds)):
        return True
    # Rows of numbers, as a series keeps them.
    are_rows = all(issubclass(kind, tuple) for kind in kinds)
    return are_rows and all(map(_is_shared, set(map(type, chain.from_iterable(items)))))


def _copy(value: Any, memo: dict[int, Any]) -> Any:
    """Deep copy of an attribute; what two attributes share is shared by the copies."""
    kind = type(value)
    if _is_shared(kind) or (isinstance(value, tuple) and _are_shared(value)):
        return value
    known = memo.get(id(value))
    if known is not None:
        return known
    if kind is np.ndarray and not value.dtype.hasobject:
        twin = memo[id(value)] = value.copy(order="K")
        return twin
    if kind not in _CONTAINERS:
        return value.__deepcopy__(memo) if isinstance(value, Stateful) else deepcopy(value, memo)
    twin = memo[id(value)] = copy(value)
    items = value.values() if kind is dict else value
    if not _are_shared(items):
        for key, item in value.items() if kind is dict else enumerate(value):
            twin[key] = _copy(item, memo)
    return twin
