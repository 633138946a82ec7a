"""Reading in a process of its own, under limits of processor time, memory and disk.

For libraries that take a file at its word: a cycle of links, a size that is not there or a bug in
compiled code then ends the process that reads, and the command gives one line. This bounds what
a file may cost; it is no sandbox.
"""

import contextlib
import faulthandler
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import IO, Any, NoReturn, Self, TypeVar

from adhesion_can.errors import AdhesionCanError, InputError

T = TypeVar("T")

_ITEM, _END, _REFUSED, _FAILED = range(4)
_MIB = 1 << 20


class LimitError(AdhesionCanError):
    """What was read takes more than the limits allow, or its reader did not survive it."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What a reader may take.

    Attributes:
        processor_s: Time of the processor, s.
        memory: Address space beyond what the process has at its start, bytes.
        disk: Size of a temporary file, bytes.

    """

    processor_s: int
    memory: int
    disk: int

    @classmethod
    def of_file(cls, size: int) -> Self:
        """Limits for a file, some times what honest ones of that size take.

        The slowest honest ones have hundreds of channels in packed blocks, each of which asammdf
        unpacks once for every channel: about 30 s a MiB.

        Args:
            size: Size of the file, bytes.

        """
        return cls(5 + 50 * size // _MIB, 400 * _MIB + 40 * size, 400 * _MIB + 40 * size)


def read_limited(work: Callable[[], Iterable[T]], limits: Limits) -> Generator[T, None, None]:
    """Items that work gives, made by another process.

    A copy of this process does the work where that is safe, on Linux as long as it has one thread:
    the copy has all modules. Elsewhere a new one starts, which takes a second, and does without
    limits on what the system does not count.

    Args:
        work: Function that can be pickled; so can its items.
        limits: Limits of the process.

    Raises:
        InputError: As the work raises it.
        LimitError: The work takes more than the limits allow, or failed in another way.

    """
    is_copy = sys.platform == "linux" and threading.active_count() == 1
    # What a reader that was stopped leaves behind goes with the folder.
    with tempfile.TemporaryDirectory(prefix="adhesion-can-") as folder:
        reader = _Copy() if is_copy else _New()
        try:
            reader.start(work, limits, folder)
            yield from _received(reader, limits)
        finally:
            reader.stop()


def _received(reader: "_Copy | _New", limits: Limits) -> Iterator[Any]:
    while True:
        try:
            kind, value = pickle.load(reader.pipe)  # noqa: S301  of our own process
        except (EOFError, pickle.UnpicklingError):
            raise LimitError(_reason(reader.wait(), limits)) from None
        if kind == _ITEM:
            yield value
        elif kind == _REFUSED:
            error, *parts = value
            raise error(*parts)
        elif kind == _FAILED:
            raise LimitError(value)
        else:
            return


def _reason(status: int, limits: Limits) -> str:
    """Why a process ended early, by its exit status; that of a signal is negative."""
    name = signal.Signals(-status).name if status < 0 else ""
    if name == "SIGXCPU":
        return f"reading it takes more than {limits.processor_s} s of processor time"
    return f"its reader ended early ({name or f'status {status}'})"


class _Copy:
    """A copy of this process."""

    def start(self, work: Callable[[], Iterable[Any]], limits: Limits, folder: str) -> None:
        """Start the work."""
        ours, theirs = os.pipe()
        with warnings.catch_warnings():
            # Python 3.12 counts threads of libraries too, which sleep and hold no lock.
            warnings.simplefilter("ignore", DeprecationWarning)
            self._process = os.fork()
        if not self._process:
            _do_as_copy(theirs, ours, work, limits, folder)
        os.close(theirs)
        self.pipe: IO[bytes] = os.fdopen(ours, "rb")
        self._status: int | None = None

    def wait(self) -> int:
        """Wait for the end of the process; its exit status."""
        if self._status is None:
            _, status = os.waitpid(self._process, 0)
            self._status = os.waitstatus_to_exitcode(status)
        return self._status

    def stop(self) -> None:
        """End the process."""
        self.pipe.close()
        if self._status is None:
            os.kill(self._process, signal.SIGKILL)
            self.wait()


def _do_as_copy(
    pipe: int, other_end: int, work: Callable[[], Iterable[Any]], limits: Limits, folder: str
) -> NoReturn:
    """What the copy does: nothing that this process has begun is ended by it."""
    try:
        os.close(other_end)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever waits for it stops it
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        _serve(os.fdopen(pipe, "wb"), work, limits, folder)
    finally:
        os._exit(1)


class _New:
    """A new process of Python."""

    _PROGRAM = (
        "import pickle, sys\n"
        "sys.path[:] = pickle.load(sys.stdin.buffer)\n"
        "from adhesion_can.recordings.limited import serve\n"
        "serve()\n"
    )

    def start(self, work: Callable[[], Iterable[Any]], limits: Limits, folder: str) -> None:
        """Start the work."""
        self._process = subprocess.Popen(  # noqa: S603  our own program
            [sys.executable, "-c", self._PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        if self._process.stdin is None or self._process.stdout is None:
            raise RuntimeError("pipes were asked for")
        self.pipe: IO[bytes] = self._process.stdout
        with self._process.stdin as pipe:
            pickle.dump(sys.path, pipe)
            pickle.dump((work, limits, folder), pipe)

    def wait(self) -> int:
        """Wait for the end of the process; its exit status."""
        return self._process.wait()

    def stop(self) -> None:
        """End the process."""
        self.pipe.close()
        self._process.kill()
        self._process.wait()


def serve() -> NoReturn:
    """Do the work that stdin names, as a new process."""
    pipe = os.fdopen(os.dup(1), "wb")
    work, limits, folder = pickle.load(sys.stdin.buffer)  # noqa: S301  of our own process
    _serve(pipe, work, limits, folder)


def _serve(
    pipe: IO[bytes], work: Callable[[], Iterable[Any]], limits: Limits, folder: str
) -> NoReturn:
    """Send what work gives, and end the process."""
    # Nothing of a library's, nor of Python's, stands between the lines of the command.
    faulthandler.disable()
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    warnings.simplefilter("ignore")
    tempfile.tempdir = folder
    _limit(limits)
    try:
        for item in work():
            pickle.dump((_ITEM, item), pipe, protocol=5)
            pipe.flush()
        last: tuple[int, object] = (_END, None)
    except InputError as error:
        last = (_REFUSED, (type(error), error.where, error.what, error.fix))
    except MemoryError:
        last = (_FAILED, f"reading it takes more than {limits.memory // _MIB} MiB of memory")
    except Exception as error:  # noqa: BLE001  a library raises whatever its parsers meet
        text = " ".join(str(error).split())[:120]
        last = (_FAILED, f"its reader failed ({type(error).__name__}: {text})")
    with contextlib.suppress(OSError):
        pickle.dump(last, pipe, protocol=5)
        pipe.flush()
    os._exit(0)


def _limit(limits: Limits) -> None:
    try:
        import resource  # noqa: PLC0415  not on every system
    except ImportError:
        return
    seconds = ceil(time.process_time()) + limits.processor_s  # loading of modules does not count
    ends = {
        resource.RLIMIT_CPU: (seconds, seconds + 2),
        resource.RLIMIT_FSIZE: (limits.disk, limits.disk),
        resource.RLIMIT_CORE: (0, 0),
    }
    pages = Path("/proc/self/statm")
    if pages.exists():
        memory = int(pages.read_text().split()[0]) * resource.getpagesize() + limits.memory
        ends[resource.RLIMIT_AS] = (memory, memory)
    for kind, pair in ends.items():
        _, most = resource.getrlimit(kind)
        is_free = most == resource.RLIM_INFINITY
        resource.setrlimit(kind, pair if is_free else (min(pair[0], most), min(pair[1], most)))
