"""One drive for `tools/bench learn`: the service without a model, what the learner makes of its
readings, and the service that applies it, and with the true model."""

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
from _truth_drive import measure

from adhesion_can import replay
from adhesion_can.config import load_configuration
from adhesion_can.config.model_file import parse_model
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.learning.doubted import is_doubted
from adhesion_can.learning.learner import Learner
from adhesion_can.learning.record import ReadingRecord
from adhesion_can.offline.load_traces import load_traces
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.effects import ActiveEffect, forms_of_effect
from adhesion_can.physics.objection import Objection
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from adhesion_can.service.model_changes import ModelChange
from adhesion_can.service.outputs import Outputs
from tests.worlds import make_world
from tests.worlds.hidden import Hidden
from tests.worlds.world import World

SIZES = {
    "speed_scale": ("", {"error": -0.01}),
    "effort_bias": ("", {"bias": 9e3}),
    "adhesion_recovery": ("", {"gain": 4e-7, "time": 3.0}),
    "rail_cleaning": ("", {"gain": 0.04}),
}
"""Form and size of what is hidden: the speed reads 1 % low, the efforts 9 kN high, slip work cleans
the rail, each axle finds a cleaner rail. The worlds that hide it have formulas of their own."""
SOUND = "null:0"
"""Kind of a drive that hides nothing."""
JUDGED_S = 600.0
"""Time from which setpoints are judged, s."""
LEAST_CREEP = 5e-4
"""Creep of an axle from which a drive pulls or brakes; below it, it coasts."""
STEP_US = 1_000_000
"""Time between two looks of the learner at what has come, µs."""


class SizedWorld(World):
    """A world that hides its effect with a size that is given, and not drawn."""

    def _sized(self, names, excess):  # noqa: ARG002  what the sizes are is given
        hidden = tuple(Hidden(name, *SIZES[name]) for name in names)
        return hidden, tuple(self._excess(one) for one in hidden)


def run_drive(task):
    """Record of a drive, fit for JSON; `task` has kind, seed, duration in s, and `with_true`.

    Setpoints are judged where the truth has the whole contact, which worlds by others have not.
    """
    kind, seed, duration_s, with_true = task
    record = {"kind": kind, "seed": seed, "duration_s": duration_s}
    began = time.perf_counter()
    with TemporaryDirectory(prefix="learn-") as folder:
        log = Path(folder) / "drive.log"
        try:
            truth = make_drive(kind, seed, log, duration_s)
            plain = replay(log)
            if truth.true_contact is not None:
                record["plain"] = measure_late(truth, log, plain)
            learned = learn(log, plain, Path(folder))
            record |= {name: value for name, value in vars(learned).items() if name != "changes"}
            record["causes"] = [one.model.names for one in learned.changes if one.model]
            if kind in SIZES:
                record["applied"] = measure_applied(truth, log, learned.changes)
                if with_true:
                    record["true"] = measure_late(truth, log, replay(log, model=true_model(truth)))
        except Exception as error:  # noqa: BLE001  whatever it was: it is the finding
            record["error"] = repr(error)[:500]
    record["seconds"] = round(time.perf_counter() - began, 1)
    return record


def make_drive(kind, seed, log, duration_s):
    """Write a drive; its truth."""
    if kind not in SIZES:
        return make_world(kind, seed, log, duration_s=duration_s)
    world = SizedWorld(kind, seed, 0, duration_s)
    return world.written((kind,), log, (0.0, np.inf), fresh=False)


def measure_applied(truth, log, changes):
    """Figures of a service that changes its model as `--learn apply` does.

    Its log has the changes; what it sent before them is what it sent without them.
    """
    with log.open("a") as file:
        file.writelines(change.to_lines() for change in changes)
    return measure_late(truth, log, replay(log))


def measure_late(truth, log, table):
    """Figures of setpoints from `JUDGED_S` on, and of those during which the drive pulls."""
    late = table["time_s"] >= JUDGED_S + table["time_s"][0]
    table = {name: column[late] for name, column in table.items()}
    profile = truth.true_contact.profile
    creep = np.abs(profile.slip).max(axis=1)
    row = np.clip(np.searchsorted(profile.t, table["time_s"]), 0, len(creep) - 1)
    pulls = creep[row] > LEAST_CREEP
    return {
        "figures": measure(truth, log, None, table=table).to_dict(),
        "pulls": float(pulls.mean()),
        "tracking_of_pulls": float((table["status"][pulls] == "TRACKING").mean()),
    }


def learn(log, plain, folder):
    """What a learner proposes and confirms, fed with the readings of a drive second by second.

    `plain` are the setpoints of a service without it.
    """
    config = load_configuration()
    blocks = blocks_in_sequence(open_recordings([log]), config.service.restart_s)
    drive = ReadingRecord(window_s=1e9, most_readings=10**9)
    for key, parts in load_traces(blocks, config, str(log)).columns.items():
        for stamps, values in parts:
            drive.add({key: (stamps, values)})
    told = SimpleNamespace(
        proposed_s=None, confirmed_s=None, dropped=0, proposals=0, found="", outcome="", changes=[]
    )
    begin_us = drive.begin_us

    def tell(report):
        now_s = (report.t_us - begin_us) / 1e6
        told.outcome = report.outcome
        if report.state == "estimated" and report.news:
            told.proposals += 1
            told.found = report.found
            told.proposed_s = now_s if told.proposed_s is None else told.proposed_s
        elif report.state == "confirmed" and report.news:
            told.confirmed_s = now_s
            told.changes.append(ModelChange(report.t_us, parse_model(report.model, "learned")))
        elif report.state == "invalid":
            told.dropped += 1
            told.changes.append(ModelChange(report.t_us, None))

    learner = Learner(config, folder, tell)
    for from_us in range(begin_us, drive.end_us + 1, STEP_US):
        to_us = from_us + STEP_US
        place = max(int(np.searchsorted(plain["time_s"], to_us / 1e6)) - 1, 0)
        doubt = Doubt[plain["doubt"][place] or "NOT_AVAILABLE"]
        said = Outputs(doubt=doubt, objection=Objection[plain["objection"][place]])
        learner.add(drive.between(from_us, to_us), is_doubted(said))
        while learner.work():
            pass
    return told


def true_model(truth):
    """The extended model that holds what a drive hides."""
    actives = []
    for hidden in truth.effects:
        effect = next(one for one in forms_of_effect(hidden.effect) if one.form == hidden.form)
        values = tuple(float(hidden.parameters[p.name]) for p in effect.parameters)
        actives.append(ActiveEffect(effect, values))
    first = truth.surfaces[0]
    return ExtendedModel((first.c1, first.c2, first.c3), effects=tuple(actives))
