"""Whole drives of the tests' own worlds: proposed, confirmed and loaded; live; and sound ones."""

import threading
import time
from dataclasses import replace
from math import inf

import numpy as np
import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.config import load_configuration
from adhesion_can.config.model_file import read_model
from adhesion_can.learning.application import AppliedModels
from adhesion_can.learning.child import LearningTask
from adhesion_can.learning.companion import LearningCompanion
from adhesion_can.learning.confirmation import LearningState
from adhesion_can.learning.doubted import is_doubted
from adhesion_can.learning.learner import Learner, LearningSettings
from adhesion_can.learning.record import ReadingRecord, join_readings
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.status import Status
from adhesion_can.recordings.candump import ReadReport, read_candump
from adhesion_can.recordings.python_can_messages import to_message
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.correcting_core import CorrectingCore
from adhesion_can.service.model_changes import read_model_changes
from adhesion_can.service.outputs import Outputs
from tests.learning.test_prediction import readings_of
from tests.service.test_core import FixedEstimator
from tests.service.test_live import Running, opened, wall_clock
from tests.worlds import make_world
from tests.worlds.encoding import write_log
from tests.worlds.plant import drive
from tests.worlds.world import World

CONFIG = load_configuration()
FAULT_S, ERROR = 40.0, -0.01
"""Time at which the vehicle speed goes off, s, and its error from then on."""
LONGEST_S = 1000.0
"""Duration of a drive in which a model is applied and dropped, at the longest, s."""
CORRECTED_S = 10.0
"""Time for which the model corrects what is wrong before the sensor goes back, s."""
DOUBT_S = 5.0
"""Time after which the service doubts the curve, s."""


def learn(log, folder, doubted_us=inf):
    """Reports of a learner that gets a recording second by second, doubted from a time on, µs."""
    reports, whole = [], ReadingRecord(window_s=1e6, most_readings=10**9)
    whole.add(readings_of(log))
    learner = Learner(CONFIG, folder, reports.append)
    for from_us in range(whole.begin_us, whole.end_us, 1_000_000):
        learner.add(whole.between(from_us, from_us + 1_000_000), from_us >= doubted_us)
        while learner.work():
            pass
    return reports


def write_fault_in_the_middle(log, duration_s, seed=1, fault_s=FAULT_S):
    """A drive whose vehicle speed reads wrong from a time on."""
    world = World("null:0", seed, 0, duration_s)
    readings = drive(world.profile, world.vehicle, world.rail, (), world.noise)
    t_s = 0.02 * np.arange(len(readings.speed))
    off = np.where(t_s >= fault_s, 1.0 + ERROR, 1.0)
    write_log(replace(readings, speed=off * readings.speed), log)


def frames_of(log):
    """Frames of a log, one after the other."""
    with log.open("rb") as lines:
        yield from (item for item in read_candump(lines, ReadReport()) if isinstance(item, Frame))


@pytest.mark.slow
@pytest.mark.long
def test_a_speed_that_is_off_is_proposed_confirmed_and_loaded(tmp_path):
    """In at least two of three drives; whatever is confirmed has the right size."""
    confirmed = 0
    for seed in (1, 2, 3):
        log, folder = tmp_path / f"{seed}.log", tmp_path / str(seed)
        folder.mkdir()
        truth = make_world("speed_scale", seed, log, duration_s=600.0)
        reports = learn(log, folder, 0)
        if reports[-1].state is not LearningState.CONFIRMED:
            continue
        confirmed += 1
        model = read_model(folder / "learned-speed_scale.toml")
        ((size,),) = (one.values for one in model.effects)
        assert size == pytest.approx(truth.effects[0].parameters["error"], rel=0.05)
        assert ServiceCore(replace(CONFIG, model=model)).estimate is None
    assert confirmed >= 2


@pytest.mark.slow
def test_in_sound_drives_nothing_is_proposed(tmp_path):
    for seed in (1, 2):
        log = tmp_path / f"{seed}.log"
        make_world("null:0", seed, log, duration_s=600.0)
        reports = learn(log, tmp_path)
        assert reports[-1].examined >= 1
        assert reports[-1].proposed == 0


@pytest.mark.slow
@pytest.mark.long
def test_a_sensor_that_goes_off_in_the_middle_in_simulated_time(tmp_path):
    log = tmp_path / "drive.log"
    write_fault_in_the_middle(log, 440.0)
    reports = learn(log, tmp_path, (FAULT_S + DOUBT_S) * 1e6)
    proposed = next(one for one in reports if one.state is LearningState.ESTIMATED)
    assert proposed.t_us > FAULT_S * 1e6
    assert proposed.causes[0].effect == "speed_scale"
    assert proposed.causes[0].size == pytest.approx(ERROR, rel=0.05)


def slow_configuration(folder):
    """Configuration of a user whose setpoints come each 100 ms: a fifth of the updates."""
    text = CONFIG.database.path.read_text()
    for number in (0x201, 0x204):
        cycle = f'BA_ "GenMsgCycleTime" BO_ {number} 20;'
        assert cycle in text
        text = text.replace(cycle, cycle.replace("20;", "100;"))
    path = folder / "slow.dbc"
    path.write_text(text)
    return load_configuration(dbc=path)


class CorrectedService:
    """A service with `--learn apply` in simulated time, its learner in the same process."""

    def __init__(self, config, folder):
        self.log, self.sent, self.taken, self.reports = [], [], [], []
        self._is_doubted, self._parts, self._next_us = None, [], 0
        self.statuses = []
        self.applied = AppliedModels(self.log.append)
        self.core = CorrectingCore(config, on_model=self._note, on_setpoint=self._observe)
        self.core.on_readings = self._parts.append
        self.applied.attach(self.core)
        self._learner = Learner(config, folder, self._hear)

    def feed(self, frame):
        self.sent += self.core.feed(frame)
        if frame.t_us >= self._next_us:
            self._next_us = frame.t_us + 1_000_000
            # Together, as they reach the learner's process.
            self._learner.add(join_readings(self._parts), self._is_doubted)
            self._parts.clear()
            while self._learner.work():
                pass

    def _observe(self, t_us, outputs):
        self._is_doubted = is_doubted(outputs)
        self.statuses.append((t_us / 1e6, outputs.status))

    def _hear(self, report):
        self.reports.append(report)
        if report.news:
            self.applied.follow(report)

    def _note(self, t_us, model):
        self.taken.append((t_us / 1e6, None if model is None else tuple(model.names)))


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.timeout(3600)
def test_a_sensor_goes_off_is_corrected_goes_back_and_the_model_is_dropped(tmp_path):
    """In simulated time; the log with its changes of the model is replayed to the same bytes.

    The sensor goes back `CORRECTED_S` after the model has taken over, whenever that is.
    """
    off, right = tmp_path / "off.log", tmp_path / "right.log"
    write_fault_in_the_middle(off, LONGEST_S)
    write_fault_in_the_middle(right, LONGEST_S, fault_s=np.inf)
    config = slow_configuration(tmp_path)
    service, fed, back_s = CorrectedService(config, tmp_path), [], np.inf
    for wrong, sound in zip(frames_of(off), frames_of(right), strict=True):
        assert wrong.t_us == sound.t_us
        fed.append(wrong if wrong.t_us < 1e6 * back_s else sound)
        service.feed(fed[-1])
        if service.taken and back_s == np.inf:
            back_s = service.taken[0][0] + CORRECTED_S
        if len(service.taken) == 2:
            break
    (applied_s, effects), (dropped_s, plain) = service.taken
    assert FAULT_S < applied_s <= FAULT_S + 600.0
    assert effects == ("speed_scale",)
    assert back_s < dropped_s
    assert plain is None
    assert service.core.model is None
    corrected = [status for t_s, status in service.statuses if applied_s < t_s < back_s]
    assert Status.TRACKING in corrected

    changes = read_model_changes("".join(service.log).encode().splitlines(), "log")
    again = CorrectingCore(config, changes)
    assert [sent for frame in fed for sent in again.feed(frame)] == service.sent


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.realtime
@pytest.mark.timeout(900)
def test_a_sensor_that_goes_off_in_the_middle_of_a_live_bench(tmp_path):
    """On python-can's virtual bus in real time, by the process that `run --learn` starts."""
    log = tmp_path / "drive.log"
    write_fault_in_the_middle(log, 560.0)
    frames = frames_of(log)
    told = []
    companion = LearningCompanion(LearningTask(CONFIG, tmp_path, LearningSettings()), told.append)
    core = ServiceCore(CONFIG, FixedEstimator)
    core.on_readings = companion.observe_readings
    proposed = threading.Event()
    try:
        with opened("learning") as sender, Running(core, opened("learning")):
            began = time.monotonic()
            for frame in frames:
                time.sleep(max(0.0, frame.t_us / 1e6 - (time.monotonic() - began)))
                sender.send(to_message(frame._replace(t_us=wall_clock())))
                if frame.t_us >= (FAULT_S + DOUBT_S) * 1e6:
                    # A fixed curve has no doubt of its own.
                    companion.observe_setpoint(frame.t_us, Outputs(doubt=Doubt.SPEED))
                if companion.report.state is LearningState.ESTIMATED:
                    proposed.set()
                    break
    finally:
        companion.close()
    assert proposed.is_set(), (companion.report, told)
    assert companion.report.causes[0].effect == "speed_scale"
    assert companion.report.causes[0].size == pytest.approx(ERROR, rel=0.05)
    assert (tmp_path / "learned-speed_scale.toml").exists()
