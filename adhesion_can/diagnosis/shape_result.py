"""Results about the family of the base curve: its peak, the cause, families side by side."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.cause_result import Cause, ParameterValue
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.shape_finding import ScoredFamily, ShapeFinding
from adhesion_can.diagnosis.peak_spread import NO_SPREAD, PeakSpread
from adhesion_can.diagnosis.regression.model import RegressionData
from adhesion_can.diagnosis.regression.segment_curves import BURCKHARDT, SegmentCurves
from adhesion_can.diagnosis.regression.whitened_regression import FittedModel
from adhesion_can.diagnosis.result import FamilyResult, SegmentResult
from adhesion_can.estimation.curves.peak import nearest_burckhardt
from adhesion_can.estimation.identifiability import (
    IdentifiabilitySettings,
    assess_peak,
    require_fall,
)
from adhesion_can.physics.curves import Conditions
from adhesion_can.physics.effects.shape_factor import CURVE_SHAPE, CURVE_SHAPE_TITLE
from adhesion_can.physics.estimate import Estimate

SLIP_MAX = IdentifiabilitySettings().slip_max
STEP = 1e-4
"""Step of a numerical derivative by a coordinate."""
POINTS = 121
"""Points of a drawn curve."""


def find_conditions(data: RegressionData, surface: int) -> Conditions:
    """Mean speed and load of the rows of one surface; the load is NaN where it is not known."""
    rows = data.surface == surface
    rows = rows if rows.any() else np.ones(len(data), dtype=np.bool_)
    speed, load = (float(data.observed(name)[rows].mean()) for name in ("speed", "load"))
    known = all(drive.has_load for drive in data.drives)
    return Conditions(speed, load if known else np.nan)


def estimate_fitted_curve(
    estimate: Estimate,
    fitted: FittedModel,
    curves: SegmentCurves,
    surface: int,
    conditions: Conditions,
    reached: float,
    spread: PeakSpread = NO_SPREAD,
) -> Estimate:
    """Estimate of a curve of the regression: its peak, and the Burckhardt curve nearest to it.

    Standard deviations come from the scatter of the blocks.

    Args:
        estimate: Estimate of Burckhardt's curve from the same rows, which are taken as independent;
            the result for a surface that had no part in the fit.
        fitted: Fit of the curves, with their covariance.
        curves: Curves of all surfaces.
        surface: Number of the surface.
        conditions: Speed and load at which the peak is computed.
        reached: Slip ratio that the share `reach` of the settings of the rows exceeds.
        spread: Differences of the peak to that of a more flexible form.

    """
    surface_curve = curves.select(surface)
    size = curves.size
    place = slice(size * surface, size * (surface + 1))
    is_burckhardt = curves.family is BURCKHARDT
    if is_burckhardt and not (fitted.grams.total.diagonal()[place] > 0.0).all():
        return estimate
    covariance = fitted.covariance[place, place]

    def nearest(curves: SegmentCurves) -> Array:
        if is_burckhardt:
            return np.array(curves.parameters[0])
        return np.array(nearest_burckhardt(curves.family, curves.parameters[0], conditions))

    def peak(curves: SegmentCurves) -> Array:
        top = curves.peak(0, conditions, SLIP_MAX)
        return np.array([float(top.mu_max), float(top.lambda_m)])

    mu_max, lambda_m = peak(surface_curve).tolist()
    peak_covariance = _propagate(surface_curve, covariance, peak)
    mu_std, lambda_std = np.sqrt(np.maximum(peak_covariance.diagonal(), 0.0)).tolist()
    mu_std = float(np.hypot(mu_std, spread.mu_max * mu_max))
    lambda_std = float(np.hypot(lambda_std, spread.lambda_m * lambda_m))
    c1, c2, c3 = nearest(surface_curve).tolist()
    settings = IdentifiabilitySettings()
    fitted_estimate = replace(
        estimate,
        c1=c1,
        c2=c2,
        c3=c3,
        covariance=_propagate(surface_curve, covariance, nearest),
        mu_max=mu_max,
        mu_max_std=mu_std,
        lambda_m=lambda_m,
        lambda_m_std=lambda_std,
        identifiable=assess_peak((mu_max, mu_std), (lambda_m, lambda_std), reached, settings),
    )
    return require_fall(fitted_estimate) if is_burckhardt else fitted_estimate


def _propagate(
    curves: SegmentCurves, covariance: Array, function: Callable[[SegmentCurves], Array]
) -> Array:
    """Covariance of a function of one curve's coordinates (delta method)."""
    columns = []
    for number in range(curves.size):
        ends = []
        for side in (1.0, -1.0):
            moved = curves.values.copy()
            moved[0, number] += side * STEP * max(abs(moved[0, number]), 1.0)
            ends.append(curves.with_values(moved))
        width = ends[0].values[0, number] - ends[1].values[0, number]
        columns.append((function(ends[0]) - function(ends[1])) / width)
    jacobian = np.stack(columns, axis=1)
    return np.asarray(jacobian @ covariance @ jacobian.T)


def build_shape_cause(
    shape: ShapeFinding, fitted: FittedModel, surface: int, segment: SegmentResult
) -> Cause:
    """The shape as a cause: the family's parameters, and the peak before and after.

    Args:
        shape: Finding of the shape.
        fitted: Fit of the extended model.
        surface: Number of the surface whose curve is given.
        segment: Estimates of Burckhardt's and of the extended model's curve of this surface.

    """
    curves = fitted.model.curves
    first = curves.size * surface
    std = np.sqrt(fitted.covariance.diagonal()[first : first + curves.size])
    std = std * curves.scales[surface]
    values = [
        ParameterValue(p.name, float(value), float(value_std), p.unit, p.meaning)
        for p, value, value_std in zip(
            shape.family.parameters, curves.parameters[surface], std, strict=True
        )
    ]
    for name, meaning in (
        ("mu_max", "adhesion at the peak"),
        ("lambda_m", "slip ratio of the peak"),
    ):
        for when, estimate in (("before", segment.base), ("after", segment.extended)):
            known = getattr(estimate.identifiable, name)
            curve = "Burckhardt's curve" if when == "before" else "this curve"
            values.append(
                ParameterValue(
                    f"{name}_{when}",
                    float(getattr(estimate, name)),
                    float(getattr(estimate, f"{name}_std")) if known else None,
                    "1",
                    f"{meaning} of {curve}",
                )
            )
    return Cause(
        CURVE_SHAPE,
        shape.family.name,
        CURVE_SHAPE_TITLE,
        shape.family.literature,
        tuple(values),
        shape.p_value,
        shape.rivals,
    )


def build_family_results(findings: Findings, surface: int) -> tuple[FamilyResult, ...]:
    """Curve families side by side, Burckhardt's first.

    Args:
        findings: Findings with the fits of all families.
        surface: Number of the surface whose curves are drawn.

    """
    data = findings.regression.data
    conditions = find_conditions(data, surface)
    reached = np.abs(data.observed("slip")[data.surface == surface]).max(initial=0.0)
    slip = np.linspace(0.0, float(reached) or 0.2, POINTS)
    chosen = findings.selection.best.model.curves.family.name
    return tuple(
        _build_family_result(scored, surface, conditions, slip, chosen=scored.family.name == chosen)
        for scored in findings.families
    )


def _build_family_result(
    scored: ScoredFamily, surface: int, conditions: Conditions, slip: Array, *, chosen: bool
) -> FamilyResult:
    curves = scored.scored.model.curves
    values = curves.parameters[surface]
    top = curves.peak(surface, conditions, SLIP_MAX)
    return FamilyResult(
        family=scored.family.name,
        title=scored.family.title,
        parameters=curves.size,
        held_out_rmse=scored.held_out_rmse,
        rmse=scored.scored.rmse,
        mu_max=float(top.mu_max),
        lambda_m=float(top.lambda_m) if bool(top.interior) else None,
        chosen=chosen,
        slip=slip,
        adhesion=scored.family.adhesion(slip, values, conditions),
    )
