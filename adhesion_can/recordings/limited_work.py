"""What a process does that reads under limits: the work, its answers, and nothing beside them."""

import contextlib
import faulthandler
import os
import pickle
import select
import signal
import socket
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import import_module
from math import ceil
from pathlib import Path
from typing import IO, Any, NoReturn, Self

from adhesion_can.errors import InputError

MESSAGE = 1 << 17
"""Largest message to a process that is copied, bytes: a function, a path and limits."""
ITEM, END, REFUSED, FAILED = range(4)
"""Kinds of answers, each with a value: an item, the end, an error to raise, words of a failure."""
MIB = 1 << 20


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
        return cls(5 + 50 * size // MIB, 400 * MIB + 40 * size, 400 * MIB + 40 * size)


@dataclass(frozen=True, slots=True)
class Job:
    """Work for a process.

    Attributes:
        work: Function that gives the items.
        limits: Limits of the process.
        library: Module that the work needs and that takes long to import; "" is none.
        folder: Folder for temporary files.

    """

    work: Callable[[], Iterable[Any]]
    limits: Limits
    library: str
    folder: str


def import_library(name: str) -> None:
    """Import a module before a process is copied, so that no copy does; "" is none.

    Where it is missing, the work says so.
    """
    if name:
        with contextlib.suppress(ImportError):
            import_module(name)


def serve() -> NoReturn:
    """Do the job that stdin names, as a new process."""
    pipe = os.fdopen(os.dup(1), "wb")
    do_job(pipe, pickle.load(sys.stdin.buffer))  # noqa: S301  of our own process


def serve_copies(requests: socket.socket) -> None:
    """Copy this process for each request of a socket, until its other end is closed.

    A request is a job with three files: a pipe for the answers, a socket that `_guard` listens to,
    and the folder to be in.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever waits for it stops it
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for a guard
    while True:
        message, files, _, _ = socket.recv_fds(requests, MESSAGE, 3)
        if not message:
            return
        job: Job = pickle.loads(message)  # noqa: S301  of our own process
        import_library(job.library)
        if not os.fork():
            requests.close()
            _guard(job, *files)
        for file in files:
            os.close(file)


def _guard(job: Job, pipe: int, control: int, folder: int) -> NoReturn:
    """Let a copy do a job, and stop it where the other end of a socket is closed.

    Its exit status goes to that socket.
    """
    try:
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        os.fchdir(folder)
        ended, ends = os.pipe()  # closed by the end of the copy, however it ends
        process = os.fork()
        if not process:
            os.close(control)
            os.close(ended)
            do_job(os.fdopen(pipe, "wb"), job)
        os.close(pipe)
        os.close(ends)
        readable, _, _ = select.select([ended, control], [], [])
        if ended not in readable:
            os.kill(process, signal.SIGKILL)
        _, status = os.waitpid(process, 0)
        os.write(control, str(os.waitstatus_to_exitcode(status)).encode())
    finally:
        os._exit(0)


def do_job(pipe: IO[bytes], job: Job) -> NoReturn:
    """Send what a job's work gives, and end the process."""
    # Nothing of a library's, nor of Python's, stands between the lines of the command.
    faulthandler.disable()
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    warnings.simplefilter("ignore")
    tempfile.tempdir = job.folder
    _limit(job.limits)
    try:
        for item in job.work():
            pickle.dump((ITEM, item), pipe, protocol=5)
            pipe.flush()
        last: tuple[int, object] = (END, None)
    except InputError as error:
        last = (REFUSED, (type(error), error.where, error.what, error.fix))
    except MemoryError:
        last = (FAILED, f"reading it takes more than {job.limits.memory // MIB} MiB of memory")
    except Exception as error:  # noqa: BLE001  a library raises whatever its parsers meet
        text = " ".join(str(error).split())[:120]
        last = (FAILED, f"its reader failed ({type(error).__name__}: {text})")
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
