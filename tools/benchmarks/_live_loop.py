"""One loop on a bus for some seconds: the service, with or without a learner, or a bare one; its
figures as JSON.

The bare loop receives, decodes with cantools, and sends the same frames at the same due times,
encoded by cantools from fixed values: what python-can and cantools cost by themselves.
"""

import argparse
import json
import time
from collections import deque
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from _live_bus import Bus, TimedBus, can, drive_frames, play_beside

from adhesion_can.bus.frame import to_us
from adhesion_can.config import load_configuration
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.live import LiveService, start_clock
from adhesion_can.service.output_messages import SETPOINT
from adhesion_can.service.reconnecting_bus import ReconnectingBus
from adhesion_can.service.schedule import Schedule

SETTLED_S = 2.0
"""Time at the start that does not count: numpy and the estimator warm up."""
WAIT_S = 0.002
LEAST_RECORD_S = 5.0
"""Shortest record that the learner diagnoses, s: it has something to do for the whole run."""


class Lateness:
    """Times at which setpoints were handed to the bus, after they were due, µs."""

    def __init__(self, clock):
        self.clock = clock
        self.late_us, self.due_us = [], []

    def add(self, t_us, _outputs):
        """Called when the setpoint of a due time has been handed to the bus."""
        self.late_us.append(self.clock() - t_us)
        self.due_us.append(t_us)


def run_service(timed, config, seconds, begin):
    lateness = Lateness(start_clock())
    return serve(ServiceCore(config, on_setpoint=lateness.add), lateness, timed, seconds, begin)


def run_learning(timed, config, seconds, begin):
    """The service with `--learn apply`, whose learner diagnoses without a pause."""
    from adhesion_can.learning.child import LearningTask
    from adhesion_can.learning.companion import LearningCompanion
    from adhesion_can.learning.learner import LearningSettings
    from adhesion_can.service.correcting_core import CorrectingCore

    lateness = Lateness(start_clock())
    settings = LearningSettings(interval_s=1.0, least_s=LEAST_RECORD_S)
    with TemporaryDirectory() as folder:
        companion = LearningCompanion(LearningTask(config, Path(folder), settings), print)
        with closing(companion):

            def observe(t_us, outputs):
                lateness.add(t_us, outputs)
                companion.observe_setpoint(t_us, outputs)

            core = CorrectingCore(config, on_setpoint=observe)
            core.on_readings = companion.observe_readings
            figures = serve(core, lateness, timed, seconds, begin, each_turn=companion.take_news)
            return figures | {
                "diagnoses": companion.report.examined,
                "learning_lost_s": companion.lost_s,
            }


def serve(core, lateness, timed, seconds, begin, **options):
    """Run a core on the bus; its figures."""
    bus = ReconnectingBus(lambda: timed, core.ids)
    # The log is written, as a bench has it.
    lines = deque(maxlen=1)
    clock = lateness.clock
    service = LiveService(core, bus, clock=clock, write_log=lines.append, **options)
    begin()
    service.run(service.clock() + round(seconds * 1e6))
    return {
        "lost": core.receiver.lost + core.counts.receive_drops,
        "overdue": service.counts.overdue,
        "clamped": core.counts.clamped,
        "samples": core.counts.samples,
        "status": None if core.estimate is None else "estimated",
        "late_us": lateness.late_us,
        "due_us": lateness.due_us,
    }


def run_bare(timed, config, seconds, begin):
    database = config.database.db
    core = ServiceCore(config)
    cycles = {
        database.get_message_by_frame_id(number): cycle
        for number, cycle in sorted(core.messages.cycles_by_id_us.items())
    }
    schedule = Schedule({message.name: cycle for message, cycle in cycles.items()})
    values = {message.name: {s.name: s.minimum or 0 for s in message.signals} for message in cycles}
    known = {message.frame_id for message in database.messages}
    own = {message.name: message.frame_id for message in cycles}
    begin()
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        message = timed.recv(WAIT_S)
        if message is None or message.arbitration_id not in known:
            continue
        if message.arbitration_id in own.values():
            continue
        database.decode_message(message.arbitration_id, message.data)
        now_us = to_us(message.timestamp)
        if not schedule.started:
            schedule.start(now_us)
        while (due_us := schedule.next_due_us) is not None and due_us <= now_us:
            for name in schedule.pop_due(due_us):
                data = database.encode_message(name, values[name], strict=False)
                timed.send(can.Message(arbitration_id=own[name], data=data, is_extended_id=False))
    timed.shutdown()
    return {}


LOOPS = {"service": run_service, "learning": run_learning, "bare": run_bare}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("loop", choices=LOOPS)
    parser.add_argument("--interface", required=True)
    parser.add_argument("--channel", required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--play", action="store_true", help="play the drive in this process")
    options = parser.parse_args()
    config = load_configuration()
    bus = Bus(options.interface, options.channel)
    watched = config.database.db.get_message_by_name(SETPOINT).frame_id
    timed = TimedBus(bus.open(), watched)
    drive = drive_frames(options.seconds, 0.0) if options.play else None

    def begin():
        """Called when all is made: the first frame that is sent is the first one handled."""
        if drive is not None:
            play_beside(bus, drive)
        print("ready", flush=True)
        timed.settle(SETTLED_S)

    figures = LOOPS[options.loop](timed, config, options.seconds, begin)
    skipped = round(SETTLED_S / 0.02)
    delays = timed.delays_us[skipped:] or [float("nan")]
    figures |= {
        "cpu": timed.cpu_share(),
        "received": timed.received,
        "sent": timed.sent,
        "p50_us": float(np.quantile(delays, 0.5)),
        "p99_us": float(np.quantile(delays, 0.99)),
        "setpoints": len(timed.delays_us),
    }
    print(json.dumps(figures), flush=True)


if __name__ == "__main__":
    main()
