"""Figures of the learner for Prometheus; needs the extra `metrics`."""

from collections.abc import Iterator

from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    Metric,
    StateSetMetricFamily,
)

from adhesion_can.learning.companion import LearningCompanion
from adhesion_can.learning.confirmation import LearningState
from adhesion_can.service.metrics import PREFIX


def collect_learning(companion: LearningCompanion) -> Iterator[Metric]:
    """Figures at this moment."""
    report = companion.report
    states = {state.value: state is report.state for state in LearningState}
    yield StateSetMetricFamily(f"{PREFIX}learning_state", "state of what is learned", states)
    for name, meaning, value in (
        ("learning_diagnoses", "diagnoses of the record of readings", report.examined),
        ("learning_proposals", "models that were proposed", report.proposed),
        ("learning_restarts", "times that the learning process was restarted", companion.restarts),
        (
            "learning_readings_lost_seconds",
            "time whose readings the learning process did not take",
            companion.lost_s,
        ),
    ):
        yield CounterMetricFamily(f"{PREFIX}{name}", meaning, value)
    size = GaugeMetricFamily(
        f"{PREFIX}learned_size", "size of a learned cause", labels=["effect", "unit"]
    )
    std = GaugeMetricFamily(
        f"{PREFIX}learned_size_std", "its standard deviation", labels=["effect", "unit"]
    )
    for cause in report.causes:
        labels = [cause.effect, cause.unit]
        size.add_metric(labels, cause.size)
        if cause.std is not None:
            std.add_metric(labels, cause.std)
    yield size
    yield std
