"""An extended model on recordings or tables: as written, and with its curves refitted.

Both stand beside Burckhardt's curve fitted to the same rows, the answer without a model. Rows,
surfaces, weights and filter are those of a diagnosis, so that its gain on drives that were held out
is the same figure.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.drive.thinning import thin_drives
from adhesion_can.diagnosis.gain_result import Comparison
from adhesion_can.diagnosis.inference.candidates import build_candidates
from adhesion_can.diagnosis.inference.hold_out_gain import LEAST_RECORDINGS, gain_interval
from adhesion_can.diagnosis.inference.split_hold_out import HELD_BLOCKS, number_blocks_of_drives
from adhesion_can.diagnosis.regression.find_surface_changes import (
    build_regression_data,
    find_surface_changes,
    fit_start_curves,
)
from adhesion_can.diagnosis.regression.model import EXCLUDED, Model, RegressionData, evaluate_model
from adhesion_can.diagnosis.regression.prepare_regression import (
    choose_block_length,
    prepare_regression,
)
from adhesion_can.diagnosis.regression.segment_curves import BURCKHARDT, SegmentCurves
from adhesion_can.diagnosis.regression.whitened_regression import fit_model
from adhesion_can.errors import InputError
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.effects import ActiveEffect
from adhesion_can.result_text import html_table


@dataclass(frozen=True, eq=False)
class ModelResiduals:
    """Residuals of the adhesion on the rows of all drives, shape (n,) each.

    Attributes:
        plain: Burckhardt's curves, fitted to these rows.
        as_written: The model as written.
        refitted: The model with its curves fitted to these rows.
        unit: Number of the span that is one unit of an interval.
        used: Whether the row counts: it is not close to a change of the surface.

    """

    plain: Array
    as_written: Array
    refitted: Array
    unit: NDArray[np.int64]
    used: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class PartEvaluation:
    """A model on one surface, on one recording, or on all.

    Attributes:
        recording: Name of the recording; '' for all together.
        from_s: Start, s on the recording's clock.
        to_s: End, s on the recording's clock.
        samples: Number of rows.
        plain: RMSE of the plain curve.
        as_written: The model as written.
        refitted: The model with its curves refitted.

    """

    recording: str
    from_s: float
    to_s: float
    samples: int
    plain: float
    as_written: Comparison
    refitted: Comparison

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return asdict(self) | {
            "plain": {"rmse": self.plain},
            "as_written": self.as_written.to_dict(),
            "refitted": self.refitted.to_dict(),
        }


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A model on recordings or tables.

    Attributes:
        total: All rows together.
        recordings: Recording by recording.
        surfaces: Surface by surface.
        left_out: Number of rows in which the effects of the model have no finite value.

    """

    total: PartEvaluation
    recordings: tuple[PartEvaluation, ...]
    surfaces: tuple[PartEvaluation, ...]
    left_out: int = 0

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "total": self.total.to_dict(),
            "recordings": [part.to_dict() for part in self.recordings],
            "surfaces": [part.to_dict() for part in self.surfaces],
            "left_out": self.left_out,
        }

    def _repr_html_(self) -> str:
        rows = [
            (
                part.recording or "all",
                str(part.samples),
                f"{part.plain:.4g}",
                f"{part.as_written.rmse:.4g}",
                f"{part.refitted.rmse:.4g}",
            )
            for part in (*self.recordings, self.total)
        ]
        columns = ("recording", "samples", "plain", "as written", "refitted")
        return html_table("RMSE of the adhesion", columns, rows)


def evaluate(drives: Sequence[DriveData], model: ExtendedModel) -> Evaluation:
    """Evaluate a model.

    Args:
        drives: Drive data of recordings or tables, at least one row in all.
        model: Extended model.

    Raises:
        InputError: A drive lacks a channel that an effect of the model needs, or the effects have
            no finite value in any row.

    """
    used = [drive for drive in drives if len(drive)]
    for drive in used:
        require_effects_apply(model, drive)
    thin, left_out = _with_values(thin_drives(used), model)
    candidates, _ = build_candidates(used)
    data = build_regression_data(thin, [find_surface_changes(drive, candidates) for drive in thin])
    residuals = compute_residuals(data, model)
    clock = _clock(data)
    recordings, surfaces = [], []
    for place, drive in enumerate(thin):
        rows = residuals.used & (data.drive_number == place)
        recordings.append(_part(residuals, rows, clock, drive.name))
        surfaces += [
            _part(residuals, rows & (data.surface == number_of_surface), clock, drive.name)
            for number_of_surface in np.unique(data.surface[rows])
        ]
    return Evaluation(_total(data, residuals), tuple(recordings), tuple(surfaces), left_out)


def _clock(data: RegressionData) -> Array:
    """Time of each row on the clock of its recording, s; shape (n,)."""
    return np.concatenate([drive.time_s + drive.first_us / 1e6 for drive in data.drives])


def _total(data: RegressionData, residuals: ModelResiduals) -> PartEvaluation:
    """Figures of all rows; the units are recordings where there are some."""
    if len(data.drives) >= LEAST_RECORDINGS:
        residuals = replace(residuals, unit=data.drive_number)
    return _part(residuals, residuals.used, _clock(data), "")


def _with_values(
    drives: Sequence[DriveData], model: ExtendedModel
) -> tuple[tuple[DriveData, ...], int]:
    """Drives less the rows in which the model has no value, and the number of these rows."""
    data = build_regression_data(tuple(drives), [[] for _ in drives])
    with np.errstate(all="ignore"):
        curves = model_curves(model, data.surfaces)
        evaluated = evaluate_model(data, curves, model_effects(model))
        finite = np.isfinite(evaluated.slip) & np.isfinite(evaluated.residual)
    if finite.all():
        return tuple(drives), 0
    if not finite.any():
        raise InputError(
            model.where,
            f"its effects have no finite value in any of {len(finite)} rows",
            "correct the formula, or remove it from the model",
        )
    parts = zip(drives, data.split(finite), strict=True)
    kept = (drive.select_rows(rows) for drive, rows in parts)
    return tuple(drive for drive in kept if len(drive)), int((~finite).sum())


def evaluate_held_out(
    data: RegressionData, held: NDArray[np.bool_], model: ExtendedModel
) -> PartEvaluation:
    """A model on the drives that a diagnosis held out.

    Args:
        data: Rows of all drives of the diagnosis, with their surfaces.
        held: Whether each drive was held out, shape (drives,).
        model: Extended model.

    """
    surface = data.surface[held[data.drive_number]]
    known = np.unique(surface[surface != EXCLUDED])
    numbered = np.where(surface == EXCLUDED, EXCLUDED, np.searchsorted(known, surface))
    drives = tuple(drive for drive, out in zip(data.drives, held, strict=True) if out)
    held_data = RegressionData(drives, numbered, len(known))
    return _total(held_data, compute_residuals(held_data, model))


def compute_residuals(data: RegressionData, model: ExtendedModel) -> ModelResiduals:
    """Residuals of the plain curves and of a model on the rows of drives.

    Args:
        data: Rows of the drives, with their surfaces.
        model: Extended model, all of whose channels the drives have.

    """
    length_s = choose_block_length(data.drives)
    block = np.concatenate(number_blocks_of_drives(data.drives, length_s))
    prepared = prepare_regression(data, fit_start_curves(data), block, (), length_s)
    effects = model_effects(model)
    curves = model_curves(model, data.surfaces)
    refitted = fit_model(prepared.regression, Model(curves, fixed=effects)).model
    return ModelResiduals(
        evaluate_model(data, prepared.plain.model.curves).residual,
        evaluate_model(data, curves, effects).residual,
        evaluate_model(data, refitted.curves, effects).residual,
        block // HELD_BLOCKS,
        data.surface != EXCLUDED,
    )


def model_effects(model: ExtendedModel) -> tuple[ActiveEffect, ...]:
    """Effects and splines of a model; its curve is not among them."""
    return (*model.effects, *(ActiveEffect(spline, ()) for spline in model.splines))


def model_curves(model: ExtendedModel, surfaces: int) -> SegmentCurves:
    """The base curve of a model, for every surface."""
    if model.curve is None:
        return SegmentCurves.from_parameters(BURCKHARDT, np.tile(model.base, (surfaces, 1)))
    values = np.tile(model.curve.values, (surfaces, 1))
    return SegmentCurves.from_parameters(model.curve.family, values)


def require_effects_apply(model: ExtendedModel, drive: DriveData) -> None:
    """InputError where the data of a drive do not suffice for an effect of the model."""
    for active in model_effects(model):
        effect, requires = active.effect, active.effect.requires
        what = f"{effect.id} of the model"
        lacking = requires.lacks(drive.covariates)
        if lacking:
            raise InputError(
                drive.name, f"{what} needs {lacking}",
                "add the column or the signal, or remove the effect from the model",
            )  # fmt: skip
        if requires.wheel_speed and drive.table:
            raise InputError(drive.name, f"{what} needs the wheel speeds", "give the recording")
        if requires.all_efforts and drive.kinematics.efforts is None:
            raise InputError(
                drive.name, f"{what} needs the efforts of all axles",
                "give a recording that has them, or remove the effect from the model",
            )  # fmt: skip
        for needed, there, column in (
            (requires.speed, drive.has_speed, "speed_mps"),
            (requires.load, drive.has_load, "normal_load_N"),
        ):
            if needed and drive.table and not there:
                raise InputError(drive.name, f"{what} needs column {column!r}", "add the column")


def compare(residuals: ModelResiduals, of_model: Array, rows: NDArray[np.bool_]) -> Comparison:
    """A model beside the plain curve on some rows.

    Args:
        residuals: Residuals and units of all rows.
        of_model: Residuals of the model, shape (n,).
        rows: Rows that count, shape (n,).

    """
    before, after = residuals.plain[rows], of_model[rows]
    rmse_before, rmse = (float(np.sqrt(np.mean(residual**2))) for residual in (before, after))
    interval = gain_interval(before, after, residuals.unit[rows])
    percent = 100.0 * (1.0 - rmse / max(rmse_before, 1e-300))
    return Comparison(rmse, percent, interval, rmse_before)


def _part(
    residuals: ModelResiduals, rows: NDArray[np.bool_], clock: Array, name: str
) -> PartEvaluation:
    """Figures of some rows, at least one."""
    return PartEvaluation(
        name,
        float(clock[rows].min()),
        float(clock[rows].max()),
        int(rows.sum()),
        float(np.sqrt(np.mean(residuals.plain[rows] ** 2))),
        compare(residuals, residuals.as_written, rows),
        compare(residuals, residuals.refitted, rows),
    )
