"""The learner's course: when it diagnoses, what it reports and writes, when it drops."""

from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.config import load_configuration
from adhesion_can.config.model_file import parse_model, read_model
from adhesion_can.errors import InputError
from adhesion_can.learning import learner as module
from adhesion_can.learning.confirmation import LearningState
from adhesion_can.learning.learner import Learner, LearningSettings
from adhesion_can.learning.prediction import PredictedSpan
from adhesion_can.learning.report import LearnedCause, LearningReport
from adhesion_can.physics.readings import Role
from tests.learning.learning_helpers import cause, diagnosis

CONFIG = load_configuration()
SETTINGS = LearningSettings(
    interval_s=300.0, doubt_s=60.0, again_s=120.0, least_s=180.0, most_age_s=600.0
)
NOTHING, LOW = diagnosis(), diagnosis(cause())


class Course:
    """A learner in simulated time, with diagnoses and predictions that a test states."""

    def __init__(self, monkeypatch, folder, answers=(), *, is_better=True, in_use=()):
        self.reports, self.examined, self.is_better = [], [], is_better
        self.answers = iter(answers)
        self.now_s = 0
        monkeypatch.setattr(module, "examine", self.examine)
        monkeypatch.setattr(module, "calibrate_readings", lambda *_: SimpleNamespace(axles=()))
        monkeypatch.setattr(module, "build_drive", lambda readings, _: readings)
        monkeypatch.setattr(module, "predict_spans", self.predict)
        self.learner = Learner(CONFIG, folder, self.reports.append, SETTINGS, in_use)

    def examine(self, readings, _):
        stamps, _ = next(iter(readings.values()))
        self.examined.append((stamps[0] / 1e6, stamps[-1] / 1e6))
        answer = next(self.answers, NOTHING)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def predict(self, readings, _model, from_us, span_us, spans):
        stamps, _ = next(iter(readings.values()))
        assert stamps[-1] >= from_us + spans * span_us
        worse = 2.0 if self.is_better else 0.5
        return [PredictedSpan(from_us + (k + 1) * span_us, worse, 1.0) for k in range(spans)]

    def go(self, until_s, is_doubted=False):
        while self.now_s < until_s:
            t_us = np.int64(self.now_s * 1_000_000) + np.arange(0, 1_000_000, 100_000)
            self.learner.add({(Role.VEHICLE_SPEED, 0): (t_us, np.zeros(10))}, is_doubted)
            self.now_s += 1
            while self.learner.work():
                pass
        return self

    @property
    def news(self):
        return [(report.state.value, report.news) for report in self.reports if report.news]


@pytest.fixture
def course(monkeypatch, tmp_path):
    return lambda *answers, **more: Course(monkeypatch, tmp_path, answers, **more)


def test_without_a_doubt_it_diagnoses_at_each_interval(course):
    ran = course().go(1000)
    assert [int(end) for _, end in ran.examined] == [300, 600, 900]
    # The record is no longer than its window.
    assert max(end - begin for begin, end in ran.examined) <= 480.0
    assert ran.news == []
    assert ran.reports[-1].examined == 3
    assert "no cause" in ran.reports[-1].outcome


def test_a_doubt_that_lasts_calls_it_sooner(course):
    ran = course().go(1000, True)
    assert [int(end) for _, end in ran.examined][:4] == [180, 300, 420, 540]


def test_readings_from_before_a_doubt_that_lasts_are_left_out(course):
    ran = course().go(250).go(600, True)
    begins = {int(end): round(begin) for begin, end in ran.examined}
    # At 300 and 420 s the doubt is too young to stand alone.
    assert begins == {300: 0, 420: 0, 540: 251}


def test_a_doubt_that_does_not_last_calls_nothing(course):
    ran = course().go(150).go(200, True).go(299)
    assert ran.examined == []


def test_a_doubt_that_is_not_available_neither_begins_nor_ends_one(course):
    ran = course().go(60, True).go(181, None)
    assert len(ran.examined) == 1
    assert course().go(299, None).examined == []


def test_what_is_confirmed_is_a_file_that_run_takes(course, tmp_path):
    ran = course(LOW, LOW, LOW).go(600)
    assert [state for state, _ in ran.news] == ["estimated", "confirmed"]
    assert all("vehicle speed reads 1.000 ± 0.050 % low" in news for _, news in ran.news)
    # The whole, then its halves.
    (begin, end), first, second = ran.examined
    assert (begin, end) == (first[0], second[1])
    assert first[1] < second[0]
    last = ran.reports[-1]
    assert last.path == str(tmp_path / "learned-speed_scale.toml")
    assert last.causes == (LearnedCause("speed_scale", -0.01, 0.0005, "1"),)
    # The service gets the model itself: it need not read the file.
    assert [one.model != "" for one in ran.reports if one.news] == [False, True]
    assert last.model == ""
    model = read_model(tmp_path / "learned-speed_scale.toml")
    assert [(one.effect.id, one.values) for one in model.effects] == [("speed_scale", (-0.01,))]
    assert model.provenance["state"] == "confirmed"
    assert model.provenance["found"] == last.found
    assert (last.spans, last.won) == (last.won, last.spans)
    # Nothing else is diagnosed while it holds.
    assert len(ran.go(2000).examined) == 3


def test_a_half_that_names_nothing_stops_it(course, tmp_path):
    ran = course(LOW, NOTHING, LOW).go(320)
    assert ran.news == []
    assert ran.reports[-1].outcome == "the first half names no cause"
    assert list(tmp_path.iterdir()) == []


def test_a_model_that_predicts_worse_is_dropped_and_its_file_says_so(course, tmp_path):
    ran = course(LOW, LOW, LOW, is_better=False).go(500)
    assert [state for state, _ in ran.news] == ["estimated", "invalid"]
    told = read_model(tmp_path / "learned-speed_scale.toml").provenance
    assert told["state"] == "invalid"
    assert "worse" in told["reason"]
    assert ran.learner.state is LearningState.INVALID
    # It diagnoses again, an interval later.
    ran.go(900)
    assert len(ran.examined) == 4


def test_a_confirmed_model_is_dropped_when_it_ceases_to_hold(course):
    ran = course(LOW, LOW, LOW).go(600)
    ran.is_better = False
    ran.go(1000)
    assert [state for state, _ in ran.news] == ["estimated", "confirmed", "invalid"]


def test_what_the_service_uses_is_not_proposed_again(course):
    ran = course(LOW, LOW, LOW, in_use=("speed_scale",)).go(700)
    assert ran.news == []
    assert len(ran.examined) == 2


def test_readings_that_cannot_be_diagnosed_are_tried_again(course):
    ran = course(InputError("record", "not one row is usable", "drive"), LOW, LOW, LOW).go(700)
    assert "not one row is usable" in ran.reports[0].outcome
    assert [state for state, _ in ran.news][:1] == ["estimated"]


def test_spans_that_tell_nothing_apart_confirm_nothing(course, monkeypatch):
    ran = course(LOW, LOW, LOW)
    monkeypatch.setattr(module, "predict_spans", lambda *_: [])
    ran.go(1000)
    assert [state for state, _ in ran.news] == ["estimated", "invalid"]
    assert "10 minutes" in ran.news[-1][1]


def test_after_a_hole_it_goes_on_with_readings_behind_it(course):
    ran = course(LOW, LOW, LOW).go(310)
    ran.now_s = 4000
    ran.go(4300)
    assert ran.reports[-1].state in (LearningState.CONFIRMED, LearningState.INVALID)
    assert ran.reports[-1].spans <= 60


def test_a_folder_that_is_gone_is_reported_and_learning_goes_on(course, tmp_path):
    ran = course(LOW, LOW, LOW)
    tmp_path.rmdir()
    ran.go(600)
    assert [state for state, _ in ran.news] == ["estimated", "confirmed"]
    assert all("not written" in news for _, news in ran.news)
    assert ran.reports[-1].path == ""
    assert [one.model != "" for one in ran.reports if one.news] == [False, True]


@pytest.fixture
def confirmed(course):
    """Course whose model was confirmed shortly before 600 s; its file is in the folder."""
    ran = course(LOW, LOW, LOW).go(600)
    assert ran.reports[-1].state is LearningState.CONFIRMED
    return ran


def begin_again(course, now_s, **more):
    """Course of a service that is started at a time, s."""
    ran = course(**more)
    ran.now_s = now_s
    return ran


def test_after_a_start_a_confirmed_model_is_confirmed_again_on_fresh_readings(course, confirmed):
    ran = begin_again(course, 5000).go(5002)
    assert [state for state, _ in ran.news] == ["estimated"]
    assert "learned before this start" in ran.news[0][1]
    before = confirmed.reports[-1]
    assert (ran.reports[-1].causes, ran.reports[-1].found) == (before.causes, before.found)
    assert ran.reports[-1].path == before.path
    ran.go(5200)
    # Sooner than a record could be diagnosed, and nothing was.
    assert [state for state, _ in ran.news] == ["estimated", "confirmed"]
    assert ran.examined == []
    assert parse_model(ran.reports[-2].model or ran.reports[-1].model, "report").effects


@pytest.mark.usefixtures("confirmed")
def test_a_service_that_ends_before_it_is_confirmed_again_leaves_the_file(course):
    for now_s in (5000, 6000):
        ran = begin_again(course, now_s).go(now_s + 30)
        assert [state for state, _ in ran.news] == ["estimated"]


@pytest.mark.usefixtures("confirmed")
def test_a_kept_model_that_does_not_hold_any_more_is_dropped_for_good(course):
    ran = begin_again(course, 5000, is_better=False).go(5200)
    assert [state for state, _ in ran.news] == ["estimated", "invalid"]
    assert begin_again(course, 6000).go(6010).news == []


@pytest.mark.usefixtures("confirmed")
def test_a_standstill_does_not_age_a_model(course, tmp_path, monkeypatch):
    def standing(*_):
        raise InputError("record", "not one row is usable", "drive")

    with monkeypatch.context() as depot:
        ran = begin_again(course, 5000)
        depot.setattr(module, "build_drive", standing)
        ran.go(7000)
        assert [state for state, _ in ran.news] == ["estimated"]
        told = read_model(tmp_path / "learned-speed_scale.toml").provenance
        assert told["state"] == "confirmed"
    monkeypatch.setattr(module, "build_drive", lambda readings, _: readings)
    ran.go(7200)
    assert [state for state, _ in ran.news] == ["estimated", "confirmed"]


@pytest.mark.usefixtures("confirmed")
@pytest.mark.parametrize(("now_s", "in_use"), [(600 + 86_400 + 60, ()), (5000, ("speed_scale",))])
def test_a_kept_model_that_is_too_old_or_in_use_is_not_taken_up(course, now_s, in_use):
    assert begin_again(course, now_s, in_use=in_use).go(now_s + 10).news == []


@pytest.mark.usefixtures("confirmed")
def test_a_file_of_another_vehicle_is_not_taken_up(course, tmp_path):
    path = tmp_path / "learned-speed_scale.toml"
    text = path.read_text()
    path.write_text(text.replace('"vehicle" = "', '"vehicle" = "x'))
    assert path.read_text() != text
    assert begin_again(course, 5000).go(5010).news == []


@pytest.mark.usefixtures("confirmed")
@pytest.mark.parametrize(
    ("damage", "what"),
    [
        (lambda text: text[:200], "line"),
        (lambda text: text.replace('"checked until" = "', '"checked until" = "on '), "not a time"),
    ],
)
def test_a_file_that_cannot_be_read_is_reported_and_learned_again(course, tmp_path, damage, what):
    path = tmp_path / "learned-speed_scale.toml"
    text = path.read_text()
    path.write_text(damage(text))
    assert path.read_text() != text
    ran = course(LOW, LOW, LOW)
    ran.now_s = 5000
    ran.go(5010)
    assert [state for state, _ in ran.news] == ["unestimated"]
    assert "learned-speed_scale.toml" in ran.news[0][1]
    assert what in ran.news[0][1]
    ran.go(5600)
    assert [state for state, _ in ran.news[1:]] == ["estimated", "confirmed"]
    assert parse_model(path.read_text(), "report").effects


@pytest.mark.costly
def test_a_model_that_holds_for_long_is_not_too_old_after_it(course, confirmed):
    confirmed.go(90_000)
    assert begin_again(course, 91_000).go(91_010).news != []


def test_a_report_survives_its_pipe():
    report = LearningReport(
        t_us=5,
        state=LearningState.CONFIRMED,
        news="µ\n",
        causes=(LearnedCause("speed_scale", -0.01, None, "1"),),
    )
    line = report.to_line()
    assert line.count("\n") == 1
    assert LearningReport.from_line(line) == report
