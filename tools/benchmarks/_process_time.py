"""Processor time of whole processes."""

import resource
import subprocess

MAIN = "import sys; from adhesion_can.cli.main import main; sys.exit(main())"
"""Code of a process that is the command."""


def processor_seconds(*words):
    """User and system time of a process, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([*map(str, words)], stdout=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
