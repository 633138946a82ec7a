"""Figures of the running service for Prometheus, read when they are asked for.

The names follow Prometheus' conventions: base units, `_total` for counters. Needs the extra
`metrics`.
"""

from collections.abc import Callable, Iterable, Iterator
from itertools import accumulate

from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    InfoMetricFamily,
    Metric,
    StateSetMetricFamily,
)
from prometheus_client.registry import Collector

from adhesion_can.bus.rejection import REJECTIONS
from adhesion_can.service.counters import COUNTERS
from adhesion_can.service.lateness import BOUNDS_US
from adhesion_can.service.live import LiveService
from adhesion_can.service.outputs import Outputs
from adhesion_can.version import __version__

PREFIX = "adhesion_can_"
GAUGES: tuple[tuple[str, str, Callable[[Outputs], float | None]], ...] = (
    ("mu_max", "peak of the adhesion curve", lambda out: out.setpoint.mu_max),
    ("mu_max_std", "its standard deviation", lambda out: out.mu_max_std),
    ("lambda_m", "slip ratio at the peak", lambda out: out.setpoint.lambda_m),
    ("lambda_m_std", "its standard deviation", lambda out: out.lambda_m_std),
    (
        "creep_speed_setpoint_meters_per_second",
        "recommended creep speed",
        lambda out: out.setpoint.creep_speed,
    ),
    ("surface_age_seconds", "time since the surface changed", lambda out: out.surface_age_s),
    ("vehicle_speed_meters_per_second", "vehicle speed", lambda out: out.speed),
)
"""Name, meaning and value of each figure that goes up and down; no sample where it is not
available."""


class ServiceCollector(Collector):
    """Collects the figures of a running service.

    Args:
        service: Service to read; never changed.
        log_lines_lost: Number of lines that the service's log lost.
        more: Figures of what runs beside the service.

    """

    def __init__(
        self,
        service: LiveService,
        log_lines_lost: Callable[[], int] = lambda: 0,
        more: Callable[[], Iterable[Metric]] = lambda: (),
    ) -> None:
        self._service = service
        self._log_lines_lost = log_lines_lost
        self._more = more

    def collect(self) -> Iterator[Metric]:
        """Figures at this moment."""
        service, outputs = self._service, self._service.core.outputs
        yield InfoMetricFamily(f"{PREFIX}build", "version", {"version": __version__})
        for counter in COUNTERS:
            value = counter.read(service)
            yield CounterMetricFamily(f"{PREFIX}{counter.metric}", counter.meaning, value)
        lost = self._log_lines_lost()
        yield CounterMetricFamily(f"{PREFIX}log_lines_lost", "lines lost from the log", lost)
        yield self._collect_rejected()
        yield self._collect_lateness()
        if (loop_us := service.core.loop_time_p99_us) is not None:
            name, meaning = "loop_time_p99_seconds", "99 % quantile of the time to handle a frame"
            yield GaugeMetricFamily(f"{PREFIX}{name}", meaning, loop_us / 1e6)
        for name, meaning, now in (
            ("status", "status", outputs.status),
            ("doubt", "doubt", outputs.doubt),
            ("objection", "objection to the readings", outputs.objection),
        ):
            states = {state.name: state is now for state in type(now)}
            yield StateSetMetricFamily(f"{PREFIX}{name}", meaning, states)
        for name, meaning, read in GAUGES:
            if (number := read(outputs)) is not None:
                yield GaugeMetricFamily(f"{PREFIX}{name}", meaning, number)
        yield _collect_axles(outputs)
        yield from self._more()

    def _collect_rejected(self) -> Metric:
        family = CounterMetricFamily(
            f"{PREFIX}frames_rejected", "input frames rejected", labels=["message", "reason"]
        )
        for record in self._service.core.receiver.records:
            for reason in REJECTIONS:
                labels = [record.message.plan.name, reason.value]
                family.add_metric(labels, record.rejected.get(reason, 0))
        return family

    def _collect_lateness(self) -> Metric:
        lateness = self._service.lateness
        bounds = [str(bound / 1e6) for bound in BOUNDS_US] + ["+Inf"]
        return HistogramMetricFamily(
            f"{PREFIX}setpoint_lateness_seconds",
            "delay of setpoints after their due time",
            buckets=list(zip(bounds, accumulate(lateness.counts), strict=True)),
            sum_value=lateness.sum_us / 1e6,
        )


def _collect_axles(outputs: Outputs) -> Metric:
    family = GaugeMetricFamily(f"{PREFIX}axle_mu_max", "peak at each axle", labels=["axle"])
    for axle, point in sorted(outputs.axles.items()):
        if point.mu_max is not None:
            family.add_metric([str(axle)], point.mu_max)
    return family
