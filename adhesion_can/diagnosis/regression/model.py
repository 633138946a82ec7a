"""Nonlinear regression model of the adhesion: a curve for each surface, and effects on top of it.

    e = z(φ) − factor(φ) · curve(slip(φ); θ_s)

z is the observed adhesion, θ_s belongs to the surface of a row ((c1, ln c2, c3) of Burckhardt's
curve, or the coordinates of another family), and φ are the parameters of the effects. This module
gives predictions, residuals and the Jacobian of the curves; `effect_derivatives` those by effects;
the least-squares fit on weighted, whitened residuals is in `whitened_regression`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData, observed_column
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.physics.curves import Conditions
from adhesion_can.physics.effects import (
    ActiveEffect,
    Contact,
    build_instruments,
    compute_change,
    effect_position,
)

Value = TypeVar("Value", bound=np.generic)

EXCLUDED = -1
"""Surface number of a row that belongs to no surface: it is close to a surface change."""


@dataclass(frozen=True, eq=False)
class RegressionData:
    """Rows of all drives that are analysed together.

    Attributes:
        drives: Drive data of each recording.
        surface: Surface number of each row of all drives, `EXCLUDED` for none; shape (n,).
        surfaces: Number of surfaces.

    """

    drives: tuple[DriveData, ...]
    surface: NDArray[np.int64]
    surfaces: int

    def __len__(self) -> int:
        return len(self.surface)

    def column(self, name: str) -> Array:
        """One attribute of the rows of all drives, concatenated; shape (n,)."""
        return np.concatenate([getattr(drive, name) for drive in self.drives])

    def observed(self, name: str) -> Array:
        """One quantity of the contacts as measured, in the rows of all drives; shape (n,)."""
        return observed_column(self.drives, name)

    @cached_property
    def drive_number(self) -> NDArray[np.int64]:
        """Place of each row's drive among all of them, shape (n,)."""
        return np.repeat(np.arange(len(self.drives)), [len(drive) for drive in self.drives])

    def split(self, rows: NDArray[Value]) -> list[NDArray[Value]]:
        """An array by drive, the rows of all of them along its last axis."""
        ends = np.cumsum([len(drive) for drive in self.drives])[:-1]
        return np.split(rows, ends, axis=-1)


@dataclass(frozen=True, eq=False)
class EvaluatedModel:
    """A model evaluated on all rows; shape (n,) each.

    Adhesion is in units of the readings, force over load: where an effort reads half of what it is,
    observed and predicted adhesion are half, and so is no noise.

    Attributes:
        adhesion: Adhesion as observed with the model's instruments.
        slip: Slip ratio at which the curve is evaluated.
        factor: Factor of the curve's adhesion, by effects and by the gain of the readings.
        curve: Adhesion of the curve.
        conditions: Speed and load at the contact.

    """

    adhesion: Array
    slip: Array
    factor: Array
    curve: Array
    conditions: Conditions

    @property
    def predicted(self) -> Array:
        """Adhesion that the model predicts, shape (n,)."""
        return self.factor * self.curve

    @property
    def residual(self) -> Array:
        """Observed less predicted adhesion, shape (n,)."""
        return self.adhesion - self.predicted


def evaluate_model(
    data: RegressionData,
    curves: SegmentCurves,
    active_effects: Sequence[ActiveEffect] = (),
    slip_correction: Array | None = None,
    known: EvaluatedModel | None = None,
) -> EvaluatedModel:
    """Observed and predicted adhesion in every row.

    Args:
        data: Rows of all drives.
        curves: Curve parameters of all surfaces.
        active_effects: Effects with their parameter values.
        slip_correction: Correction added to every measured slip ratio, shape (n,); None: none.
        known: Evaluation with the same curves, whose curve is used again where slip, speed and load
            are the same: most effects change the factor alone.

    """
    corrections = (
        [None] * len(data.drives) if slip_correction is None else data.split(slip_correction)
    )
    parts = [
        _apply_effects(drive, active_effects, correction)
        for drive, correction in zip(data.drives, corrections, strict=True)
    ]
    adhesion, slip, factor, speed, load = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    conditions = Conditions(speed, load)
    if known is not None and _is_same_contact(known, slip, conditions):
        curve = known.curve
    else:
        curve = curves.adhesion(slip, data.surface, conditions)
    return EvaluatedModel(adhesion, slip, factor, curve, conditions)


def _is_same_contact(known: EvaluatedModel, slip: Array, conditions: Conditions) -> bool:
    """Whether a curve has been evaluated at the same slips, speeds and loads."""
    before = known.conditions
    return (
        np.array_equal(slip, known.slip)
        and np.array_equal(conditions.speed, before.speed)
        and np.array_equal(conditions.load, before.load, equal_nan=True)
    )


def _apply_effects(
    drive: DriveData, active_effects: Sequence[ActiveEffect], slip_correction: Array | None
) -> tuple[Array, Array, Array, Array, Array]:
    """Observed adhesion, slip ratio at the curve, factor, speed and load; shape (n,) each."""
    observed = drive.observe(build_instruments(active_effects))
    slip, creep_speed = observed.slip, observed.creep_speed
    if slip_correction is not None:
        slip, creep_speed = slip + slip_correction, creep_speed + slip_correction * observed.speed
    contact = Contact(
        slip=slip,
        creep_speed=creep_speed,
        speed=observed.speed,
        load=observed.load,
        time_s=drive.time_s,
        axle=drive.axle.astype(np.float64),
        place=drive.place,
        adhesion=observed.adhesion,
        covariates=drive.covariates,
        series_s=drive.t_s,
    )
    change = compute_change(active_effects, contact, drive.lags)
    gain = observed.force_gain
    factor = np.broadcast_to(change.factor * gain, change.slip.shape)
    # A table without loads has 1 N in every row.
    load = observed.load if drive.has_load else np.full(len(drive), np.nan)
    return observed.adhesion * gain, change.slip, factor, observed.speed, load


def compute_factor(drive: DriveData, active: ActiveEffect) -> Array:
    """Factor of the adhesion by one effect in the rows of a drive, shape (n,)."""
    return _apply_effects(drive, [active], None)[2]


def compute_curve_jacobian(
    data: RegressionData, curves: SegmentCurves, evaluation: EvaluatedModel
) -> Array:
    """Derivatives of the prediction by each surface's coordinates, 0 in other rows.

    Args:
        data: Rows of all drives.
        curves: Curve parameters of all surfaces.
        evaluation: Model evaluated at the slips at which the derivatives are taken.

    Returns:
        Jacobian, adhesion per unit of the coordinate; shape (n, k·surfaces).

    """
    gradient = curves.gradient(evaluation.slip, data.surface, evaluation.conditions)
    gradients = np.ascontiguousarray((evaluation.factor * gradient).T)
    if data.surfaces == 1:
        return gradients
    size = curves.size
    columns = np.zeros((len(data), size * data.surfaces))
    for number in range(data.surfaces):
        rows = data.surface == number
        columns[rows, size * number : size * (number + 1)] = gradients[rows]
    return columns


@dataclass(frozen=True, slots=True)
class Model:
    """Curves and effects with their parameter values.

    Attributes:
        curves: Curve parameters of all surfaces.
        candidates: Effects whose parameters are estimated.
        values: Values of each candidate's free parameters.
        fixed: Further effects whose parameters are given.

    """

    curves: SegmentCurves
    candidates: tuple[Candidate, ...] = ()
    values: tuple[tuple[float, ...], ...] = ()
    fixed: tuple[ActiveEffect, ...] = ()

    @property
    def estimates(self) -> tuple[tuple[Candidate, tuple[float, ...]], ...]:
        """Each effect whose parameters are estimated, with their values."""
        return tuple(zip(self.candidates, self.values, strict=True))

    @property
    def active_effects(self) -> tuple[ActiveEffect, ...]:
        """All effects with their values, in the order of the library."""
        pairs = sorted(self.estimates, key=lambda pair: effect_position(pair[0].effect))
        return (*(candidate.active(values) for candidate, values in pairs), *self.fixed)

    @property
    def parameter_vector(self) -> Array:
        """All free parameters: θ surface by surface, then φ effect by effect; shape (p,)."""
        return np.concatenate([self.curves.values.ravel(), *map(np.array, self.values)])

    def first_parameter(self, place: int) -> int:
        """Index in `parameter_vector` of the first parameter of the effect at one place."""
        return self.curves.values.size + sum(c.size for c in self.candidates[:place])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the free parameters, in the order of the vector; (p,) each."""
        effects = [p for candidate in self.candidates for p in candidate.free_parameters]
        sides = zip(self.curves.bounds, ("lower", "upper"), strict=True)
        surfaces = len(self.curves.values)
        lower, upper = (
            np.concatenate([np.tile(end, surfaces), [getattr(p, side) for p in effects]])
            for end, side in sides
        )
        return lower, upper

    def with_parameters(self, vector: Array) -> "Model":
        """The model with other free parameters, clipped to their ranges; `vector` shape (p,)."""
        size = self.curves.values.size
        curves = self.curves.with_values(vector[:size].reshape(self.curves.values.shape))
        values, first = [], size
        for candidate in self.candidates:
            last = first + candidate.size
            values.append(
                tuple(
                    float(np.clip(v, p.lower, p.upper))
                    for v, p in zip(vector[first:last], candidate.free_parameters, strict=True)
                )
            )
            first = last
        return replace(self, curves=curves, values=tuple(values))

    def with_effect(self, candidate: Candidate, values: tuple[float, ...] | None = None) -> "Model":
        """The model with one more effect, of size 0 where no values are given."""
        given = candidate.null_values if values is None else values
        return replace(self, candidates=(*self.candidates, candidate), values=(*self.values, given))


def remove_effect(model: Model, place: int) -> tuple[Model, Candidate, tuple[float, ...]]:
    """A model without the effect at one place of its list, that effect, and its values."""
    rest = [i for i in range(len(model.candidates)) if i != place]
    smaller = replace(
        model,
        candidates=tuple(model.candidates[i] for i in rest),
        values=tuple(model.values[i] for i in rest),
    )
    return smaller, model.candidates[place], model.values[place]
