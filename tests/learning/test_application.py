"""What a service does with the reports of its learner."""

from dataclasses import replace

from adhesion_can.config import load_configuration
from adhesion_can.config.model_file import model_text
from adhesion_can.learning.application import AppliedModels
from adhesion_can.learning.confirmation import LearningState
from adhesion_can.learning.report import LearningReport
from adhesion_can.service.correcting_core import CorrectingCore
from adhesion_can.service.model_changes import read_model_changes
from tests.service.test_correcting_core import drive
from tests.service.test_model_changes import model_of

CONFIG = load_configuration()


class Service:
    """A core in the middle of a drive, whose model reports change; its log."""

    def __init__(self):
        self.log = []
        self.applied = AppliedModels(self.log.append)
        self.core = CorrectingCore(CONFIG, on_model=self.applied.note)
        self.applied.attach(self.core)
        self.frames = list(drive())
        self.play(1.0)

    def play(self, duration_s):
        end_us = self.frames[0].t_us + 1e6 * duration_s
        while self.frames and self.frames[0].t_us < end_us:
            self.core.feed(self.frames.pop(0))

    def changes(self):
        return list(read_model_changes("".join(self.log).encode().splitlines(), "log"))


CONFIRMED = LearningReport(
    state=LearningState.CONFIRMED, model=model_text(model_of(-0.01)), found="speed low", news="x"
)
DROPPED = LearningReport(state=LearningState.INVALID, news="dropped")


def test_a_confirmed_model_is_begun_after_what_was_worked_ahead_and_logged():
    service = Service()
    due_us = service.core.next_due_us
    assert "beside" in service.applied.follow(CONFIRMED)
    (change,) = service.changes()
    assert change.t_us > due_us
    assert change.model.effects == model_of(-0.01).effects
    service.play(0.5)
    assert service.core.model_beside is not None or service.core.model is not None


def test_a_dropped_model_is_taken_back_once():
    service = Service()
    service.applied.follow(CONFIRMED)
    service.play(2.0)
    service.applied.follow(DROPPED)
    service.applied.follow(DROPPED)
    service.play(0.5)
    assert [change.model is None for change in service.changes()] == [False, True]
    assert service.core.model is service.core.model_beside is None


def test_what_was_never_applied_is_not_taken_back():
    service = Service()
    assert service.applied.follow(DROPPED) == ""
    assert not service.applied.take_back()
    assert service.log == []


def test_it_is_said_which_model_took_over():
    service = Service()
    service.applied.note(0, model_of())
    service.applied.note(0, None)
    assert "in use" in service.applied.take_news()
    assert "plain curve" in service.applied.take_news()
    assert service.applied.take_news() == ""


def test_a_model_that_is_damaged_is_reported_and_changes_nothing():
    service = Service()
    assert "not applied" in service.applied.follow(replace(CONFIRMED, model="[base]\n"))
    assert service.log == []


def test_another_log_gets_the_latest_change_again():
    service = Service()
    service.applied.log_again()
    assert service.log == []
    service.applied.follow(CONFIRMED)
    service.applied.log_again()
    assert len(service.log) == 2
    assert service.log[0] == service.log[1]
