"""Estimators by name, all with the interface `Estimator`, and their settings.

A distribution offers an estimator by an entry point of the group 'adhesion_can.estimators': its
name is the estimator's, its object makes a fresh estimator from `EstimatorSettings`.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING

from adhesion_can.estimation.baselines import BASELINES
from adhesion_can.estimation.baselines.settings import ChangeSettings, EvolutionSettings
from adhesion_can.estimation.doubt.settings import DoubtSettings, InstrumentUncertainty
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.estimation.noise.settings import NoiseSettings
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSwitch
from adhesion_can.estimation.plausibility.settings import PlausibilitySettings
from adhesion_can.estimation.tracker.settings import TrackerSettings
from adhesion_can.plugins import load_plugins

if TYPE_CHECKING:
    from adhesion_can.estimation.tracker.tracker import Tracker

DEFAULT = "tracker"
GROUP = "adhesion_can.estimators"
"""Group of the entry points."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorSettings:
    """Settings of all estimators; each estimator uses those that concern it.

    Attributes:
        identifiability: Limits from which the peak counts as identifiable, section
            `[identifiability]`; used by every estimator.
        noise: Settings of the noise of the samples in front of the default estimator, section
            `[noise]`.
        doubt: Settings of the tests of the default estimator's residual, section `[doubt]`.
        instruments: Errors of the instruments before the data show them, section `[instruments]`;
            used by the default estimator.
        plausibility: Limits of the readings in front of every estimator, section `[plausibility]`.
        observed_speed: Whether the vehicle speed is observed by the driven axles in front of every
            estimator, section `[observed_speed]`.
        tracker: Settings of the default estimator and of its parts, sections `[tracker]`,
            `[run_length]`, `[memory]`, `[prior]` and `[axles]`.
        evolution: Settings of the differential evolution, section `[evolution]`; its block length
            and search range are also those of the other estimators that need them.
        change: Settings of the change detection of the paper's estimator, section `[change]`.

    """

    identifiability: IdentifiabilitySettings = field(default_factory=IdentifiabilitySettings)
    noise: NoiseSettings = field(default_factory=NoiseSettings)
    doubt: DoubtSettings = field(default_factory=DoubtSettings)
    instruments: InstrumentUncertainty = field(default_factory=InstrumentUncertainty)
    plausibility: PlausibilitySettings = field(default_factory=PlausibilitySettings)
    observed_speed: ObservedSpeedSwitch = field(default_factory=ObservedSpeedSwitch)
    tracker: TrackerSettings = field(default_factory=TrackerSettings)
    evolution: EvolutionSettings = field(default_factory=EvolutionSettings)
    change: ChangeSettings = field(default_factory=ChangeSettings)


def make_tracker(
    settings: EstimatorSettings, known_changes_us: Iterable[int] | None = None
) -> "Tracker":
    """Fresh tracker.

    Args:
        settings: Settings of the estimators.
        known_changes_us: Stamps from which on the surface is another one, µs; None: it detects
            them.

    """
    # Imported here, since a configuration needs the settings alone.
    from adhesion_can.estimation.tracker.tracker import Tracker  # noqa: PLC0415

    return Tracker(settings.tracker, settings.identifiability, known_changes_us=known_changes_us)


def make_default(settings: EstimatorSettings, axles: int | None = None) -> Estimator:
    """Fresh tracker, with the noise of its samples estimated in front of it.

    Args:
        settings: Settings of the estimators.
        axles: Number of axles of the vehicle that the samples come from, whose residual is then
            tested for what the model leaves out; None: points of a curve, and no doubt.

    """
    estimator: Estimator
    tracker = estimator = make_tracker(settings)
    # The parts are imported here, as the tracker is.
    if axles is not None and settings.doubt.enabled:
        from adhesion_can.estimation.doubt.estimator import DoubtingTracker  # noqa: PLC0415

        doubt, instruments, limits = settings.doubt, settings.instruments, settings.identifiability
        estimator = DoubtingTracker(tracker, axles, doubt, instruments, limits)
    if not settings.noise.estimated:
        return estimator
    from adhesion_can.estimation.noise.scaled_estimator import (  # noqa: PLC0415
        NoiseScaledEstimator,
    )

    return NoiseScaledEstimator(estimator, settings.noise)


def oracle(settings: EstimatorSettings, changes_us: Iterable[int]) -> "Tracker":
    """Tracker that knows when the surface changes; the difference shows what detection costs.

    Args:
        settings: Settings of the estimators.
        changes_us: Stamps from which on the surface is another one, µs.

    """
    return make_tracker(settings, changes_us)


MakeEstimator = Callable[[EstimatorSettings], Estimator]
"""Factory of a fresh estimator."""


def _make_paper(settings: EstimatorSettings) -> Estimator:
    from adhesion_can.estimation.baselines.paper import PaperEstimator  # noqa: PLC0415

    return PaperEstimator(settings.evolution, settings.identifiability, settings.change)


def _baseline(name: str) -> MakeEstimator:
    return lambda settings: BASELINES[name](settings.evolution, settings.identifiability)


ESTIMATORS: Mapping[str, MakeEstimator] = {
    DEFAULT: make_default,
    "paper": _make_paper,
    **{name: _baseline(name) for name in BASELINES},
}
"""The built-in estimators."""


@cache
def known_estimators() -> Mapping[str, MakeEstimator]:
    """The built-in estimators, then those of installed distributions.

    Raises:
        PluginError: A distribution offers something that makes no estimator, or a name that
            exists already.

    """
    known = dict(ESTIMATORS)
    for plugin in load_plugins(GROUP):
        if plugin.name in known:
            raise plugin.error(f"an estimator {plugin.name!r} exists already")
        if not callable(plugin.value):
            raise plugin.error("its object cannot be called to make an estimator")
        known[plugin.name] = plugin.value
    return known


def estimator_by_name(name: str) -> MakeEstimator:
    """Factory of the estimator of that name; KeyError with the names that exist."""
    if name in ESTIMATORS:
        return ESTIMATORS[name]
    known = known_estimators()
    if name not in known:
        raise KeyError(f"no estimator {name!r}; known: {', '.join(known)}")
    return known[name]
