"""A bench: the service and a simulated locomotive on one bus, and we listen.

    python bench.py [DURATION_S]

On vcan0 where this machine has it, else over multicast that does not leave the host. Instead of the
locomotive put your own drive on the bus: the service does not know the difference.
"""

import subprocess
import sys
import time
from pathlib import Path

import can
import cantools

from adhesion_can.bus.database import packaged_path

SETPOINT = 0x201


def main(duration_s: float = 20.0) -> None:
    if Path("/sys/class/net/vcan0").exists():
        bus = {"interface": "socketcan", "channel": "vcan0"}
        options = ["-i", "socketcan", "-c", "vcan0"]
    else:
        bus = {"interface": "udp_multicast", "channel": "239.74.163.2", "hop_limit": 0}
        options = ["-i", "udp_multicast", "-c", "239.74.163.2", "--bus-kwargs", "hop_limit=0"]
    print(f"bus: {bus['interface']} {bus['channel']}")

    command = str(Path(sys.executable).with_name("adhesion-can"))
    database = cantools.database.load_file(packaged_path())
    message = database.get_message_by_frame_id(SETPOINT)

    # Terminal 1: the service. Terminal 2: the locomotive, which obeys it.
    drive = ["--scenario", "dry-wet-dry", "--duration", str(duration_s), "--closed-loop"]
    with can.Bus(**bus) as listener:
        service = subprocess.Popen([command, "run", *options])
        locomotive = subprocess.Popen([command, "simulate", *drive, *options])
        try:
            listen(listener, message, locomotive)
        finally:
            # Ctrl-C: every message goes out once more as 'not available', then they end.
            for process in (locomotive, service):
                process.terminate()
                process.wait(30)


def listen(
    bus: can.BusABC, message: cantools.database.Message, locomotive: subprocess.Popen
) -> None:
    """Terminal 3: one line a second, until the locomotive has arrived."""
    told, seen, begun = 0.0, 0, time.monotonic()
    while locomotive.poll() is None and time.monotonic() - begun < 300:
        frame = bus.recv(0.5)
        if frame is None or frame.arbitration_id != SETPOINT:
            continue
        seen += 1
        if frame.timestamp - told < 1.0:
            continue
        told = frame.timestamp
        values = message.decode(frame.data)
        names = ("Status", "MuMax", "LambdaM", "CreepSpeedSetpoint")
        print(*(f"{name} {values[name]!s:15}" for name in names), flush=True)
    print(f"{seen} setpoints received")


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
