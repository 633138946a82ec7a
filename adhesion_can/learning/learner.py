"""The learner: readings in, reports out; no process, and no clock but the readings' own."""

import threading
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path

from adhesion_can.config import Configuration
from adhesion_can.config.model_file import model_text
from adhesion_can.errors import InputError
from adhesion_can.learning.coasting_witness import calibrate_readings, find_contradiction
from adhesion_can.learning.confirmation import (
    MOST_AGE_S,
    SPAN_S,
    LearningState,
    ModelConfirmation,
)
from adhesion_can.learning.examination import build_drive, examine, halves
from adhesion_can.learning.learned_file import find_confirmed, learned_path, write_learned
from adhesion_can.learning.prediction import PredictedSpan, predict_spans
from adhesion_can.learning.proposal import (
    LearnedModel,
    find_disagreement,
    find_objection,
    propose_model,
)
from adhesion_can.learning.record import WINDOW_S, ReadingRecord
from adhesion_can.learning.report import LearningReport
from adhesion_can.sampling.column_former import Readings
from adhesion_can.service.kept_state import fingerprint

SPANS_AT_ONCE = 6
"""Number of spans that are predicted from the same fit of the curves."""
REWRITE_S = 600.0
"""Time after which the file of a confirmed model is written again, s, to say how long it held."""
EDGE_S = 2.0
"""Time behind the last span that must have come, s: rows need readings around them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LearningSettings:
    """When a record is diagnosed, and how long a model may take to be confirmed.

    Attributes:
        interval_s: Time after which a record is diagnosed again, s.
        doubt_s: Time for which a doubt or an objection must last to have the record diagnosed
            sooner, s.
        again_s: Least time between two diagnoses while it lasts, s.
        least_s: Least length of a record that is diagnosed, s.
        window_s: Length of the record, s.
        training_s: Time before fresh readings to which the curves are fitted, s.
        most_age_s: Time after which a model that is not confirmed is dropped, s.

    """

    interval_s: float = 300.0
    doubt_s: float = 60.0
    again_s: float = 120.0
    least_s: float = 180.0
    window_s: float = WINDOW_S
    training_s: float = 60.0
    most_age_s: float = MOST_AGE_S


class Learner:
    """Keeps a record of the readings, proposes a model, and confirms or drops it.

    `add` may be called in another thread than `work`, which takes long.

    Args:
        configuration: Vehicle, roles and settings of the service, without a model.
        folder: Folder of the model files; None: none is written.
        report: Callback with each report.
        settings: Times of the work; None: the defaults.
        in_use: Names of the effects of the model that the service uses, which are not proposed.

    """

    def __init__(
        self,
        configuration: Configuration,
        folder: Path | None,
        report: Callable[[LearningReport], object],
        settings: LearningSettings | None = None,
        in_use: Collection[str] = (),
    ) -> None:
        self.settings = settings or LearningSettings()
        self.learned: LearnedModel | None = None
        """Model that was proposed last and not dropped."""
        self._in_use = frozenset(in_use)
        self._configuration = configuration
        self._folder = folder
        self._tell = report
        self._record = ReadingRecord(self.settings.window_s, configuration.service.restart_s)
        self._lock = threading.Lock()
        self._doubt_since_us: int | None = None
        self._examined_us: int | None = None
        """Time of the latest diagnosis, or of the first reading, µs."""
        self._confirmation: ModelConfirmation | None = None
        self._fresh_us = 0
        """Start of the readings that are not predicted yet, µs."""
        self._vehicle = fingerprint(configuration)
        self._has_begun = False
        """Whether it was looked for a model that was learned before."""
        self._is_kept = False
        """Whether the model's file is that of an earlier service."""
        self._written_us = 0
        """Time at which the model's file was written, µs."""
        self._report = LearningReport()

    @property
    def state(self) -> LearningState:
        """State of what is learned."""
        return self._report.state

    def add(self, readings: Readings, is_doubted: bool | None) -> None:
        """Add readings.

        Args:
            readings: Readings of all signals, behind the others.
            is_doubted: What the service said of them at their end, as `doubted.is_doubted` has it.

        """
        with self._lock:
            self._record.add(readings)
            now_us = self._record.end_us
            if is_doubted is False:
                self._doubt_since_us = None
            elif is_doubted and self._doubt_since_us is None:
                self._doubt_since_us = now_us

    def work(self) -> bool:
        """Do the next piece of work; returns whether there was any.

        Raises:
            ArithmeticError: A computation failed.

        """
        with self._lock:
            now_us, begin_us = self._record.end_us, self._record.begin_us
        if now_us is None or begin_us is None:
            return False
        if not self._has_begun:
            self._has_begun = True
            return self._take_up(now_us)
        if self.learned is not None and self._confirmation is not None:
            return self._confirm(self.learned, self._confirmation, now_us)
        if not self._is_due(now_us, begin_us):
            return False
        self._examined_us = now_us
        self._examine()
        return True

    def _is_due(self, now_us: int, begin_us: int) -> bool:
        """Whether the record is to be diagnosed at a time, µs."""
        settings = self.settings
        if self._examined_us is None:
            self._examined_us = begin_us
        if now_us - begin_us < settings.least_s * 1e6:
            return False
        since_us = now_us - self._examined_us
        doubt_us = self._doubt_since_us
        doubted = doubt_us is not None and now_us - doubt_us >= settings.doubt_s * 1e6
        return since_us >= (settings.again_s if doubted else settings.interval_s) * 1e6

    # ------------------------------------------------------------------------------- to propose

    def _examine(self) -> None:
        """Diagnose the record, and propose a model where it and its halves name the same."""
        with self._lock:
            begin_us, end_us = self._record.begin_us or 0, self._record.end_us or 0
            doubt_us = self._doubt_since_us
            if doubt_us is not None and end_us - doubt_us >= self.settings.least_s * 1e6:
                # What was right before the doubt would only hide what is wrong since.
                begin_us = max(begin_us, doubt_us)
            readings = self._record.between(begin_us, end_us + 1)
        try:
            proposal = self._propose(readings, begin_us, end_us)
        except InputError as error:
            proposal = f"not diagnosed: {error}"
        report = replace(self._report, t_us=end_us, examined=self._report.examined + 1, news="")
        if isinstance(proposal, str):
            self._send(replace(report, outcome=proposal))
            return
        length_s = (end_us - begin_us) / 1e6
        self._begin_to_confirm(
            proposal,
            report,
            f"{proposal.found} (from {length_s:.0f} s of readings); now being confirmed",
        )

    def _begin_to_confirm(self, learned: LearnedModel, report: LearningReport, news: str) -> None:
        """Let the readings behind those of a report decide on a model."""
        self.learned = learned
        self._confirmation = ModelConfirmation(report.t_us, self.settings.most_age_s)
        self._fresh_us = report.t_us
        report = replace(
            report,
            state=LearningState.ESTIMATED,
            found=learned.found,
            causes=learned.sizes,
            proposed=report.proposed + 1,
            spans=0,
            won=0,
            news=news,
            outcome="a model is proposed",
        )
        self._send(report)

    def _take_up(self, now_us: int) -> bool:
        """Propose what was confirmed before the service was started again, if anything was.

        Its file stays as it is until fresh readings have decided: the service may end before.
        """
        if self._folder is None:
            return False
        most_age_s = self._configuration.service.state_age_s
        unreadable: list[InputError] = []
        kept = find_confirmed(
            self._folder, self._vehicle, now_us, most_age_s, self._in_use, unreadable.append
        )
        for error in unreadable:
            news = f"a learned model of an earlier run cannot be used: {error}"
            self._send(replace(self._report, t_us=now_us, news=news))
        if kept is None:
            return False
        self._is_kept = True
        news = f"{kept.found} (learned before this start); now being confirmed again"
        self._begin_to_confirm(kept, replace(self._report, t_us=now_us), news)
        return True

    def _propose(self, readings: Readings, begin_us: int, end_us: int) -> LearnedModel | str:
        """A model, or the reason why there is none, a clause."""
        config = self._configuration
        whole = examine(readings, config)
        objection = find_objection(whole)
        if objection or whole.model is None:
            return objection
        if self._in_use.issuperset(whole.model.names):
            return "the record names what the model in use holds"
        contradiction = find_contradiction(
            calibrate_readings(readings, config), whole.model.effects
        )
        if contradiction:
            return f"{whole.causes[0].effect} is contradicted: {contradiction}"
        disagreement = find_disagreement(
            whole, [examine(half, config) for half in halves(readings)]
        )
        return disagreement or propose_model(whole, begin_us, end_us)

    # ------------------------------------------------------------------------------- to confirm

    def _confirm(self, learned: LearnedModel, confirmation: ModelConfirmation, now_us: int) -> bool:
        """Predict the next spans of fresh readings, where they have come."""
        span_us = round(SPAN_S * 1e6)
        with self._lock:
            known_us = self._record.begin_us
        begin_us = now_us if known_us is None else known_us
        # After a hole the record has begun again.
        from_us = max(self._fresh_us, begin_us + round(self.settings.training_s * 1e6))
        to_us = from_us + SPANS_AT_ONCE * span_us
        if now_us < to_us + EDGE_S * 1e6:
            return False
        confirmation.pause(from_us - self._fresh_us)
        self._fresh_us = to_us
        before = confirmation.state
        spans = self._predict(learned, from_us, to_us, span_us)
        if spans is None:
            confirmation.pause(to_us - from_us)
        for span in spans or ():
            confirmation.add(span.to_us, is_better=span.is_better)
        confirmation.grow_old(now_us)
        report = replace(
            self._report,
            t_us=now_us,
            state=confirmation.state,
            spans=confirmation.spans,
            won=confirmation.won,
            news="",
            model="",
        )
        if confirmation.state is LearningState.CONFIRMED and before is not confirmation.state:
            report = replace(
                report,
                news=f"confirmed on fresh readings ({confirmation.won} of {confirmation.spans} "
                f"spans of {SPAN_S:g} s predicted better): {report.found}",
                model=model_text(replace(learned.model, provenance={})),
            )
        elif confirmation.state is LearningState.INVALID:
            report = replace(report, news=f"dropped: {report.found}: {confirmation.reason}")
        self._send(report)
        if confirmation.state is LearningState.INVALID:
            self.learned = self._confirmation = None
            self._examined_us = now_us
        return True

    def _predict(
        self, learned: LearnedModel, from_us: int, to_us: int, span_us: int
    ) -> list[PredictedSpan] | None:
        """Predicted spans; None where the readings do not allow it."""
        training_us = round(self.settings.training_s * 1e6)
        with self._lock:
            readings = self._record.between(from_us - training_us, to_us + round(EDGE_S * 1e6))
        try:
            drive = build_drive(readings, self._configuration)
            return predict_spans(drive, learned.model, from_us, span_us, SPANS_AT_ONCE)
        except InputError:
            # Nothing to be learned from these readings: a standstill, or a hole.
            return None

    # ---------------------------------------------------------------------------------- reports

    def _send(self, report: LearningReport) -> None:
        """Write the model's file where its state is new or the file is old, and report."""
        since_us = report.t_us - self._written_us
        is_old = report.state is LearningState.CONFIRMED and since_us >= REWRITE_S * 1e6
        if (report.news or is_old) and self._folder is not None:
            report = self._with_file(report, self._folder)
        self._report = report
        self._tell(report)

    def _with_file(self, report: LearningReport, folder: Path) -> LearningReport:
        if self.learned is None or self._confirmation is None:
            return report
        if self._is_kept and report.state is LearningState.ESTIMATED:
            return replace(report, path=str(learned_path(folder, self.learned)))
        self._is_kept, self._written_us = False, report.t_us
        try:
            path = write_learned(folder, self.learned, self._confirmation, self._vehicle)
        except InputError as error:
            news = f"{report.news}; not written: {error}" if report.news else ""
            return replace(report, news=news, path="")
        return replace(report, path=str(path))
