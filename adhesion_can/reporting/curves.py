"""Comparison of curve families as tables and sentences for a terminal."""

from math import exp, isfinite

from adhesion_can.estimation.batch_result import BatchResult, Segment
from adhesion_can.estimation.curves.fit import FittedCurve
from adhesion_can.estimation.curves.hold_out import LEAST_SAMPLES
from adhesion_can.estimation.curves.result import (
    COLUMNS,
    COMMON_ADHESION,
    COMMON_SLIP,
    CurveComparison,
)
from adhesion_can.estimation.rail_peak import BURCKHARDT, RailPeak
from adhesion_can.physics.curves import FAMILIES
from adhesion_can.reporting.text import FittingTable
from adhesion_can.result_text import HELD_OUT_RMSE, TimeScale, plus_minus

SCORE_NOTE = (
    f"{HELD_OUT_RMSE}: RMSE of the whitened residuals there, in standard deviations σ of the "
    "noise; smaller is better. Weights follow from the log density, which also counts how well a "
    "family states its noise."
)
"""Meaning of the scores of families."""
CREEP_SPEED = 1.0
"""Creep speed for which the fall of the friction is stated, m/s."""


def family_lines(result: BatchResult) -> list[str]:
    """Which curve families hold: one line, or one for each segment that differs from the others."""
    said: dict[str, list[Segment]] = {}
    for segment, rail in zip(result.segments, result.rails, strict=False):
        known = segment.estimate.identifiable
        if rail is not None and rail.burckhardt_holds and not (known.mu_max or known.lambda_m):
            continue  # slips that show no peak contradict no family
        if rail is not None:
            text = rail.sentence
        elif segment.directions.sentence:
            continue
        else:
            text = (
                f"Curve families are not compared: fewer than {LEAST_SAMPLES} samples with a speed."
            )
        said.setdefault(text, []).append(segment)
    if len(result.segments) == 1:
        return list(said)
    if [len(segments) for segments in said.values()] == [len(result.segments)]:
        return [f"On all surfaces: {text}" for text in said]
    return [
        f"{', '.join(result.times.span(s.from_us, s.to_us) for s in segments)} s: {text}"
        for text, segments in said.items()
    ]


def render_curves(result: BatchResult) -> list[FittingTable | str]:
    """Table and sentences for each segment whose families were compared."""
    alone = len(result.segments) == 1
    rails = result.rails or (None,) * len(result.segments)
    parts = [
        part
        for segment, rail, comparison in zip(result.segments, rails, result.curves, strict=False)
        for part in _render_comparison(
            comparison, "" if alone else _span(result.times, segment), rail
        )
    ]
    if alone or not result.curves:
        return parts
    return [
        *parts,
        *_render_comparison(result.whole_curves, ", all surfaces together"),
        *_judge_changes(result),
    ]


def _span(times: TimeScale, segment: Segment) -> str:
    return f", {times.span(segment.from_us, segment.to_us)} s"


def _judge_changes(result: BatchResult) -> list[str]:
    """Whether one curve of another family does what Burckhardt curves of the segments do."""
    together, plain = result.whole_curves, FAMILIES["burckhardt"].name
    densities = [
        (c.samples, s.log_density)
        for c in result.curves
        if c is not None
        for s in c.families
        if s.fit.family.name == plain
    ]
    if together is None or len(densities) < len(result.segments):
        return []
    best = together.families[0]
    apart = sum(n * density for n, density in densities) / sum(n for n, _ in densities)
    name = best.fit.family.name
    if best.log_density < apart or name == plain:
        return []
    sentence = (
        f"A single {name} curve predicts held-out samples better than one {plain} curve for each "
        f"surface, by {best.log_density - apart:.4f} in log density a sample, so the surface may "
        "not have changed."
    )
    return [sentence]


def _render_comparison(
    comparison: CurveComparison | None, where: str, rail: RailPeak | None = None
) -> list[FittingTable | str]:
    if comparison is None:
        return [f"Curve families{where}: fewer than {LEAST_SAMPLES} samples, none compared."]
    rows = [row[:-1] for row in comparison.rows()]
    title = f"Curve families{where}, {comparison.samples} samples"
    parts: list[FittingTable | str] = [FittingTable(title, COLUMNS[:-1], rows)]
    parts += [
        f"{scored.fit.family.name}: {_parameters(scored.fit)}" for scored in comparison.families
    ]
    parts.append(f"Held out: {comparison.held_out}. {SCORE_NOTE}")
    if len(comparison.families) > 1:
        parts.append(_verdict(comparison, rail))
    parts += [
        _describe_polach(s.fit) for s in comparison.families if s.plausible and _is_physical(s.fit)
    ]
    return parts


def _parameters(fit: FittedCurve) -> str:
    return ", ".join(
        f"{p.name} {value:.4g}{'' if p.unit == '1' else ' ' + p.unit}"
        for p, value in zip(fit.family.parameters, fit.values, strict=True)
    )


def _verdict(comparison: CurveComparison, rail: RailPeak | None) -> str:
    mu_std, lambda_std = comparison.rail_std
    names = comparison.plausible
    fits = (
        f"{names[0]} predicts held-out samples better than the others, for certain."
        if len(names) == 1
        else f"The data cannot distinguish {', '.join(names[:-1])} and {names[-1]}."
    )
    if rail is not None and rail.burckhardt_holds and BURCKHARDT not in names:
        fits += " Its peak agrees with that of burckhardt, which the last line has."
    peak = (
        f"{plus_minus(comparison.mu_max, mu_std)} at a slip of "
        f"{plus_minus(comparison.lambda_m, lambda_std if isfinite(lambda_std) else None)}"
    )
    return (
        f"{fits} Peak of the surface at {comparison.speed:.1f} m/s: {peak}; the errors include "
        f"{COMMON_SLIP:g} of slip and {100 * COMMON_ADHESION:g} % of adhesion that all samples "
        "share."
    )


def _is_physical(fit: FittedCurve) -> bool:
    """Whether the values of a curve in Polach's form have their physical meaning."""
    return fit.family.name == FAMILIES["polach"].name and bool(isfinite(float(fit.conditions.load)))


def _describe_polach(fit: FittedCurve) -> str:
    values = dict(zip((p.name for p in fit.family.parameters), fit.values, strict=True))
    start = 50.0 * (values["kA"] + values["kS"])
    left = values["A"] + (1.0 - values["A"]) * exp(-values["B"] * CREEP_SPEED)
    return (
        f"In Polach's form, the curve starts with {start:.0f} % of the stiffness of a clean "
        f"contact, and friction falls by {100 * (1 - left):.0f} % at {CREEP_SPEED:g} m/s of "
        "creep."
    )
