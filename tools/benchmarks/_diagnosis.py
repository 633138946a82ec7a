"""One `adhesion-can diagnose` in a process of its own: its arguments are the command's.

The last line on stdout is JSON: seconds of the processor for the start with its imports and for the
work, and the peak of the memory, MiB.
"""

import json
import sys
import time
from pathlib import Path


def peak_mib():
    """Peak of this process alone: what getrusage says may be its parent's."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    raise OSError("no VmHWM in /proc/self/status")


def main():
    import adhesion_can.diagnosis.diagnose  # noqa: F401  which the command imports late
    from adhesion_can.cli.main import main as command

    start = time.process_time()
    status = command(["diagnose", *sys.argv[1:]])
    cost = {"start": start, "work": time.process_time() - start, "mib": peak_mib()}
    print(json.dumps(cost))
    return status


if __name__ == "__main__":
    sys.exit(main())
