"""The Python process of an FMU: `python -m adhesion_can.fmu.child RESOURCES`.

Requests come from the standard input and answers go to the standard output, as `session` defines
them. It ends when its input is closed, thus with its host.
"""

import os
import signal
import sys
import traceback
from array import array
from pathlib import Path

from adhesion_can.errors import AdhesionCanError
from adhesion_can.recordings.python_can_mf4 import put_off_asammdf

# Numerical libraries read this when they are imported: our matrices are small.
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
put_off_asammdf()  # no file is read here, and to import it takes longer than all else

from adhesion_can.fmu.contents import read_contents
from adhesion_can.fmu.session import LONGEST_ERROR, PROTOCOL, Session, hello
from adhesion_can.printable import say
from adhesion_can.version import __version__

_NUMBER = array("d").itemsize


class Wire:
    """Two descriptors to the library of the FMU.

    Args:
        read_from: Descriptor of the requests.
        write_to: Descriptor of the answers.

    """

    def __init__(self, read_from: int, write_to: int) -> None:
        self._from, self._to = read_from, write_to

    def read(self, count: int) -> "array[float] | None":
        """So many numbers; None where the other end has closed."""
        data = b""
        while len(data) < count * _NUMBER:
            more = os.read(self._from, count * _NUMBER - len(data))
            if not more:
                return None
            data += more
        return array("d", data)

    def write(self, *parts: bytes) -> None:
        """Write all parts."""
        rest = memoryview(b"".join(parts))
        while rest:
            rest = rest[os.write(self._to, rest) :]


def serve(resources: Path, wire: Wire) -> int:
    """Answer requests until the other end closes; returns the exit status."""
    try:
        contents, guid = read_contents(resources)
        slave = contents.make_slave()
    except (AdhesionCanError, OSError) as error:
        text = str(error)[:LONGEST_ERROR].encode()
        wire.write(_packed([PROTOCOL, -1.0, float(len(text))]), text)
        return 2
    text = guid.encode()
    head = [PROTOCOL, float(len(slave.variables)), float(len(text))]
    wire.write(_packed(head), text, _packed(hello(slave.variables)))
    session = Session(slave)
    while (request := wire.read(session.request_length)) is not None:
        try:
            answer = session.answer(request)
        except Exception as error:  # noqa: BLE001  the host is to hear of a fault of ours, too
            traceback.print_exc()
            answer = session.failure(f"{type(error).__name__}: {error}")
        error_text = answer.error.encode()
        wire.write(_packed(answer.numbers), error_text)
    return 0


def _packed(numbers: list[float]) -> bytes:
    return array("d", numbers).tobytes()


def main() -> int:
    """Serve the FMU that the first argument names."""
    if len(sys.argv) != 2:
        say(f"adhesion-can {__version__} is here; FMUs start it")
        return 2
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the host, which closes our input
    # What somebody prints goes to the standard error.
    answers = os.dup(1)
    os.dup2(2, 1)
    try:
        return serve(Path(sys.argv[1]), Wire(0, answers))
    except (BrokenPipeError, ConnectionResetError):
        return 0  # the host has gone


if __name__ == "__main__":
    sys.exit(main())
