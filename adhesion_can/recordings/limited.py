"""Reading in a process of its own, under limits of processor time, memory and disk.

For libraries that take a file at its word: a cycle of links, a size that is not there or a bug in
compiled code then ends the process that reads, and the command gives one line. This bounds what
a file may cost; it is no sandbox.
"""

import atexit
import os
import pickle
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from typing import IO, Any, NoReturn, Protocol, TypeVar

from adhesion_can.errors import AdhesionCanError
from adhesion_can.recordings.limited_work import (
    FAILED,
    ITEM,
    MESSAGE,
    REFUSED,
    Job,
    Limits,
    do_job,
    import_library,
)

T = TypeVar("T")


class LimitError(AdhesionCanError):
    """What was read takes more than the limits allow, or its reader did not survive it."""


def read_limited(
    work: Callable[[], Iterable[T]], limits: Limits, library: str = ""
) -> Generator[T, None, None]:
    """Items that work gives, made by another process.

    On Linux it is a copy: of this process while it has one thread, so that the copy has all
    modules, else of one that starts with the first work, in two seconds. Elsewhere a new process
    starts for each work, without limits on what the system does not count.

    Args:
        work: Function that can be pickled; so can its items.
        limits: Limits of the process.
        library: Module that the work needs and that takes long to import; "" is none.

    Raises:
        InputError: As the work raises it.
        LimitError: The work takes more than the limits allow, or failed in another way.

    """
    # What a reader that was stopped leaves behind goes with the folder.
    with tempfile.TemporaryDirectory(prefix="adhesion-can-") as folder:
        process = _start(Job(work, limits, library, folder))
        try:
            yield from _received(process, limits)
        finally:
            process.stop()


def _start(job: Job) -> "_Process":
    """Process that does a job."""
    if sys.platform != "linux":
        return _New(job)
    if threading.active_count() == 1:
        return _Copy(job)
    return _Template.of_this_process().copy(job)


def _received(process: "_Process", limits: Limits) -> Iterator[Any]:
    while True:
        try:
            kind, value = pickle.load(process.pipe)  # noqa: S301  of our own process
        except (EOFError, pickle.UnpicklingError):
            raise LimitError(_reason(process.wait(), limits)) from None
        if kind == ITEM:
            yield value
        elif kind == REFUSED:
            error, *parts = value
            raise error(*parts)
        elif kind == FAILED:
            raise LimitError(value)
        else:
            return


def _reason(status: int, limits: Limits) -> str:
    """Why a process ended early, by its exit status; that of a signal is negative."""
    name = signal.Signals(-status).name if status < 0 else ""
    if name == "SIGXCPU":
        return f"reading it takes more than {limits.processor_s} s of processor time"
    return f"its reader ended early ({name or f'status {status}'})"


class _Process(Protocol):
    """A process that does a job.

    Attributes:
        pipe: What it answers.

    """

    pipe: IO[bytes]

    def wait(self) -> int:
        """Wait for the end of the process; its exit status."""

    def stop(self) -> None:
        """End the process."""


class _Copy:
    """A copy of this process.

    Args:
        job: What it does.

    """

    def __init__(self, job: Job) -> None:
        import_library(job.library)
        ours, theirs = os.pipe()
        with warnings.catch_warnings():
            # Python 3.12 counts threads of libraries too, which sleep and hold no lock.
            warnings.simplefilter("ignore", DeprecationWarning)
            self._process = os.fork()
        if not self._process:
            _do_as_copy(theirs, ours, job)
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


def _do_as_copy(pipe: int, other_end: int, job: Job) -> NoReturn:
    """What the copy does: nothing that this process has begun is ended by it."""
    try:
        os.close(other_end)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever waits for it stops it
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        do_job(os.fdopen(pipe, "wb"), job)
    finally:
        os._exit(1)


class _Template:
    """A process of one thread, to be copied where this one has several.

    It keeps the modules that its copies need, so that only the first one waits for them.
    """

    _PROGRAM = (
        "import pickle, socket, sys\n"
        "requests = socket.socket(fileno=0)\n"
        f"sys.path[:] = pickle.loads(requests.recv({MESSAGE}))\n"
        "from adhesion_can.recordings.limited_work import serve_copies\n"
        "serve_copies(requests)\n"
    )
    _lock = threading.Lock()
    _running: "_Template | None" = None

    @classmethod
    def of_this_process(cls) -> "_Template":
        """The one that runs, or a new one."""
        with cls._lock:
            if cls._running is None or not cls._running.is_usable:
                cls._running = cls()
            return cls._running

    def __init__(self) -> None:
        self._user = os.getpid()
        # A message arrives whole, whichever threads send at the same time.
        self._requests, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(  # noqa: S603  our own program
                [sys.executable, "-c", self._PROGRAM],
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        self._requests.send(pickle.dumps(sys.path))
        atexit.register(self._end)

    @property
    def is_usable(self) -> bool:
        """Whether it runs, and is that of this process and not of the one that forked it."""
        return self._user == os.getpid() and self._process.poll() is None

    def copy(self, job: Job) -> "_CopyOfTemplate":
        """A copy that does a job, in the folder in which this process is.

        Raises:
            LimitError: The process is gone.

        """
        ours, theirs = os.pipe()
        control, other_end = socket.socketpair()
        here = os.open(".", os.O_RDONLY)
        try:
            files = [theirs, other_end.fileno(), here]
            socket.send_fds(self._requests, [pickle.dumps(job)], files)
        except OSError as error:
            os.close(ours)
            control.close()
            raise LimitError(f"its reader cannot start ({error.strerror})") from error
        finally:
            other_end.close()
            os.close(theirs)
            os.close(here)
        return _CopyOfTemplate(os.fdopen(ours, "rb"), control)

    def _end(self) -> None:
        if self._user == os.getpid():
            self._requests.close()
            self._process.wait()


class _CopyOfTemplate:
    """A copy of another process.

    Args:
        pipe: What it answers.
        control: Socket that brings its exit status, and whose end ends it.

    """

    def __init__(self, pipe: IO[bytes], control: socket.socket) -> None:
        self.pipe, self._control = pipe, control
        self._status: int | None = None

    def wait(self) -> int:
        """Wait for the end of the process; its exit status."""
        if self._status is None:
            # Nothing comes where what guards it was killed too.
            self._status = int(self._control.recv(16) or -signal.SIGKILL)
        return self._status

    def stop(self) -> None:
        """End the process."""
        self.pipe.close()
        self._control.shutdown(socket.SHUT_WR)
        self.wait()
        self._control.close()


class _New:
    """A new process of Python.

    Args:
        job: What it does.

    """

    _PROGRAM = (
        "import pickle, sys\n"
        "sys.path[:] = pickle.load(sys.stdin.buffer)\n"
        "from adhesion_can.recordings.limited_work import serve\n"
        "serve()\n"
    )

    def __init__(self, job: Job) -> None:
        self._process = subprocess.Popen(  # noqa: S603  our own program
            [sys.executable, "-c", self._PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        if self._process.stdin is None or self._process.stdout is None:
            raise RuntimeError("pipes were asked for")
        self.pipe: IO[bytes] = self._process.stdout
        with self._process.stdin as pipe:
            pickle.dump(sys.path, pipe)
            pickle.dump(job, pipe)

    def wait(self) -> int:
        """Wait for the end of the process; its exit status."""
        return self._process.wait()

    def stop(self) -> None:
        """End the process."""
        self.pipe.close()
        self._process.kill()
        self._process.wait()
