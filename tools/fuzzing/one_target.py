"""One target under atheris: `one_target.py TARGET PACKAGES COMPARISONS [libFuzzer's own]`.

PACKAGES are those whose branches guide the fuzzer, with commas between. COMPARISONS is 1 where
comparisons guide it too, else 0: atheris 3.0 never frees what they give, which counts for arrays.
"""

import logging
import resource
import signal
import sys
import warnings
from pathlib import Path
from types import FrameType

import atheris
from atheris.import_hook import HookManager

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

NAME, PACKAGES, COMPARISONS = sys.argv[1:4]
# What `atheris.instrument_imports` gives, which has no such option.
with HookManager(set(PACKAGES.split(",")), set(), True, COMPARISONS == "1"):
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
    run = TARGETS[NAME].run

    def run_in_time(data: bytes) -> None:
        # Time of the processor: a machine with other work stands still now and then.
        signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
        run(data)
        signal.setitimer(signal.ITIMER_PROF, 0)

    signal.signal(signal.SIGPROF, stop)
    logging.getLogger("can").setLevel(logging.CRITICAL)  # python-can tells of each line it refuses
    warnings.simplefilter("error")  # as in the tests: a warning is no answer to an input
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    atheris.Setup([sys.argv[0], *sys.argv[4:]], run_in_time)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
