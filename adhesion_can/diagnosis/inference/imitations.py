"""Laws that a named effect may stand for, and that are no candidates by themselves.

A curve bends to them or an instrument has no such law in the library, so no search tries them. But
where one of them explains the same rows as the named effect does, the name is not the only one.
"""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.inference.model_comparison import LEVEL, worse_p_value
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression, fit_model
from adhesion_can.physics.effects.contact_factors import LOAD_DEPENDENCE
from adhesion_can.physics.effects.instrument_errors import SPEED_SCALE
from adhesion_can.physics.effects.speed_error import (
    GROWING_SPEED_ERROR,
    SPEED_ERROR,
    STEPPED_SPEED_ERROR,
)

AS_GOOD, BETTER = 0.95, 1.02
"""Share of what a step, and what another error of the speed explains, from which a growth may stand
in its place. A constant error is a growth within seconds, to the last hundredth."""


def imitates_load(regression: WhitenedRegression, without: Model, candidate: Candidate) -> bool:
    """Whether a gain that follows the effort explains as much as a dependence on the load.

    At the same slip an axle of larger load has the larger effort. A reading that is too large by a
    share that grows with the effort's square, as that of a motor with saturated iron, makes the
    adhesion rise with the load there, and at small slips leaves it as it is. The true effort is
    taken from the model, since the reading would explain its own noise.

    Args:
        regression: Rows with weights, filter and blocks.
        without: Model without the named effect, fitted.
        candidate: The named effect.

    """
    if candidate.effect.id != LOAD_DEPENDENCE:
        return False
    data = regression.data
    predicted = regression.evaluate_corrected(without).predicted
    load = data.observed("load")
    of_gain = regression.whiten((predicted**3 * (load / float(np.median(load))) ** 2)[:, None])
    of_load = regression.whiten(regression.compute_signature(without, candidate))
    columns = regression.build_columns(without)
    by_gain, by_load = (_explained(regression, columns, column) for column in (of_gain, of_load))
    return by_gain >= by_load


def _explained(regression: WhitenedRegression, columns: Array, added: Array) -> float:
    """Whitened sum of squares of a residual that one more column explains.

    Args:
        regression: Rows with weights, filter and blocks.
        columns: Whitened Jacobian of a model, and its residual last; shape (n, p + 1).
        added: Whitened column, shape (n, 1).

    """
    grams = regression.compute_grams(np.hstack([columns[:, :-1], added, columns[:, -1:]]))
    place = columns.shape[1] - 1
    remainder = grams.project_out(range(place), [place])[:, 0]
    square = float(remainder @ grams.total @ remainder)
    return float(remainder @ grams.total[:, -1]) ** 2 / square if square > 0.0 else 0.0


def find_growth(
    regression: WhitenedRegression, model: Model, place: int, without: Model
) -> float | None:
    """Time over which an error of the vehicle speed grows that explains more than a named one, s.

    The radii of all wheels grow with the heat of brakes and slip, which shows as such an error. One
    that depends on something else explains a part of it, and one that steps explains nearly all.

    Args:
        regression: Rows with weights, filter and blocks.
        model: Model with the named effect, fitted.
        place: Place of the effect among the model's.
        without: Model without it, fitted to the same rows.

    Returns:
        Time constant; None where the effect is no error of the speed, of several drives or of rows
        without order, where the growth is not certainly better, and of a step where it is certainly
        worse.

    """
    effect = model.candidates[place].effect
    drives = regression.data.drives
    if effect.id not in (SPEED_ERROR, SPEED_SCALE) or len(drives) > 1 or drives[0].independent:
        return None
    growth = Candidate(GROWING_SPEED_ERROR)
    grown = (
        fit_model(regression, without.with_effect(growth, start)) for start in growth.start_values
    )
    best = min(grown, key=lambda fitted: fitted.cross_validated_square)
    named, neither = fit_model(regression, model), fit_model(regression, without)
    by_named, by_growth = (
        neither.cross_validated_square - fitted.cross_validated_square for fitted in (named, best)
    )
    if effect is STEPPED_SPEED_ERROR:
        explains = by_growth >= AS_GOOD * by_named and worse_p_value(named, best) >= LEVEL
    else:
        explains = by_growth >= BETTER * by_named and worse_p_value(best, named) < LEVEL
    return best.model.values[-1][1] if explains else None
