"""One target under atheris: `one_target.py TARGET PACKAGES [libFuzzer's options and folders]`.

PACKAGES are those whose branches guide the fuzzer, with commas between.
"""

import dis
import operator as op
import resource
import signal
import sys
import warnings
from pathlib import Path
from types import FrameType

import atheris
import numpy as np
from atheris.version_dependent import CMP_OP_SHIFT_AMOUNT

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

with atheris.instrument_imports(include=sys.argv.pop(2).split(",")):
    from tests.fuzz.rule import LONGEST_S
    from tests.fuzz.targets import TARGETS

ADDRESSES = 6 << 30
"""Address space of the process, bytes: a request for more is a MemoryError, and so a finding."""


_trace_cmp = atheris._trace_cmp  # noqa: SLF001  the instrumented code looks it up there
_COMPARISONS = dict(zip(dis.cmp_op, (op.lt, op.le, op.eq, op.ne, op.gt, op.ge), strict=True))


def compare(left: object, right: object, code: int, *others: object) -> object:
    """A comparison that guides the fuzzer; not of arrays: atheris never frees what those give."""
    if isinstance(left, np.ndarray) or isinstance(right, np.ndarray):
        return _COMPARISONS[dis.cmp_op[code >> CMP_OP_SHIFT_AMOUNT]](left, right)
    return _trace_cmp(left, right, code, *others)


class HangError(BaseException):
    """An input that takes too long; no `except Exception` of a parser takes it."""


def stop(_number: int, _frame: FrameType | None) -> None:
    """End an input that has had its time."""
    raise HangError(f"more than {LONGEST_S} s of the processor")


def main() -> None:
    """Fuzz until libFuzzer ends the process."""
    run = TARGETS[sys.argv.pop(1)].run

    def run_in_time(data: bytes) -> None:
        # Time of the processor: a machine with other work stands still now and then.
        signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
        run(data)
        signal.setitimer(signal.ITIMER_PROF, 0)

    atheris._trace_cmp = compare  # noqa: SLF001
    signal.signal(signal.SIGPROF, stop)
    warnings.simplefilter("error")  # as in the tests: a warning is no answer to an input
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    atheris.Setup(sys.argv, run_in_time, enable_python_coverage=True)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
