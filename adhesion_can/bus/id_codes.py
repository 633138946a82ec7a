"""Ids of frames to small codes, by which rows are sorted into messages."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

_Keys = NDArray[np.uint32]
_Tables = NDArray[np.uint16]

UNSEEN = 0
"""Code of an id met after all codes were given away."""

_LEARNED = 1024  # ids that no database knows; a bus of random ids must not fill the memory
_LOW, _MIDDLE = 11, 10  # bits; a standard id is low bits alone
_STANDARD = 1  # place of the tables of standard ids; the tables at place 0 stay empty


class KeyCodes:
    """Gives each key of `Block.key` a code, new ones when they are first met.

    The codes are in a radix tree of three levels, by the high, middle and low bits of a key, like
    the page tables of a processor: one table of all keys would be of gigabytes.

    Args:
        keys: Known ids, which get the codes 1, 2, ..

    """

    def __init__(self, keys: Iterable[int]) -> None:
        self.keys: list[int] = [0]
        """Key of each code; nothing stands at `UNSEEN`."""
        self._high = np.zeros(1 << (32 - _LOW - _MIDDLE), dtype=np.uint16)
        self._middle = np.zeros((2, 1 << _MIDDLE), dtype=np.uint16)
        self._low = np.zeros((2, 1 << _LOW), dtype=np.uint16)
        self._high[0] = self._middle[_STANDARD, 0] = _STANDARD
        self._used = [_STANDARD + 1, _STANDARD + 1]  # tables in `_middle` and in `_low`
        for key in keys:
            self._learn(key)
        self._most = len(self.keys) + _LEARNED

    def encode(self, keys: _Keys) -> NDArray[np.uint16]:
        """Codes of keys, shape (n,); `UNSEEN` once more than a thousand unknown ids came."""
        codes = self._look_up(keys)
        room = self._most - len(self.keys)
        if room and not codes.all():
            for key in np.unique(keys[codes == UNSEEN])[:room].tolist():
                self._learn(key)
            codes = self._look_up(keys)
        return codes

    def _look_up(self, keys: _Keys) -> NDArray[np.uint16]:
        if keys.max(initial=0) < 1 << _LOW:
            return np.asarray(self._low[_STANDARD].take(keys))
        high, middle, low = _parts(keys)
        tables = self._high.take(high).astype(np.uint32)
        tables = self._middle.ravel().take((tables << _MIDDLE) | middle).astype(np.uint32)
        return np.asarray(self._low.ravel().take((tables << _LOW) | low))

    def _learn(self, key: int) -> None:
        high, middle, low = (part.item() for part in _parts(np.array([key], dtype=np.uint32)))
        if not self._high[high]:
            self._high[high], self._middle = self._new_table(0, self._middle)
        place = self._high[high], middle
        if not self._middle[place]:
            self._middle[place], self._low = self._new_table(1, self._low)
        self._low[self._middle[place], low] = len(self.keys)
        self.keys.append(key)

    def _new_table(self, level: int, tables: _Tables) -> tuple[int, _Tables]:
        """Place of an empty table, and the tables, more of them where they were all used."""
        place = self._used[level]
        self._used[level] += 1
        if place == len(tables):
            tables = np.concatenate([tables, np.zeros_like(tables)])
        return place, tables


def _parts(keys: _Keys) -> tuple[_Keys, _Keys, _Keys]:
    """High, middle and low bits of keys."""
    low, middle = np.uint32(_LOW), np.uint32(_MIDDLE)
    one = np.uint32(1)
    return (
        keys >> (low + middle),
        (keys >> low) & ((one << middle) - one),
        keys & ((one << low) - one),
    )
