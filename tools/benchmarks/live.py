"""The service on a bus beside a bare loop of python-can and cantools: times, losses, computing.

Each figure is a ratio to the bare loop on the same bus in the same run, or a time against the due
time. Over multicast and on vcan the drive is played by another process; the network of the
multicast is one of its own where the kernel allows it, so that nothing leaves the machine.
"""

import json
import os
import shutil
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from statistics import median

import numpy as np
from _live_bus import LEAD_S, Bus
from _rows import positive, row_parser, run_rows

HERE = Path(__file__).resolve().parent
MULTICAST = Bus("udp_multicast", "239.74.163.2")
VCAN = Bus("socketcan", "vcan0")
NETWORK = "ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && exec "
INSIDE = "ADHESION_CAN_OWN_NETWORK"
OWN_RATE = 466
"""Frames a second of the full input set."""
SETTLED_US = 2_000_000
LEARNING_S = 40.0
"""Shortest run beside a learner, s: it takes seconds to start."""


def loop(kind, bus, seconds, *, foreign=0.0, pauses=(), play=False):
    """Figures of one loop; with the number of frames that were played for it."""
    where = ["--interface", bus.interface, "--channel", bus.channel]
    words = [sys.executable, str(HERE / "_live_loop.py"), kind, *where]
    with ExitStack() as stack:
        player = None
        if not play:
            drive = [sys.executable, str(HERE / "_live_player.py"), *where]
            drive += ["--seconds", str(seconds - LEAD_S - 1.0), "--foreign", str(foreign)]
            for begin, end in pauses:
                drive += ["--pause", str(begin), str(end)]
            player = stack.enter_context(_process(drive))
            player.stdout.readline()
        own = stack.enter_context(
            _process([*words, "--seconds", str(seconds), *(["--play"] if play else [])])
        )
        own.stdout.readline()
        if player is not None:
            player.stdin.write("\n")
            player.stdin.flush()
        text = own.stdout.read()
        if own.wait() or not text.strip():
            sys.exit(f"the {kind} loop on {bus.interface} failed")
        figures = json.loads(text)
        if player is not None:
            figures["played"] = int(player.stdout.read())
    return figures


def _process(words):
    return subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=HERE
    )


def beside_bare(report, options, bus, *, play=False):
    """The service's time from a frame to the setpoint over the bare loop's, in turns."""
    found = {"bare": [], "service": []}
    for _ in range(options.runs):
        for kind, figures in found.items():
            figures.append(loop(kind, bus, options.seconds, play=play))
    for share in ("p50", "p99"):
        times = {k: median(one[f"{share}_us"] for one in runs) for k, runs in found.items()}
        ratio = times["service"] / times["bare"]
        report.write(
            f"{share}: service {times['service']:.0f} us, bare loop {times['bare']:.0f} us"
        )
        report.at_most(f"{share} of {bus.interface} over the bare loop's", ratio, 4.0, ".2f")


def virtual(report, options):
    """frame to setpoint on python-can's virtual bus, the drive from a thread beside the loop"""
    beside_bare(report, options, Bus("virtual", "live"), play=True)


def multicast(report, options):
    """frame to setpoint between processes over UDP multicast"""
    beside_bare(report, options, MULTICAST)


def vcan(report, options):
    """frame to setpoint between processes on vcan0"""
    if not Path("/sys/class/net/vcan0").exists():
        report.write("no vcan0 here: tools/vcan -t 600 tools/bench live --only vcan")
        return
    beside_bare(report, options, VCAN)


def quiet(report, options):
    """where no frame comes: when the setpoint is on the bus after its due time"""
    begin, end = 4.0, 4.9
    found = loop("service", MULTICAST, options.seconds, pauses=[(begin, end)])
    due = np.array(found["due_us"])
    since_s = (due - due[0]) / 1e6
    late = np.array(found["late_us"])[(since_s > begin + 0.05) & (since_s < end - 0.05)] / 1e3
    report.write(f"{len(late)} setpoints in a pause of {end - begin:g} s")
    p99 = float(np.quantile(late, 0.99)) if len(late) else float("nan")
    report.at_most("p99 of the time after the due time, ms, 2 of them awaited", p99, 4.0, ".2f")


def load(report, options):
    """frames of 10 000 a second, own and foreign ids: losses and jitter of the setpoints"""
    for rate, target in ((10_000, True), (20_000, False)):
        found = loop("service", MULTICAST, options.seconds, foreign=rate - OWN_RATE)
        late = np.array(found["late_us"])[np.array(found["due_us"]) > 0]
        late = late[round(SETTLED_US / 20_000) :] / 1e3
        jitter = float(np.quantile(late, 0.99))
        lost = found["lost"] + found["overdue"]
        played = found["played"] / (options.seconds - LEAD_S - 1.0)
        figure = f"{lost} of {found['played']} ({played:.0f}/s)"
        if target:
            report.check(f"lost at {rate} frames/s", figure, "none", met=lost == 0)
            report.at_most("p99 of setpoints after their due time, ms", jitter, 4.0, ".2f")
        else:
            report.write(f"at {rate} frames/s: lost {figure}, p99 {jitter:.2f} ms")


def computing(report, options):
    """share of a core at the full input set of 466 frames a second"""
    runs = {kind: loop(kind, MULTICAST, options.seconds) for kind in ("bare", "service")}
    report.write(f"bare loop: {100 * runs['bare']['cpu']:.1f} % of a core")
    report.at_most("service, % of a core", 100 * runs["service"]["cpu"], 15.0, ".1f")


def learn(report, options):
    """with and without --learn apply, in turns: frame to setpoint, share of a core"""
    found = {"service": [], "learning": []}
    for _ in range(options.runs):
        for kind, figures in found.items():
            figures.append(loop(kind, MULTICAST, max(options.seconds, LEARNING_S)))
    diagnoses = sum(run["diagnoses"] for run in found["learning"])
    lost_s = sum(run["learning_lost_s"] for run in found["learning"])
    report.write(f"the learner made {diagnoses} diagnoses and lost {lost_s:g} s of readings")
    for name, unit in (("p50_us", "us"), ("p99_us", "us"), ("cpu", "of a core")):
        without, learning = (median(run[name] for run in runs) for runs in found.values())
        report.write(f"{name}: {learning:.4g} {unit} with --learn, {without:.4g} without")
        if name != "p50_us":
            report.at_most(f"{name} with --learn over without", learning / without, 1.25, ".2f")


ROWS = {
    "virtual": virtual,
    "multicast": multicast,
    "vcan": vcan,
    "quiet": quiet,
    "load": load,
    "computing": computing,
    "learn": learn,
}


def main():
    parser = row_parser("live", ROWS)
    parser.add_argument("--seconds", type=positive(float), default=12.0, help="of each loop")
    parser.add_argument("--runs", type=positive(int), default=3, help="of each loop, in turns")
    options = parser.parse_args()
    if options.only != ["vcan"]:
        _enter_own_network()
    run_rows(ROWS, options)


def _enter_own_network():
    """Go on in a network namespace with a multicast route, where one can be had."""
    if os.environ.get(INSIDE) or not (shutil.which("unshare") and shutil.which("ip")):
        return
    os.environ[INSIDE] = "1"
    probe = ["unshare", "-n", "sh", "-c", NETWORK + "true"]
    if subprocess.run(probe, capture_output=True, check=False).returncode:
        return
    command = ["unshare", "-n", "sh", "-c", NETWORK + '"$0" "$@"', sys.executable, *sys.argv]
    os.execvp(command[0], command)  # noqa: S606  this program, in a network of its own


if __name__ == "__main__":
    main()
