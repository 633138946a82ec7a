"""A recording: simulate a drive, look whether it can be used, replay it, compare with the truth.

    python replay.py [DURATION_S]

Take a log of your own in place of drive.log; without a database of its own its ids and signals are
those of dbc/adhesion.dbc.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np

import adhesion_can


def main(duration_s: float = 60.0) -> None:
    drive = adhesion_can.simulate("dry-wet-dry", duration_s, seed=1)
    log = drive.write("drive.log")

    # 1. Is it usable? Signals, rates, gaps, checksums, counters, noise, excitation.
    command = str(Path(sys.executable).with_name("adhesion-can"))
    subprocess.run([command, "check", str(log)], check=True)

    # 2. The setpoints that the service would have sent: one row for each message 0x201. On the
    #    command line: adhesion-can replay drive.log --table setpoints.csv
    table = adhesion_can.replay(log)
    tracking = table["status"] == "TRACKING"
    print(f"{len(tracking)} setpoints, {tracking.mean():.0%} with status TRACKING")

    # 3. Beside the truth, which a simulation knows.
    time_s = table["time_s"] - table["time_s"][0]
    print("surface   mu_max true, estimated   lambda_m true, estimated")
    for surface in drive.truth["surfaces"]:
        inside = tracking & (time_s > surface["from_s"]) & (time_s <= surface["to_s"])
        if not inside.any():
            print(f"{surface['name']:10}not identified")
            continue
        mu_max, lambda_m = (np.median(table[name][inside]) for name in ("mu_max", "lambda_m"))
        print(
            f"{surface['name']:9} {surface['mu_max']:.4f}, {mu_max:.4f}"
            f"           {surface['lambda_m']:.4f}, {lambda_m:.4f}"
        )


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
