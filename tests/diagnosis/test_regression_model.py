"""The model of the data against formulas written out here, its slopes against differences."""

from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.effect_derivatives import (
    compute_effect_jacobian,
    compute_signature,
)
from adhesion_can.diagnosis.regression.model import (
    Model,
    RegressionData,
    compute_curve_jacobian,
    evaluate_model,
    remove_effect,
)
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.physics.effects import EFFECTS, ActiveEffect, effect_by_id
from adhesion_can.physics.parameter import Parameter, SearchStart
from adhesion_can.physics.vehicle import Geometry, Locomotive
from tests.diagnosis.diagnosis_helpers import (
    C1,
    C2,
    C3,
    SyntheticDrive,
    burckhardt,
)

CURVE = np.array([[C1, np.log(C2), C3]])
COVARIATES = {
    "relative_humidity_percent": (40.0, 90.0, 31.0),
    "rail_temperature_degC": (0.0, 40.0, 23.0),
    "curvature_per_m": (-0.003, 0.003, 11.0),
}


def covariates(t):
    """Each swings at a period of its own."""
    found = {
        name: (low + high) / 2 + (high - low) / 2 * np.sin(2 * np.pi * t / period)
        for name, (low, high, period) in COVARIATES.items()
    }
    found["rain"] = np.floor(t / 1.7) % 3
    return {**found, "sanding_active": (np.sin(t) > 0.3).astype(float)}


@pytest.fixture(scope="module")
def data():
    """A short drive of four axles with every covariate."""
    vehicle = Locomotive((0.625,) * 4, (245e3,) * 4, geometry=Geometry((2, 2)))
    drive = SyntheticDrive(16.0, axles=4).build_drive_data(np.random.default_rng(1), vehicle)
    drive.covariates.update(covariates(drive.t_s))
    return RegressionData(
        (drive.select_rows(slice(None, None, 5)),), np.zeros(-(-len(drive) // 5), dtype=int), 1
    )


# A step at a row has no slope.
CANDIDATES = [
    Candidate(e, 2 if any(p.axle for p in e.parameters) else 0)
    for e in EFFECTS
    if not any(p.search is SearchStart.STEP_TIME for p in e.parameters)
]


def test_without_effects_it_is_the_curve(data):
    at = evaluate_model(data, SegmentCurves(CURVE))
    seen = data.drives[0].observe()
    assert at.predicted == pytest.approx(burckhardt(seen.slip), abs=1e-12)
    assert at.residual == pytest.approx(seen.adhesion - burckhardt(seen.slip), abs=1e-12)
    shifted = evaluate_model(data, SegmentCurves(CURVE), (), np.full(len(data), 0.01))
    assert shifted.predicted == pytest.approx(burckhardt(seen.slip + 0.01), abs=1e-12)
    assert (shifted.adhesion == at.adhesion).all()


FORMULAS = {
    ("humidity", ""): ((-0.004,), lambda _, x: 1 - 0.004 * (x["relative_humidity_percent"] - 60)),
    ("rail_temperature", ""): (
        (0.006,), lambda _, x: 1 + 0.006 * (x["rail_temperature_degC"] - 20)),
    ("sanding", ""): ((0.3,), lambda _, x: 1 + 0.3 * x["sanding_active"]),
    ("slow_drift", ""): ((-0.002,), lambda _, x: 1 - 0.002 * x["time_s"]),
    ("traction_braking_asymmetry", ""): ((0.2,), lambda s, _: np.where(s.slip < 0, 1.2, 1.0)),
    ("falling_friction", "burckhardt"): ((0.1,), lambda s, _: np.exp(-0.1 * abs(s.creep_speed))),
    ("load_dependence", "burckhardt"): ((3e-12,), lambda s, _: 1 - 3e-12 * s.load**2),
}  # fmt: skip


def test_a_corrected_slip_is_a_creep_speed_as_much_faster(data):
    seen, shift = data.drives[0].observe(), np.linspace(-0.01, 0.02, len(data))
    fall = ActiveEffect(effect_by_id("falling_friction", "burckhardt"), (0.1,))
    at = evaluate_model(data, SegmentCurves(CURVE), (fall,), shift)
    by_hand = np.exp(-0.1 * np.abs(seen.creep_speed + shift * seen.speed))
    assert at.factor == pytest.approx(by_hand, abs=1e-12)
    assert at.predicted == pytest.approx(by_hand * burckhardt(seen.slip + shift), abs=1e-12)


def test_columns_are_split_where_their_drives_begin(data):
    (drive,) = data.drives
    short = drive.select_rows(slice(0, 7))
    both = RegressionData((drive, short, drive), np.zeros(2 * len(drive) + 7, dtype=int), 1)
    parts = both.split(np.array([both.column("t_s"), both.drive_number]))
    assert [part[0].tolist() for part in parts] == [
        one.t_s.tolist() for one in (drive, short, drive)
    ]
    assert [set(part[1]) for part in parts] == [{0}, {1}, {2}]


@pytest.mark.parametrize("key", FORMULAS)
def test_an_effect_in_the_contact_multiplies_the_curve(data, key):
    values, factor = FORMULAS[key]
    drive = data.drives[0]
    seen = drive.observe()
    at = evaluate_model(data, SegmentCurves(CURVE), (ActiveEffect(effect_by_id(*key), values),))
    expected = factor(seen, {**drive.covariates, "time_s": drive.t_s}) * burckhardt(seen.slip)
    assert at.predicted == pytest.approx(expected, abs=1e-10)


def test_slopes_of_the_curve_are_its_differences(data):
    half = np.arange(len(data)) % 2
    two = RegressionData(data.drives, half.astype(np.int64), 2)
    curves = np.array([[C1, np.log(C2), C3], [0.2, np.log(25.0), 0.2]])
    active_effects = (ActiveEffect(effect_by_id("humidity"), (-0.004,)),)
    slopes = compute_curve_jacobian(
        two, SegmentCurves(curves), evaluate_model(two, SegmentCurves(curves), active_effects)
    )
    assert slopes.shape == (len(data), 6)
    for column in range(6):
        step = np.zeros(6)
        step[column] = 1e-6
        up, down = (
            evaluate_model(
                two, SegmentCurves(curves + side * step.reshape(2, 3)), active_effects
            ).predicted
            for side in (1, -1)
        )
        assert slopes[:, column] == pytest.approx((up - down) / 2e-6, abs=1e-7)


@pytest.mark.parametrize("candidate", CANDIDATES, ids=lambda c: c.name)
def test_slopes_of_an_effect_are_differences_of_the_residual(data, candidate):
    """At its typical size, by Richardson's extrapolation of differences of other steps."""
    model = Model(SegmentCurves(CURVE), (Candidate(effect_by_id("sanding")),), ((0.1,),))
    # A brake fades with a kink: beyond the speeds of the drive.
    values = tuple(40.0 if p.name == "fade" else p.typical for p in candidate.free_parameters)
    slopes = compute_effect_jacobian(data, model, candidate, values)
    assert slopes.shape == (len(data), candidate.size)

    def residual(moved):
        active_effects = (*model.with_effect(candidate, moved).active_effects,)
        return evaluate_model(data, model.curves, active_effects).residual

    for column, limit in enumerate(candidate.free_parameters):

        def central(share, column=column, limit=limit):
            step = share * abs(limit.typical)
            up, down = list(values), list(values)
            up[column] += step
            down[column] -= step
            return -(residual(tuple(up)) - residual(tuple(down))) / (2 * step)

        by_hand = (4 * central(0.004) - central(0.008)) / 3
        size = float(np.sqrt(np.mean(by_hand**2)))
        assert size > 0
        error = np.sqrt(np.mean((slopes[:, column] - by_hand) ** 2))
        # Signals are straight lines between readings: a delay has kinks.
        assert error < (0.1 if "delay" in candidate.name else 0.01) * size


@pytest.mark.parametrize("candidate", CANDIDATES, ids=lambda c: c.name)
def test_at_a_limit_the_slope_is_one_sided(data, candidate):
    limit = candidate.free_parameters[0]
    rest = tuple(p.typical for p in candidate.free_parameters[1:])
    for bound in (limit.lower, limit.upper):
        slopes = compute_effect_jacobian(
            data, Model(SegmentCurves(CURVE)), candidate, (bound, *rest)
        )
        assert np.isfinite(slopes).all()


@pytest.mark.parametrize("candidate", CANDIDATES, ids=lambda c: c.name)
def test_a_signature_points_where_the_effect_does(data, candidate):
    """The chord of what the effect does at a third of its typical size, per size."""
    model = Model(SegmentCurves(CURVE))
    chord = compute_signature(data, model, candidate, candidate.null_values)
    size = 0.3 * candidate.free_parameters[0].typical
    values = (size, *candidate.null_values[1:])
    bare = evaluate_model(data, model.curves)
    changed = evaluate_model(
        data, model.curves, model.with_effect(candidate, values).active_effects
    )
    change = (bare.residual - changed.residual) / size
    cosine = change @ chord / np.linalg.norm(change) / np.linalg.norm(chord)
    assert cosine > 0.97
    assert np.linalg.norm(chord) == pytest.approx(np.linalg.norm(change), rel=0.3)


def test_effects_act_in_the_order_of_the_list_whatever_the_order_of_naming():
    a, b = Candidate(effect_by_id("curve_creep")), Candidate(effect_by_id("creep_relaxation"))
    one = Model(SegmentCurves(CURVE)).with_effect(a, (5.0,)).with_effect(b, (0.5,))
    other = Model(SegmentCurves(CURVE)).with_effect(b, (0.5,)).with_effect(a, (5.0,))
    assert one.active_effects == other.active_effects
    less, taken, values = remove_effect(one, 0)
    assert (taken, values) == (a, (5.0,))
    assert less.candidates == (b,)


@pytest.mark.parametrize("size", [-1e300, 0.0, 1e300])
def test_any_size_is_plausible_unless_a_vehicle_excludes_it(size):
    lowest, highest = Candidate(effect_by_id("humidity")).plausible
    assert lowest < size < highest


def test_a_search_steps_through_the_starts_of_all_parameters_together():
    """One with fewer of them stays at its last; none leaves its range."""
    size = Parameter("size", "1", 0.2, -1.0, 1.0, "size")
    short = Parameter("short", "s", 2.0, 0.1, 60.0, "one start", starts=(1.0,))
    long = Parameter("long", "s", 10.0, 5.0, 20.0, "three of them", starts=(0.3, 1.0, 3.0))
    effect = SimpleNamespace(parameters=(size, short, long))
    wanted = ((0.0, 2.0, 5.0), (0.0, 2.0, 10.0), (0.0, 2.0, 20.0))
    assert Candidate(effect).start_values == wanted
    given = Candidate(effect, starts=((3.0, 7.0), (4.0, 8.0)))
    assert given.start_values == ((0.0, 3.0, 7.0), (0.0, 4.0, 8.0))
    assert given.null_values == (0.0, 4.0, 8.0)
    assert Candidate(SimpleNamespace(parameters=(size,))).start_values == ((0.0,),)


def test_parameters_stay_within_their_limits():
    candidate = Candidate(effect_by_id("humidity"))
    model = Model(SegmentCurves(CURVE)).with_effect(candidate, (0.0,))
    wild = model.with_parameters(np.array([-5.0, 99.0, -1.0, 7.0]))
    assert (wild.curves.values[0, [0, 2]] >= 0).all()
    assert wild.values[0] == (candidate.free_parameters[0].upper,)
    assert model.with_parameters(model.parameter_vector).parameter_vector == pytest.approx(
        model.parameter_vector
    )


def test_parameters_stand_effect_by_effect():
    two = Candidate(effect_by_id("falling_friction", "polach"))
    one = Candidate(effect_by_id("humidity"))
    model = Model(SegmentCurves(np.tile(CURVE, (2, 1))))
    model = model.with_effect(two, (0.04, 0.7)).with_effect(one, (-0.003,))
    assert [model.first_parameter(place) for place in (0, 1)] == [6, 8]
    assert model.parameter_vector[[6, 7, 8]].tolist() == [0.04, 0.7, -0.003]
