"""Every estimator by its name, behind the one protocol."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from adhesion_can.estimation.baselines import BASELINES
from adhesion_can.estimation.baselines.paper import ChangeSettings, PaperEstimator
from adhesion_can.estimation.differential_evolution import EvolutionSettings
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.estimation.tracker.tracker import Tracker, TrackerParts

DEFAULT = "tracker"


@dataclass(frozen=True, slots=True)
class EstimatorSettings:
    """What estimators are set by; each takes what it knows.

    Attributes:
        parts: of the tracker.
        evolution: of the differential evolution.
        change: when the paper's estimator believes in another rail.

    """

    parts: TrackerParts = field(default_factory=TrackerParts)
    evolution: EvolutionSettings = field(default_factory=EvolutionSettings)
    change: ChangeSettings = field(default_factory=ChangeSettings)

    @property
    def identifiability(self) -> IdentifiabilitySettings:
        """When the peak counts as identifiable; the tracker also wants its fall beyond seen."""
        return self.parts.identifiability


def oracle(settings: EstimatorSettings, changes_us: Iterable[int]) -> Tracker:
    """The tracker, told when the rail changes: what finding it out costs shows beside it.

    Args:
        settings: see there.
        changes_us: stamps from which on the rail is another one, µs.

    """
    return Tracker(settings.parts, told_us=changes_us)


def _baseline(name: str) -> Callable[[EstimatorSettings], Estimator]:
    return lambda settings: BASELINES[name](settings.evolution, settings.identifiability)


ESTIMATORS: Mapping[str, Callable[[EstimatorSettings], Estimator]] = {
    DEFAULT: lambda s: Tracker(s.parts),
    "paper": lambda s: PaperEstimator(s.evolution, s.identifiability, s.change),
    **{name: _baseline(name) for name in BASELINES},
}
