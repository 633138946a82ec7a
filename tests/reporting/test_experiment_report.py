"""An experiment's table, figures and sentences, whoever takes part and however badly."""

import io
from dataclasses import replace

import numpy as np
import plotly.graph_objects as go
import pytest

from adhesion_can.experiments.figures_of_merit import (
    EstimatorResult,
    NoiseLevelResult,
    compute_figures,
)
from adhesion_can.experiments.runs import cramer_rao_bound
from adhesion_can.experiments.simulated_data import EXPERIMENTS
from adhesion_can.reporting.experiment import csv_rows, document, merit_table, page, verdict
from adhesion_can.reporting.experiment_figures import figures
from adhesion_can.reporting.experiment_style import PAPERS_OWN, SHOWN
from adhesion_can.reporting.page import render
from adhesion_can.reporting.text import FittingTable, console

SMALL = {n: replace(e, blocks=1 if e.ramp else 4, block=40) for n, e in EXPERIMENTS.items()}
NAMES = (
    "oracle", "tracker", "paper", "de", "scipy-de", "least-squares", "rls", "ekf", "bank", "window",
    "newcomer", "paper (ordinary)", "paper (mean)", "paper (sum)", "paper (sequence)",
)  # fmt: skip


def made_of(number, names, noise=0.01, runs=6, off=0.02, seed=1):
    """Results off the truth by a share: the k-th name by k + 1 times it."""
    experiment, rng = SMALL[number], np.random.default_rng(seed)
    truth = experiment.truth()
    results = []
    for k, name in enumerate(names):
        errors = off * (k + 1) * rng.standard_normal((runs, *truth.shape))
        needed = rng.integers(1, 999, (runs, 2)).astype(float) if len(truth) == 12 else None
        seconds = np.full((runs, len(truth)), 3.456e-5 * 2.0**k)
        results.append(EstimatorResult(name, truth * (1 + errors), seconds, needed))
    return NoiseLevelResult(
        experiment=experiment,
        noise_std=noise,
        seed=1,
        bound=cramer_rao_bound(experiment, noise, 1),
        results=tuple(results),
    )


def replaced(made, name, **changes):
    results = [replace(r, **changes) if r.name == name else r for r in made.results]
    return replace(made, results=tuple(results))


def printed(made):
    shown, out = merit_table(made), io.StringIO()
    console(out).print(FittingTable(shown.caption, shown.columns, shown.rows))
    return out.getvalue()


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("off", [0.0, 1e-3, 0.03, 3.0])
def test_the_table_fits_and_the_smallest_error_comes_first(number, off):
    made = made_of(number, NAMES, off=off)
    lines = [line.rstrip() for line in printed(made).splitlines()]
    assert max(map(len, lines)) <= 120
    assert "…" not in "".join(lines)
    ranks = [row[0] for row in merit_table(made).rows if row[0] != "Cramér-Rao bound"]
    if off:
        errors = {r.name: compute_figures(r, made).rmse[3] for r in made.results}
        assert ranks == sorted(NAMES, key=errors.__getitem__)


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("off", [0.0, 0.03, 3.0])
def test_figures_are_plotlys_and_begin_with_who_matters(number, off):
    made = made_of(number, NAMES, off=off)
    for figure in figures(made):
        go.Figure({"data": list(figure.data), "layout": dict(figure.layout)})  # raises if unknown
        estimators = [t for t in figure.data if t.get("legendgroup") in NAMES]
        seen = {t["legendgroup"] for t in estimators if t["visible"] is True}
        assert seen in (set(), {*SHOWN, PAPERS_OWN[number]})
        # One entry in the legend each.
        named = [t["name"] for t in estimators if t["showlegend"]]
        assert len(named) == len(set(named))
        for axis in (v for k, v in figure.layout.items() if k.startswith(("xaxis", "yaxis"))):
            low, high = axis.get("range", (0, 1))
            assert np.isfinite([low, high]).all()
            assert low < high
            bottom, top = axis.get("domain", (0, 1))
            assert 0 <= bottom < top <= 1


def test_the_curves_are_those_at_the_end_of_each_surface():
    made = made_of(3, ["tracker"])
    trace = next(t for t in figures(made)[0].data if t["name"] == "tracker")
    x, y = np.array(trace["x"]), np.array(trace["y"])
    edges = np.flatnonzero(np.isnan(y))
    assert len(edges) == 3
    for surface, end in enumerate(edges):
        c1, c2, c3 = made.results[0].values[0, 4 * surface + 3, :3]
        h = x[end - 121 : end]
        assert y[end - 121 : end] == pytest.approx(c1 * (1 - np.exp(-c2 * h)) - c3 * h)


def test_the_histogram_counts_every_block_once():
    made = made_of(3, ["tracker", "de"], off=0.5)
    for trace in figures(made)[4].data:
        assert sum(trace["y"]) == pytest.approx(100)


def test_the_band_holds_nine_tenths_of_the_runs():
    made = made_of(3, ["tracker"], runs=101)
    line = next(t for t in figures(made)[2].data if t["name"] == "tracker" and t["showlegend"])
    band = next(t for t in figures(made)[2].data if t.get("fill") == "toself")
    values = made.results[0].values[..., 3]
    assert line["y"] == pytest.approx(values.mean(0))
    assert band["y"][:12] == pytest.approx(np.sort(values, 0)[95])
    assert band["y"][12:][::-1] == pytest.approx(np.sort(values, 0)[5])


@pytest.mark.parametrize("number", [1, 3])
def test_estimators_without_an_estimate_are_listed_and_not_drawn(number):
    made = made_of(number, ["tracker", "mute"])
    silent = np.full_like(made.results[1].values, np.nan)
    made = replaced(made, "mute", values=silent, samples_needed=None)
    text = render(page([made], {"version": "0"}))
    assert "No estimate before the end of the" in text
    assert not any(t.get("legendgroup") == "mute" for f in figures(made) for t in f.data)
    assert "mute" not in {row[0] for row in merit_table(made).rows}
    (level,) = document([made], {})["noise_levels"]
    assert [e["silent_before_the_end"] for e in level["estimators"]] == [False, True]
    values = [v for name, _, _, q, v in csv_rows([made]) if (name, q) == ("mute", "rmse_mu_max")]
    assert set(values) == {""}


def test_gaps_at_the_begin_are_gaps():
    made = made_of(3, ["tracker", "late"])
    values = made.results[1].values.copy()
    values[:, :3] = np.nan
    made = replaced(made, "late", values=values)
    late = next(t for t in figures(made)[2].data if t["name"] == "late" and t["showlegend"])
    assert np.isnan(late["y"]).tolist() == [True] * 3 + [False] * 9
    (level,) = document([made], {})["noise_levels"]
    assert level["estimators"][1]["answered"] == 0.75


def test_the_verdict_names_the_best_the_papers_own_and_the_default():
    made = made_of(3, ["oracle", "window", "tracker", "paper (mean)"])
    first = verdict(made)[0]
    errors = {r.name: compute_figures(r, made).rmse[3] for r in made.results}
    assert first.startswith("Noise sd 0.01: window has the smallest error")
    assert f"{errors['paper (mean)'] / errors['window']:.1f} times as large" in first
    assert "tracker, the default, has" in first
    made = made_of(3, ["tracker", "paper (mean)"])
    assert "the default" not in verdict(made)[0]
    assert verdict(made_of(3, [])) == []


def test_never_found_is_shown_as_never():
    made = made_of(3, ["tracker"], off=3.0)
    (row,) = (row for row in merit_table(made).rows if row[0] == "tracker")
    assert row[-3] == "never"
    (level,) = document([made], {})["noise_levels"]
    assert level["estimators"][0]["blocks_needed"]["never"] > 0.5
