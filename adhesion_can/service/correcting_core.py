"""A core that can change to another extended model while it runs, and back.

The new model first runs beside the one in use, on the same readings. It takes over at a due time at
which the drive does not feel it: where the one in use vouches for nothing, or where both peaks are
the same within their standard deviations. Frames, and times from which models run, give the same
bytes whenever they are played.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from math import hypot, isfinite
from typing import NamedTuple

from adhesion_can.config import Configuration
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.readings import Reading
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.status import Status
from adhesion_can.sampling.column_former import Readings
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.estimation_loop import EstimationLoop
from adhesion_can.service.inputs import FrameInputs, InputSnapshot
from adhesion_can.service.model_changes import ModelChange
from adhesion_can.service.outputs import OutputBuilder, Outputs
from adhesion_can.service.states import StatusMachine

WARM_US = 20_000_000
"""Time for which a model runs beside one that vouches for nothing before it may take over without
vouching for anything itself, µs: a sweep of the slips takes a few seconds."""


class CorrectingCore(ServiceCore):
    """The service's core, whose extended model can be changed while it runs.

    Args:
        configuration: Database, roles, vehicle and settings, with the model at the start.
        changes: Changes of the model that are known beforehand, as a log has them.
        on_model: Callback with due time, µs, and model where one has taken over.
        estimator: Name of the estimator; None: the configured one.
        on_setpoint: Callback with due time (µs) and outputs of each setpoint message.
        on_samples: Callback with the samples of each due time that has any.
        on_readings: Callback with the readings of accepted frames, in the order of their stamps.

    Raises:
        ConfigError: As for `ServiceCore`, or a model needs what the configuration lacks.

    """

    def __init__(
        self,
        configuration: Configuration,
        changes: Iterable[ModelChange] = (),
        on_model: Callable[[int, ExtendedModel | None], None] | None = None,
        *,
        estimator: str | None = None,
        on_setpoint: Callable[[int, Outputs], None] | None = None,
        on_samples: Callable[[Samples], None] | None = None,
        on_readings: Callable[[Readings], None] | None = None,
    ) -> None:
        make = partial(configuration.make_estimator, estimator)
        super().__init__(configuration, make, on_setpoint, on_samples, on_readings)
        self._estimator = estimator
        self._shared = _SharedInputs(configuration, self.receiver)
        self._inputs = self._shared
        self._changes: list[_PreparedChange] = []
        self._fault_us: int | None = None
        """Time of the latest fault, µs; None where there was none."""
        self._on_model = on_model
        self._beside: _CoreBeside | None = None
        for change in changes:
            self.change_model(change)

    @property
    def model(self) -> ExtendedModel | None:
        """Model in use."""
        return self.configuration.model

    @property
    def model_beside(self) -> ExtendedModel | None:
        """Model that runs beside it and waits to take over."""
        return None if self._beside is None else self._beside.configuration.model

    def change_model(self, change: ModelChange) -> None:
        """Change to a model at the first due time that is not before the change's time.

        Raises:
            ConfigError: The model needs a channel or an axle that the configuration lacks.

        """
        # Made here, as it takes milliseconds: at a due time a setpoint would wait for it.
        beside = _CoreBeside(replace(self.configuration, model=change.model), self._estimator)
        self._changes.append(_PreparedChange(change.t_us, beside))
        self._changes.sort(key=lambda prepared: prepared.t_us)

    def next_change_us(self) -> int:
        """Earliest time of a change, µs, behind the due time for which work was done ahead."""
        return (self.schedule.next_due_us or self.now_us) + 1

    @property
    def has_work_ahead(self) -> bool:
        """Whether `work_ahead` has something to do; nothing where another model may take over."""
        return self._beside is None and not self._changes and super().has_work_ahead

    def _update(self, t_us: int, inputs: InputSnapshot) -> None:
        while self._changes and self._changes[0].t_us <= t_us:
            inputs = self._turn_to(self._changes.pop(0).beside, t_us, inputs)
        super()._update(t_us, inputs)
        beside = self._beside
        if beside is not None:
            beside.update(t_us)
            if _may_take_over(self.outputs, beside.outputs, t_us - beside.since_us):
                self._take_over(beside, t_us)
                self.outputs = beside.outputs

    def _turn_to(self, beside: "_CoreBeside", t_us: int, inputs: InputSnapshot) -> InputSnapshot:
        """Let a model run beside the one in use; returns the inputs of this due time.

        The plain estimator takes over at once: what a refuted model says is not sent any longer.
        """
        self._drop_beside()
        model = beside.configuration.model
        if model == self.model:
            return inputs
        beside.begin(t_us, self._fault_us, self._shared)
        if model is None:
            self._take_over(beside, t_us)
            return self._inputs.snapshot(t_us)
        self._beside = self._shared.follower = beside
        return inputs

    def _take_over(self, beside: "_CoreBeside", t_us: int) -> None:
        """Go on with the model that ran beside."""
        self._drop_beside()
        self.configuration, self.speed_derived = beside.configuration, beside.speed_derived
        inputs, self._estimation, self._status, self._builder = beside.parts()
        self._shared.go_on_as(inputs)
        if self._on_model is not None:
            self._on_model(t_us, self.model)

    def _drop_beside(self) -> None:
        self._beside = self._shared.follower = None

    def _forget(self) -> None:
        if self._beside is not None:
            # After a hole or a stop there is nothing against which a change would be felt.
            self._take_over(self._beside, self.now_us)
        super()._forget()

    def _add_fault(self, t_us: int, reason: str) -> None:
        super()._add_fault(t_us, reason)
        self._fault_us = t_us
        if self._beside is not None:
            # FAULT is held for its whole time, whichever model is in use then.
            self._beside.hold_fault(t_us)


class _CoreBeside(ServiceCore):
    """The parts of a core with another model, brought from due time to due time by the first one.

    Args:
        configuration: That of the first core, with the other model.
        estimator: Name of the estimator; None: the configured one.

    """

    def __init__(self, configuration: Configuration, estimator: str | None) -> None:
        super().__init__(configuration, partial(configuration.make_estimator, estimator))
        self.since_us = 0
        """Time from which it runs, µs."""

    def begin(self, t_us: int, fault_us: int | None, inputs: FrameInputs) -> None:
        """Begin where the first core is.

        Args:
            t_us: Due time, µs.
            fault_us: Time of the first core's latest fault, µs; None where it had none.
            inputs: Its inputs: a source of the speed that was said once holds here, too.

        """
        self.since_us = t_us
        self._inputs.start(t_us)
        self._inputs.speed, self._inputs.speed_source = inputs.speed, inputs.speed_source
        self.use_speed_source(inputs.speed_source)
        if fault_us is not None:
            self.hold_fault(fault_us)

    def hold_fault(self, t_us: int) -> None:
        """Hold FAULT because of a fault of the first core at a time, µs."""
        self._status.add_fault(t_us)

    def add(self, readings: Iterable[Reading]) -> None:
        """Add readings of the first core."""
        self._inputs.add(readings)
        self.use_speed_source(self._inputs.speed_source)

    def update(self, t_us: int) -> None:
        """Bring estimate, status and outputs to a due time, µs."""
        self._update(t_us, self._inputs.snapshot(t_us))

    def parts(self) -> tuple[FrameInputs, EstimationLoop, StatusMachine, OutputBuilder]:
        """What the first core goes on with; this one is not used any more then."""
        return self._inputs, self._estimation, self._status, self._builder


class _PreparedChange(NamedTuple):
    """A change of the model that is still to come.

    Attributes:
        t_us: Earliest time, µs.
        beside: Core with the model, which has not begun.

    """

    t_us: int
    beside: _CoreBeside


class _SharedInputs(FrameInputs):
    """Inputs whose readings a core beside gets, too."""

    follower: _CoreBeside | None = None

    def add(self, readings: Iterable[Reading]) -> None:
        """Add the readings of an accepted frame, here and there."""
        if self.follower is not None:
            readings = list(readings)
            self.follower.add(readings)
        super().add(readings)

    def go_on_as(self, other: FrameInputs) -> None:
        """Go on with the readings and samples of other inputs, whose owner lets go of them."""
        receiver = self._receiver
        vars(self).update(vars(other))
        self._receiver = receiver


def _may_take_over(now: Outputs, then: Outputs, beside_us: int) -> bool:
    """Whether the drive does not feel it when the second outputs follow the first ones.

    Args:
        now: Outputs of the model in use.
        then: Outputs of the model beside it.
        beside_us: Time for which it has run beside, µs.

    """
    if then.status is Status.FAULT:
        return False
    if now.status is not Status.TRACKING:
        return then.status is Status.TRACKING or beside_us >= WARM_US
    return then.status is Status.TRACKING and all(
        _are_alike(*pair)
        for pair in (
            (now.setpoint.mu_max, now.mu_max_std, then.setpoint.mu_max, then.mu_max_std),
            (now.setpoint.lambda_m, now.lambda_m_std, then.setpoint.lambda_m, then.lambda_m_std),
        )
    )


def _are_alike(
    first: float | None, first_std: float | None, second: float | None, second_std: float | None
) -> bool:
    """Whether two values are the same within their standard deviations."""
    if first is None or second is None or first_std is None or second_std is None:
        return False
    std = hypot(first_std, second_std)
    return isfinite(std) and abs(first - second) <= std
