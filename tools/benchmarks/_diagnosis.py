"""One `adhesion-can diagnose` in a process of its own: its arguments are the command's.

The last line on stdout is JSON: seconds of the imports, processor seconds of all, peak memory, MiB.
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
    began = time.perf_counter()
    import adhesion_can.criticism.diagnose  # noqa: F401  which the command imports late
    from adhesion_can.cli.main import main as command

    imported = time.perf_counter() - began
    status = command(["diagnose", *sys.argv[1:]])
    cost = {"imports": imported, "processor": time.process_time(), "mib": peak_mib()}
    print(json.dumps(cost))
    return status


if __name__ == "__main__":
    sys.exit(main())
