"""What a service knew or changed beside its frames, as its logs have it.

These are the surfaces that `--state` had kept, and the models that `--learn apply` changed to.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import chain
from typing import Any

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import Frame
from adhesion_can.config import Configuration
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.samples import Samples
from adhesion_can.plurals import counted
from adhesion_can.recordings.recording import Recording
from adhesion_can.sampling.column_former import Readings
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.correcting_core import CorrectingCore
from adhesion_can.service.kept_state import read_kept_curves, with_surfaces
from adhesion_can.service.model_changes import ModelChange, read_model_changes
from adhesion_can.service.outputs import Outputs
from adhesion_can.service.replay import ReplaySummary, replay, replay_blocks

_OURS = b" adhesion-can-"
"""What stands in the comments that a replay needs."""


class ReplayedModels:
    """Kept surfaces, and changes of the model, in some logs.

    A log of another start of the service begins with the plain curve; one that it began later, at a
    signal, begins with the latest change.

    Args:
        recordings: The logs.

    Raises:
        RecordingError: A change, or what was kept, is damaged.

    """

    def __init__(self, recordings: Sequence[Recording]) -> None:
        self._changes: list[ModelChange] = []
        self._kept: tuple[CurveParameters, ...] = ()
        for place, recording in enumerate(recordings):
            # Once through a log; most of its comments are others.
            comments = [line for line in recording.comments() if _OURS in line]
            changes = list(read_model_changes(comments, str(recording.path)))
            begin_us = _begin_us(recording) if self._changes else None
            if begin_us is not None and not (changes and changes[0].t_us <= begin_us):
                self._changes.append(ModelChange(begin_us, None))
            self._changes += changes
            if place == 0:
                self._kept = read_kept_curves(comments, str(recording.path))
        self._taken: list[tuple[int, ExtendedModel | None]] = []

    @property
    def is_fixed(self) -> bool:
        """Whether the model is the same throughout."""
        return not self._changes

    def make_core(
        self,
        config: Configuration,
        estimator: str | None,
        on_setpoint: Callable[[int, Outputs], None],
        on_samples: Callable[[Samples], None] | None = None,
        on_readings: Callable[[Readings], None] | None = None,
    ) -> ServiceCore:
        """Core that changes its model as the service did.

        Args:
            config: Configuration, with the model at the start.
            estimator: Name of the estimator; None: the configured one.
            on_setpoint: Callback with due time (µs) and outputs of each setpoint message.
            on_samples: Callback with the samples of each due time that has any.
            on_readings: Callback with the readings of accepted frames.

        Raises:
            ConfigError: A model needs a channel or an axle that the configuration lacks.

        """
        config = with_surfaces(config, self._kept)
        if self.is_fixed:
            make = partial(config.make_estimator, estimator)
            return ServiceCore(config, make, on_setpoint, on_samples, on_readings)
        return CorrectingCore(
            config,
            self._changes,
            lambda t_us, model: self._taken.append((t_us, model)),
            estimator=estimator,
            on_setpoint=on_setpoint,
            on_samples=on_samples,
            on_readings=on_readings,
        )

    def run(
        self,
        blocks: Iterable[Block],
        core: ServiceCore,
        send: Callable[[Frame], None],
        *,
        from_s: float = 0.0,
        to_s: float | None = None,
        realtime: bool = False,
    ) -> ReplaySummary:
        """Run recorded blocks through the core that `make_core` gave.

        Args:
            blocks: Blocks in the order of the recordings.
            core: The core.
            send: Callback with each frame that the service sends.
            from_s: Start of the part that is replayed, s after the first frame.
            to_s: End of that part (inclusive), s after the first frame; None for the last frame.
            realtime: Whether to keep the speed of the recording.

        """
        if self.is_fixed and not realtime:
            return replay_blocks(blocks, core, send, from_s=from_s, to_s=to_s)
        items = chain.from_iterable(block.items() for block in blocks)
        return replay(items, core, send, from_s=from_s, to_s=to_s, realtime=realtime)

    def sentences(self, first_us: int) -> Iterator[str]:
        """What was known at the start, and which model took over when.

        Args:
            first_us: Stamp of the first frame, µs.

        """
        if self._kept:
            yield f"The service began with {counted(len(self._kept), 'kept surface')}."
        for t_us, model in self._taken:
            name = "the plain curve" if model is None else f"the model {', '.join(model.names)}"
            yield f"From {(t_us - first_us) / 1e6:.3f} s on the service used {name}."

    def to_dict(self) -> dict[str, Any]:
        """The same as JSON has it; nothing where nothing was kept and no model changed."""
        kept = {"kept_surfaces": len(self._kept)} if self._kept else {}
        if self.is_fixed:
            return kept
        taken = [
            {"from_s": t_us / 1e6, "effects": [] if model is None else list(model.names)}
            for t_us, model in self._taken
        ]
        return {**kept, "models": taken}


def _begin_us(recording: Recording) -> int | None:
    """Stamp of the first frame, µs; None where there is none."""
    # Another reader: the statistics of the first one count each frame once.
    block = next(Recording(recording.path).blocks(), None)
    return int(block.t_ns[0]) // 1000 if block is not None and len(block) else None
