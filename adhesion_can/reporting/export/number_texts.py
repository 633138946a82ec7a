"""Numbers as text, many at a time."""

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

_SMALLEST = 1e-12
"""Magnitude down to which a number is written without an exponent."""


class FloatTexts:
    """Shortest texts that read back as the same floats, by the floats' bits.

    Signals take few values, and looking one up is many times as fast as Python's `repr`. Numbers
    that a signal may well have are written without an exponent: PlotJuggler takes a column whose
    first field is '1e-05' for text.

    Args:
        special: Text of what is no finite number; None: nan, inf and -inf.

    """

    _MOST = 1 << 19

    def __init__(self, special: str | None = None) -> None:
        self._special = special
        self._texts: dict[int, str] = _Texts(self._text)

    def of(self, numbers: NDArray[Any]) -> list[str]:
        """Texts of numbers, shape (n,)."""
        bits = numbers.astype(np.float64, copy=False).view(np.int64)
        if len(self._texts) > self._MOST:
            self._texts.clear()
        return list(map(self._texts.__getitem__, bits.tolist()))

    def _text(self, number: float) -> str:
        text = repr(number)
        if "n" in text:
            return text if self._special is None else self._special
        if "e-" in text and abs(number) >= _SMALLEST:
            return np.format_float_positional(number, unique=True)
        return text


class _Texts(dict[int, str]):
    def __init__(self, text: Any) -> None:
        super().__init__()
        self._text = text

    def __missing__(self, bits: int) -> str:
        (number,) = struct.unpack("<d", struct.pack("<q", bits))
        text: str = self._text(number)
        self[bits] = text
        return text
