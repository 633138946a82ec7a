"""A diagnosis in words, tables, figures and JSON, whatever came out and whatever is missing."""

import io
import json
from dataclasses import replace
from functools import partial
from math import inf, nan
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from adhesion_can.cli.outputs import finite
from adhesion_can.diagnosis.cause_result import (
    Cause,
    ClosestExplanation,
    EnvironmentSizes,
    ParameterValue,
    SizeLevel,
)
from adhesion_can.diagnosis.evidence import ChannelEvidence, EffectEvidence, Untested
from adhesion_can.diagnosis.formatting import measured
from adhesion_can.diagnosis.gain_result import Gain, GainMethod
from adhesion_can.diagnosis.inference.sensor_noise import NoiseComparison
from adhesion_can.diagnosis.plot_result import (
    CurveData,
    PlotData,
    PredictionPlot,
    Profile,
    SimulationPlot,
)
from adhesion_can.diagnosis.result import Diagnosis, InputFile, SegmentResult, Verdict
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.effects import EFFECTS, ActiveEffect, effect_by_id
from adhesion_can.physics.effects.empirical import Empirical
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.reporting.charts import insert_gaps, thinned
from adhesion_can.reporting.diagnosis import terminal, verdict_sentences
from adhesion_can.reporting.diagnosis_page import page
from adhesion_can.reporting.page import Figure, render
from adhesion_can.reporting.text import console
from tests.reporting.test_page import NASTY, Elements, nothing_is_loaded

SECTIONS = (
    "What the simulation gets wrong", "Refuted explanations that help",
    "One size everywhere?", "Gain", "Measured and simulated", "Residual",
    "Curve and data", "Evidence for every effect", "Channels", "What would distinguish the rivals",
    "Not tested or rejected", "Extended model", "Inputs", "Provenance",
)  # fmt: skip
SOURCES = (
    InputFile(Path("drive one.log"), "drive one.log", "ab" * 32),
    InputFile(Path("other.log"), "other.log", "cd" * 32, held_out=True),
)


def estimate(c1=0.35, c2=24.0, c3=0.5, std=0.004, identifiable=True):
    lambda_m = float(np.log(c1 * c2 / c3) / c2)
    mu_max = float(c1 - c3 * (lambda_m + 1 / c2))
    return Estimate(
        c1=c1, c2=c2, c3=c3, covariance=np.diag([1e-5, 0.3, 1e-3]), mu_max=mu_max, mu_max_std=std,
        lambda_m=lambda_m, lambda_m_std=3 * std if identifiable else inf, noise_std=0.012,
        samples=36000,
        identifiable=Identifiable(mu_max=True, lambda_m=identifiable), surface_since_us=0,
    )  # fmt: skip


def sizes_of(effect, parameter, partition, size, values, *, refutes):
    """Sizes of an effect in two environments, known to a twentieth."""
    levels = tuple(
        SizeLevel(f"{partition} {k}", value, abs(value) / 20) for k, value in enumerate(values)
    )
    p_value, spread = (1e-6, 0.7) if refutes else (0.4, 0.02)
    return EnvironmentSizes(
        effect, parameter, partition, "1", size, levels, p_value, spread, refutes
    )


def named():
    """Adhesion that falls with speed, named; numbers made up here."""
    rng = np.random.default_rng(1)
    base, extended = estimate(0.31, 26.0, 0.4), estimate(0.36, 24.0, 0.5)
    flat = estimate(identifiable=False)
    slip = rng.uniform(0, 0.15, 3000)
    curve = extended.c1 * (1 - np.exp(-extended.c2 * slip)) - extended.c3 * slip
    noise = 0.012 * rng.standard_normal((2, 3000))
    cause = Cause(
        "speed_dependence", "", "adhesion at the same slip falls with vehicle speed",
        "Curtius and Kniffler, Elektrische Bahnen 21 (1950) 201-210",
        (
            ParameterValue("share", 0.8123, 0.0631, "1", "1 is Curtius and Kniffler's"),
        ),
        0.001, ("slow_drift",),
    )  # fmt: skip
    actives = (
        ActiveEffect(effect_by_id("wheel_radius"), (0.0102, 2.0)),
        ActiveEffect(effect_by_id("speed_dependence"), (0.8123,)),
    )
    return Diagnosis(
        verdict=Verdict.NAMED,
        causes=(cause,),
        channel=None,
        wrong=(
            "The plain curve predicts 0.041 too much adhesion at 25 m/s.",
            "The wheels of axle 2 are 1.0 % larger than configured.",
        ),
        gain=Gain(
            0.0213, 0.0141, 0.0122, 33.8, (28.1, 39.5), "blocks of 20 s, this drive only",
            (("drive one.log", 40.0, 60.0), ("drive one.log", 120.0, 140.0)),
        ),
        evidence=tuple(
            EffectEvidence(
                e.id, e.form, 2 * (e.id == "wheel_radius"), 9.0 - k / 3, min(0.001 * 3**k, 1),
                0.03 + 0.9 * k / len(EFFECTS), ("slow_drift", 0.71), 33.0 / (k + 1),
            )
            for k, e in enumerate(EFFECTS)
        ),
        channels=(
            ChannelEvidence("speed", "m/s", 0.41, 0.2),
            ChannelEvidence("rail_temperature_degC", "degC", 0.22, 0.4),
            ChannelEvidence("oil_film_um", "", 0.9, 0.0),
        ),
        needed="a drive that passes the same speed twice, early and late",
        untested=(Untested("humidity", "no signal gives the relative humidity"),),
        surfaces=(
            SegmentResult("drive one.log", 0.0, 31.0, flat, flat),
            SegmentResult("drive one.log", 31.5, 200.0, base, extended),
        ),
        model=ExtendedModel(
            base=(0.36, 24.0, 0.5), effects=actives, covariances=(None, ((0.0631**2,),))
        ),
        profile=profile(rng),
        closest=(
            ClosestExplanation(
                "wheelset_inertia", "", "the wheelset's inertia differs from the configured one",
                (ParameterValue("error", 812.0, 33.0, "kg m^2", "true minus configured inertia"),),
                12.3, "its error is not the same everywhere",
            ),
        ),
        environments=(
            sizes_of("speed_dependence", "share", "axle", 0.8, (0.79, 0.82), refutes=False),
            sizes_of("speed_dependence", "share", "time", 0.8, (0.81, 0.8), refutes=False),
            sizes_of("wheelset_inertia", "error", "speed", 812.0, (300.0, 1400.0), refutes=True),
        ),
        noise=NoiseComparison(0.0122, 0.0120),
        draw=drawn(
            (simulation_plot(rng, 2), simulation_plot(rng, 5)),
            curves=CurveData(slip, curve * 0.9 + 2 * noise[0], slip, curve + noise[1]),
        ),
        samples={"drive one.log": 36000, "other.log": 24000},
        lost={"below v_min": 120, "slip out of range": 0},
    )  # fmt: skip


def profile(rng):
    at = np.linspace(2.0, 28.0, 14)
    before = 0.04 - 0.0031 * at + 0.001 * rng.standard_normal(14)
    std = np.full(14, 0.0015)
    std[0] = nan
    return Profile(
        "speed", "m/s", at, before, 0.001 * rng.standard_normal(14), std, std, 0.04 - 0.0031 * at
    )


def drawn(*plots, **more):
    """What draws these plots."""
    return partial(PlotData, *plots, **more)


def simulation_plot(rng, axle):
    t = np.arange(0.0, 60.0, 0.01)
    t[3000:] += 8.0
    n = len(t)
    speed = 20 + 10 * np.sin(t / 9)
    mu = 0.2 + 0.1 * np.sin(t / 3)
    drift = np.remainder(t, 10.0)
    before = speed + 0.05 * drift
    before[100:130] = nan
    return SimulationPlot(
        "drive one.log", axle, t, speed + 0.01 * rng.standard_normal(n), before,
        speed + 0.01 * drift, mu + 0.012 * rng.standard_normal(n), mu * 0.9, mu, 10.0,
    )  # fmt: skip


def nothing():
    found = named()
    gain = Gain(0.0121, 0.0121, 0.012, 0.0, (-0.4, 0.5), "blocks of 20 s", ())
    own = found.surfaces[1].base
    plain = ExtendedModel(own.theta, tuple(map(tuple, own.covariance.tolist())))
    chance = tuple(replace(e, p_value=0.31, gain_percent=0.4) for e in found.evidence)
    return replace(
        found, closest=(), environments=(),
        verdict=Verdict.NOTHING, causes=(), wrong=(), gain=gain, needed=None, untested=(),
        evidence=chance, model=plain, profile=None, surfaces=found.surfaces[1:],
    )  # fmt: skip


def unexplained():
    spline = Empirical(
        "position", "factor", (0.0,) * 4 + (400.0, 900.0) + (1500.0,) * 4,
        (0.0, 0.05, -0.1, 0.02, 0.03, 0.0),
    )  # fmt: skip
    found = named()
    return replace(
        found, closest=(), environments=(),
        verdict=Verdict.UNEXPLAINED, causes=(), channel="position",
        channels=(ChannelEvidence("position", "m", 0.0004, 21.0), *found.channels),
        model=ExtendedModel(base=(0.36, 24.0, 0.5), splines=(spline,)), needed=None,
        profile=replace(found.profile, channel="position", unit="m"),
    )  # fmt: skip


def empty():
    """A diagnosis of data that allow none."""
    return Diagnosis(verdict=Verdict.NOTHING, untested=(Untested("everything", "too few rows"),))


MADE = {"named": named, "nothing": nothing, "unexplained": unexplained, "empty": empty}
PROVENANCE = {"command": "adhesion-can diagnose 'drive one.log'", "version": "1.2.3"}


def of_files(found, files):
    """The diagnosis with the files that it rests on."""
    return replace(found, input_files=tuple(files))


def rendered(found, sources=SOURCES, problems=()):
    return Elements(render(page(of_files(found, sources), PROVENANCE, problems)))


def printed(found):
    out = io.StringIO()
    screen = console(out)
    for part in terminal(found):
        screen.print(part, **({"markup": False} if isinstance(part, str) else {}))
    return out.getvalue()


# --- sentences


def test_a_named_cause_is_told_with_its_size_its_certainty_and_its_rivals():
    first, gain = verdict_sentences(named())
    assert first.startswith("Named: adhesion at the same slip falls with vehicle speed")
    assert "share 0.812 ± 0.063" in first
    assert "p = 0.001, corrected for all effects tested" in first
    assert "cannot distinguish it from slow_drift (adhesion drifts with time)" in first
    assert "33.8 % (95 % interval 28.1 to 39.5 %)" in gain
    assert "plain curve 0.0213, extended model 0.0141. On the deciding data, a fit with" in gain
    assert "a spline in every channel leaves an RMSE of 0.0122." in gain
    assert "this drive only" in gain


def test_much_that_is_left_is_not_called_noise():
    found = nothing()
    assert found.conclusive
    found = replace(found, gain=replace(found.gain, noise_floor=0.006))
    first, _ = verdict_sentences(found)
    assert first.startswith(
        "Undecided: on held-out data the plain curve has an RMSE of 0.0121, a fit with a spline in "
        "every channel leaves 0.00600 on the deciding data, and no effect or channel"
    )
    assert not found.to_dict()["conclusive"]


def test_an_effect_that_shows_and_is_not_named_is_not_called_noise():
    sure = nothing().evidence[0]
    sure = replace(sure, p_value=0.001, gain_percent=33.0)
    why = "its size would be about 1, but no such vehicle has more than 0.5"
    found = replace(
        nothing(), evidence=(sure,), untested=(Untested(sure.effect, why, rejected=True),)
    )
    first, _ = verdict_sentences(found)
    assert first.startswith("Undecided: the deciding data show an effect")
    assert first.endswith(f"p = 0.001, gain alone 33.0 %; {why}.")
    assert f"Rejected: {sure.effect}: {why}" in " ".join(printed(found).split())
    assert not found.to_dict()["conclusive"]


def test_nothing_found_is_no_proof_and_says_so():
    first, gain = verdict_sentences(nothing())
    assert first.startswith("Nothing found")
    assert "may still be too small" in first
    assert "p = 0.310, gain alone 0.4 %" in first
    assert gain.startswith("There is no extension")
    (only,) = verdict_sentences(empty())
    assert only.startswith("No verdict")


def test_what_is_unexplained_names_its_channel_and_no_cause():
    first = verdict_sentences(unexplained())[0]
    assert first.startswith("Unexplained: the residual depends on position along the rail")
    assert "p < 0.001" in first
    first = verdict_sentences(replace(unexplained(), channel=None))[0]
    assert "neither a known effect nor a single measured channel" in first
    both = verdict_sentences(replace(unexplained(), causes=named().causes))
    assert both[1].startswith("Also named: adhesion at the same slip")


def test_a_gain_that_no_model_holds_is_told_as_one():
    bare = ExtendedModel(base=(0.36, 24.0, 0.5))
    for model in (None, bare):
        found = replace(unexplained(), model=model)
        assert "which a model file cannot hold" in verdict_sentences(found)[1]
        elements = rendered(found)
        assert "There is no extension" in " ".join(elements.text.values())
        for figure in elements.figures():
            names = {trace.get("name") for trace in figure["data"]}
            assert "extended model" not in names or "change by the extended model" in names
    assert "which a model file" not in " ".join(verdict_sentences(unexplained()))


def test_a_gain_that_may_be_none_is_not_sold():
    gain = replace(named().gain, interval=(-3.0, 40.0))
    assert "not certain" in verdict_sentences(replace(named(), gain=gain))[1]
    gain = replace(named().gain, percent=-6.7, interval=(-54.1, 26.1))
    assert "no better than the plain curve" in verdict_sentences(replace(named(), gain=gain))[1]
    gain = replace(named().gain, interval=(-inf, inf))
    text = verdict_sentences(replace(named(), gain=gain))[1]
    assert "interval not known" in text
    assert "inf" not in text


@pytest.mark.parametrize(
    ("value", "std", "unit", "text"),
    [
        (0.8123, 0.0631, "1", "0.812 ± 0.063"),
        (-1834.2, 251.7, "N", "-1834 ± 252 N"),
        (4.123e-7, 0.52e-7, "1/J", "(4.12 ± 0.52)e-7 1/J"),
        (3e-12, 4e-12, "1/N^2", "(3.0 ± 4.0)e-12 1/N²"),
        (1234567.0, 20000.0, "N", "(1.235 ± 0.020)e6 N"),
        (0.0, 0.0, "s", "0 ± 0 s"),
        (0.5, 0.0, "s", "0.500 ± 0.000 s"),
        (2.0, None, "1", "2"),
        (0.0123, None, "s", "0.0123 ± ? s"),
        (0.0123, inf, "s", "0.0123 ± ? s"),
        (398.4, 12.3, "kg m^2", "398 ± 12 kg·m²"),
    ],
)
def test_a_value_has_two_digits_of_its_standard_deviation(value, std, unit, text):
    assert measured(value, std, unit) == text


# --- terminal


@pytest.mark.parametrize("kind", MADE)
def test_the_terminal_is_short_and_its_tables_fit(kind):
    found = MADE[kind]()
    output = printed(found)
    lines = output.splitlines()
    assert len(lines) < 45
    assert "…" not in output
    for table in (part for part in terminal(found) if not isinstance(part, str)):
        out = io.StringIO()
        console(out).print(table)
        assert max(len(line.rstrip()) for line in out.getvalue().splitlines()) <= 120
    for sentence in (*verdict_sentences(found), *found.wrong):
        assert sentence in output
    for what, why, _ in found.untested:
        assert f"{what}: {why}" in output


def test_names_with_brackets_are_no_markup():
    found = replace(named(), wrong=("axle [bold]2[/bold] of [/x]",))
    assert "axle [bold]2[/bold] of [/x]" in printed(found)


# --- JSON


@pytest.mark.parametrize("kind", MADE)
def test_json_has_the_names_of_the_contract(kind):
    found = MADE[kind]()
    document = json.loads(json.dumps(finite(of_files(found, SOURCES).to_dict()), allow_nan=False))
    assert document.keys() >= {
        "verdict", "causes", "channel", "wrong", "gain", "evidence", "needed", "base", "extended",
        "inputs",
    }  # fmt: skip
    assert document["verdict"] in {"named", "nothing_found", "unexplained"}
    for cause in document["causes"]:
        assert cause.keys() >= {"effect", "parameters", "p_value", "rivals"}
        for parameter in cause["parameters"].values():
            assert parameter.keys() == {"value", "std", "unit"}
    for evidence in document["evidence"]:
        assert evidence.keys() >= {"effect", "statistic", "p_value", "absorbed", "most_alike"}
        other, cosine = evidence["most_alike"]
        assert isinstance(other, str)
        assert isinstance(cosine, float)
    assert [entry.keys() >= {"path", "sha256", "samples"} for entry in document["inputs"]]
    if found.gain is None:
        assert document["gain"] is None
    else:
        assert document["gain"].keys() >= {
            "rmse_before", "rmse_after", "noise_floor", "percent", "interval", "held_out", "spans",
        }  # fmt: skip
    for which in ("base", "extended"):
        fields = {"c1", "c2", "c3", "mu_max", "lambda_m", "noise_std", "samples", "identifiable"}
        if found.surfaces:
            assert document[which].keys() == fields | {"segments"}
            assert len(document[which]["segments"]) == len(found.surfaces)
        else:
            assert document[which] is None


def test_json_has_the_values():
    document = of_files(named(), SOURCES).to_dict()
    (cause,) = document["causes"]
    assert cause["parameters"]["share"] == {"value": 0.8123, "std": 0.0631, "unit": "1"}
    assert cause["rivals"] == ["slow_drift"]
    assert document["gain"]["spans"] == [[40.0, 60.0], [120.0, 140.0]]
    assert document["gain"]["recordings"] == ["drive one.log"] * 2
    assert document["gain"]["method"] == []
    assert document["base"]["c1"]["value"] == 0.31  # of the longest surface, not of the first
    assert document["extended"]["c1"]["value"] == 0.36
    assert document["extended"]["segments"][0]["lambda_m"]["std"] is None
    assert document["base"]["segments"][1]["from_s"] == 31.5
    assert document["inputs"][1] == {
        "path": "other.log", "sha256": "cd" * 32, "samples": 24000, "held_out": True,
    }  # fmt: skip
    assert document["evidence"][1]["axle"] == 2
    assert document["untested"] == [
        {"what": "humidity", "why": "no signal gives the relative humidity", "rejected": False}
    ]


def test_a_gain_says_how_it_was_computed():
    plain = named().gain
    method = GainMethod.WHERE_IT_ACTS | GainMethod.WITHOUT_SPEED_ERRORS
    document = replace(plain, method=method).to_dict()
    assert document["method"] == ["without_speed_errors", "where_it_acts"]
    assert document["held_out"].startswith(plain.held_out + "; vehicle-speed errors")
    assert document["held_out"].endswith("; the interval is that of the gain on these data, where "
                                         "the models differ")  # fmt: skip


def test_a_recording_that_was_kept_back_for_want_of_others_is_told_as_such():
    two = [replace(source, held_out=False) for source in SOURCES]
    gain = replace(named().gain, spans=(("other.log", 0.0, 100.0),), whole=True)
    found = replace(named(), gain=gain)
    assert [one["held_out"] for one in of_files(found, two).to_dict()["inputs"]] == [False, True]
    cells = rendered(found, two).texts("td")
    assert cells[cells.index("other.log") + 1] == "held out for the gain"
    assert cells[cells.index("drive one.log") + 1] == "diagnosed"
    # One drive alone is diagnosed, though spans of it are held out.
    assert [one["held_out"] for one in of_files(named(), two[:1]).to_dict()["inputs"]] == [False]


# --- page


def test_sizes_by_environment_are_drawn_with_their_intervals():
    made = page(of_files(named(), SOURCES), PROVENANCE)
    parts = made.sections["One size everywhere?"]
    steady, varying = (part for part in parts if isinstance(part, Figure))
    assert [trace["name"] for trace in steady.data] == ["sizes that agree"]
    (trace,) = varying.data
    assert trace["name"] == "sizes that differ"
    assert trace["x"] == [300.0, 1400.0]
    assert trace["error_x"]["array"] == pytest.approx([1.96 * 15.0, 1.96 * 70.0], rel=1e-4)
    assert varying.layout["shapes"][0]["x0"] == 812.0


def test_what_is_closest_is_said_with_its_size_and_the_reason():
    text = " ".join(str(part) for part in terminal(named()))
    assert (
        "the wheelset's inertia differs from the configured one (wheelset_inertia: "
        "error 812 ± 33 kg·m²) "
        "reduces the RMSE on held-out data by 12.3 % but is refuted as the cause: its error is not "
        "the same everywhere."
    ) in text
    assert "wheelset_inertia" not in "".join(verdict_sentences(named()))


def test_more_than_the_sensors_noise_is_said():
    noise = NoiseComparison(0.32, 0.005, usual=64.0, left=64.0)
    text = " ".join(verdict_sentences(replace(unexplained(), noise=noise)))
    assert "64 times as much" in text
    assert "64 times" not in " ".join(verdict_sentences(named()))


@pytest.mark.parametrize("kind", MADE)
def test_every_section_is_there_and_nothing_is_loaded(kind):
    found = MADE[kind]()
    text = render(
        page(of_files(found, SOURCES), PROVENANCE, ["other.log: 3 frames failed their checks"])
    )
    elements = nothing_is_loaded(text)
    assert elements.texts("h2") == ["Result", *SECTIONS]
    flat = " ".join(" ".join(elements.text.values()).split())
    for words in (*verdict_sentences(found), *found.wrong, "3 frames failed their checks"):
        assert words in flat
    assert "drive one.log" in flat
    assert PROVENANCE["command"] in flat
    for source in SOURCES:
        assert source.sha256 in elements.texts("td")


@pytest.mark.parametrize(
    ("kind", "count"), [("named", 7), ("nothing", 4), ("unexplained", 5), ("empty", 0)]
)
def test_figures_are_plotlys(kind, count):
    found = MADE[kind]()
    made = page(of_files(found, SOURCES), PROVENANCE)
    parts = [part for section in made.sections.values() for part in section]
    figures = [part for part in parts if isinstance(part, Figure)]
    assert len(figures) == count
    for figure in figures:
        go.Figure({"data": list(figure.data), "layout": dict(figure.layout)})  # raises if unknown
        for trace in figure.data:
            assert len(trace["x"]) == len(trace["y"])


def test_evidence_and_channels_are_all_in_the_page():
    elements = rendered(named())
    cells = elements.texts("td")
    for effect in EFFECTS:
        name = f"{effect.id} {effect.form}".strip()
        assert any(cell.startswith(name) for cell in cells), name
    assert "rail temperature" in cells
    assert "°C" in cells
    assert "oil_film_um" in cells


def test_the_extended_model_is_told_in_numbers():
    cells = rendered(named()).texts("td")
    assert "0.812 ± 0.063" in cells
    assert "0.0102 ± ?" in cells  # its covariance is not known
    text = " ".join(rendered(unexplained()).text.values())
    assert "Empirical: a curve over position along the rail" in text
    assert "6 coefficients from 0 to 1500" in text
    assert "There is no extension" in " ".join(rendered(nothing()).text.values())


def test_what_is_told_is_never_markup():
    found = replace(
        named(), wrong=(NASTY,), needed=NASTY, untested=(Untested(NASTY, NASTY),),
        channels=(ChannelEvidence(NASTY, NASTY, 0.5, 0.1),), lost={NASTY: 3},
        profile=replace(named().profile, channel=NASTY),
        draw=drawn(
            (replace(named().plots.simulations[0], recording=NASTY),), curves=named().curves
        ),
        environments=(sizes_of(NASTY, NASTY, NASTY, 1.0, (1.0, 2.0), refutes=True),),
        closest=(replace(named().closest[0], refuted_by=NASTY, title=NASTY),),
    )  # fmt: skip
    sources = [InputFile(Path(NASTY), NASTY, "00")]
    text = render(page(of_files(found, sources), {NASTY: NASTY}, [NASTY]))
    elements = nothing_is_loaded(text)
    # Five figures, Plotly, what draws.
    assert len(elements.texts("script")) == 7


def test_the_whisker_is_the_interval_of_the_gain():
    gain = page(of_files(named(), SOURCES), {}).sections["Gain"]
    figure = next(part for part in gain if isinstance(part, Figure))
    (bars,) = figure.data
    before, after, _ = bars["x"]
    more, less = bars["error_x"]["array"][1], bars["error_x"]["arrayminus"][1]
    assert 100 * (1 - (after - less) / before) == pytest.approx(39.5)
    assert 100 * (1 - (after + more) / before) == pytest.approx(28.1)


def test_long_series_are_thinned_and_gaps_stay():
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 600.0, 0.01)
    long = simulation_plot(rng, 1)
    series = {
        name: np.resize(getattr(long, name), len(t)).copy()
        for name in (
            "wheel_speed", "simulated_before", "simulated_after", "adhesion", "predicted_before",
            "predicted_after",
        )
    }  # fmt: skip
    series["adhesion"][31234] = 0.77
    plots = replace(named().plots, simulations=(replace(long, time_s=t, **series),))
    found = replace(named(), draw=lambda: plots)
    text = render(page(of_files(found, SOURCES), PROVENANCE))
    shown = [f for f in Elements(text).figures() if len(f["data"]) == 8]
    assert len(shown) == 1
    (adhesion,) = (d for d in shown[0]["data"] if d["name"] == "measured" and d["yaxis"] == "y3")
    assert len(adhesion["x"]) <= 4000
    assert max(adhesion["y"]) == 0.77
    assert any(y is None for d in shown[0]["data"] for y in d["y"])


# --- thinning


def series(length):
    return arrays(
        np.float64, length, elements=st.floats(-1e6, 1e6) | st.sampled_from([nan, 0.0, 1.0])
    )


lengths = st.integers(1, 300)


@given(st.data(), st.integers(1, 3), st.integers(11, 60))
def test_thinning_keeps_ends_extremes_and_order(data, count, at_most):
    length = data.draw(lengths)
    x = np.arange(length) * 0.5
    ys = [data.draw(series(length)) for _ in range(count)]
    thin_x, *thin = thinned(x, *ys, at_most=at_most)
    assert len(thin_x) <= max(at_most, 0)
    assert len(thin_x) == length or length > at_most
    assert (np.diff(thin_x) > 0).all()
    assert (thin_x[0], thin_x[-1]) == (x[0], x[-1])
    rows = np.searchsorted(x, thin_x)
    for y, kept in zip(ys, thin, strict=True):
        np.testing.assert_array_equal(y[rows], kept)
        known = np.isfinite(y)
        assert np.isfinite(kept).any() == known.any()
        assert np.isfinite(kept).all() == known.all()
        if known.any():
            assert np.nanmax(kept) == np.nanmax(y)
            assert np.nanmin(kept) == np.nanmin(y)


@given(st.data())
def test_the_extremes_of_every_stretch_stay(data):
    y = data.draw(series(200))
    _, kept = thinned(np.arange(200.0), y, at_most=62)
    rows, _ = thinned(np.arange(200.0), y, at_most=62)
    # Between two kept rows nothing lies outside what the rows of its bin and its neighbours span.
    width = 200 // 20
    for first in range(0, 200 - 2 * width, width):
        inside = (rows >= first - width) & (rows < first + 3 * width)
        part = y[first : first + width]
        if np.isfinite(part).any():
            assert np.nanmax(kept[inside]) >= np.nanmax(part)
            assert np.nanmin(kept[inside]) <= np.nanmin(part)


def test_thinning_refuses_what_does_not_fit():
    y = np.zeros(100)
    with pytest.raises(ValueError, match="do not fit"):
        thinned(y, y, y, y, at_most=7)
    with pytest.raises(ValueError, match="0 series"):
        thinned(y, at_most=50)
    x, same = thinned(y, y, at_most=100)
    assert x is y
    assert same is y


def test_a_leap_of_the_abscissa_is_a_gap():
    x = np.concatenate([np.arange(10.0), np.arange(50.0, 60.0)])
    out, y = insert_gaps(x, x + 1)
    assert len(out) == 21
    assert np.isnan(y[10])
    assert (np.diff(out) > 0).all()
    np.testing.assert_array_equal(y[~np.isnan(y)], x + 1)
    one = np.array([1.0])
    assert insert_gaps(one, one) == (one, one)


def test_a_table_shows_measured_against_predicted_adhesion():
    measured = np.linspace(-0.3, 0.3, 50)
    plot = PredictionPlot(measured, 0.8 * measured, measured + 0.01, 500)
    made = page(replace(named(), draw=drawn(prediction=plot)), PROVENANCE)
    (part,) = made.sections["Measured and simulated"]
    assert "50 of 500 rows" in part.caption
    points = [trace for trace in part.data if trace["mode"] == "markers"]
    rmse = 0.2 * np.sqrt(np.mean(measured**2))
    assert [trace["name"].split("RMSE ")[1] for trace in points] == [f"{rmse:.3g}", "0.01"]
    go.Figure(part.data, part.layout)


def test_only_a_page_computes_what_it_draws():
    drawn_for = []

    def draw():
        drawn_for.append("page")
        return PlotData()

    found = of_files(replace(named(), draw=draw), SOURCES)
    found.to_dict()
    printed(found)
    assert not drawn_for
    page(found, PROVENANCE)
    assert drawn_for == ["page"]
