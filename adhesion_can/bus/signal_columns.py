"""Signals of a message as numbers, by cantools' rules: which type, and which rows carry them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from typing import cast

import numpy as np
from cantools.database.can import Message, Signal
from cantools.database.conversion import (
    BaseConversion,
    IdentityConversion,
    LinearIntegerConversion,
)
from numpy.typing import NDArray

from adhesion_can.bus.codec import Raw, SignalPlan, among, nearest_float
from adhesion_can.bus.frame import MAX_PAYLOAD

Values = NDArray[np.int64] | NDArray[np.uint64] | NDArray[np.float64]
Mask = NDArray[np.bool_]

_IntegerType = type[np.int64] | type[np.uint64]
_Page = tuple[str, frozenset[int]]  # a selector, and its values that select


@dataclass(frozen=True)
class SignalColumn:
    """One signal in the frames of its message.

    Attributes:
        signal: Signal of the database.
        values: Values in the signal's unit, shape (n,): int64 where scale and offset are integers,
            uint64 where int64 is too small, float64 where both are, or where the values are no
            integers.
        present: Rows whose multiplexer selects the signal, shape (n,); None: all.

    """

    signal: Signal
    values: Values
    present: Mask | None


class MessageSignals:
    """The signals of a message that can be decoded to numbers, and are wanted.

    Args:
        message: Message of cantools' database.
        wanted: Predicate of the signals to decode, by the names of message and signal; None: all.
        undecodable: Reasons why a signal can never be decoded, by name; filled in.

    """

    def __init__(
        self,
        message: Message,
        wanted: Callable[[str, str], bool] | None,
        undecodable: dict[str, str],
    ) -> None:
        self._plans: list[_SignalNumbers] = []
        self._selectors = _Selectors(message)
        obstacle = "a container of other messages" if message.is_container else None
        obstacle = obstacle or self._selectors.obstacle
        if obstacle:
            undecodable[message.name] = obstacle
            return
        for signal in message.signals:
            obstacle = _obstacle(signal, message.length) or _namesake(signal, message)
            if obstacle:
                undecodable[f"{message.name}.{signal.name}"] = obstacle
            elif wanted is None or wanted(message.name, signal.name):
                self._plans.append(_SignalNumbers(signal, message.length))

    def __bool__(self) -> bool:
        return bool(self._plans)

    def decode(self, words: NDArray[np.uint64]) -> tuple[dict[str, SignalColumn], Mask | None]:
        """Columns by name, and the rows whose selectors have values that the database lacks.

        Args:
            words: Payloads as 64-bit words, shape (n, w).

        """
        selection = _Selection(self._selectors, words)
        columns: dict[str, SignalColumn] = {}
        for plan in self._plans:
            name = plan.signal.name
            column = SignalColumn(plan.signal, plan.values(words), selection.present(plan.page))
            columns[name] = _merged(columns[name], column) if name in columns else column
        return columns, selection.unknown()


def find_obstacle(signal: Signal, message: Message) -> str | None:
    """Why a signal of a message cannot be decoded, its multiplexers included; None: it can."""
    own_obstacle = _obstacle(signal, message.length) or _namesake(signal, message)
    if own_obstacle or signal.multiplexer_signal is None:
        return own_obstacle
    return _Selectors(message).obstacle


class _SignalNumbers:
    """One signal: its numbers by cantools' rules of types and of order."""

    def __init__(self, signal: Signal, size: int) -> None:
        self.signal = signal
        self.page: _Page | None = None
        if signal.multiplexer_signal is not None:
            self.page = signal.multiplexer_signal, frozenset(signal.multiplexer_ids or ())
        self._plan = SignalPlan.from_signal(signal, size)
        # The conversion without its value table.
        conversion = BaseConversion.factory(
            scale=signal.conversion.scale,
            offset=signal.conversion.offset,
            is_float=signal.conversion.is_float,
        )
        self._scale, self._offset = conversion.scale, conversion.offset
        self._kind = self._kind_of(conversion)

    def _kind_of(self, conversion: BaseConversion) -> "_Kind":
        if isinstance(conversion, IdentityConversion):
            return _Kind.FLOAT if conversion.is_float else _Kind.RAW
        if isinstance(conversion, LinearIntegerConversion):
            return _Kind.INTEGER
        if conversion.is_float or not isinstance(conversion.scale, int):
            return _Kind.LINEAR
        # Python multiplies integers without loss before it adds the offset.
        largest = (1 << self._plan.length) * abs(conversion.scale)
        return _Kind.LINEAR if largest <= 1 << 53 else _Kind.PRODUCT

    def values(self, words: NDArray[np.uint64]) -> Values:
        """Values, shape (n,), of payloads of shape (n, w)."""
        raw = self._plan.raw_column(words)
        if self._kind is _Kind.RAW:
            return raw
        if self._kind is _Kind.FLOAT:
            return self._plan.float_column(raw)
        if self._kind is _Kind.LINEAR:
            return self._plan.value_column(raw)
        if self._kind is _Kind.PRODUCT:
            return self._integers(raw, 0).astype(np.float64) + self._offset
        return self._integers(raw, int(self._offset))

    def _integers(self, raw: Raw, offset: int) -> Values:
        """Raw values · scale + offset in the type that holds them all."""
        scale, plan = int(self._scale), self._plan
        lowest = -(1 << (plan.length - 1)) if plan.signed else 0
        highest = lowest + (1 << plan.length) - 1
        kind = _integer_type(lowest * scale + offset, highest * scale + offset)
        if kind is not None:
            return _modular(raw, scale, offset, kind)
        if not len(raw):
            return np.zeros(0)
        kind = _integer_type(int(raw.min()) * scale + offset, int(raw.max()) * scale + offset)
        if kind is not None:
            return _modular(raw, scale, offset, kind).astype(np.float64)
        return np.array([nearest_float(number * scale + offset) for number in raw.tolist()])


class _Kind(Enum):
    """How cantools makes a number of a raw value."""

    RAW = auto()
    FLOAT = auto()
    INTEGER = auto()
    LINEAR = auto()
    PRODUCT = auto()  # integer scale, other offset


class _Selectors:
    """The multiplexers of a message.

    Attributes:
        obstacle: Reason why the multiplexers cannot be followed; None: they can.
        signals: Selector signals by name.
        known: Values that the database defines, by name; without any, all are allowed.

    """

    def __init__(self, message: Message) -> None:
        self.signals: dict[str, _SignalNumbers] = {}
        self.known: dict[str, frozenset[int]] = {}
        self.obstacle: str | None = None
        for signal in message.signals:
            if not signal.is_multiplexer:
                continue
            obstacle = _obstacle(signal, message.length)
            if signal.name in self.signals:
                obstacle = "is defined twice"
            if obstacle:
                self.obstacle = f"multiplexer {signal.name}: {obstacle}"
                return
            self.signals[signal.name] = _SignalNumbers(signal, message.length)
            children = (s for s in message.signals if s.multiplexer_signal == signal.name)
            known = {number for child in children for number in child.multiplexer_ids or ()}
            # cantools takes a value with a name for known, though no signal belongs to it.
            self.known[signal.name] = frozenset(known | set(signal.conversion.choices or ()))
        if any(self._in_circle(name) for name in self.signals):
            self.obstacle = "multiplexers that select each other in a circle"

    def _in_circle(self, name: str) -> bool:
        above = self.signals[name].page
        for _ in self.signals:
            if above is None or above[0] not in self.signals:
                return False
            above = self.signals[above[0]].page
        return above is not None and above[0] in self.signals


class _Selection:
    """Values of the selectors in some payloads."""

    def __init__(self, selectors: _Selectors, words: NDArray[np.uint64]) -> None:
        self._selectors = selectors
        self._words = words
        self._values: dict[str, Values] = {}
        self._present: dict[_Page, Mask] = {}

    def present(self, page: _Page | None) -> Mask | None:
        """Rows that carry the signals of a page; None: all do."""
        if page is None:
            return None
        if page not in self._present:
            name, ids = page
            selector = self._selectors.signals.get(name)
            if selector is None:
                self._present[page] = np.zeros(len(self._words), dtype=np.bool_)
            else:
                above = self.present(selector.page)
                here = self._among(name, ids)
                self._present[page] = here if above is None else here & above
        return self._present[page]

    def unknown(self) -> Mask | None:
        """Rows with a selector whose value the database does not know; None: there is none."""
        any_unknown: Mask | None = None
        for name, known in self._selectors.known.items():
            if not known:
                continue
            unknown = ~self._among(name, known)
            above = self.present(self._selectors.signals[name].page)
            if above is not None:
                unknown &= above
            any_unknown = unknown if any_unknown is None else any_unknown | unknown
        return any_unknown

    def _among(self, name: str, ids: frozenset[int]) -> Mask:
        # cantools selects by the scaled value without its fraction.
        if name not in self._values:
            self._values[name] = self._selectors.signals[name].values(self._words)
        values = self._values[name]
        if values.dtype == np.float64:
            with np.errstate(invalid="ignore"):  # NaN selects nothing
                whole = np.trunc(values)
            return np.isin(whole, np.array(list(ids), dtype=np.float64))
        return among(cast(Raw, values), ids)


def _obstacle(signal: Signal, size: int) -> str | None:
    """Why a signal cannot be decoded; None: it can."""
    if size > MAX_PAYLOAD:
        return f"in a message of {size} bytes, while a frame has at most {MAX_PAYLOAD}"
    if signal.length > 64:
        return "longer than 64 bits"
    if signal.conversion.is_float and signal.length not in (16, 32, 64):
        return f"a float of {signal.length} bits"
    plan = SignalPlan.from_signal(signal, size)
    if plan.shift < 0 or plan.shift + signal.length > 8 * size:
        return f"reaches beyond the {size} bytes of its message"
    if not (math.isfinite(plan.scale) and math.isfinite(plan.offset)):
        return "its factor or offset is not finite"
    return None


def _namesake(signal: Signal, message: Message) -> str | None:
    """Why a name does not show which signal it is: another one of it in the same frames."""
    for other in message.signals:
        if other is not signal and other.name == signal.name and _meet(signal, other):
            return "another signal in the same frames has this name"
    return None


def _meet(signal: Signal, other: Signal) -> bool:
    """Whether two signals can be in one frame, as far as one selector shows."""
    if signal.multiplexer_signal is None or other.multiplexer_signal is None:
        return True
    same = signal.multiplexer_signal == other.multiplexer_signal
    return same and not {*(signal.multiplexer_ids or ())}.isdisjoint(other.multiplexer_ids or ())


def _integer_type(lowest: int, highest: int) -> _IntegerType | None:
    """Type of 64 bits that holds two numbers and those between them; None: neither does."""
    lowest, highest = min(lowest, highest), max(lowest, highest)
    if lowest >= -(1 << 63) and highest < 1 << 63:
        return np.int64
    return np.uint64 if lowest >= 0 and highest < 1 << 64 else None


def _modular(raw: Raw, scale: int, offset: int, kind: _IntegerType) -> Raw:
    """Raw values · scale + offset where the type holds the result: modulo 2⁶⁴ the way there is."""
    modulus = 1 << 64
    product = raw.view(np.uint64) * np.uint64(scale % modulus)
    bits = product + np.uint64(offset % modulus)
    return bits if kind is np.uint64 else bits.view(np.int64)


def _merged(first: SignalColumn, second: SignalColumn) -> SignalColumn:
    """A signal that a database gives two places, each on pages of its own."""
    if second.present is None:
        return second
    values = np.where(second.present, second.values, first.values)
    present = None if first.present is None else first.present | second.present
    return SignalColumn(first.signal, values, present)
