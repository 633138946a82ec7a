"""Results of the functions for one recording as values of columns."""

from array import array
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from statistics import median
from typing import Any

from adhesion_can.calibration.fit import AxleRadius, Calibration
from adhesion_can.diagnosis.cause_result import Cause
from adhesion_can.diagnosis.result import Diagnosis
from adhesion_can.estimation.batch_result import BatchResult
from adhesion_can.fleet.calibrated_radii import AppliedRadii
from adhesion_can.fleet.schema import doubt_column, status_column
from adhesion_can.offline.check import CheckResult
from adhesion_can.offline.check_table import TableCheck
from adhesion_can.offline.extract_samples import UPDATE_US
from adhesion_can.physics.doubt import DESCRIPTIONS, Doubt
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.status import Status
from adhesion_can.recordings.tables.sample_table import POSITION
from adhesion_can.service.outputs import Outputs

Row = dict[str, Any]
"""Values of a row by column; a column that is missing is null."""

_MEDIANS = ("mu_max", "mu_max_std", "lambda_m", "lambda_m_std")


def number(value: float | None) -> float | None:
    """A number as a table has it: None where it is not finite."""
    return None if value is None or not isfinite(value) else float(value)


def check_fields(result: CheckResult | TableCheck, problems: Sequence[str] = ()) -> Row:
    """Columns of `check`.

    Args:
        result: Result of the check.
        problems: Further failures: what was passed over while the file was read.

    """
    failures = [*result.failures, *problems]
    fields: Row = {
        "usable": not failures,
        "failures": len(failures),
        "warnings": len(result.warnings),
        "first_failure": failures[0] if failures else None,
    }
    if isinstance(result, CheckResult):
        fields["frames_rejected"] = result.receiver.rejected
        fields["frames_lost"] = result.receiver.lost
    return fields


def calibration_fields(result: Calibration, applied: AppliedRadii) -> Row:
    """Columns of `calibrate`: lists by axle from 1, with None at an axle without a value."""
    axles = {radius.axle: radius for radius in result.axles}

    def listed(value: Callable[[AxleRadius], float | None]) -> list[float | None]:
        """A value of each axle; of axles without a wheel speed there is none."""
        places = range(1, max(axles, default=0) + 1)
        return [number(value(axles[axle])) if axle in axles else None for axle in places]

    return {
        "wheel_radii_m": listed(
            lambda axle: None if axle.estimate is None else axle.estimate.value
        ),
        "wheel_radii_std_m": listed(
            lambda axle: None if axle.estimate is None else axle.estimate.std
        ),
        "wheel_radii_configured_m": listed(lambda axle: axle.configured),
        "coasting_s": listed(lambda axle: axle.coasting_s),
        "wheel_radii_applied": bool(applied.ratio),
        "wheel_radii_used_m": listed(
            lambda axle: axle.configured * applied.ratio.get(axle.axle, 1.0)
        ),
        "wheel_radii_note": applied.note or None,
        "speed_offset_mps": None if result.offset is None else number(result.offset.value),
    }


class SetpointStatistics:
    """What the setpoints of a replay say, without keeping them."""

    def __init__(self) -> None:
        self._by_status: Counter[Status] = Counter()
        self._by_doubt: Counter[Doubt] = Counter()
        self._tracking: Mapping[str, array[float]] = {name: array("d") for name in _MEDIANS}

    def add(self, _t_us: int, outputs: Outputs) -> None:
        """Add the setpoint of a due time."""
        self._by_status[outputs.status] += 1
        self._by_doubt[outputs.doubt] += 1
        if outputs.status is Status.TRACKING:
            point = outputs.setpoint
            values = (point.mu_max, outputs.mu_max_std, point.lambda_m, outputs.lambda_m_std)
            for name, value in zip(_MEDIANS, values, strict=True):
                if value is not None and isfinite(value):
                    self._tracking[name].append(value)

    def fields(self) -> Row:
        """Columns of `replay`; no shares where there is no setpoint."""
        count = self._by_status.total()
        fields: Row = {
            "setpoints": count,
            "tracking_s": self._by_status[Status.TRACKING] * UPDATE_US / 1e6,
        }
        if count:
            fields |= {status_column(status): self._by_status[status] / count for status in Status}
            fields |= {doubt_column(doubt): self._by_doubt[doubt] / count for doubt in DESCRIPTIONS}
        return fields | {
            name: float(median(values)) if values else None
            for name, values in self._tracking.items()
        }


def segment_rows(
    result: BatchResult, position: Callable[[int, int], tuple[float | None, float | None]]
) -> list[Row]:
    """Rows of `segments`.

    Args:
        result: Batch fit.
        position: Function from the first and last stamp of a segment, µs, to its latitude and
            longitude, °.

    """
    return [
        {
            "segment": place,
            "from_s": segment.from_us / 1e6,
            "to_s": segment.to_us / 1e6,
            **dict(zip(POSITION, position(segment.from_us, segment.to_us), strict=True)),
            **_curve(segment.estimate),
            "directions_agree": segment.directions.agree,
        }
        for place, segment in enumerate(result.segments, start=1)
    ]


def _curve(estimate: Estimate) -> Row:
    document = estimate.to_dict()
    return {
        "samples": estimate.samples,
        "mu_max": number(estimate.mu_max),
        "mu_max_std": document["mu_max"]["std"],
        "lambda_m": number(estimate.lambda_m),
        "lambda_m_std": document["lambda_m"]["std"],
        "c1": number(estimate.c1),
        "c2": number(estimate.c2),
        "c3": number(estimate.c3),
        "noise_std": number(estimate.noise_std),
    }


def diagnosis_fields(diagnosis: Diagnosis) -> Row:
    """Columns of `diagnose`."""
    fields: Row = {
        "verdict": diagnosis.verdict.value,
        "conclusive": diagnosis.conclusive,
        "causes": [cause.effect for cause in diagnosis.causes],
        "channel": diagnosis.channel,
    }
    gain = diagnosis.gain
    if gain is None:
        return fields
    low, high = gain.interval
    return fields | {
        "rmse_before": number(gain.rmse_before),
        "rmse_after": number(gain.rmse_after),
        "noise_floor": number(gain.noise_floor),
        "gain_percent": number(gain.percent),
        "gain_low_percent": number(low),
        "gain_high_percent": number(high),
    }


def cause_rows(diagnosis: Diagnosis) -> list[Row]:
    """Rows of `causes`: named effects in their order, then the others that were tested."""
    rows: dict[str, Row] = {
        cause.effect: _named(cause, rank) for rank, cause in enumerate(diagnosis.causes, start=1)
    }
    for evidence in diagnosis.evidence:
        row = rows.setdefault(evidence.effect, {"effect": evidence.effect, "named": False})
        alike, cosine = evidence.most_similar
        tested = {
            "form": evidence.form,
            "axle": evidence.axle,
            "statistic": number(evidence.statistic),
            "p_value": number(evidence.p_value),
            "absorbed": number(evidence.absorbed),
            "most_alike": alike,
            "cosine": number(cosine),
            "gain_percent": number(evidence.gain_percent),
        }
        row |= {name: value for name, value in tested.items() if name not in row}
    return list(rows.values())


def _named(cause: Cause, rank: int) -> Row:
    values = cause.parameters
    axle = next((int(parameter.value) for parameter in values if parameter.name == "axle"), None)
    return {
        "effect": cause.effect,
        "form": cause.form,
        **({} if axle is None else {"axle": axle}),
        "named": True,
        "rank": rank,
        "p_value": number(cause.p_value),
        "parameters": [parameter.name for parameter in values],
        "values": [number(parameter.value) for parameter in values],
        "stds": [number(parameter.std) for parameter in values],
        "parameter_units": [parameter.unit for parameter in values],
        "rivals": list(cause.rivals),
    }
