"""Baseline estimators with the interface `Estimator`, for comparison in experiments and replay.

Defaults are tuned on blocks of 500 samples with λ uniform in 0..0.2 and noise of 0.01 and 0.1, on
the paper's experiments and on `burckhardt.RAIL`, with switches between surfaces.
"""

from collections.abc import Callable, Mapping
from importlib import import_module

from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.identifiability import IdentifiabilitySettings

MakeBaseline = Callable[[EvolutionSettings, IdentifiabilitySettings], Estimator]
"""Factory of a fresh baseline estimator."""


def _imported_when_called(module: str, factory: str) -> MakeBaseline:
    """Class or function of a module of this folder, imported when called: few commands need one."""

    def make(evolution: EvolutionSettings, limits: IdentifiabilitySettings) -> Estimator:
        make_baseline: MakeBaseline = getattr(import_module(f"{__name__}.{module}"), factory)
        return make_baseline(evolution, limits)

    return make


BASELINES: Mapping[str, MakeBaseline] = {
    "de": _imported_when_called("block_fit", "evolution_estimator"),
    "scipy-de": _imported_when_called("block_fit", "scipy_evolution_estimator"),
    "least-squares": _imported_when_called("block_fit", "least_squares_estimator"),
    "rls": _imported_when_called("recursive_least_squares", "RlsEstimator"),
    "ekf": _imported_when_called("extended_kalman", "EkfEstimator"),
    "bank": _imported_when_called("model_bank", "bank_estimator"),
    "window": _imported_when_called("growing_window", "WindowEstimator"),
    "gradient": _imported_when_called("robust_gradient", "GradientEstimator"),
}
