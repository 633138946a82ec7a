"""What an extension gains on data that had no part in deciding on it."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.inference.find_residual_channels import Left
from adhesion_can.diagnosis.regression.gram_matrices import solve
from adhesion_can.diagnosis.regression.model import Model, curve_slopes, evaluate
from adhesion_can.diagnosis.regression.whitened_regression import Stage, fit
from adhesion_can.diagnosis.result import Gain


@dataclass(frozen=True, eq=False)
class Held:
    """Residuals on what was held out, adhesion.

    Attributes:
        rows: of the study, shape (m,).
        before: by the plain model, shape (m,).
        after: by the extended one, shape (m,).

    """

    rows: NDArray[np.int64]
    before: Array
    after: Array


def held_out(
    stage: Stage, plain: Model, extended: Model, left: Left | None, *, other_drives: bool
) -> Held:
    """Both models on the rows that were kept back.

    Args:
        stage: on which they were fitted.
        plain: curves alone.
        extended: with effects.
        left: a channel that adds to it; None: nothing does.
        other_drives: whether whole recordings were kept back. Their rails are their own, so both
            models get curves of theirs; the effects stay as they were found.

    """
    study = stage.study
    if other_drives:
        plain = fit(stage.turned, Model(plain.theta)).model
        extended = fit(stage.turned, Model(extended.theta, fixed=extended.actives)).model
    rows = np.flatnonzero(stage.turned.used)
    before = evaluate(study, plain.theta, plain.actives).residual
    after = evaluate(study, extended.theta, extended.actives).residual
    if left is not None and other_drives:
        after = after - left.alone
        # At the likely slips, as the channel was fitted.
        likely = evaluate(study, extended.theta, extended.actives, stage.shift)
        slopes = curve_slopes(study, extended.theta, likely)
        own = slopes[rows]
        after = after - slopes @ solve(own.T @ own, own.T @ after[rows])
    elif left is not None:
        after = after - left.explained
    return Held(rows, before[rows], after[rows])


def interval(before: Array, after: Array, unit: NDArray[np.int64]) -> tuple[float, float]:
    """95 % interval of the gain in percent, from the scatter over units that were held out whole.

    Args:
        before: residuals, shape (m,).
        after: likewise.
        unit: number of each row's unit, shape (m,).

    """
    numbers = np.unique(unit, return_inverse=True)[1]
    b, a = np.bincount(numbers, before**2), np.bincount(numbers, after**2)
    units = len(b)
    if units < 2 or b.sum() == 0.0 or a.sum() == 0.0:
        return -np.inf, 100.0
    share = a / a.sum() - b / b.sum()
    spread = float(np.sqrt(units / (units - 1) * np.sum(share**2)))
    middle = float(np.log(a.sum() / b.sum()))
    reach = float(scipy.stats.t.ppf(0.975, units - 1)) * spread
    low, high = (100.0 * (1.0 - np.exp((middle + side * reach) / 2)) for side in (1.0, -1.0))
    return float(low), float(high)


def gain_of(
    held: Held,
    unit: NDArray[np.int64],
    noise_floor: float,
    words: str,
    spans: tuple[tuple[str, float, float], ...],
) -> Gain:
    """Gain with its interval.

    Args:
        held: residuals.
        unit: number of each row's unit, shape as theirs.
        noise_floor: of the adhesion.
        words: what was held out.
        spans: likewise, as times.

    """
    before = float(np.sqrt(np.mean(held.before**2)))
    after = float(np.sqrt(np.mean(held.after**2)))
    same = np.array_equal(held.before, held.after)
    percent = 0.0 if same else 100.0 * (1.0 - after / max(before, 1e-300))
    between = (0.0, 0.0) if same else interval(held.before, held.after, unit)
    return Gain(before, after, noise_floor, percent, between, words, spans)
