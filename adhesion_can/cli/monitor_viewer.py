"""The command of one page of `monitor --serve`: the same monitor, in a process of its own."""

import shlex
import sys

VIEWER = "--in-page"
"""Option of such a process; it is for the server alone."""
COMMAND = "monitor"


def viewer_command(command_line: str) -> str:
    """Command line of a page's process, for a shell.

    Args:
        command_line: Command line of the server, with the name of the program in front.

    """
    words = shlex.split(command_line)[1:]
    place = words.index(COMMAND) + 1
    words.insert(place, VIEWER)
    # The interpreter and the package of the server; its shell makes room, so that the server is
    # the parent.
    return "exec " + shlex.join([sys.executable, "-m", "adhesion_can.cli.main", *words])
