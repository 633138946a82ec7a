"""Compilation of kernels by numba, with types: the only place that numba is imported in."""

import logging
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import numba
from numba import types

Function = TypeVar("Function", bound=Callable[..., Any])

F8 = types.float64
IN = types.Array(types.float64, 1, "A", readonly=True)
"""Numbers of samples: any column, also one that may not be written to."""
INTS = types.Array(types.int64, 1, "A", readonly=True)
"""Stamps and numbers of axles or groups of samples."""
ROW = types.Array(types.float64, 1, "C")
ROWS = types.Array(types.float64, 2, "C")
BLOCK = types.Array(types.float64, 3, "C")
BLOCKS = types.Array(types.float64, 4, "C")
STRIDED_ROWS = types.Array(types.float64, 2, "A")
STRIDED_BLOCK = types.Array(types.float64, 3, "A")
"""Parts of a larger array."""
STAMPS = types.Array(types.int64, 1, "C")
PLACES = types.Array(types.int64, 2, "C")
MASK = types.Array(types.boolean, 1, "C")


def compiled(result: Any, *arguments: Any) -> Callable[[Function], Function]:
    """Decorator: compile a function at once, for arguments of these types, or load it.

    Never at a call: a live loop has no time for it. What was compiled is kept beside the source or
    in the user's cache (`NUMBA_CACHE_DIR`), and where neither can be written to, not at all.
    Without fast mathematics, so that it rounds as NumPy does. The first function that is compiled
    and not loaded is logged, at level INFO: all of them take some ten seconds.
    """

    def compile_now(function: Function) -> Function:
        signature = result(*arguments)
        options = {"nogil": True, "fastmath": False, "error_model": "numpy"}
        try:
            made = numba.njit(signature, cache=True, **options)(function)
        except RuntimeError:  # no place for the cache
            made = numba.njit(signature, **options)(function)
        if not made.stats.cache_hits:
            _log_compilation()
        return made

    return compile_now


@cache
def _log_compilation() -> None:
    logging.getLogger(__name__).info("compiling the estimator for this machine: about 10 s, once")


def inlined(function: Function) -> Function:
    """Decorator of a function that compiled ones call: compiled into them."""
    return numba.njit(fastmath=False, error_model="numpy")(function)
