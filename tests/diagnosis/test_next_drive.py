"""The drive that would tell: its criterion, the search of the shortest one, and the whole way."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from adhesion_can.api.configuration import as_configuration
from adhesion_can.api.diagnosis import diagnose
from adhesion_can.api.simulation import (
    build_run_settings,
    drive_plan,
    make_simulation,
    simulate,
)
from adhesion_can.config.plan_file import read_plan, write_plan
from adhesion_can.diagnosis.drive.kinematics import SpeedError
from adhesion_can.diagnosis.next_drive import compute_next_drive
from adhesion_can.diagnosis.next_drive.catalogue import QUICK_S, build_catalogue
from adhesion_can.diagnosis.next_drive.compute_next_drive import (
    needed_discrepancy,
    plan_drive,
    power_of,
)
from adhesion_can.diagnosis.next_drive.discrepancy import ExplanationComparison, add_grams, minimise
from adhesion_can.diagnosis.next_drive.drive_setting import DriveSetting, TrainResistance
from adhesion_can.diagnosis.next_drive.explanations import PLAIN, Explanation
from adhesion_can.diagnosis.next_drive.planned_drive import DriveStart, predict_drive
from adhesion_can.diagnosis.next_drive.search import find_shortest
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model, evaluate_model
from adhesion_can.diagnosis.regression.segment_curves import BURCKHARDT, SegmentCurves
from adhesion_can.physics.driving_plan import DrivingPlan, PlanLimits, PlanStep
from adhesion_can.physics.effects import EFFECTS, effect_by_id
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.scenarios import surface_by_name

CURVE = SegmentCurves.from_parameters(BURCKHARDT, np.array([[0.4, 60.0, 0.3]]))
SETTING = DriveSetting(
    vehicle=Locomotive(),
    load=np.full(6, 245e3),
    resistance=TrainResistance(1.65e6, 0.0, -0.01),
    speed=12.0,
    covariates={"sanding_active": 0.0},
    wheel_std=5e-4,
    speed_error=SpeedError(0.0012, 3.0, 0.0012),
    noise=0.01,
    cycle_s=0.06,
    block_length_s=6.0,
)
START = DriveStart(2.0, 12.0)
TRACTION = PlanStep(6.0, "traction", (0.002, 0.14), 6.0, stagger=True)
BRAKING = PlanStep(6.0, "braking", (0.002, 0.14), 6.0, stagger=True)
COAST = PlanStep(3.0, "coast")


def explanation(effect=None, *values, std=0.05, axle=0):
    """An explanation whose sizes are known to a share."""
    if effect is None:
        return Explanation(PLAIN, Model(CURVE), np.zeros((0, 0)))
    candidate = Candidate(effect_by_id(effect), axle)
    information = np.diag([1.0 / (std * abs(value)) ** 2 for value in values])
    return Explanation(candidate.name, Model(CURVE, (candidate,), (tuple(values),)), information)


BIAS, SCALE = explanation("effort_bias", 8000.0), explanation("speed_scale", 0.01)
FALL, TIME = explanation("falling_friction", 0.15), explanation("slow_drift", -2e-3)


@pytest.mark.parametrize("one", [BIAS, SCALE, FALL, TIME, explanation("effort_delay", 0.03)])
def test_what_an_explanation_predicts_leaves_it_no_residual(one):
    drive = predict_drive((TRACTION, BRAKING), START, SETTING, one)
    found = evaluate_model(drive.data, one.model.curves, one.model.active_effects)
    assert np.abs(found.residual).max() < 1e-6
    (data,) = drive.data.drives
    slip = data.observe().slip[drive.step == 0]
    assert slip.min() > -1e-9
    assert slip.max() == pytest.approx(0.14, abs=0.01)


def test_axles_that_coast_before_a_pull_use_no_adhesion():
    """The slips of the next step do not begin in the one before."""
    drive = predict_drive((COAST, TRACTION, COAST), START, SETTING, FALL)
    (data,) = drive.data.drives
    seen = data.observe()
    first = drive.step == 0
    assert first.any()
    assert np.abs(seen.slip[first]).max() < 1e-9
    assert np.abs(seen.adhesion[first]).max() < 1e-6


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: f"{effect.id} {effect.form}")
def test_every_effect_of_the_library_can_be_planned_with(effect):
    """Some instruments need more of a drive than its rows, such as the efforts of all axles."""
    candidate = Candidate(effect, 2 if any(p.axle for p in effect.parameters) else 0)
    values = tuple(p.typical for p in candidate.free_parameters)
    model, information = Model(CURVE, (candidate,), (values,)), np.eye(len(values))
    one = Explanation(candidate.name, model, information)
    setting = replace(SETTING, covariates=dict.fromkeys(effect.requires.covariates, 0.1))
    drive = predict_drive((TRACTION, BRAKING), START, setting, one)
    found = evaluate_model(drive.data, model.curves, model.active_effects)
    assert np.abs(found.residual).max() < 1e-3
    comparison = ExplanationComparison((one, explanation()), setting)
    grams = comparison.build_part((TRACTION, BRAKING), START).grams
    assert all(np.isfinite(gram).all() for gram in grams.values())


@pytest.mark.costly
def test_the_prediction_agrees_with_the_simulated_locomotive():
    """An oracle of its own: the plant with its wheels, its train and its controller."""
    plan = DrivingPlan((TRACTION, BRAKING), 12.0)
    config = as_configuration(None)
    settings = build_run_settings("dry", 12.0, 1, ["falling_friction=0.15"], config, plan=plan)
    simulation = make_simulation(settings, config)
    rows = []
    for _ in drive_plan(simulation, config, plan):
        plant = simulation.plant
        rows.append((simulation.now_us / 1e6, *(plant.force / plant.load)))
    rows = np.array(rows)
    curves = SegmentCurves.from_parameters(BURCKHARDT, np.array([surface_by_name("dry").theta]))
    one = Explanation(FALL.name, Model(curves, *vars_of(FALL)), FALL.information)
    drive = predict_drive(plan.steps, DriveStart(0.0, 12.0), SETTING, one)
    (data,) = drive.data.drives
    observed = data.observe().adhesion
    for axle in range(1, 7):
        own = data.axle == axle
        true = np.interp(data.t_s[own], rows[:, 0], rows[:, axle])
        # Where the curve is steep, the controller's error of the slip is what one would see.
        flat = (data.t_s[own] % 6.0 > 1.5) & (np.abs(data.observe().slip[own]) > 0.05)
        assert np.abs(true - observed[own])[flat].mean() < 0.003


def vars_of(one):
    return one.model.candidates, one.model.values


def test_an_explanation_is_at_no_distance_from_itself():
    other = explanation("effort_bias", 8000.0)
    comparison = ExplanationComparison((BIAS, SCALE), SETTING)
    gram = comparison._regression(predict_drive((TRACTION, COAST), START, SETTING, BIAS)).gram(
        other.model
    )
    assert gram[-1, -1] < 1e-6


def test_the_grams_of_parts_add_up_to_those_of_the_whole():
    comparison = ExplanationComparison((BIAS, SCALE), SETTING)
    first = comparison.build_part((TRACTION,), START)
    second = comparison.build_part((COAST,), first.end)
    apart = comparison.compute(add_grams(first.grams, second.grams))
    whole = comparison.compute(comparison.build_part((TRACTION, COAST), START).grams)
    for pair, value in whole.items():
        assert apart[pair] == pytest.approx(value, rel=0.25)


def test_the_linearised_discrepancy_is_near_the_one_after_a_fit():
    comparison = ExplanationComparison((BIAS, SCALE), SETTING)
    steps = (TRACTION, COAST, BRAKING)
    linear = comparison.compute(comparison.build_part(steps, START).grams)
    fitted = comparison.refit(steps, START)
    for pair, value in linear.items():
        assert fitted[pair].discrepancy == pytest.approx(value, rel=0.5)


def test_the_rival_s_own_parameters_lower_the_discrepancy():
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(200, 4))
    gram = columns.T @ columns
    _, free = minimise(gram, np.zeros((3, 3)))
    _, held = minimise(gram, 1e6 * np.eye(3))
    exact = np.linalg.lstsq(columns[:, :3], columns[:, 3], rcond=None)[1][0]
    assert free == pytest.approx(exact)
    assert held == pytest.approx(gram[-1, -1], rel=1e-2)
    assert free < held


def test_a_test_at_the_needed_discrepancy_has_its_power_and_its_level():
    """Cox's statistic by drawing: mean T and variance 4 T under the one, -T under the other."""
    rng = np.random.default_rng(1)
    wanted = needed_discrepancy()
    assert power_of(wanted) == pytest.approx(0.95)
    away = np.zeros(50)
    away[0] = np.sqrt(wanted)
    noise = rng.normal(size=(20_000, 50))
    excess = ((noise + away) ** 2).sum(axis=1) - (noise**2).sum(axis=1)
    refuted = excess / (2.0 * np.sqrt(wanted)) > 1.645
    assert refuted.mean() == pytest.approx(0.95, abs=0.01)


CATALOGUE = ((TRACTION,), (BRAKING,), (COAST,), (PlanStep(6.0, "traction", (0.03, 0.03)),))


@pytest.mark.parametrize("pair", [(BIAS, SCALE), (BIAS, explanation()), (FALL, TIME)])
@pytest.mark.parametrize("least_s", [0.0, 10.0])
def test_the_drive_is_as_short_as_the_best_of_all_sequences(pair, least_s):
    comparison = ExplanationComparison(pair, SETTING)
    built = {}

    def build(steps, _start):
        """Parts that do not depend on the speed, so that every sequence can be tried."""
        if steps not in built:
            built[steps] = comparison.build_part(steps, START)
        return built[steps]

    def reached(sequence):
        grams = dict(build(sequence[0], START).grams)
        for steps in sequence[1:]:
            grams = add_grams(grams, build(steps, START).grams)
        return min(comparison.compute(grams).values())

    def duration(sequence):
        return sum(step.duration_s for steps in sequence for step in steps)

    wanted = 0.6 * reached((CATALOGUE[0], CATALOGUE[1], CATALOGUE[2]))
    every = [s for count in (1, 2, 3, 4) for s in product(CATALOGUE, repeat=count)]
    good = [s for s in every if reached(s) >= wanted and duration(s) >= least_s]
    shortest = min(map(duration, good))
    most = max(reached(s) for s in good if duration(s) == shortest)
    found, _ = find_shortest(
        CATALOGUE, START, PlanLimits(), wanted, least_s, build, comparison.compute
    )
    assert found.duration_s == pytest.approx(shortest)
    assert found.reached >= 0.9 * most


@pytest.mark.costly
def test_the_sentence_says_what_to_drive_and_what_each_predicts():
    found = plan_drive((BIAS, SCALE), SETTING, PlanLimits())
    assert found.plan is not None
    assert found.sentence.startswith(f"Drive {found.plan.duration_s:g} s from 12 m/s: 1 s coasting")
    for one in (BIAS, SCALE):
        assert f"If {one.name} holds, the adhesion " in found.sentence
    assert all(pair.power > 0.95 for pair in found.pairs)
    assert {(pair.explanation, pair.rival) for pair in found.pairs} == {
        (BIAS.name, SCALE.name), (SCALE.name, BIAS.name)
    }  # fmt: skip
    assert found.plan.duration_s <= 60.0


@pytest.mark.slow
def test_the_sentence_says_what_was_assumed():
    setting = replace(SETTING, resistance=TrainResistance(1.65e6, 0.0, 0.0, is_known=False))
    found = plan_drive((BIAS, SCALE), setting, PlanLimits())
    assert "The resistance of the train is set to 0, because" in found.sentence
    falling = SegmentCurves.from_parameters(BURCKHARDT, np.array([[0.4, 1.2, 0.3]]))
    one = replace(BIAS, model=replace(BIAS.model, curves=falling))
    plan = plan_drive((one, SCALE), SETTING, PlanLimits())
    assert plan.plan is not None
    assert plan.plan.curve == pytest.approx((0.4, 1.5, 0.3))
    assert "the controller gets c2 = 1.5 instead of 1.2." in plan.sentence
    assert plan_drive((BIAS, SCALE), SETTING, PlanLimits()).sentence.endswith(".")


def test_limits_hold_in_the_plan():
    limits = PlanLimits(slip_max=0.05, braking=False, single_axles=False, effort_max=110e3)
    plan = plan_drive((BIAS, SCALE), SETTING, limits).plan
    assert plan is not None
    assert all(step.mode != "braking" and not step.axles for step in plan.steps)
    assert max(max(step.slip) for step in plan.steps) <= 0.05


@pytest.mark.slow
def test_a_pair_that_no_drive_parts_does_not_keep_the_others_together():
    nearly_plain = explanation("slow_drift", -1e-7)
    found = plan_drive((BIAS, nearly_plain, explanation()), SETTING, PlanLimits(duration_max=30.0))
    assert found.plan is not None
    missed = "within the limits, no drive of up to 30 s distinguishes the plain curve from slow"
    assert missed in found.sentence
    power = {(pair.explanation, pair.rival): pair.power for pair in found.pairs}
    assert power.pop((nearly_plain.name, PLAIN)) < 0.5
    assert all(one > 0.95 for one in power.values())


@pytest.mark.slow
@pytest.mark.parametrize(("window_s", "quick"), [(3.0, False), (1.0, True)])
def test_no_sweep_is_quicker_than_what_smooths_a_late_speed(window_s, quick, monkeypatch):
    asked = {}

    def build(*given, **named):
        asked.update(named)
        return build_catalogue(*given, **named)

    monkeypatch.setattr(compute_next_drive, "build_catalogue", build)
    setting = replace(SETTING, speed_error=SpeedError(0.0012, window_s, 0.0012))
    late = explanation("speed_delay", 0.15)
    assert plan_drive((late, explanation()), setting, PlanLimits()).plan is not None
    assert asked["quick"] == quick
    assert plan_drive((BIAS, SCALE), setting, PlanLimits()).plan is not None
    assert asked["quick"]
    periods = {
        step.period_s
        for steps in build_catalogue(PlanLimits(), 6, 0.07, sand=False, quick=False)
        for step in steps
    }
    assert QUICK_S not in periods


@pytest.mark.costly
@pytest.mark.parametrize(
    ("explanations", "limits", "said"),
    [
        ((), PlanLimits(), "no explanation remains"),
        ((BIAS,), PlanLimits(), "one explanation remains, effort_bias"),
        ((BIAS, SCALE), PlanLimits(effort_max=5e2), "no manoeuvre is within the limits"),
        ((explanation("slow_drift", -1e-7), explanation()), PlanLimits(duration_max=30.0),
         "distinguishes the plain curve from slow_drift"),
    ],
)  # fmt: skip
def test_where_nothing_tells_them_apart_there_is_no_plan(explanations, limits, said):
    found = plan_drive(explanations, SETTING, limits)
    assert found.plan is None
    assert found.sentence.startswith("No plan: ")
    assert said in found.sentence


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "duration_s", "rival"),
    [
        ("effort_delay=0.02", 120.0, "wheel_speed_delay"),
        # In 120 s it is certain, and the plain curve is none that is left.
        ("falling_friction=0.2", 60.0, PLAIN),
    ],
)
def test_from_a_drive_with_rivals_to_the_one_that_is_left(tmp_path, effect, duration_s, rival):
    id_ = effect.partition("=")[0]
    first = simulate("dry", duration_s, 1, effects=[effect]).write(tmp_path / "first.log")
    before = diagnose(first, next_drive=True)
    assert before.next_drive is not None
    (name,) = (one for one in before.next_drive.explanations if one.split()[0] == id_)
    assert rival in before.next_drive.explanations
    write_plan(before.next_drive.plan, tmp_path / "plan.toml")
    plan = read_plan(tmp_path / "plan.toml")
    drive = simulate("dry", None, 2, effects=[effect], plan=plan)
    second = drive.write(tmp_path / "second.log")
    after = diagnose([first, second])
    assert after.remaining is not None
    assert after.remaining.left == (name,)
    assert f"second.log leaves {name}" in after.remaining.sentence
    assert after.to_dict()["remaining"]["left"] == [name]


@pytest.fixture(scope="module")
def rivalled(tmp_path_factory):
    """A recording in which a dependence on the load has a rival that no block prefers."""
    path = tmp_path_factory.mktemp("rivalled") / "first.log"
    return simulate("sweep", 120.0, 3, effects=["load_dependence"]).write(path)


@pytest.mark.slow
def test_a_rival_that_is_named_is_planned_with(rivalled):
    found = diagnose(rivalled, next_drive=True)
    (cause,) = found.causes
    assert (cause.effect, cause.rivals) == ("load_dependence", ("load_transfer",))
    names = ("load_dependence burckhardt", "load_transfer geometry")
    assert found.next_drive.explanations == names
    assert [one.name for one in found.next_drive.plan.predictions] == list(names)
    assert "drive the plan" in found.next_step
    shown = [one.effect for one in found.evidence if one.decision == "rival"]
    assert set(shown) == {"load_transfer"}


@pytest.mark.slow
def test_a_rival_without_a_law_is_named_where_there_is_no_plan(rivalled, monkeypatch):
    monkeypatch.setattr("adhesion_can.diagnosis.next_drive.explanations.AS_GOOD", 2.0)
    found = diagnose(rivalled, next_drive=True)
    assert found.next_drive.plan is None
    assert "distinguishes load_dependence burckhardt from load_transfer" in found.next_step
    assert "Next: to distinguish load_dependence from load_transfer, record" in found.next_step
    assert "one explanation remains" not in found.next_step


@pytest.mark.slow
@pytest.mark.long
def test_of_two_long_recordings_one_is_held_out_and_the_explanations_are_compared(tmp_path):
    """A short drive was no use where there were two long ones."""
    effects = ["effort_delay=0.02"]
    long = [
        simulate("dry", duration_s, seed, effects=effects).write(tmp_path / f"{seed}.log")
        for seed, duration_s in ((1, 120.0), (2, 110.0))
    ]
    before = diagnose(long, next_drive=True)
    assert before.next_drive is not None
    write_plan(before.next_drive.plan, tmp_path / "plan.toml")
    plan = read_plan(tmp_path / "plan.toml")
    short = simulate("dry", None, 3, effects=effects, plan=plan).write(tmp_path / "short.log")
    for given, held_out in (([*long, short], []), ([long[0], short], [long[1]])):
        after = diagnose(given, holdout=held_out)
        assert after.held_out_files == {"2.log"}
        assert (after.remaining.before, after.remaining.by) == (("1.log",), ("short.log",))
        assert [name.split()[0] for name in after.remaining.left] == ["effort_delay"]
        assert [cause.effect for cause in after.causes] == ["effort_delay"]
