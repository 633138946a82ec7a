"""Use of what is learned: confirmed models take over in the service, dropped ones go."""

from collections import deque
from collections.abc import Callable

from adhesion_can.config.model_file import parse_model
from adhesion_can.errors import InputError
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.learning.confirmation import LearningState
from adhesion_can.learning.report import LearningReport
from adhesion_can.service.correcting_core import CorrectingCore
from adhesion_can.service.model_changes import ModelChange


class AppliedModels:
    """Changes the model of a service as its learner reports.

    Args:
        write_log: Callback with lines for the service's log, which makes a replay repeat the
            change; None: there is no log.

    """

    def __init__(self, write_log: Callable[[str], object] | None = None) -> None:
        self.write_log = write_log
        self._core: CorrectingCore | None = None
        self._found = ""
        self._latest: ModelChange | None = None
        self._taken: deque[str] = deque()

    @property
    def is_applied(self) -> bool:
        """Whether a learned model is in use."""
        return self._core is not None and self._core.model is not None

    def attach(self, core: CorrectingCore) -> None:
        """Name the core whose model is changed; it calls `note` with each model that took over."""
        self._core = core

    def follow(self, report: LearningReport) -> str:
        """Change the model as a report asks; returns a sentence for the operator, or ''."""
        core = self._core
        if core is None:
            return ""
        if report.state is LearningState.CONFIRMED and report.model:
            try:
                model = parse_model(report.model, "the learned model")
                change = ModelChange(core.next_change_us(), model)
                core.change_model(change)
            except InputError as error:
                return f"not applied: {error}"
            self._found = report.found
            self._log(change)
            return "it runs beside the plain curve, and takes over when the drive does not feel it"
        if report.state is LearningState.INVALID:
            self.take_back()
        return ""

    def take_back(self) -> bool:
        """Go back to the plain curve; returns whether a model was in use or about to be."""
        if self._core is None or self._latest is None or self._latest.model is None:
            return False
        change = ModelChange(self._core.next_change_us(), None)
        self._core.change_model(change)
        self._log(change)
        return True

    def note(self, _t_us: int, model: ExtendedModel | None) -> None:
        """Note a model that took over."""
        self._taken.append(
            "the plain curve is in use again"
            if model is None
            else f"the model is in use: {self._found}"
        )

    def take_news(self) -> str:
        """What took place since the last call, a sentence; '' for nothing."""
        return self._taken.popleft() if self._taken else ""

    def log_again(self) -> None:
        """Write the latest change once more: another log has begun."""
        if self._latest is not None:
            self._log(self._latest)

    def _log(self, change: ModelChange) -> None:
        self._latest = change
        if self.write_log is not None:
            self.write_log(change.to_lines())
