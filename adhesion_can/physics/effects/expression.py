"""Arithmetic expressions over channels and constants, read from text and evaluated on arrays.

Numbers, + − * / **, parentheses, and the functions of `FUNCTIONS`. A name in quotes is a channel,
as it must be where the name is not one word, or is that of a constant. Nothing else is accepted,
and nothing is executed.
"""

import ast
import keyword
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np

from adhesion_can.arrays import Array

Value = Array | float
Lag = Callable[[str, Array, float], Array]
"""First-order lag of an array, by a name that is its own, with its time constant, s."""

LAG = "lag"
"""Function of a value and a time constant, s: the value, lagging by a first order."""
FUNCTIONS: Mapping[str, tuple[int, Callable[..., Value]]] = {
    "exp": (1, np.exp),
    "log": (1, np.log),
    "sqrt": (1, np.sqrt),
    "tanh": (1, np.tanh),
    "abs": (1, np.abs),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
}
"""Functions by name, with their number of arguments; `LAG` besides."""
_OPERATORS: Mapping[type[ast.operator], Callable[[Value, Value], Value]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: np.divide,
    ast.Pow: np.power,
}
_LONGEST = 500
"""Most characters of an expression: a longer one is no formula that a reader would follow."""
_DEEPEST = 100
"""Most operations within each other: each takes two of the 1000 calls that Python allows."""


class ExpressionError(ValueError):
    """An expression that cannot be read, with the part that is wrong."""


@dataclass(frozen=True)
class Expression:
    """An expression that was read without an error.

    Attributes:
        text: Text of the expression.

    """

    text: str

    def __post_init__(self) -> None:
        if len(self.text) > _LONGEST:
            raise ExpressionError(f"longer than {_LONGEST} characters")
        _require_shallow(self._tree)
        for node in _operands(self._tree):
            _require_known(node)

    @cached_property
    def _tree(self) -> ast.expr:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Python's about its own syntax
                return ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            raise ExpressionError(f"{self.text!r} is not an expression") from error

    @cached_property
    def names(self) -> tuple[tuple[str, bool], ...]:
        """Names in the text, each once and in its order, and whether they stand in quotes."""
        return _names(self._tree)

    @cached_property
    def names_of_lag_times(self) -> tuple[tuple[str, bool], ...]:
        """Names in the time constants of lags, and whether they stand in quotes."""
        names: list[tuple[str, bool]] = []
        for node in _operands(self._tree):
            match node:
                case ast.Call(func=ast.Name(id=name), args=[_, time]) if name == LAG:
                    names += _names(time)
        return tuple(dict.fromkeys(names))

    def lag_times(self, constants: Mapping[str, float]) -> Iterator[tuple[str, float]]:
        """Text and time constant of each lag, s, in which constants alone occur.

        Args:
            constants: Values of the constants.

        """
        with np.errstate(all="ignore"):
            for node in _operands(self._tree):
                match node:
                    case ast.Call(func=ast.Name(id=name), args=[_, time]) if name == LAG:
                        value = self._value(time, {}, constants, _no_lag)
                        yield ast.unparse(node), float(value)

    def evaluate(
        self, channels: Mapping[str, Array], constants: Mapping[str, float], lag: Lag
    ) -> Value:
        """Value of the expression.

        What is not defined, as the logarithm of a negative number, is NaN or infinite.

        Args:
            channels: Values of the channels, shape (n,) each.
            constants: Values of the constants.
            lag: First-order lag.

        """
        with np.errstate(all="ignore"):
            return self._value(self._tree, channels, {**channels, **constants}, lag)

    def _value(
        self,
        node: ast.expr,
        channels: Mapping[str, Array],
        words: Mapping[str, Value],
        lag: Lag,
    ) -> Value:
        def of(part: ast.expr) -> Value:
            return self._value(part, channels, words, lag)

        result: Value
        match node:
            case ast.Constant(value=str() as name):
                result = channels[name]
            case ast.Name(id=name):
                result = words[name]
            case ast.Constant(value=int() | float() as number):
                result = float(number)
            case ast.UnaryOp(op=op, operand=operand):
                result = -of(operand) if isinstance(op, ast.USub) else of(operand)
            case ast.BinOp(left=left, op=op, right=right):
                result = _OPERATORS[type(op)](of(left), of(right))
            case ast.Call(func=ast.Name(id=name), args=[target, time]) if name == LAG:
                result = lag(ast.unparse(node), np.asarray(of(target)), float(of(time)))
            case ast.Call(func=ast.Name(id=name), args=arguments):
                result = FUNCTIONS[name][1](*map(of, arguments))
            case _:
                raise ExpressionError(f"{ast.unparse(node)!r} is not supported")
        return result


def _no_lag(_name: str, target: Array, _time: float) -> Array:
    """Lag of a constant: the constant."""
    return target


def _operands(tree: ast.expr) -> Iterator[ast.expr]:
    """All parts but the names of functions."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        waiting += [
            child
            for child in ast.iter_child_nodes(node)
            if isinstance(child, ast.expr)
            and not (isinstance(node, ast.Call) and child is node.func)
        ]


def _names(tree: ast.expr) -> tuple[tuple[str, bool], ...]:
    """Names in a part, each once and in its order, and whether they stand in quotes."""
    names = []
    for node in sorted(_operands(tree), key=lambda node: (node.lineno, node.col_offset)):
        match node:
            case ast.Name(id=name):
                names.append((name, False))
            case ast.Constant(value=str() as name):
                names.append((name, True))
    return tuple(dict.fromkeys(names))


def _require_shallow(tree: ast.expr) -> None:
    """ExpressionError where parts stand too deep within each other; without a recursion itself."""
    level: list[ast.AST] = [tree]
    depth = 0
    while level:
        level = [child for node in level for child in ast.iter_child_nodes(node)]
        depth += 1
        if depth > _DEEPEST:
            raise ExpressionError(f"more than {_DEEPEST} nested operations")


def _is_finite(number: float) -> bool:
    """Whether a number fits a float; Python's integers have no end."""
    try:
        return isfinite(number)
    except OverflowError:
        return False


def _require_known(node: ast.expr) -> None:
    """ExpressionError where a part is not one of those that are allowed."""
    match node:
        case ast.Name() | ast.Constant(value=str()):
            return
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            if not _is_finite(number):
                raise ExpressionError("a number out of range")
            return
        case ast.BinOp(op=op) if type(op) in _OPERATORS:
            return
        case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
            return
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            wanted = 2 if name == LAG else FUNCTIONS.get(name, (0, None))[0]
            if not wanted:
                known = ", ".join((*FUNCTIONS, LAG))
                raise ExpressionError(f"no function {name!r}; known: {known}")
            if len(arguments) != wanted:
                raise ExpressionError(f"{name} takes {wanted} values, not {len(arguments)}")
            return
    raise ExpressionError(f"{ast.unparse(node)!r}: only numbers, names, + - * / ** and functions")


def channel_text(name: str, constants: Collection[str]) -> str:
    """Name of a channel as an expression with these constants has it."""
    is_word = name.isidentifier() and not keyword.iskeyword(name)
    return name if is_word and name not in (*FUNCTIONS, LAG, *constants) else repr(name)
