"""Entry point: parses, runs, and turns errors into one line and an exit status.

0: done, whatever the verdict. 1: a check failed. 2: bad input or usage. The module of a command is
imported when the command is called, so that no command waits for the libraries of another one.
"""

import argparse
import errno
import os
import select
import shlex
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from adhesion_can.cli.commands import COMMANDS
from adhesion_can.cli.parsing import CommandParser, Parser
from adhesion_can.errors import AdhesionCanError
from adhesion_can.printable import say
from adhesion_can.recordings.python_can_mf4 import put_off_asammdf
from adhesion_can.version import __version__

BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""Environment of the libraries for linear algebra. Our matrices are small: more threads than one
wait for each other, and a service would keep all cores busy."""

_DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def build_parser() -> argparse.ArgumentParser:
    """Parser of all commands."""
    parser = Parser(
        prog="adhesion-can",
        description="Identifies the wheel/rail adhesion curve from CAN data, online and from "
        "recordings, and sends the optimal creep back to the drive.",
        epilog="'adhesion-can COMMAND --help' shows the command's options and two examples.",
    )
    parser.add_argument("--version", action="version", version=f"adhesion-can {__version__}")
    commands = parser.add_subparsers(
        title="commands",
        metavar="COMMAND",
        required=True,
        dest="command",
        parser_class=CommandParser,
    )
    for name, command in COMMANDS.items():
        commands.add_parser(name, help=command.line).command = name
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        arguments: Words of the command line; None for those of the process.

    Returns:
        Exit status.

    """
    for name in BLAS_THREADS:
        os.environ.setdefault(name, "1")  # read when the library is loaded, with the command
    if arguments is None:  # the process is this command's alone
        put_off_asammdf()
    try:
        options = build_parser().parse_args(arguments)
    except AdhesionCanError as error:  # of an installed extension that a help text names
        _tell(f"adhesion-can: {error}")
        return 2
    words = sys.argv[1:] if arguments is None else arguments
    options.command_line = shlex.join(["adhesion-can", *map(str, words)])
    if options.progress is not None or "adhesion_can.cli.bars" in sys.modules:
        from adhesion_can.cli.bars import Bar  # noqa: PLC0415  short commands have no bar

        Bar.wanted = options.progress
    try:
        with _terminable():
            status: int = options.run(options)
            sys.stdout.flush()
    except AdhesionCanError as error:
        _tell(f"adhesion-can {options.command}: {error}")
        return 2
    except BrokenPipeError:
        _drop_stdout()  # the reader has gone (| head)
        return 0
    except OSError as error:
        # Files and their disks have errors of their own.
        if error.errno not in _DISK_FULL or error.filename is not None:
            raise
        _drop_stdout()
        reason = f"stdout: {error.strerror}; free some space, or write elsewhere"
        _tell(f"adhesion-can {options.command}: {reason}")
        return 2
    except KeyboardInterrupt:
        return 130
    return status


def _tell(line: str) -> None:
    """Print a line on stderr, unless whoever reads it takes nothing for half a second."""
    try:
        takes_it = bool(select.select([], [sys.stderr], [], 0.5)[1])
    except (OSError, ValueError):
        takes_it = True  # nothing that one can wait for, such as a file in memory
    if takes_it:
        say(line)


@contextmanager
def _terminable() -> Iterator[None]:
    """SIGTERM unwinds the command as Ctrl-C does, and so leaves no file half written.

    A command may have a handler of its own meanwhile; one of the process stays in force.
    """

    def stop(number: int, _: FrameType | None) -> NoReturn:
        sys.exit(128 + number)

    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _drop_stdout() -> None:
    """No more output, and no complaint at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())
