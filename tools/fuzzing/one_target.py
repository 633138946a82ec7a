"""One target under atheris: `one_target.py TARGET [libFuzzer's options and folders]`."""

import resource
import sys
import warnings
from pathlib import Path

import atheris

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

ADDRESSES = 6 << 30
"""Address space of the process, bytes: a request for more is a MemoryError, and so a finding."""

with atheris.instrument_imports(include=["adhesion_can", "cantools", "textparser", "tomllib"]):
    from tests.fuzz.targets import TARGETS


def main() -> None:
    """Fuzz until libFuzzer ends the process."""
    name = sys.argv.pop(1)
    warnings.simplefilter("error")  # as in the tests: a warning is no answer to an input
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    atheris.Setup(sys.argv, TARGETS[name].run, enable_python_coverage=True)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
