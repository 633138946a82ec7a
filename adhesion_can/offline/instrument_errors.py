"""What a recording shows of the errors that all axles share, held against `[instruments]`."""

from collections.abc import Iterator
from math import ceil, floor, log10
from typing import TYPE_CHECKING

import numpy as np

from adhesion_can.config import Configuration
from adhesion_can.estimation.batch_result import BatchResult
from adhesion_can.estimation.doubt.settings import EFFORT_BIAS_SHARE, InstrumentUncertainty
from adhesion_can.physics.samples import Samples
from adhesion_can.result_text import plus_minus

if TYPE_CHECKING:
    from adhesion_can.estimation.doubt.shared_errors import SharedError

WORTHWHILE = 0.5
"""Largest error in place of a stated one that is worth a proposal, as a share of it."""
LEAST_FORCE, LEAST_SHARE = 0.05, 0.02
"""Adhesion from which a train pulls or brakes, and least share of samples in which it does."""
LEAST = 0.1
"""Least error that is proposed, as a share of the default: instruments drift between drives."""


def propose_instruments(
    samples: Samples, fitted: BatchResult, configuration: Configuration
) -> Iterator[str]:
    """Sentence with smaller errors for `[instruments]`, where the recording bears them out.

    Args:
        samples: Samples of the recording.
        fitted: Their batch fit.
        configuration: Configuration with the errors that are stated.

    """
    first = fitted.segments[0].estimate
    force = samples.adhesion
    # In one direction only the form of the curve would show errors.
    if not min(np.mean(force > LEAST_FORCE), np.mean(force < -LEAST_FORCE)) > LEAST_SHARE:
        return
    # Imported here, since most recordings are in one direction, and the doubt imports much.
    from adhesion_can.estimation.doubt.shared_errors import (  # noqa: PLC0415
        estimate_shared_errors,
    )

    estimators, vehicle = configuration.estimators, configuration.vehicle
    errors = estimate_shared_errors(
        samples,
        first.theta,
        vehicle.axles,
        estimators.identifiability.slip_max,
        changes_us=[segment.from_us for segment in fitted.segments[1:]],
        noise=estimators.noise,
    )
    if errors is None:
        return
    load = sum(vehicle.axle_load) / vehicle.axles
    stated, usual = estimators.instruments.on_load(load), InstrumentUncertainty()
    speed, effort = errors
    proposals = {
        "speed_error_std": _propose(speed, stated.speed_error_std, usual.speed_error_std),
        "effort_bias_std": _propose(effort, stated.used_bias_std, EFFORT_BIAS_SHARE * load),
    }
    keys = [f"{key} = {value:g}" for key, value in proposals.items() if value is not None]
    if not keys:
        return
    yield (
        f"the vehicle speed reads {_in_words(speed, 100.0, ' %')}, the efforts "
        f"{_in_words(effort, 1.0, ' N')}. With {' and '.join(keys)} in [instruments], the service "
        "knows the peak before the train has braked"
    )


def _propose(error: "SharedError", stated: float, usual: float) -> float | None:
    """Standard deviation to state, with two digits; None where the stated one is good enough."""
    wanted = max(error.covering, LEAST * usual)
    if not wanted <= WORTHWHILE * stated:
        return None
    step = 10.0 ** (ceil(log10(wanted)) - 2)
    return float(f"{ceil(wanted / step) * step:.2g}")


def _in_words(error: "SharedError", factor: float, unit: str) -> str:
    """An error with its standard deviation: '0.012 ± 0.005 % low'."""
    side = "high" if error.value >= 0.0 else "low"
    digits = max(-floor(log10(max(factor * error.std, 1e-9))), 0)
    return f"{plus_minus(factor * abs(error.value), factor * error.std, digits)}{unit} {side}"
