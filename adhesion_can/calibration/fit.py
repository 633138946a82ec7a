"""Wheel radii, and zero error and delay of the vehicle speed, from coasting.

A wheel that transmits no force rolls without slip. So while axle i coasts

    v(t) = r_i ω_i(t) + o − τ a(t) + e(t)

with the measured vehicle speed v, its zero error o, its delay τ and the acceleration a of the
vehicle; e is an error that all axles share and that is correlated over seconds. The radii are
relative to the vehicle speed: a scale error of it is indistinguishable from one of all radii.

All r_i, o and τ are fitted together by Huber's M-estimator (Huber, Ann. Math. Statist. 35 (1964)
73-101) by iteratively reweighted least squares: weights k·s/|e| beyond k·s, s from the median
absolute residual. Short slides have little influence on it. Standard errors come from deleting one
block of several seconds at a time (block jackknife; Künsch, Ann. Statist. 17 (1989) 1217-1241),
since standard errors per sample would treat a correlated error as many independent ones. o and τ
are estimated only where they are identifiable: in a drive at one speed o is a part of every radius.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from math import inf, sqrt
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.calibration.coasting import (
    SOFTEST_CONTACT,
    CalibrationSettings,
    CoastingDrive,
    CoastingRows,
    CoastingTimes,
    find_coasting,
    join_coasting,
)
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.result_text import html_table, plus_minus

_SMALLEST_SCALE = 1e-6
"""Least scale of the residuals, m/s; keeps Huber's weights above 0 without any noise."""

_SINGULAR = 1e10
"""Condition number of the scaled normal equations beyond which they are not solved."""


@dataclass(frozen=True, slots=True)
class CalibratedQuantity:
    """Estimate of one quantity.

    Attributes:
        value: Estimate, in the quantity's unit.
        std: Standard error, in the quantity's unit.
        interval: 95 % interval by Student's t over the blocks, in the quantity's unit.

    """

    value: float
    std: float
    interval: tuple[float, float]


@dataclass(frozen=True, slots=True)
class AxleRadius:
    """Radius of one axle from coasting.

    Attributes:
        axle: Number of the axle, from 1.
        configured: Configured radius, m.
        estimate: Estimated radius, m; None: too little coasting.
        coasting_s: Total duration of its coasting, s.
        blocks: Number of blocks with coasting.

    """

    axle: int
    configured: float
    estimate: CalibratedQuantity | None
    coasting_s: float
    blocks: int

    @property
    def ratio(self) -> float:
        """Estimated over configured radius; 1 where it is not estimated."""
        return 1.0 if self.estimate is None else self.estimate.value / self.configured


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Result of a calibration.

    Attributes:
        axles: Radii of the axles with a wheel speed, in their order.
        offset: Zero error of the vehicle speed, m/s, true = measured − offset; None: not
            identifiable, and the radii hold for an offset of 0.
        delay: Delay of the vehicle speed against the wheels, s; None: not identifiable, or known.
        delay_used_s: Delay for which the radii hold, s.
        offset_std: Standard error that an estimated offset would have, m/s; inf: unbounded.
        delay_std: Standard error that an estimated delay would have, s; inf: unbounded.
        noise_std: Standard deviation of the vehicle speed against the wheels, m/s, from the median
            absolute residual.
        outliers: Share of the samples with a weight below a half.
        effort_known: Whether coasting was detected from effort; otherwise from steady speed alone,
            and the slip of traction is a part of the radii.
        speed_range: Lowest and highest vehicle speed used, m/s.
        mean_speed: Mean vehicle speed, m/s.
        mean_acceleration: Mean acceleration of the vehicle, m/s².
        systematic_percent: Bound of the radii's systematic error by the creep left while coasting,
            %; None where coasting was not detected from effort.
        times: Time that each condition of coasting leaves.

    """

    axles: tuple[AxleRadius, ...]
    offset: CalibratedQuantity | None
    delay: CalibratedQuantity | None
    delay_used_s: float
    offset_std: float
    delay_std: float
    noise_std: float
    outliers: float
    effort_known: bool
    speed_range: tuple[float, float]
    mean_speed: float
    mean_acceleration: float
    systematic_percent: float | None
    times: CoastingTimes

    def to_dict(self, rim_speed_axles: Collection[int] = ()) -> dict[str, Any]:
        """Radii and errors of the vehicle speed, as JSON has them.

        Quantities that are not identifiable are None.

        Args:
            rim_speed_axles: Axles whose wheel speed is sent as speed of the rim, so that its factor
                is corrected and not the radius.

        """
        return {
            "axles": [
                {
                    "axle": axle.axle,
                    "configured_m": axle.configured,
                    "radius_m": _quantity(axle.estimate)
                    if axle.estimate
                    else {"value": axle.configured, "std": None, "interval": None},
                    "change_percent": 100 * (axle.ratio - 1) if axle.estimate else None,
                    "coasting_s": axle.coasting_s,
                    "blocks": axle.blocks,
                    "corrected_by": "factor" if axle.axle in rim_speed_axles else "wheel_radius_m",
                }
                for axle in self.axles
            ],
            "offset_mps": _quantity(self.offset),
            "delay_s": _quantity(self.delay),
            "relative_to": "vehicle speed",
            "coasting_told_by": "tractive effort" if self.effort_known else None,
            "systematic_percent": self.systematic_percent,
            "noise_std_mps": self.noise_std,
            "outliers_percent": 100 * self.outliers,
        }

    def _repr_html_(self) -> str:
        rows = [
            (
                str(axle.axle),
                f"{axle.configured:.4f}",
                plus_minus(
                    None if axle.estimate is None else axle.estimate.value,
                    None if axle.estimate is None else axle.estimate.std,
                ),
                f"{axle.coasting_s:.1f}",
            )
            for axle in self.axles
        ]
        columns = ("axle", "configured m", "radius m", "coasting s")
        return html_table("Wheel radii, ± standard error", columns, rows)


def _quantity(quantity: CalibratedQuantity | None) -> dict[str, Any]:
    if quantity is None:
        return {"value": None, "std": None, "interval": None}
    return {"value": quantity.value, "std": quantity.std, "interval": list(quantity.interval)}


def calibrate(
    drives: Sequence[CoastingDrive], vehicle: Locomotive, settings: CalibrationSettings
) -> Calibration:
    """Radii from the coasting of one or more drives.

    Args:
        drives: Signals of the drives, at least one, all with the same axles.
        vehicle: Vehicle with the configured radii, the loads and the wheelsets' inertia.
        settings: Definition of coasting, and limits of the estimates.

    Returns:
        Calibration; no axle has an estimate where none coasts for long enough.

    """
    axles = sorted(drives[0].wheel_speed)
    configured = np.array([vehicle.wheel_radius[axle - 1] for axle in axles])
    rows = join_coasting([find_coasting(drive, axles, vehicle, settings) for drive in drives])
    coasting_s = rows.span @ rows.used
    blocks = [len(np.unique(rows.block[column])) for column in rows.used.T]
    enough = (coasting_s >= settings.coasting_min_s) & (np.array(blocks) >= settings.blocks_min)
    effort_known = any(drive.effort for drive in drives)
    fit, offset_std, delay_std = (
        _fit_identifiable(rows, enough, settings) if enough.any() else (None, inf, inf)
    )
    place = np.cumsum(enough) - 1
    moving = rows.used.any(axis=1)
    v, a = rows.speed[moving], rows.acceleration[moving]
    return Calibration(
        axles=tuple(
            AxleRadius(
                axle,
                float(configured[i]),
                fit.quantity(int(place[i])) if fit and enough[i] else None,
                float(coasting_s[i]),
                blocks[i],
            )
            for i, axle in enumerate(axles)
        ),
        offset=fit.quantity(fit.offset) if fit and fit.offset is not None else None,
        delay=fit.quantity(fit.delay) if fit and fit.delay is not None else None,
        delay_used_s=float(fit.values[fit.delay])
        if fit and fit.delay is not None
        else settings.delay_s or 0.0,
        offset_std=offset_std,
        delay_std=delay_std,
        noise_std=fit.scale if fit else inf,
        outliers=fit.outliers if fit else 0.0,
        effort_known=effort_known,
        speed_range=(float(v.min(initial=inf)), float(v.max(initial=-inf))),
        mean_speed=float(v.mean()) if len(v) else 0.0,
        mean_acceleration=float(a.mean()) if len(a) else 0.0,
        systematic_percent=100 * settings.adhesion_max / SOFTEST_CONTACT if effort_known else None,
        times=rows.times,
    )


@dataclass(frozen=True, slots=True)
class _Fit:
    """Robust fit of the radii, then offset and delay where they are fitted.

    Attributes:
        values: Estimates, m, m/s and s, shape (p,).
        stds: Standard errors, in the same units, shape (p,).
        freedom: Degrees of freedom of each, blocks less one.
        offset: Index of the offset; None where it is not fitted.
        delay: Index of the delay; None where it is not fitted.
        scale: Robust standard deviation of the residuals, m/s.
        outliers: Share of the samples with a weight below a half.

    """

    values: Array
    stds: Array
    freedom: Sequence[int]
    offset: int | None
    delay: int | None
    scale: float
    outliers: float

    def std(self, i: int | None) -> float:
        return inf if i is None else float(self.stds[i])

    def quantity(self, i: int) -> CalibratedQuantity:
        value, std = float(self.values[i]), float(self.stds[i])
        reach = float(scipy.special.stdtrit(self.freedom[i], 0.975)) * std
        return CalibratedQuantity(value, std, (value - reach, value + reach))


def _fit_identifiable(
    rows: CoastingRows, enough: NDArray[np.bool_], settings: CalibrationSettings
) -> tuple[_Fit | None, float, float]:
    """Fit with offset and delay, repeated without those that are not identifiable.

    Where acceleration is proportional to speed the two are collinear, and neither is.

    Returns:
        Fit, and the standard errors of offset, m/s, and delay, s, when both are fitted; inf:
        unbounded.

    """
    unknown = settings.delay_s is None
    full = _fit(rows, enough, settings, offset=True, delay=unknown)
    if full is None:  # nothing accelerates
        full = _fit(rows, enough, settings, offset=True, delay=False)
    offset_std = full.std(full.offset) if full else inf
    delay_std = full.std(full.delay) if full else inf
    offset = offset_std <= settings.offset_std_max
    delay = unknown and delay_std <= settings.delay_std_max
    if full is None or not offset or delay is not (full.delay is not None):
        full = _fit(rows, enough, settings, offset=offset, delay=delay)
    return full, offset_std, delay_std


def _fit(
    rows: CoastingRows,
    enough: NDArray[np.bool_],
    settings: CalibrationSettings,
    *,
    offset: bool,
    delay: bool,
) -> _Fit | None:
    """Huber's M-estimate and its block jackknife; None where the equations are singular."""
    row, axle = np.nonzero(rows.used[:, enough])
    count = int(enough.sum())
    speed, acceleration, block = rows.speed[row], rows.acceleration[row], rows.block[row]
    radii = np.zeros((len(row), count))
    radii[np.arange(len(row)), axle] = rows.rolling[:, enough][row, axle]
    extra = ([np.ones(len(row))] if offset else []) + ([-acceleration] if delay else [])
    X = np.column_stack([radii, *extra])
    y = speed + (settings.delay_s or 0.0) * acceleration
    size = np.sqrt(np.mean(X * X, axis=0))
    if not (size > 0).all():
        return None
    X /= size
    weight = np.ones(len(y))
    scale, beta = inf, np.zeros(X.shape[1])
    for _ in range(50):
        solved = _solve(X.T @ (weight[:, None] * X), X.T @ (weight * y))
        if solved is None:
            return None
        done = bool(np.max(np.abs(solved - beta)) <= 1e-9 * np.max(np.abs(solved)))
        beta = solved
        if done:
            break
        error = np.abs(y - X @ beta)
        scale = max(1.4826 * float(np.median(error)), _SMALLEST_SCALE)
        weight = np.minimum(1.0, settings.huber * scale / np.maximum(error, scale * 1e-3))
    return _Fit(
        values=beta / size,
        stds=_jackknife(X, y - X @ beta, weight, block) / size,
        freedom=[len(np.unique(block[axle == i])) - 1 for i in range(count)]
        + [len(np.unique(block)) - 1] * len(extra),
        offset=count if offset else None,
        delay=count + offset if delay else None,
        scale=scale,
        outliers=float(np.mean(weight < 0.5)),
    )


def _solve(normal: Array, right: Array) -> Array | None:
    if not np.linalg.cond(normal) < _SINGULAR:
        return None
    return np.asarray(np.linalg.solve(normal, right))


def _jackknife(X: Array, error: Array, weight: Array, block: NDArray[np.int64]) -> Array:
    """Standard errors by the block jackknife, shape (p,); inf where a block cannot be left out.

    The fit without a block is one Newton step from the whole fit, in which samples on the flat
    part of Huber's loss have no curvature: Δβ = −(Σ ψ' x xᵀ)⁻¹ Σ_block ψ x.

    Args:
        X: Scaled regressors, shape (n, p).
        error: Residual of each row, m/s, shape (n,).
        weight: Huber's weight of each row, 1 on the quadratic part, shape (n,).
        block: Number of each row's block, ascending, shape (n,).

    """
    starts = np.flatnonzero(np.diff(block, prepend=-1))
    parts = [slice(a, b) for a, b in zip(starts, [*starts[1:], len(block)], strict=True)]
    inner = (weight == 1.0)[:, None] * X
    curvatures = np.array([X[part].T @ inner[part] for part in parts])
    scores = np.array([X[part].T @ (weight * error)[part] for part in parts])
    whole = curvatures.sum(axis=0)
    steps = [
        _solve(whole - curvature, -score)
        for curvature, score in zip(curvatures, scores, strict=True)
    ]
    solved = [step for step in steps if step is not None]
    count = len(parts)
    if len(solved) < count or count < 2:
        return np.full(X.shape[1], inf)
    spread = np.array(solved) - np.mean(solved, axis=0)
    return np.asarray(sqrt((count - 1) / count) * np.sqrt(np.sum(spread**2, axis=0)))
