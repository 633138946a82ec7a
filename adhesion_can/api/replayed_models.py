"""Models that a service with `--learn apply` changed to, as their logs have it."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import chain
from typing import Any

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import Frame
from adhesion_can.config import Configuration
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.samples import Samples
from adhesion_can.recordings.recording import Recording
from adhesion_can.sampling.column_former import Readings
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.correcting_core import CorrectingCore
from adhesion_can.service.model_changes import read_model_changes
from adhesion_can.service.outputs import Outputs
from adhesion_can.service.replay import ReplaySummary, replay, replay_blocks


class ReplayedModels:
    """Changes of the model in some logs.

    Args:
        recordings: The logs.

    Raises:
        RecordingError: A change is damaged.

    """

    def __init__(self, recordings: Sequence[Recording]) -> None:
        self._changes = [
            change
            for recording in recordings
            for change in read_model_changes(recording.comments(), str(recording.path))
        ]
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
        """Which model took over when.

        Args:
            first_us: Stamp of the first frame, µs.

        """
        for t_us, model in self._taken:
            name = "the plain curve" if model is None else f"the model {', '.join(model.names)}"
            yield f"From {(t_us - first_us) / 1e6:.3f} s on the service used {name}."

    def to_dict(self) -> dict[str, Any]:
        """The same as JSON has it; nothing where the model is the same throughout."""
        if self.is_fixed:
            return {}
        taken = [
            {"from_s": t_us / 1e6, "effects": [] if model is None else list(model.names)}
            for t_us, model in self._taken
        ]
        return {"models": taken}
