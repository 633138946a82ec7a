"""Entry point: parses, runs, and turns errors into one line and an exit status.

0: done, whatever the verdict. 1: a check failed. 2: bad input or usage.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from adhesion_can import __version__
from adhesion_can.cli import (
    calibrate,
    check,
    convert,
    demo,
    diagnose,
    experiment,
    identify,
    replay,
    run,
    simulate,
)
from adhesion_can.errors import AdhesionCanError

COMMANDS = (demo, run, simulate, replay, identify, calibrate, diagnose, experiment, check, convert)


class _Parser(argparse.ArgumentParser):
    """One line on stderr for wrong usage, as for every other error."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see '{self.prog} --help'\n")


def build_parser() -> argparse.ArgumentParser:
    """Parser of all commands."""
    parser = _Parser(
        prog="adhesion-can",
        description="Identifies the wheel/rail adhesion curve from CAN data, online and from "
        "recordings, and sends the optimal creep back to the drive.",
    )
    parser.add_argument("--version", action="version", version=f"adhesion-can {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, dest="command")
    for module in COMMANDS:
        module.add_to(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        arguments: of the command line; None: those of the process.

    Returns:
        Exit status.

    """
    options = build_parser().parse_args(arguments)
    try:
        status: int = options.run(options)
        sys.stdout.flush()
    except AdhesionCanError as error:
        print(f"adhesion-can {options.command}: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        # The reader has gone (| head): no more output, and no complaint at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        return 130
    return status


if __name__ == "__main__":
    sys.exit(main())
