"""`run --learn`: its options, its news, and a service that it never holds up."""

import json
import os
import shlex
import signal
from pathlib import Path
from types import SimpleNamespace

import pytest

from adhesion_can.cli.main import main
from adhesion_can.cli.monitor_learned import LOOK_S, LearnedFolder
from adhesion_can.cli.run_learning import RunLearning, command_with_model
from adhesion_can.errors import InputError
from adhesion_can.learning.confirmation import LearningState, ModelConfirmation
from adhesion_can.learning.learned_file import write_learned
from adhesion_can.learning.proposal import propose_model
from adhesion_can.learning.report import LearningReport
from adhesion_can.recordings.candump import ReadReport, read_candump
from tests.cli.test_never_blocked import assert_goes_on, assert_taken_back
from tests.learning.learning_helpers import cause, diagnosis
from tests.loopback_bus import ServiceProcess

BUS = ("run", "-i", "virtual", "-c", "nobody")


def refused(capsys, *words):
    """Line of an error of usage or input."""
    try:
        status = main([*BUS, *words])
    except SystemExit as ended:
        status = ended.code
    assert status == 2
    return capsys.readouterr().err


def test_a_folder_without_learning_is_a_mistake(capsys, tmp_path):
    assert "add --learn propose" in refused(capsys, "--learn-to", str(tmp_path))


def test_a_folder_must_be_there(capsys, tmp_path):
    missing = tmp_path / "missing"
    line = refused(capsys, "--learn", "propose", "--learn-to", str(missing))
    assert "does not exist" in line
    missing.write_text("")
    assert "is no folder" in refused(capsys, "--learn", "propose", "--learn-to", str(missing))


def test_an_interval_is_positive(capsys):
    assert "--learn-every" in refused(capsys, "--learn", "propose", "--learn-every", "0")


def test_only_what_there_is_can_be_asked_for(capsys):
    assert "apply" in refused(capsys, "--learn", "always")


@pytest.mark.parametrize(
    "words",
    [
        ["run", "-c", "can0"],
        ["run", "--model", "old.toml", "-c", "can0"],
        ["run", "-c", "can0", "--model=old.toml"],
    ],
)
def test_the_line_to_type_is_the_same_command_with_the_model(words):
    typed = shlex.split(command_with_model(words, "a folder/learned.toml"))
    assert typed[1:] == ["run", "-c", "can0", "--model", "a folder/learned.toml"]


class Narrated:
    """A narrator and a log that keep their lines."""

    def __init__(self):
        self.lines, self.logged = [], []

    def warn(self, line):
        self.lines.append(line)

    def write(self, line):
        self.logged.append(line)


def told(report):
    """Lines for the operator and in the log after one report."""
    kept = Narrated()
    news = iter([report])
    companion = SimpleNamespace(take_news=lambda: next(news, None), observe_readings=None)
    companion.observe_setpoint = None
    learning = RunLearning(companion, kept, ["run", "-c", "can0"])
    learning.observe(SimpleNamespace(on_readings=None, now_us=5_000_000), [], kept)
    learning.look()
    learning.look()
    return kept.lines, kept.logged


def test_a_proposal_is_a_line_and_a_comment():
    report = LearningReport(state=LearningState.ESTIMATED, news="speed\nlow", path="m.toml")
    lines, logged = told(report)
    assert len(lines) == len(logged) == 1
    # Whatever a sentence contains, the comment is one line, and no frame of a replay.
    assert logged == ["#5.000000# learn:speed\\nlow 000#\n"]
    assert not list(read_candump([logged[0].encode()], ReadReport()))


def test_a_confirmed_model_comes_with_the_line_to_type():
    report = LearningReport(state=LearningState.CONFIRMED, news="confirmed: low", path="m.toml")
    lines, _ = told(report)
    assert lines[0] == "--learn: confirmed: low"
    assert lines[1].endswith("run -c can0 --model m.toml")


@pytest.mark.slow  # a process of the lowest priority gets no time on a busy machine
@pytest.mark.realtime
def test_the_service_goes_on_whatever_becomes_of_its_learning_process(tmp_path):
    options = ("--learn", "propose", "--json", "told.json")
    with ServiceProcess(tmp_path, *options) as service:
        assert_goes_on(service)
        (child,) = children(service.process.pid)
        os.kill(child, signal.SIGSTOP)
        assert_goes_on(service)
        os.kill(child, signal.SIGKILL)
        assert_goes_on(service)
        code, _ = service.end()
        assert code == 0
        assert_taken_back(service)
    told = json.loads((tmp_path / "told.json").read_text())["learning"]
    assert told["state"] == "unestimated"
    lines = (tmp_path / "stderr").read_text()
    assert f"models are written to {tmp_path.resolve()}" in lines
    assert lines.count("ended with status -9") == 1


def children(process_id):
    """Processes that a process has started."""
    return [
        int(status.parent.name)
        for status in Path("/proc").glob("[0-9]*/stat")
        if int(status.read_text().rpartition(")")[2].split()[1]) == process_id
    ]


def test_monitor_names_what_was_learned(tmp_path):
    now_s = [0.0]
    folder = LearnedFolder(tmp_path, lambda: now_s[0])
    assert folder.sentences() == ()
    one = cause()
    learned = propose_model(diagnosis(one), 0, 300_000_000)
    write_learned(tmp_path, learned, ModelConfirmation(0), "vehicle")
    (tmp_path / "learned-odd.toml").write_bytes(b"\xff")
    assert folder.sentences() == ()
    now_s[0] += LOOK_S
    odd, found = folder.sentences()
    assert odd.startswith("learned-odd.toml: ")
    assert found.startswith("Learned (estimated): vehicle speed reads 1.000 ± 0.050 % low")


def test_monitor_needs_a_folder(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        LearnedFolder(tmp_path / "missing")


class Followed:
    """A learner whose model is in use, and what the operator hears of it."""

    def __init__(self):
        self.kept = Narrated()
        self.companion = SimpleNamespace(
            take_news=lambda: None, restarts=0, failures=0, lost_s=0.0, report=LearningReport()
        )
        self.taken_back = 0
        self.learning = RunLearning(self.companion, self.kept, [], self)

    def take_back(self):
        self.taken_back += 1
        return True

    def take_news(self):
        return ""


@pytest.mark.parametrize("count", ["restarts", "failures"])
def test_a_model_that_nobody_checks_is_taken_back(count):
    followed = Followed()
    followed.learning.look()
    assert followed.taken_back == 0
    setattr(followed.companion, count, 1)
    followed.learning.look()
    followed.learning.look()
    assert followed.taken_back == 1
    assert "was not checked while the learning process was down" in followed.kept.lines[0]


def test_a_model_is_taken_back_where_the_learner_gets_no_time():
    followed = Followed()
    for lost_s, report, expected in (
        (0.0, 1, 0),
        (299.0, 1, 0),
        (299.0, 2, 0),  # a report: it is alive
        (598.0, 2, 0),
        (600.0, 2, 1),
    ):
        followed.companion.lost_s = lost_s
        if followed.companion.report.examined != report:
            followed.companion.report = LearningReport(examined=report)
        followed.learning.look()
        assert followed.taken_back == expected
    assert "got no time" in followed.kept.lines[0]
