"""An experiment's results for people and programs: table, page, JSON and CSV."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.registry import DEFAULT
from adhesion_can.experiments.figures_of_merit import (
    EstimatorResult,
    FiguresOfMerit,
    NoiseLevelResult,
    bound_slip,
    compute_figures,
    mean,
    quartiles,
    rms,
)
from adhesion_can.experiments.runs import ALL_DATA, ONE_SAMPLE
from adhesion_can.experiments.simulated_data import MU_MAX, QUANTITIES, SURFACES, with_peak
from adhesion_can.reporting.experiment_figures import figures
from adhesion_can.reporting.experiment_style import PAPERS_OWN
from adhesion_can.reporting.page import Page, Table, Text

BOUND = "Cramér-Rao bound"
TITLES: Mapping[int, str] = {
    1: "one surface, data in sequence",
    2: "a switching surface, ordinary differential evolution",
    3: "a switching surface, the paper's modified differential evolution",
}
"""Title of each experiment's page."""

CSV_COLUMNS = ("estimator", "noise_std", "run", "quantity", "value")
ORDINARY, SUMMED = "paper (ordinary)", "paper (sum)"


def merit_table(outcome: NoiseLevelResult) -> Table:
    """Table of all estimators at one noise level, the smallest error of μ_max first."""
    return _sequence_table(outcome) if outcome.experiment.ramp else _block_table(outcome)


def _ranked(outcome: NoiseLevelResult) -> list[tuple[EstimatorResult, FiguresOfMerit]]:
    pairs = [(r, compute_figures(r, outcome)) for r in outcome.results if not r.is_late]
    return sorted(pairs, key=lambda pair: (pair[1].rmse[MU_MAX], pair[0].name))


def late_estimators(outcome: NoiseLevelResult) -> str:
    """Sentence on the estimators without an estimate before the end; empty where there are none."""
    names = [r.name for r in outcome.results if r.is_late]
    if not names:
        return ""
    return f"No estimate before the end of the {outcome.experiment.updates} updates: " + ", ".join(
        names
    )


def _block_table(outcome: NoiseLevelResult) -> Table:
    experiment, bound = outcome.experiment, rms(outcome.bound, 0)
    rows = [(bound[MU_MAX], (BOUND, "-", *map(_sig, bound), "-", "-", "-", "-"))]
    for result, m in _ranked(outcome):
        samples = m.samples_needed
        cells = (
            result.name,
            str(result.runs),
            *map(_sig, m.rmse),
            _sig(m.rmse_steady[MU_MAX]),
            _count(_median(m.blocks_needed)),
            "-" if samples is None else _count(_median(samples)),
            _sig(m.update_ms),
        )
        rows.append((m.rmse[MU_MAX], cells))
    return Table(
        f"Experiment {experiment.number}, noise sd {outcome.noise_std:g}: root mean square "
        "error over all blocks and runs",
        ("estimator", "runs", *QUANTITIES, "mu_max*", "blocks", "samples", "ms"),
        [cells for _, cells in sorted(rows, key=lambda row: row[0])],
        "oracle: the tracker that knows when the surface changes. mu_max*: without the first block "
        "after each switch. blocks, samples: after a switch "
        "until mu_max is within 5 % and stays there, median over runs and switches; samples with "
        f"updates of {experiment.detail}, until {experiment.detail_after} blocks after "
        f"the switch, in the first {experiment.detail_runs} runs. ms: median time of an "
        f"update of {experiment.block} samples, measured in these runs, the machine's noise "
        f"in it. {BOUND}: of all samples since the last switch.",
    )


def _sequence_table(outcome: NoiseLevelResult) -> Table:
    experiment, end = outcome.experiment, outcome.bound[-1]
    slips = bound_slip(outcome)
    rows = [(end[MU_MAX], (BOUND, "-", *map(_slip, slips), _sig(end[MU_MAX]), "-"))]
    for result, m in _ranked(outcome):
        low, middle, high = m.slip_quartiles
        cells = [
            _slip(middle[q]) if q >= 3 else _with_quartiles(low[q], middle[q], high[q])
            for q in range(len(QUANTITIES))
        ]
        cells += [_sig(m.rmse[MU_MAX]), _sig(m.update_ms)]
        rows.append((m.rmse[MU_MAX], (result.name, str(result.runs), *cells)))
    note = (
        "Slip: where each value is within 10 % and stays there, median (quartiles) over the "
        "runs; an open quartile: never. "
        "end: root mean square error of mu_max after the last sample. ms: median time of an "
        f"update of one sample, the machine's noise in it. {BOUND}: where its standard deviation "
        f"falls below 10 %. {late_estimators(outcome)}"
    )
    return Table(
        f"Experiment {experiment.number}, noise sd {outcome.noise_std:g}: slip at which the "
        "values are found",
        ("estimator", "runs", *QUANTITIES, "end", "ms"),
        [cells for _, cells in sorted(rows, key=lambda row: row[0])],
        note.strip(),
    )


# ------------------------------------------------------------------------------------ verdict


def verdict(outcome: NoiseLevelResult) -> list[str]:
    """Main results at one noise level, one sentence each."""
    merits = {r.name: m for r, m in _ranked(outcome)}
    papers_own = PAPERS_OWN[outcome.experiment.number]
    others = [name for name in merits if name != "oracle"]
    if not others:
        return []
    best, level = others[0], f"Noise sd {outcome.noise_std:g}"
    errors = {name: m.rmse[MU_MAX] for name, m in merits.items()}
    limit = outcome.bound[-1, MU_MAX] if outcome.experiment.ramp else rms(outcome.bound, 0)[MU_MAX]
    when = "at the end " if outcome.experiment.ramp else ""
    first = (
        f"{level}: {best} has the smallest error of the maximum adhesion {when}"
        f"(RMSE {_sig(errors[best])}; {BOUND} {_sig(limit)})"
    )
    if papers_own in errors and papers_own != best:
        times = errors[papers_own] / errors[best]
        much = f"{times:.1f} times as large" if times >= 1.05 else "hardly larger"
        first += f"; that of {papers_own} is {much} ({_sig(errors[papers_own])})"
    if DEFAULT in errors and best != DEFAULT:
        first += f"; {DEFAULT}, the default, has {_sig(errors[DEFAULT])}"
    sentences = [first + "."]
    if outcome.experiment.ramp and papers_own in merits:
        c1, c2, c3, mu, _ = merits[papers_own].slip_quartiles[1]
        sentences.append(
            f"{level}: slip at which {papers_own} has found a value, median: c1 {_slip(c1)}, "
            f"c2 {_slip(c2)}, c3 {_slip(c3)}, maximum adhesion {_slip(mu)} (the paper reports "
            "about 0.1 for c1 and c2, 0.4 for c3)."
        )
    if {papers_own, ORDINARY, SUMMED} <= errors.keys() and papers_own != ORDINARY:
        comparison = "; ".join(
            f"{what} {_sig(errors[name])} and {_sig(merits[name].rmse[0])}"
            for what, name in (
                ("ordinary algorithm", ORDINARY),
                ("both changes, mean innovation", papers_own),
                ("both changes, summed innovation", SUMMED),
            )
        )
        sentences.append(
            f"{level}: the paper's estimators, RMSE of the maximum adhesion and of c1: "
            f"{comparison}."
        )
    if {papers_own, ONE_SAMPLE, ALL_DATA} <= errors.keys() and not outcome.experiment.ramp:
        sentences.append(
            f"{level}: RMSE of the maximum adhesion by block processing "
            f"{_sig(errors[papers_own])}, by sequence processing {_sig(errors[ONE_SAMPLE])} with "
            f"one sample for each block and {_sig(errors[ALL_DATA])} with all samples so far."
        )
    return sentences


# --------------------------------------------------------------------------------------- page


def page(outcomes: Sequence[NoiseLevelResult], provenance: Mapping[str, str]) -> Page:
    """Page of an experiment, with one section for each noise level."""
    number = outcomes[0].experiment.number
    sections = {}
    for outcome in outcomes:
        parts: list[Any] = [merit_table(outcome)]
        if late_estimators(outcome) and not outcome.experiment.ramp:
            parts.append(Text(late_estimators(outcome) + "."))
        parts += figures(outcome)
        sections[f"Noise sd {outcome.noise_std:g}"] = parts
    return Page(
        title=f"Experiment {number}: {TITLES[number]}",
        lead=_lead(outcomes[0]),
        verdict=[sentence for outcome in outcomes for sentence in verdict(outcome)],
        sections=sections,
        provenance=provenance,
    )


def _lead(outcome: NoiseLevelResult) -> str:
    experiment = outcome.experiment
    runs = max(r.runs for r in outcome.results)
    surfaces = " → ".join("({:g}, {:g}, {:g})".format(*theta) for theta in experiment.surfaces)
    data = (
        f"{experiment.updates} samples in sequence, slip rising from 0 to "
        f"{experiment.slip_max:g}, started anywhere in the search range"
        if experiment.ramp
        else f"{experiment.updates} blocks of {experiment.block} samples, slip uniform in 0 to "
        f"{experiment.slip_max:g}, a sudden switch every {experiment.blocks} blocks"
    )
    if experiment.theta0 is not None:
        start = "({:g}, {:g}, {:g})".format(*experiment.theta0)
        first = (
            ", which is the curve of the first surface"
            if experiment.theta0 == experiment.surfaces[0]
            else ""
        )
        data += f", started at {start}{first}"
    count = "one run" if runs == 1 else f"{runs} runs"
    return (
        f"After He et al., IEEE Access 6 (2018). Curve (c1, c2, c3): {surfaces}; {data}; {count}. "
        "All estimators get the same data. The paper's noise N(0, 0.01) is read as a "
        "standard deviation of 0.01 and as a variance of 0.01 (sd 0.1)."
    )


# ------------------------------------------------------------------------------- JSON and CSV


def document(outcomes: Sequence[NoiseLevelResult], provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Document of all numbers, for `--json`."""
    experiment = outcomes[0].experiment
    surfaces = with_peak(np.array(experiment.surfaces)).tolist()
    return {
        "experiment": {**asdict(experiment), "paper_surfaces": experiment.surfaces == SURFACES},
        "surfaces": [dict(zip(QUANTITIES, row, strict=True)) for row in surfaces],
        "noise_levels": [
            {
                "noise_std": outcome.noise_std,
                "cramer_rao": {
                    "rmse": _named(_bound_rmse(outcome)),
                    "by_update": _columns(outcome.bound),
                },
                "estimators": [_result_json(result, outcome) for result in outcome.results],
                "verdict": verdict(outcome),
            }
            for outcome in outcomes
        ],
        **provenance,
    }


def _result_json(result: EstimatorResult, outcome: NoiseLevelResult) -> dict[str, Any]:
    m = compute_figures(result, outcome)
    errors = result.values - outcome.truth
    fields: dict[str, Any] = {
        "name": result.name,
        "runs": result.runs,
        "silent_before_the_end": result.is_late,
        "answered": m.answered,
        "rmse": _named(m.rmse),
        "update_ms": m.update_ms,
    }
    if outcome.experiment.ramp:
        fields["slip_needed"] = {
            name: _spread(column) for name, column in zip(QUANTITIES, m.slip_needed.T, strict=True)
        }
    else:
        fields["rmse_without_switch_blocks"] = _named(m.rmse_steady)
        fields["blocks_needed"] = _spread(m.blocks_needed)
        samples = m.samples_needed
        fields["samples_needed"] = None if samples is None else _spread(samples)
    fields["mean_by_update"] = _columns(mean(result.values, 0))
    fields["rmse_by_update"] = _columns(rms(errors, 0))
    return fields


def csv_rows(outcomes: Sequence[NoiseLevelResult]) -> Iterator[tuple[str, ...]]:
    """Rows under `CSV_COLUMNS`: one figure of merit of one run, or of all runs together.

    A value is empty where there is no estimate, where it was never found, or not measured.
    """
    for outcome in outcomes:
        level = f"{outcome.noise_std:g}"
        for name, value in zip(QUANTITIES, _bound_rmse(outcome), strict=True):
            yield (BOUND, level, "all", f"rmse_{name}", _number(value))
        for result in outcome.results:
            runs = [(str(run + 1), slice(run, run + 1)) for run in range(result.runs)]
            for run, part in (("all", slice(None)), *runs):
                for quantity, value in _quantities(compute_figures(result, outcome, part)):
                    yield (result.name, level, run, quantity, _number(value))


def _quantities(m: FiguresOfMerit) -> Iterator[tuple[str, float]]:
    """Figures of merit by name; medians over the runs where there are several."""
    for q, name in enumerate(QUANTITIES):
        yield f"rmse_{name}", m.rmse[q]
    for q, name in enumerate(QUANTITIES):
        if len(m.slip_needed):
            yield f"slip_needed_{name}", m.slip_quartiles[1, q]
        else:
            yield f"rmse_without_switch_blocks_{name}", m.rmse_steady[q]
    for switch in range(m.blocks_needed.shape[1]):
        yield f"blocks_needed_switch_{switch + 1}", _median(m.blocks_needed[:, switch])
        if m.samples_needed is not None:
            yield f"samples_needed_switch_{switch + 1}", _median(m.samples_needed[:, switch])
    yield "update_ms", m.update_ms
    yield "answered", m.answered


# ------------------------------------------------------------------------------- ingredients


def _bound_rmse(outcome: NoiseLevelResult) -> Array:
    return outcome.bound[-1] if outcome.experiment.ramp else rms(outcome.bound, 0)


def _named(values: Array) -> dict[str, float]:
    return dict(zip(QUANTITIES, map(float, values), strict=True))


def _columns(values: Array) -> dict[str, list[float]]:
    return dict(zip(QUANTITIES, values.T.tolist(), strict=True))


def _median(values: Array) -> float:
    return float(quartiles(values.ravel())[1])


def _spread(values: Array) -> dict[str, Any]:
    """Quartiles, and the share of runs in which the value was never found."""
    low, middle, high = quartiles(values.ravel()).tolist()
    return {"median": middle, "quartiles": [low, high], "never": float(np.isinf(values).mean())}


def _number(value: float) -> str:
    return f"{value:.8g}" if np.isfinite(value) else ""


def _sig(value: float) -> str:
    """Three digits, never as a power of ten."""
    if not np.isfinite(value):
        return "-"
    return str(np.format_float_positional(value, 3, unique=False, fractional=False, trim="-"))


def _count(value: float) -> str:
    return "-" if np.isnan(value) else "never" if np.isinf(value) else f"{value:.0f}"


def _slip(value: float) -> str:
    return "-" if np.isnan(value) else "never" if np.isinf(value) else f"{value:.3f}"


def _with_quartiles(low: float, middle: float, high: float) -> str:
    if not np.isfinite(middle):
        return _slip(middle)
    ends = (f"{x:.2f}".removeprefix("0") if np.isfinite(x) else ".." for x in (low, high))
    return f"{middle:.2f} ({'-'.join(ends)})"
