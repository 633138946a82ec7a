"""`run --learn`: the service diagnoses itself in a low-priority process, and uses what it finds."""

import argparse
import shlex
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from adhesion_can.cli.common import own_command, require_positive
from adhesion_can.cli.narrator import Narrator
from adhesion_can.config import Configuration
from adhesion_can.errors import InputError
from adhesion_can.printable import printable
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.frame_log import LogBehind
from adhesion_can.service.log_comments import format_comment, format_stamp
from adhesion_can.service.outputs import Outputs

# Diagnosis is imported where somebody learns: it takes a second of a start.
if TYPE_CHECKING:
    from adhesion_can.learning.application import AppliedModels
    from adhesion_can.learning.companion import LearningCompanion
    from adhesion_can.learning.report import LearningReport


def add_learning(parser: argparse.ArgumentParser) -> None:
    """Options --learn, --learn-to and --learn-every."""
    parser.add_argument(
        "--learn",
        choices=("propose", "apply"),
        help="diagnose the readings in a process of low priority; write what is wrong as a model; "
        "'apply' also uses it while it predicts better",
    )
    parser.add_argument(
        "--learn-to",
        type=Path,
        metavar="DIR",
        help="folder of these models (default: that of --state, or the current one)",
    )
    parser.add_argument(
        "--learn-every",
        type=float,
        metavar="MIN",
        default=5.0,
        help="minutes between two diagnoses; sooner where a doubt lasts (default: 5)",
    )


UNCHECKED_S = 300.0
"""Time of readings that did not reach the learner from which a model in use is taken back, s."""


class _Unchecked:
    """Readings that were lost since the latest report of a learner."""

    def __init__(self) -> None:
        self._report: LearningReport | None = None
        self._lost_s = 0.0

    def is_too_long(self, companion: "LearningCompanion") -> bool:
        """Whether a model in use was not checked for too long."""
        if companion.report is not self._report:
            self._report, self._lost_s = companion.report, companion.lost_s
        return companion.lost_s - self._lost_s > UNCHECKED_S


class RunLearning:
    """What `run` does about a learner: starts it, reports its news, and ends it.

    Args:
        companion: Process of the learner; None: nothing is learned.
        narrator: Lines for the operator.
        argv: Words of the command line after the command's own name.
        applied: What uses confirmed models; None: they are proposed alone.

    """

    def __init__(
        self,
        companion: "LearningCompanion | None",
        narrator: Narrator,
        argv: Sequence[str],
        applied: "AppliedModels | None" = None,
    ) -> None:
        self._companion = companion
        self._applied = applied
        self._has_new_log = False
        self._ends = 0
        """Number of ends of the learning process that were noticed."""
        self._unchecked = _Unchecked()
        self._core: ServiceCore | None = None
        self._log: LogBehind | None = None
        self._narrator = narrator
        self._argv = tuple(argv)

    def make_core(
        self, config: Configuration, on_setpoint: Callable[[int, Outputs], None]
    ) -> ServiceCore:
        """Core of the service, which can change its model where that is asked for."""
        if self._applied is None:
            return ServiceCore(config, on_setpoint=on_setpoint)
        from adhesion_can.service.correcting_core import CorrectingCore  # noqa: PLC0415

        core = CorrectingCore(config, on_model=self._applied.note, on_setpoint=on_setpoint)
        self._applied.attach(core)
        return core

    def observe(
        self,
        core: ServiceCore,
        observers: list[Callable[[int, Outputs], None]],
        log: LogBehind | None,
    ) -> None:
        """Give the learner what the service reads and doubts.

        Args:
            core: Core of the service, which has received nothing yet.
            observers: Callbacks with each setpoint.
            log: Log in which news become comments; None: there is none.

        """
        self._core, self._log = core, log
        if self._applied is not None and log is not None:
            self._applied.write_log = log.write
        if self._companion is not None:
            core.on_readings = self._companion.observe_readings
            observers.append(self._companion.observe_setpoint)

    def expect_new_log(self) -> None:
        """Take note that another log begins; safe from a signal handler."""
        self._has_new_log = True

    def look(self) -> None:
        """Report news, if there are any, and change the model as they ask; never waits."""
        if self._companion is None:
            return
        if self._applied is not None:
            if self._has_new_log:
                self._has_new_log = False
                self._applied.log_again()
            self._say(self._applied.take_news())
            ends = self._companion.restarts + self._companion.failures
            if ends != self._ends:
                self._ends = ends
                self._take_back("while the learning process was down")
            elif self._unchecked.is_too_long(self._companion):
                self._take_back("as the learning process got no time")
        news = self._companion.take_news()
        if news is None:
            return
        self._say(news.news)
        if self._applied is not None:
            self._say(self._applied.follow(news))
        elif news.state == "confirmed" and news.path:
            self._say(f"to use it, type: {command_with_model(self._argv, news.path)}")

    def _take_back(self, why: str) -> None:
        """Go back to the plain curve where a model was in use that nobody checks."""
        if self._applied is not None and self._applied.take_back():
            self._say(f"the model was not checked {why}")

    def _say(self, line: str) -> None:
        """Tell the operator and the log; '' says nothing."""
        if not line:
            return
        self._narrator.warn(f"--learn: {line}")
        if self._log is not None:
            stamp = format_stamp(0 if self._core is None else self._core.now_us)
            self._log.write(format_comment(stamp, "learn", printable(line)))

    def fields(self) -> dict[str, Any]:
        """Latest report with what was lost, as JSON has it; nothing where nothing is learned."""
        if self._companion is None:
            return {}
        lost = {"lost_s": self._companion.lost_s, "restarts": self._companion.restarts}
        applied = {} if self._applied is None else {"applied": self._applied.is_applied}
        return {"learning": self._companion.report.to_dict() | lost | applied}

    def metrics(self) -> Iterable[Any]:
        """Figures for Prometheus; none where nothing is learned."""
        if self._companion is None:
            return ()
        from adhesion_can.learning.metrics import collect_learning  # noqa: PLC0415  an extra

        return collect_learning(self._companion)


def command_with_model(argv: Sequence[str], path: str) -> str:
    """The same command with another model, for a shell.

    Args:
        argv: Words of the command line after the command's own name.
        path: Path of the model.

    """
    words, skips = [], False
    for word in argv:
        if not skips and word != "--model" and not word.startswith("--model="):
            words.append(word)
        skips = word == "--model"
    return shlex.join([own_command(), *words, "--model", path])


def start_learning(
    options: argparse.Namespace, config: Configuration, stack: ExitStack, narrator: Narrator
) -> RunLearning:
    """Start the learner where it is asked for; it ends with the stack.

    Args:
        options: Options of the command.
        config: Configuration of the service.
        stack: What ends with the service.
        narrator: Lines for the operator.

    Raises:
        InputError: An option is missing, or the folder cannot serve.

    """
    if options.learn is None:
        if options.learn_to is not None:
            raise InputError("--learn-to", "nothing is learned", "add --learn propose")
        return RunLearning(None, narrator, ())
    if config.observes_speed:
        raise InputError(
            f"--learn {options.learn}",
            "a diagnosis needs a measured vehicle speed, and [observed_speed] replaces it",
            "leave out --learn, or set enabled = false",
        )
    require_positive(options.learn_every, "--learn-every", "minutes")
    applies = options.learn == "apply"
    if applies and config.model is not None:
        raise InputError(
            "--learn apply",
            "--model is given, whose place a learned model would take",
            "leave out --model, or take --learn propose",
        )
    folder = _folder(options)
    from adhesion_can.learning.child import LearningTask  # noqa: PLC0415
    from adhesion_can.learning.companion import LearningCompanion  # noqa: PLC0415
    from adhesion_can.learning.learner import LearningSettings  # noqa: PLC0415

    settings = LearningSettings(interval_s=60.0 * options.learn_every)
    in_use = () if config.model is None else tuple(config.model.names)
    task = LearningTask(replace(config, model=None), folder, settings, in_use)
    companion = LearningCompanion(task, narrator.warn)
    stack.callback(companion.close)
    narrator.print(f"--learn: models are written to {folder}")
    if not applies:
        return RunLearning(companion, narrator, sys.argv[1:])
    from adhesion_can.learning.application import AppliedModels  # noqa: PLC0415

    return RunLearning(companion, narrator, sys.argv[1:], AppliedModels())


def _folder(options: argparse.Namespace) -> Path:
    """Folder of the models.

    Raises:
        InputError: It is none.

    """
    default = Path() if options.state is None else options.state.parent
    folder: Path = default if options.learn_to is None else options.learn_to
    if not folder.is_dir():
        reason = "is no folder" if folder.exists() else "does not exist"
        raise InputError(f"--learn-to {folder}", reason, "create the folder first")
    return folder.resolve()
