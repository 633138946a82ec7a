"""The rules by which the hunt and the bench of the setpoints judge: pure functions."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def tools():
    sys.path[1:1] = [str(ROOT / "tools" / name) for name in ("hunting", "benchmarks")]
    import _prepeak_bound
    import _truth_figures
    import contact
    import judge
    import plan
    import prepeak
    import tables
    import truth

    return SimpleNamespace(
        bound=_prepeak_bound,
        contact=contact,
        figures=_truth_figures,
        judge=judge,
        plan=plan,
        prepeak=prepeak,
        tables=tables,
        truth=truth,
    )


def _cause(effect, *rivals, **parameters):
    numbers = {"c4": 0.1} if effect == "falling_friction" and not parameters else parameters
    found = {name: {"value": value, "std": 0.01} for name, value in numbers.items()}
    return {"effect": effect, "rivals": list(rivals), "parameters": found, "p_value": 0.001}


def _record(kind, causes, verdict="named", channel=None, excess=0.3, **more):
    effect = kind.partition("+")[2]
    hidden = ["curve_shape", *([effect] if effect else [])]
    truth = {
        "effects": [{"effect": e, "form": "", "parameters": {}} for e in hidden],
        "channel": None,
        "excess": [excess] * len(hidden),
        "peak": {"mu_max": 0.30, "lambda_m": 0.020, "interior": True, "speed": 10.0},
    }
    extended = {
        "c1": {"value": 0.34, "std": 0.01},
        "c2": {"value": 200.0, "std": 1.0},
        "c3": {"value": 0.0, "std": None},
        "mu_max": {"value": 0.302, "std": 0.002},
        "lambda_m": {"value": 0.0180, "std": 0.0005},
    }
    gain = {"percent": 1.0, "interval": [0, 2], "rmse_before": 0.02, "rmse_after": 0.01}
    diagnosis = {"verdict": verdict, "channel": channel, "causes": causes, "gain": gain}
    base = {"kind": kind, "seed": 1, "status": 0, "seconds": 1.0, "rss_mb": 1.0, "truth": truth}
    return base | {"diagnosis": diagnosis | {"extended": extended} | more}


@pytest.mark.parametrize(
    ("kind", "causes", "wanted", "blames"),
    [
        ("contact:extended", [_cause("curve_shape")], "named", False),
        ("contact:extended", [_cause("falling_friction")], "named", False),
        ("contact:extended", [_cause("speed_dependence", "falling_friction")], "named", False),
        (
            "contact:extended",
            [_cause("falling_friction"), _cause("speed_scale")],
            "wrong",
            True,
        ),
        ("contact:extended", [_cause("humidity")], "wrong", False),
        ("contact:extended", [_cause("effort_bias")], "wrong", True),
        ("points:fastsim", [_cause("curve_shape", "falling_friction")], "named", False),
        ("contact:extended+humidity", [_cause("curve_shape"), _cause("humidity")], "both", False),
        ("contact:extended+humidity", [_cause("humidity"), _cause("speed_scale")], "one", True),
        ("contact:extended+humidity", [_cause("falling_friction")], "shape", False),
        ("contact:extended+humidity", [_cause("sanding")], "wrong", False),
        ("contact:extended+speed_scale", [_cause("speed_scale")], "one", False),
        ("contact:extended+speed_scale", [_cause("effort_bias", "speed_scale")], "one", False),
    ],
)
def test_a_contact_is_named_by_its_shape_and_blames_no_instrument(
    tools, kind, causes, wanted, blames
):
    row = tools.judge.judge_record(_record(kind, causes))
    assert row.outcome == wanted
    assert row.blames_instrument == blames


def test_nothing_is_right_where_the_misfit_is_small(tools):
    small = _record("contact:fastsim", [], "nothing_found", excess=0.05)
    assert tools.judge.judge_record(small).outcome == "nothing below noise"
    large = _record("contact:fastsim", [], "nothing_found")
    assert tools.judge.judge_record(large).outcome == "nothing"
    slip = _record("contact:fastsim", [], "unexplained", "slip")
    assert tools.judge.judge_record(slip).outcome == "unexplained"


def test_the_peak_after_extension_is_held_against_the_true_one(tools):
    row = tools.judge.judge_record(_record("contact:extended", [_cause("curve_shape")]))
    assert row.peak.mu_max == pytest.approx(0.302 / 0.30 - 1)
    assert row.peak.lambda_m == pytest.approx(-0.1)
    assert row.peak.covered == (True, False)
    plateau = _record("contact:coulomb", [])
    plateau["truth"]["peak"]["interior"] = False
    found = tools.judge.judge_record(plateau).peak
    assert found.lambda_m is None
    assert found.covered == (True,)
    unknown = _record("contact:extended", [], extended=None)
    assert tools.judge.judge_record(unknown).peak is None
    unsure = _record("contact:extended", [])
    unsure["diagnosis"]["extended"]["mu_max"]["std"] = None
    assert tools.judge.judge_record(unsure).peak.covered == (False,)


def test_falling_friction_moves_the_peak_to_the_speed_of_the_drive(tools):
    # 0.34 (1 − e^(−200 λ)) e^(−c4 λ v) has its peak where 200/(e^(200 λ) − 1) = c4 v.
    at = np.log1p(200.0 / 5.0) / 200.0
    record = _record("contact:extended", [_cause("falling_friction", c4=0.5)])
    found = tools.judge.judge_record(record).peak
    assert found.lambda_m == pytest.approx(at / 0.020 - 1, abs=2e-3)
    height = 0.34 * -np.expm1(-200 * at) * np.exp(-5.0 * at)
    assert found.mu_max == pytest.approx(height / 0.30 - 1, abs=1e-5)
    record = _record("contact:extended", [_cause("falling_friction", A=1.0, B=0.3)])
    flat = tools.judge.judge_record(record).peak
    assert flat.mu_max == pytest.approx(0.34 / 0.30 - 1, abs=1e-3)


def test_a_sensor_that_is_said_to_cut_off_is_blamed(tools):
    record = _record("contact:coulomb", [], "unexplained", "tractive_effort")
    assert tools.judge.judge_record(record).blames_instrument


def test_the_targets_of_contacts_are_printed_beside_their_figures(tools):
    records = [_record("contact:extended", [_cause("curve_shape")]) for _ in range(20)]
    records.append(_record("contact:polach-wet+humidity", [_cause("humidity")]))
    rows = [tools.judge.judge_record(record) for record in records]
    found = {t.what: t for t in tools.tables.targets(rows)}
    assert found["contacts: shape or falling friction named, or too small"].verdict == "met"
    assert found["contacts: λ_m after extension within 8 %"].verdict == "FAILED"
    assert found["contact and effect: effect named"].figure.startswith("100.0%")
    assert found["points: μ_max after extension within 1 %"].verdict == "no data"
    text = tools.tables.confusion(rows)
    assert "| contact:extended" in text
    assert "| contact:polach-wet+humidity" in text
    plain = tools.tables.targets([r for r in rows if r.group == "single"])
    assert not [t for t in plain if t.what.startswith("contact")]


# --- setpoints beside the truth ------------------------------------------------------------------


def _setpoints(tools, **changed):
    n = 100
    arrays = {
        "t": 19.0 + 0.1 * np.arange(n),
        "tracking": np.ones(n, dtype=bool),
        "mu_max": np.full(n, 0.3),
        "mu_max_std": np.full(n, 0.001),
        "lambda_m": np.full(n, 0.02),
        "lambda_m_std": np.full(n, 0.0001),
        "true_mu_max": np.full(n, 0.3),
        "true_lambda_m": np.full(n, 0.02),
        "interior": np.ones(n, dtype=bool),
        "reached": np.ones(n),
    }
    return tools.figures.Setpoints(**(arrays | changed))


def test_what_is_right_is_not_wrong(tools):
    found = tools.figures.judge(_setpoints(tools))
    assert found.rows == found.tracking == found.peaks == 90
    assert found.wrong("mu_max") == found.wrong("lambda_m") == 0
    assert found.rms("lambda_m") == pytest.approx(0.0, abs=1e-12)
    assert found.reached_at(0.05) == 1


def test_wrong_is_far_in_standard_deviations_and_in_percent(tools):
    def wrong(mu, std):
        found = tools.figures.judge(
            _setpoints(tools, mu_max=np.full(100, mu), mu_max_std=np.full(100, std))
        )
        return found.wrong("mu_max")

    assert wrong(0.3 * 1.021, 0.001) == 1
    assert wrong(0.3 * 0.979, 0.001) == 1
    assert wrong(0.3 * 1.019, 0.0001) == 0  # below 2 %
    assert wrong(0.3 * 1.05, 0.006) == 0  # within 3 standard deviations
    assert wrong(0.3 * 1.05, 0.004) == 1
    assert wrong(0.3 * 1.5, np.nan) == 0  # claims nothing
    slips = tools.figures.judge(_setpoints(tools, lambda_m=np.full(100, 0.02 * 1.04)))
    assert slips.wrong("lambda_m") == 0
    slips = tools.figures.judge(_setpoints(tools, lambda_m=np.full(100, 0.02 * 1.06)))
    assert slips.wrong("lambda_m") == 1
    assert slips.rms("lambda_m") == pytest.approx(0.06)


def test_only_tracking_is_judged_and_no_slip_of_a_plateau(tools):
    off = np.full(100, 0.4)
    late = np.arange(100) >= 50
    found = tools.figures.judge(_setpoints(tools, mu_max=off, tracking=late))
    assert found.tracking == 50
    assert found.tracking_share() == pytest.approx(50 / 90)
    none = tools.figures.judge(_setpoints(tools, tracking=np.zeros(100, dtype=bool)))
    assert np.isnan(none.wrong("mu_max"))
    assert np.isnan(none.reached_at(0.05))
    flat = tools.figures.judge(_setpoints(tools, lambda_m=off, interior=np.zeros(100, dtype=bool)))
    assert np.isnan(flat.wrong("lambda_m"))


def test_drives_are_pooled_by_their_tracking_time(tools):
    one = tools.figures.judge(_setpoints(tools, mu_max=np.full(100, 0.33)))
    two = tools.figures.judge(
        _setpoints(tools, tracking=np.arange(100) >= 70, reached=np.full(100, 0.9))
    )
    both = tools.figures.pooled([one, two])
    assert both.tracking == 120
    assert both.wrong("mu_max") == pytest.approx(90 / 120)
    assert both.rms("mu_max") == pytest.approx(0.1 * np.sqrt(90 / 120))
    assert both.reached_at(0.2) == pytest.approx(0.9)
    assert both.reached_at(0.3) == pytest.approx(1.0)
    again = tools.figures.figures_of(both.to_dict())
    assert again.reached_at(0.2) == pytest.approx(0.9)
    assert np.isnan(tools.figures.pooled([]).wrong("mu_max"))


def _truth_record(tools, kind, plain, model):
    figures = {
        way: tools.figures.judge(_setpoints(tools, mu_max=np.full(100, mu))).to_dict()
        for way, mu in (("plain", plain), ("model", model))
    }
    return {"kind": kind, "seed": 1, "duration_s": 240.0, "causes": [], **figures}


def test_the_targets_of_the_setpoints(tools):
    good = [_truth_record(tools, "null:0", 0.3, 0.3), _truth_record(tools, "humidity", 0.3, 0.3)]
    assert {t.verdict for t in tools.truth.targets(good)} == {"met"}
    bad = [*good, _truth_record(tools, "sanding", 0.3, 0.35)]
    found = {t.what: t for t in tools.truth.targets(bad)}
    assert found["more wrong μ_max with the model"].figure == "sanding"
    assert found["more wrong μ_max with the model"].verdict == "FAILED"
    assert found["TRACKING with a wrong μ_max, mean of all kinds, plain"].verdict == "met"
    assert found["TRACKING with a wrong μ_max, mean of all kinds, model"].figure == "33.3 %"
    text = tools.truth.report([*bad, {"kind": "humidity", "error": "x", "duration_s": 1}], 5, "v")
    assert "| sanding" in text
    assert "drives that failed" in text
    assert "FAILED" in text
    assert tools.truth.targets([])[0].verdict == "no data"


def test_the_bench_plans_the_same_drives_however_many_rounds(tools):
    one = tools.truth.build_tasks(7, 1, [], 240.0)
    assert one == tools.truth.build_tasks(7, 3, [], 240.0)[: len(one)]
    kinds = [kind for kind, *_ in one]
    assert len(kinds) == len(set(kinds)) == 2 + 18 + 4 + 2 + 3 + 2
    assert [k for k, *_ in tools.truth.build_tasks(7, 1, ["contact:extended+sanding"], 1.0)] == [
        "contact:extended+sanding"
    ]
    assert len(tools.truth.build_tasks(7, 1, ["contact"], 1.0)) == 4 + 2
    with pytest.raises(SystemExit):
        tools.truth.parse_options(["--only", "contact:coulomb"])


def test_a_bench_that_was_stopped_goes_on_and_tries_again_what_failed(tools, tmp_path):
    tasks = tools.truth.build_tasks(7, 1, ["null:0", "humidity", "sanding"], 240.0)
    results = tools.plan.Results(tmp_path / "r.jsonl", "v1")
    record = {"seed": 7, "holdout": False}
    results.add({**record, "kind": "humidity", "duration_s": 240.0})
    results.add({**record, "kind": "humidity", "duration_s": 60.0})
    results.add({**record, "kind": "sanding", "duration_s": 240.0, "error": "x"})
    again = tools.plan.Results(tmp_path / "r.jsonl", "v1").records()
    assert len(again) == 3
    left = tools.truth.tasks_left(tasks, again)
    assert [kind for kind, *_ in left] == ["null:0", "sanding"]


# --- before the peak -----------------------------------------------------------------------------


def test_the_information_bounds_the_error_of_a_known_shape(tools):
    bound = tools.bound
    phi = np.log([0.35, 45.0, 4.1])
    data, slope = bound.information(phi, 0.9, 1000, 0.01)
    # ln μ_max goes with ln c1 one to one, and with ln c2 not at all.
    assert slope[:2] == pytest.approx([1.0, 0.0], abs=1e-6)
    # Shape known: the level has the error of a fit of one factor.
    theta = bound.theta_of(phi)
    slip = (np.arange(200) + 0.5) / 200 * bound.slip_at_use(theta, 0.9)
    from adhesion_can.physics.burckhardt import adhesion

    assert data[0, 0] == pytest.approx(5 * np.sum(adhesion(slip, *theta) ** 2) / 0.01**2, rel=1e-4)
    narrow = np.array([1.0, 1e-4, 1e-4])
    assert bound.local_variance(phi, narrow, 0.9, 1000, 0.01) == pytest.approx(
        1 / data[0, 0], rel=0.01
    )


def test_van_trees_is_below_the_local_bound_and_falls_with_what_is_used(tools):
    bound, rng = tools.bound, np.random.default_rng(2)
    _, centre, scale = bound.components(tools.prepeak.PriorSettings())[0]
    phis = [bound.draw_surface(rng, centre, scale) for _ in range(30)]
    before = np.inf
    for used in (0.5, 0.7, 0.95):
        least = bound.van_trees_variance(phis, scale, used, 500, 0.01)
        local = np.mean([bound.local_variance(p, scale, used, 500, 0.01) for p in phis])
        assert 0 < least <= local * (1 + 1e-9)
        assert least < before
        before = least


def test_a_slip_uses_the_share_that_is_asked_for(tools):
    from adhesion_can.physics.burckhardt import adhesion, peak

    theta = (0.35, 45.0, 0.2)
    for used in (0.5, 0.95):
        slip = tools.bound.slip_at_use(theta, used)
        top = peak(*theta, slip_max=1.0)
        assert slip < top.lambda_m
        assert adhesion(np.array([slip]), *theta)[0] == pytest.approx(used * float(top.mu_max))


def test_the_summary_counts_coverage_and_wide_claims(tools):
    runs = [
        (0.01, 0.01, True, True, 0.0001, 0.01, 0.01),
        (0.03, 0.01, True, False, 0.0001, 0.03, 0.03),
        (-0.05, 0.05, True, False, 0.0004, -0.05, 0.01),
        (0.0, np.inf, False, False, 0.0002, 0.0, 0.02),
    ]
    found = tools.prepeak.summarise(runs, 0.03)
    assert found["coverage"] == 0.75
    assert found["low_excitation"] == 0.75
    assert found["known_but_wide"] == 1
    assert found["exact_coverage"] == 0.75
    assert found["exact_rmse"] == pytest.approx(found["rmse"])
    assert found["local_bound"] == pytest.approx(np.sqrt(0.0002))
    assert found["rmse"] == pytest.approx(np.sqrt((0.01**2 + 0.03**2 + 0.05**2) / 4))
