"""The service's messages, decoded: the latest contents, and the setpoints of two minutes."""

from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from math import inf

from adhesion_can.bus.checked_message import CheckedMessage, SignalValues
from adhesion_can.bus.message_record import LATE_CYCLES
from adhesion_can.bus.output_values import objection_in, status_in, theta_in
from adhesion_can.monitoring.snapshot import HistoryPoint, ServiceView
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.status import Status

SETPOINT, MODEL, QUALITY = "AdhesionSetpoint", "AdhesionModel", "AdhesionQuality"
AXLE, HEALTH = "AxleSetpoint", "ServiceStatus"
HISTORY_US, HISTORY_STEP_US = 120_000_000, 200_000
"""Time for which setpoints are kept and the time between two of them, µs."""


class SetpointReader:
    """Contents of the service's messages as they come.

    Args:
        quality: Decoder of `AdhesionQuality`, for the ends of its ranges.
        cycle_us: Cycle of `AdhesionSetpoint`, µs.

    """

    def __init__(self, quality: CheckedMessage, cycle_us: int) -> None:
        self._timeout_us = LATE_CYCLES * cycle_us
        self._ends = {name: _end_of_range(quality, name) for name in ("MuMaxStd", "LambdaMStd")}
        self._view: ServiceView | None = None
        self._axles: dict[int, SignalValues] = {}
        self._history: deque[HistoryPoint] = deque()

    @property
    def history(self) -> tuple[HistoryPoint, ...]:
        """Setpoints of the last two minutes, five a second."""
        return tuple(self._history)

    def add(self, name: str, values: SignalValues, t_us: int) -> None:
        """Take the values of an accepted frame, by the name of its message and its stamp, µs."""
        view = self._view or ServiceView(t_us)
        if name == SETPOINT:
            view = replace(
                view,
                t_us=t_us,
                status=status_in(values),
                mu_max=values.get("MuMax"),
                lambda_m=values.get("LambdaM"),
                creep_speed=values.get("CreepSpeedSetpoint"),
            )
        elif name == MODEL:
            view = replace(view, theta=theta_in(values), objection=objection_in(values))
        elif name == QUALITY:
            view = replace(
                view,
                mu_max_std=self._deviation("MuMaxStd", values),
                lambda_m_std=self._deviation("LambdaMStd", values),
                doubt=_doubt(values.get("Doubt")),
                surface_age_s=values.get("SurfaceAge"),
            )
        elif name == AXLE:
            self._axles[int(values.get("Axle") or 0)] = values
        elif name == HEALTH:
            view = replace(
                view,
                rejected=_whole(values.get("FramesRejected")),
                lost=_whole(values.get("FramesLost")),
                loop_time_us=values.get("LoopTimeP99"),
            )
        self._view = view
        if name == SETPOINT:
            self._keep(view)

    def axle(self, number: int) -> Mapping[str, float | None]:
        """Setpoint of an axle: `mu_max`, `lambda_m` and `creep_setpoint` as far as they came."""
        values = self._axles.get(number, {})
        return {
            "mu_max": values.get(f"MuMax_Ax{number}"),
            "lambda_m": values.get(f"LambdaM_Ax{number}"),
            "creep_setpoint": values.get(f"CreepSpeedSetpoint_Ax{number}"),
        }

    def view(self, t_us: int) -> ServiceView | None:
        """Latest contents at a time, µs; None where nothing came."""
        if self._view is None:
            return None
        view = self._view
        is_silent = t_us - view.t_us > self._timeout_us
        signed_off = view.status is Status.INIT and view.mu_max is None
        return replace(view, is_silent=is_silent, has_ended=is_silent and signed_off)

    def _keep(self, view: ServiceView) -> None:
        history = self._history
        # A status that lasts for less than the step is seen all the same.
        if (
            history
            and view.t_us - history[-1].t_us < HISTORY_STEP_US
            and view.status is history[-1].status
        ):
            return
        stds = (view.mu_max_std, view.lambda_m_std)
        point = HistoryPoint(view.t_us, view.status, view.mu_max, stds[0], view.lambda_m, stds[1])
        history.append(point)
        while history[0].t_us < view.t_us - HISTORY_US:
            history.popleft()

    def _deviation(self, name: str, values: SignalValues) -> float | None:
        """Standard deviation; inf at the end of its range, where larger ones stand as well."""
        value = values.get(name)
        return inf if value is not None and value >= self._ends[name] else value


def _end_of_range(message: CheckedMessage, name: str) -> float:
    plan = message.plan.signals[name]
    return plan.value(plan.raw(plan.encode(inf)))


def _doubt(value: float | None) -> Doubt:
    """Doubt by its number; one that a newer service knows counts as not available."""
    number = Doubt.NOT_AVAILABLE if value is None else int(value)
    return Doubt(number) if number in set(Doubt) else Doubt.NOT_AVAILABLE


def _whole(value: float | None) -> int | None:
    return None if value is None else round(value)
