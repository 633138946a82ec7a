"""Estimators by name, all with the interface `Estimator`, and their settings."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from adhesion_can.estimation.baselines import BASELINES
from adhesion_can.estimation.baselines.paper import ChangeSettings, PaperEstimator
from adhesion_can.estimation.differential_evolution import EvolutionSettings
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.estimation.tracker.tracker import Tracker, TrackerSettings

DEFAULT = "tracker"


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorSettings:
    """Settings of all estimators; each estimator uses those that concern it.

    Attributes:
        identifiability: Limits from which the peak counts as identifiable, section
            `[identifiability]`; used by every estimator.
        tracker: Settings of the default estimator and of its parts, sections `[tracker]`,
            `[run_length]`, `[memory]`, `[prior]` and `[axles]`.
        evolution: Settings of the differential evolution, section `[evolution]`; its block length
            and search range are also those of the other estimators that need them.
        change: Settings of the change detection of the paper's estimator, section `[change]`.

    """

    identifiability: IdentifiabilitySettings = field(default_factory=IdentifiabilitySettings)
    tracker: TrackerSettings = field(default_factory=TrackerSettings)
    evolution: EvolutionSettings = field(default_factory=EvolutionSettings)
    change: ChangeSettings = field(default_factory=ChangeSettings)


def oracle(settings: EstimatorSettings, changes_us: Iterable[int]) -> Tracker:
    """Tracker that knows when the surface changes; its lead shows what detection costs.

    Args:
        settings: Settings of the estimators.
        changes_us: Stamps from which on the surface is another one, µs.

    """
    return Tracker(settings.tracker, settings.identifiability, known_changes_us=changes_us)


def _baseline(name: str) -> Callable[[EstimatorSettings], Estimator]:
    return lambda settings: BASELINES[name](settings.evolution, settings.identifiability)


ESTIMATORS: Mapping[str, Callable[[EstimatorSettings], Estimator]] = {
    DEFAULT: lambda s: Tracker(s.tracker, s.identifiability),
    "paper": lambda s: PaperEstimator(s.evolution, s.identifiability, s.change),
    **{name: _baseline(name) for name in BASELINES},
}
