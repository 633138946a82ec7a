"""The worlds themselves: what they write is what the bus would carry, and hides what they say."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import e2e
import numpy as np
import pytest

from tests.worlds import KINDS, LAWS, NULLS, OUTSIDE, PAIRS, SINGLES, make_world
from tests.worlds.drive_profile import LEAD, STEP_S
from tests.worlds.encoding import database, messages
from tests.worlds.fitting import fit
from tests.worlds.hidden import Hidden, State, contact
from tests.worlds.other_laws import OTHER_LAWS
from tests.worlds.plant import draw_noise, drive, view
from tests.worlds.rail import curve, draw_curve, peak
from tests.worlds.world import World

ROOT = Path(__file__).resolve().parents[2]
LINE = re.compile(r"\((\d+)\.(\d{6})\) can0 ([0-9A-F]{3})#([0-9A-F]{16})")


@pytest.fixture(scope="module")
def world():
    return World("null:0", 3, 0, 60.0)


@pytest.mark.costly
def test_worlds_share_no_code_with_the_product():
    names = "tests.worlds, tests.worlds.outside.world, tests.worlds.outside.car"
    code = f"import sys, {names}; print([m for m in sys.modules if 'adhesion_can' in m])"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_every_frame_is_what_cantools_and_e2e_make_of_the_readings(world, tmp_path):
    readings = drive(world.profile, world.vehicle, world.rail, (), world.noise)
    world.written((), tmp_path / "a.log", (0.1, 0.6), False)
    frames = [LINE.fullmatch(line) for line in (tmp_path / "a.log").read_text().splitlines()]
    assert all(frames)
    by_id = {}
    for m in frames:
        by_id.setdefault(int(m[3], 16), []).append((int(m[1] + m[2]), bytes.fromhex(m[4])))
    for name, signals in messages(readings).items():
        message = database().get_message_by_name(name)
        sent = by_id.pop(message.frame_id)
        assert [t for t, _ in sent] == list(range(0, 60_000_000, message.cycle_time * 1000))
        zero = {s.name: 0 for s in message.signals}
        for k in range(0, len(sent), 1 + len(sent) // 150):
            values = {n: float(column[k]) for n, column in signals.items()}
            expected = bytearray(message.encode(zero | values))
            expected[1] = k % 15
            e2e.p01.e2e_p01_protect(expected, message.frame_id, increment_counter=False)
            assert sent[k][1] == bytes(expected), (name, k)
    assert not by_id


@pytest.mark.costly
@pytest.mark.parametrize("kind", [*SINGLES, *LAWS, *OUTSIDE, PAIRS[7]])
def test_each_effect_is_as_large_as_is_stated(kind, tmp_path):
    path = tmp_path / ("a.csv" if kind == "out:table" else "a.log")
    truth = make_world(kind, 5, path, duration_s=120.0)
    assert path.stat().st_size > 100_000
    assert len(truth.effects) == len(truth.excess) == (2 if kind.startswith("pair:") else 1)
    assert all(0.1 <= share <= 0.71 for share in truth.excess)
    assert all(name in kind for name in truth.names)
    assert truth.rmse_before >= 1.1 * truth.noise_floor
    # With the kinematics' noise away, as a diagnosis may have it, more is gained than is felt.
    assert truth.true_gain_percent() > 100 * (1 - truth.noise_floor / truth.rmse_before) - 10
    assert json.loads(truth.to_json())["kind"] == kind


@pytest.mark.parametrize("kind", NULLS)
def test_a_null_hides_nothing(kind, tmp_path):
    truth = make_world(kind, 1, tmp_path / "a.log", duration_s=120.0)
    assert truth.effects == ()
    assert truth.true_gain_percent([(20, 50)]) == pytest.approx(0, abs=1e-9)
    assert truth.rmse_before == pytest.approx(truth.noise_floor, rel=0.1)
    assert (len(truth.surfaces) > 2) == (kind == "null:surfaces")


def test_the_gain_is_that_of_the_spans_held_out(tmp_path):
    truth = make_world("sanding", 2, tmp_path / "a.log", duration_s=120.0)
    gains = [truth.true_gain_percent([(a, a + 30)]) for a in (1, 31, 61, 90)]
    assert max(gains) - min(gains) > 1
    assert np.mean(gains) == pytest.approx(truth.true_gain_percent(), abs=10)
    assert truth.floor_on([(1, 119)]) == pytest.approx(truth.noise_floor, rel=0.05)


def test_the_same_seed_gives_the_same_bytes_and_a_fresh_drive_the_same_world(tmp_path):
    first = make_world("humidity", 4, tmp_path / "a.log", duration_s=60.0, fresh=True)
    again = make_world("humidity", 4, tmp_path / "b.log", duration_s=60.0)
    other = make_world("humidity", 5, tmp_path / "c.log", duration_s=60.0)
    files = {name: (tmp_path / f"{name}.log").read_bytes() for name in "abc"}
    assert files["a"] == files["b"] != files["c"]
    assert first.effects == again.effects != other.effects
    assert first.fresh.effects == first.effects
    assert first.fresh.surfaces == first.surfaces
    assert (tmp_path / "a_fresh.log").read_bytes() != files["a"]
    table = make_world("out:table", 4, tmp_path / "t.csv", duration_s=60.0, fresh=True)
    assert table.fresh.channel == table.channel
    header = (tmp_path / "t_fresh.csv").read_text().splitlines()[0].split(",")
    assert {"time_s", "slip", table.channel} <= set(header)


def test_kinds_are_all_singles_all_pairs_nulls_and_the_rest(tmp_path):
    assert len(SINGLES) == 18
    assert len(PAIRS) == 153
    assert len(KINDS) == 18 + 11 + 153 + len(NULLS) + len(OUTSIDE) + 6 + 6 * 17 + 6
    with pytest.raises(ValueError, match="no kind 'rain'"):
        make_world("rain", 1, tmp_path / "a.log")


def test_drives_have_every_phase_and_keep_their_speed():
    for seed in range(4):
        profile = World("null:0", seed, 0, 240.0).profile
        mean = profile.slip.mean(axis=1)
        assert np.mean(mean > 0.005) > 0.15
        assert np.mean(mean < -0.005) > 0.15
        assert np.mean(np.abs(mean) < 1e-6) > 0.1
        assert profile.v.min() > 4
        assert profile.v.max() < 25
        assert np.ptp(profile.humidity) > 25
        assert np.ptp(profile.rail_temperature) >= 10
        assert np.ptp(np.abs(profile.curvature)) > 1 / 1600
        assert np.sum(np.diff(profile.sanding) > 0) >= 3


def test_the_noise_has_its_size_and_its_memory():
    rng = np.random.default_rng(1)
    white, slow = draw_noise(rng, 20_000, 0.0).effort, draw_noise(rng, 200_000, 1.0).effort
    # 20 000 times at least: six standard errors.
    assert white.std() == pytest.approx(2450, rel=0.03)
    assert slow.std() == pytest.approx(2450, rel=0.05)
    lag = np.mean(slow[100:] * slow[:-100]) / slow.var()
    assert lag == pytest.approx(np.exp(-1), abs=0.06)


def test_the_fit_finds_the_curve(world):
    readings = drive(world.profile, world.vehicle, world.rail, (), world.noise)
    c = fit(view(readings, (), world.rail, world.vehicle))
    assert peak(c)[0] == pytest.approx(peak(world.rail.curves[0])[0], rel=0.02)
    assert peak(c)[1] == pytest.approx(peak(world.rail.curves[0])[1], rel=0.1)


def _state(slip, v=10.0):
    n = len(slip)
    return State(
        t=np.arange(n) * STEP_S,
        v=np.full(n, v),
        slip=np.repeat(slip[:, None], 6, axis=1),
        load=np.full((n, 6), 2e5),
        position=np.arange(n) * STEP_S * v,
        curvature=np.full(n, 0.002),
        humidity=np.full(n, 70.0),
        rail_temperature=np.full(n, 10.0),
        sanding=np.zeros(n),
        order=np.arange(1, 7),
        behind=np.zeros(6),
    )


def test_relaxation_follows_a_step_over_its_length_and_cleaning_work_settles():
    c = np.array([0.3, 50.0, 0.1])
    step = np.where(np.arange(600) >= 100, 0.05, 0.0)
    late = contact(_state(step), [Hidden("creep_relaxation", "", {"length": 2.0})], c[None])
    # 2 m at 10 m/s: 63 % after 0.2 s.
    assert late.slip[119, 0] == pytest.approx(0.05 * (1 - np.exp(-1)), rel=0.05)
    steady = np.full(3000, 0.05)
    recovery = Hidden("adhesion_recovery", "", {"gain": 1e-6, "time": 2.0})
    factor = contact(_state(steady), [recovery], np.tile(c, (3000, 1))).factor[-1, 0]
    # W = P·time and P = factor·bare, so factor = 1 / (1 − gain·time·bare).
    bare = curve(c, np.array(0.05)) * 2e5 * 0.5
    assert factor == pytest.approx(1 / (1 - 2e-6 * bare), rel=1e-3)


@pytest.mark.parametrize("effect", OTHER_LAWS)
def test_another_law_is_the_same_mechanism(effect):
    """It moves the adhesion the way that its library law does, and by no factor of that."""
    law = OTHER_LAWS[effect]
    kinds = {"speed_dependence": "share", "load_dependence": "c5", "falling_friction": "c4",
             "curve_creep": "lever", "humidity": "slope", "rail_temperature": "slope",
             "slow_drift": "rate"}  # fmt: skip
    size, other = {
        "speed_dependence": (1.0, 0.8), "load_dependence": (2e-12, 1e-6),
        "falling_friction": (0.2, 0.2), "curve_creep": (10.0, 13.0), "slow_drift": (2e-3, 2e-3),
        "adhesion_recovery": (2e-7, 2e-7),
    }.get(effect, (0.004, 0.004))  # fmt: skip
    more = {"time": 3.0} if effect == "adhesion_recovery" else {}
    rng = np.random.default_rng(3)
    n = 6000
    state = replace(
        _state(0.06 * np.sin((np.arange(n) + 0.5) / 300)),
        v=np.linspace(6, 20, n),
        load=2e5 * (1 + 0.1 * rng.standard_normal((n, 6))),
        humidity=np.linspace(45, 85, n),
        rail_temperature=np.linspace(0, 25, n),
        curvature=np.linspace(0, 0.003, n),
        sanding=(np.arange(n) // 1500 % 2).astype(float),
    )
    c = np.array([0.3, 50.0, 0.1])

    def adhesion(form, parameters):
        hidden = [Hidden(effect, form, parameters | more)] if form is not None else []
        return contact(state, hidden, np.tile(c, (n, 1))).adhesion(c)

    form = "burckhardt" if effect in ("load_dependence", "falling_friction") else ""
    bare = adhesion(None, {})
    moves = [
        adhesion(form, {kinds.get(effect, "gain"): size}) / bare,
        adhesion(law.form, {law.name: other}) / bare,
    ]
    felt = np.abs(state.slip) > 0.01
    one, two = (move[felt] - move[felt].mean() for move in moves)
    assert np.corrcoef(one, two)[0, 1] > 0.9
    assert 0.5 < np.std(two) / np.std(one) < 2


def test_lateral_creep_takes_its_part():
    c = np.array([0.3, 50.0, 0.1])
    found = contact(_state(np.full(3, -0.03)), [Hidden("curve_creep", "", {"lever": 20.0})], c)
    # 20 m · 0.002 /m = 0.04: with 0.03 along, 0.05 in all.
    assert found.adhesion(c)[1, 2] == pytest.approx(-0.6 * curve(c, np.array(0.05)))


def test_sensor_effects_shift_what_they_read(world):
    def readings(effect, **parameters):
        hidden = (Hidden(effect, "", parameters),)
        return drive(world.profile, world.vehicle, world.rail, hidden, world.noise)

    plain = drive(world.profile, world.vehicle, world.rail, (), world.noise)
    assert np.allclose(readings("effort_bias", bias=500.0).effort - plain.effort, 500, atol=10)
    scaled = readings("speed_scale", error=0.02).speed
    assert np.allclose(scaled, plain.speed + 0.02 * world.profile.v[LEAD::2], atol=0.003)
    late = readings("speed_delay", delay=0.4).speed
    true = world.profile.v[LEAD - 40 : -40 : 2]
    assert np.std(late - true) == pytest.approx(0.01, rel=0.1)
    small = readings("wheel_radius", error=-0.04, axle=3).wheel_speed
    assert np.allclose(small[:, 2] * 0.96, plain.wheel_speed[:, 2], atol=0.01)
    assert np.allclose(small[:, 3], plain.wheel_speed[:, 3], atol=1e-9)
    assert np.abs(readings("out:saturation", limit=2e4).effort).max() <= 2e4


def test_surfaces_are_plausible():
    rng = np.random.default_rng(7)
    for _ in range(50):
        mu_max, lambda_m = peak(draw_curve(rng))
        assert 0.149 < mu_max < 0.451
        assert 0.029 < lambda_m < 0.151


# --- the hunt's rules ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def hunting():
    sys.path.insert(0, str(ROOT / "tools" / "hunting"))
    import judge
    import plan
    import tables
    import work

    return SimpleNamespace(judge=judge, plan=plan, tables=tables, work=work)


def _cause(effect, *rivals, **parameters):
    found = {name: {"value": v, "std": s, "unit": ""} for name, (v, s) in parameters.items()}
    return {"effect": effect, "rivals": list(rivals), "p_value": 0.001, "parameters": found}


def _record(kind, causes, verdict="named", channel=None, hidden=None, wanted=None, **more):
    names = kind.removeprefix("pair:").split("+") if ":" not in kind or "+" in kind else []
    effects = [{"effect": n, "form": "", "parameters": (hidden or {}).get(n, {})} for n in names]
    gain = {"percent": 20.0, "interval": [10.0, 30.0], "rmse_before": 0.02, "rmse_after": 0.016}
    diagnosis = {"verdict": verdict, "channel": channel, "causes": causes, "gain": gain}
    base = {"kind": kind, "seed": 1, "holdout": False, "status": 0, "seconds": 1.0, "rss_mb": 99.0}
    truth = {"effects": effects, "channel": wanted}
    return {**base, "truth": truth, "diagnosis": diagnosis, **more}


@pytest.mark.parametrize(
    ("kind", "causes", "wanted"),
    [
        ("humidity", [_cause("humidity")], "named"),
        ("humidity", [_cause("sanding")], "wrong"),
        ("humidity", [_cause("slow_drift", "humidity")], "rival"),
        ("humidity", [_cause("humidity"), _cause("sanding")], "wrong"),
        ("humidity", [_cause("humidity", "sanding"), _cause("sanding")], "named"),
        ("pair:humidity+sanding", [_cause("humidity"), _cause("sanding")], "both"),
        ("pair:humidity+sanding", [_cause("humidity", "sanding")], "one"),
        ("pair:humidity+sanding", [_cause("slow_drift", "humidity"), _cause("sanding")], "both"),
        ("pair:humidity+sanding", [_cause("slow_drift")], "wrong"),
        ("humidity", [_cause("humidity", "sanding", "slow_drift")], "wrong"),
        ("pair:humidity+sanding", [_cause("slow_drift", "humidity", "sanding")], "wrong"),
        ("null:1", [_cause("humidity")], "wrong"),
        ("out:hump", [_cause("humidity")], "wrong"),
    ],
)
def test_a_name_is_right_by_itself_or_by_its_rivals(hunting, kind, causes, wanted):
    assert hunting.judge.judge_record(_record(kind, causes)).outcome == wanted


@pytest.mark.parametrize(
    ("kind", "verdict", "channel", "wanted", "outcome"),
    [
        ("null:1", "nothing_found", None, None, "nothing"),
        ("null:1", "unexplained", "time", None, "unexplained"),
        ("out:hump", "unexplained", "slip", "slip", "unexplained"),
        ("out:hump", "unexplained", "time", "slip", "wrong channel"),
        ("out:torsion", "unexplained", "time", None, "unexplained"),
        ("out:hump", "nothing_found", None, "slip", "nothing"),
        ("sanding", "unexplained", "slip", None, "unexplained"),
    ],
)
def test_what_is_not_known_is_judged_by_its_channel(
    hunting, kind, verdict, channel, wanted, outcome
):
    record = _record(kind, [], verdict, channel, wanted=wanted)
    assert hunting.judge.judge_record(record).outcome == outcome


def test_gain_floor_and_parameters_are_judged_beside_the_truth(hunting):
    causes = [_cause("humidity", slope=(-0.0030, 0.0005))]
    hidden = {"humidity": {"slope": -0.0035}}
    row = hunting.judge.judge_record(
        _record("humidity", causes, hidden=hidden, true_gain=29.0, floor=0.0150)
    )
    assert row.covered
    assert row.gain_error == pytest.approx(-9)
    assert row.floor_ratio == pytest.approx(0.016 / 0.015)
    assert row.inside == (True,)
    hidden = {"humidity": {"slope": -0.0041}}
    row = hunting.judge.judge_record(
        _record("humidity", causes, hidden=hidden, true_gain=31.0, floor=0.0150)
    )
    assert not row.covered
    assert row.inside == (False,)
    axle = [_cause("wheel_radius", error=(0.01, 0.001), axle=(3, None))]
    hidden = {"wheel_radius": {"error": 0.01, "axle": 2}}
    assert hunting.judge.judge_record(_record("wheel_radius", axle, hidden=hidden)).inside == (
        False,
    )


def test_a_target_fails_when_its_bound_excludes_it(hunting):
    share = hunting.tables.share
    assert share("x", [True] * 19 + [False], 0.95).verdict == "met"
    assert share("x", [True] * 18 + [False] * 2, 0.95).verdict == "not met"
    assert share("x", [True] * 80 + [False] * 20, 0.95).verdict == "FAILED"
    assert share("x", [True] * 100, 0.85, 0.97).verdict == "FAILED"
    assert share("x", [], 0.95).verdict == "no data"
    # 19 of 20: the lower bound is the p at which 19 or 20 of 20 have a chance of 5 %.
    low, _ = hunting.tables.bounds(19, 20)
    assert 20 * low**19 * (1 - low) + low**20 == pytest.approx(0.05, rel=1e-6)


def test_a_hunt_plans_its_drives_and_goes_on_where_it_was_killed(hunting, tmp_path):
    tasks = hunting.plan.build_tasks(7, 2, [])
    a_round = 18 + 11 + 10 + 4 + 5 + 6 + 6 + 6
    assert len(tasks) == 2 * a_round
    assert tasks[:a_round] == hunting.plan.build_tasks(7, 1, [])
    assert {t.kind for t in hunting.plan.build_tasks(7, 1, ["null", PAIRS[3]])} == {
        *NULLS,
        PAIRS[3],
    }
    path = tmp_path / "r.jsonl"
    results = hunting.plan.Results(path, "v1")
    results.begin(7)
    results.add(_record("humidity", []))
    with path.open("a") as file:
        file.write('{"version": "v1", "kind": "sand')
    again = hunting.plan.Results(path, "v1")
    assert again.seed == 7
    assert [r["kind"] for r in again.records()] == ["humidity"]
    again.add(_record("sanding", []))
    assert len(hunting.plan.Results(path, "v1").records()) == 2
    assert hunting.plan.Results(path, "v2").records() == []
    assert hunting.plan.Results(path, "v2").seed is None
    rows = [hunting.judge.judge_record(r) for r in again.records()]
    assert "| sanding" in hunting.tables.confusion(rows)
    assert "no data" in hunting.tables.target_table(hunting.tables.targets(rows))


def test_a_diagnosis_that_crashes_is_a_finding(hunting, tmp_path):
    diagnosis_options = hunting.work.DiagnosisOptions(entry="json:loads", timeout_s=60)
    found = hunting.work.run_diagnosis(["diagnose"], diagnosis_options, tmp_path / "output.txt")
    assert found["status"] == "crashed"
    assert "TypeError" in found["error"]
    assert 5 < found["rss_mb"] < 2048
