"""One target under atheris: `one_target.py TARGET PACKAGES [libFuzzer's options and folders]`.

PACKAGES are those whose branches guide the fuzzer, with commas between.
"""

import resource
import signal
import sys
import warnings
from pathlib import Path
from types import FrameType

import atheris

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

with atheris.instrument_imports(include=sys.argv.pop(2).split(",")):
    from tests.fuzz.rule import LONGEST_S
    from tests.fuzz.targets import TARGETS

ADDRESSES = 6 << 30
"""Address space of the process, bytes: a request for more is a MemoryError, and so a finding."""


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

    signal.signal(signal.SIGPROF, stop)
    warnings.simplefilter("error")  # as in the tests: a warning is no answer to an input
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    atheris.Setup(sys.argv, run_in_time, enable_python_coverage=True)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
