"""Baseline estimators with the interface `Estimator`, for comparison in experiments and replay.

Defaults are tuned on blocks of 500 samples with λ uniform in 0..0.2 and noise of 0.01 and 0.1, on
the paper's experiments and on `burckhardt.RAIL`, with switches between surfaces.
"""

from collections.abc import Callable, Mapping

from adhesion_can.estimation.baselines.block_fit import (
    BlockEstimator,
    evolution_estimator,
    least_squares_estimator,
    scipy_evolution_estimator,
)
from adhesion_can.estimation.baselines.extended_kalman import EkfEstimator, EkfSettings
from adhesion_can.estimation.baselines.growing_window import WindowEstimator, WindowSettings
from adhesion_can.estimation.baselines.model_bank import BankEstimator, BankSettings
from adhesion_can.estimation.baselines.recursive_least_squares import RlsEstimator, RlsSettings
from adhesion_can.estimation.differential_evolution import EvolutionSettings
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.identifiability import IdentifiabilitySettings

__all__ = [
    "BASELINES",
    "BankEstimator",
    "BankSettings",
    "BlockEstimator",
    "EkfEstimator",
    "EkfSettings",
    "RlsEstimator",
    "RlsSettings",
    "WindowEstimator",
    "WindowSettings",
]

BASELINES: Mapping[str, Callable[[EvolutionSettings, IdentifiabilitySettings], Estimator]] = {
    "de": evolution_estimator,
    "scipy-de": scipy_evolution_estimator,
    "least-squares": least_squares_estimator,
    "rls": lambda evolution, limits: RlsEstimator(None, evolution, limits),
    "ekf": lambda evolution, limits: EkfEstimator(None, evolution, limits),
    "bank": lambda _evolution, limits: BankEstimator(None, limits),
    "window": lambda evolution, limits: WindowEstimator(None, evolution, limits),
}
