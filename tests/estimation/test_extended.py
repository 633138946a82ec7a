"""Extended models online and in a batch; every effect by a formula written out here."""

from dataclasses import replace
from math import exp, hypot, log, sqrt

import numpy as np
import pytest

from adhesion_can.config import load_configuration
from adhesion_can.errors import ConfigError, InputError
from adhesion_can.estimation.batch_fit import fit
from adhesion_can.estimation.extended.correction import (
    channels_used,
    correct_samples,
    require_channels,
    require_columns,
)
from adhesion_can.estimation.extended.estimator import ExtendedEstimator
from adhesion_can.estimation.extended.instrument_removal import remove_instrument_errors
from adhesion_can.estimation.extended.model import BaseCurve, ExtendedModel
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.physics.curves import FAMILIES
from adhesion_can.physics.effects import ActiveEffect, effect_by_id
from adhesion_can.physics.effects.empirical import Empirical
from adhesion_can.physics.effects.formula import formula_of
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.readings import Direction, Reading, Role
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.former import SampleFormer

BASE = (0.4, 60.0, 0.3)
PEAK = log(BASE[0] * BASE[1] / BASE[2]) / BASE[1]  # λ_m
HEIGHT = BASE[0] * (1 - exp(-BASE[1] * PEAK)) - BASE[2] * PEAK
STEP_US, UPDATE_US = 10_000, 100_000
KNOTS = (5.0,) * 4 + (10.0, 16.0) + (25.0,) * 4
WEIGHTS = (0.0, 0.1, -0.15, 0.1, -0.1, 0.05)


def rail(slip):
    """The base curve."""
    size = np.abs(slip)
    return np.sign(slip) * (BASE[0] * (1 - np.exp(-BASE[1] * size)) - BASE[2] * size)


class World:
    """Six axles swept through their slips while everything else varies at a pace of its own."""

    def __init__(self, seconds=9.0, noise=0.002, seed=1):
        self.rng = np.random.default_rng(seed)
        self.noise = noise
        self.t_us = np.arange(0, round(seconds * 1e6), STEP_US)
        self.t = t = self.t_us * 1e-6
        self.v = 13 + 8 * np.sin(2 * np.pi * t / 5.3)
        self.humidity = 65 + 20 * np.sin(2 * np.pi * t / 3.9)
        self.warmth = 15 + 12 * np.sin(2 * np.pi * t / 4.7)
        self.sand = (np.sin(2 * np.pi * t / 2.3) > 0.3).astype(float)
        self.curvature = 0.002 * np.sin(2 * np.pi * t / 3.3)
        self.axles = np.arange(1, 7)
        phase = t[:, None] / 1.7 + self.axles / 6
        self.slip = 0.14 * np.sin(2 * np.pi * phase)  # (time, axle)
        # It ends in traction, so that there is one present condition.
        last = t > t[-1] - 1.0
        self.slip[last] = np.abs(self.slip[last]) + 0.004
        pace = 2 * np.pi * (t[:, None] / 6.1 + self.axles / 9)
        self.load = 240e3 + 25e3 * np.sin(pace) + 4e3 * self.axles

    def batches(self, adhesion):
        """Samples of true adhesion (time, axle) with noise, an update at a time."""
        measured = adhesion + self.noise * self.rng.standard_normal(adhesion.shape)
        count = UPDATE_US // STEP_US
        for first in range(0, len(self.t), count):
            yield self.samples(slice(first, first + count), measured)

    def samples(self, rows, measured):
        def flat(column):
            return np.broadcast_to(column[rows], (rows.stop - rows.start, 6)).ravel()

        t_us = flat(self.t_us[:, None])
        zero = np.zeros(len(t_us))
        speed = flat(self.v[:, None])
        covariates = {
            "relative_humidity_percent": self.humidity,
            "rail_temperature_degC": self.warmth,
            "sanding_active": self.sand,
            "curvature_per_m": self.curvature,
        }
        return Samples(
            t_us=t_us,
            axle=np.tile(self.axles, len(t_us) // 6),
            slip=flat(self.slip),
            adhesion=flat(measured),
            creep_speed=flat(self.slip) * speed,
            speed=speed,
            load=flat(self.load),
            load_std=zero,
            slip_var=zero,
            adhesion_var=zero + self.noise**2,
            slip_common_var=zero,
            speed_us=t_us,
            transient_var=zero,
            speed_share=zero + 1.0,
            covariates={n: flat(c[:, None]) for n, c in covariates.items()},
        )

    def whole(self, adhesion):
        return Samples.concatenate(list(self.batches(adhesion)))


# ---------------------------------------------- the effects, each as a factor and a slip, by hand


def curtius_kniffler(v):
    return (7.5 / (3.6 * v + 44) + 0.161) / (7.5 / 44 + 0.161)


def speed(w, slip, i, _):
    return slip, 1 + 0.9 * (curtius_kniffler(w.v[i]) - 1)


def load(w, slip, i, k):
    return slip, 1 - 4e-12 * w.load[i, k] ** 2


def load_power(w, slip, i, k):
    return slip, (w.load[i, k] / 100e3) ** -0.5


def falling(w, slip, i, _):
    return slip, np.exp(-0.1 * np.abs(slip) * w.v[i])


def polach(w, slip, i, _):
    return slip, 0.6 * np.exp(-0.3 * np.abs(slip) * w.v[i]) + 0.4


def cleaning(_w, slip, _i, k):
    return slip, 1 + 0.02 * k


def humidity(w, slip, i, _):
    return slip, 1 - 0.003 * (w.humidity[i] - 60)


def warmth(w, slip, i, _):
    return slip, 1 + 0.005 * (w.warmth[i] - 20)


def sanding(w, slip, i, _):
    return slip, 1 + 0.2 * w.sand[i]


def asymmetry(_w, slip, _i, _k):
    return slip, np.where(slip < 0, 0.85, 1.0)


def curve(w, slip, i, _):
    whole = np.sqrt(slip**2 + (3.0 * w.curvature[i]) ** 2)
    return np.sign(slip) * whole, np.abs(slip) / whole


def spline(w, slip, i, _):
    # de Boor's recursion, from its definition.
    def basis(j, degree, x):
        if degree == 0:
            inside = (KNOTS[j] <= x) & (x < KNOTS[j + 1])
            at_end = (x == KNOTS[-1]) & (KNOTS[j] < KNOTS[j + 1] == KNOTS[-1])
            return float(inside or at_end)
        total = 0.0
        if KNOTS[j + degree] > KNOTS[j]:
            total += (x - KNOTS[j]) / (KNOTS[j + degree] - KNOTS[j]) * basis(j, degree - 1, x)
        if KNOTS[j + degree + 1] > KNOTS[j + 1]:
            rest = (KNOTS[j + degree + 1] - x) / (KNOTS[j + degree + 1] - KNOTS[j + 1])
            total += rest * basis(j + 1, degree - 1, x)
        return total

    def one(v):
        x = min(max(v, KNOTS[0]), KNOTS[-1])
        return 1 + sum(c * basis(j, 3, x) for j, c in enumerate(WEIGHTS))

    return slip, np.array([one(v) for v in np.atleast_1d(w.v[i])]).reshape(np.shape(w.v[i]))


NAMED = {
    "speed_dependence": (speed, "", (0.9,)),
    "load_dependence": (load, "burckhardt", (4e-12,)),
    "load power": (load_power, "power", (0.5,)),
    "falling_friction": (falling, "burckhardt", (0.1,)),
    "falling polach": (polach, "polach", (0.3, 0.4)),
    "rail_cleaning": (cleaning, "", (0.02,)),
    "humidity": (humidity, "", (-0.003,)),
    "rail_temperature": (warmth, "", (0.005,)),
    "sanding": (sanding, "", (0.2,)),
    "traction_braking_asymmetry": (asymmetry, "", (-0.15,)),
    "curve_creep": (curve, "", (3.0,)),
}
IDS = {"load power": "load_dependence", "falling polach": "falling_friction"}


def model_of(name, covariance=None):
    _, form, values = NAMED[name]
    active = ActiveEffect(effect_by_id(IDS.get(name, name), form), values)
    return ExtendedModel(BASE, effects=(active,), covariances=(covariance,))


def world_of(formula, **how):
    w = World(**how)
    columns = [formula(w, w.slip[:, k], slice(None), k) for k in range(6)]
    return w, np.stack([factor * rail(slip) for slip, factor in columns], axis=1)


def present_peaks(w, formula):
    """Peak (height, place) of each axle's curve in the last instant, on a fine grid."""
    grid = np.linspace(1e-4, 0.5, 100_000)
    found = []
    for k in range(6):
        slip, factor = formula(w, grid, len(w.t) - 1, k)
        mu = factor * rail(slip)
        found.append((mu.max(), grid[mu.argmax()], mu))
    pooled = np.mean([mu for _, _, mu in found], axis=0)
    return (pooled.max(), grid[pooled.argmax()]), [row[:2] for row in found]


class Watched:
    """An estimator whose last estimate is kept."""

    def __init__(self):
        self.inner, self.last = Tracker(), None

    def update(self, samples, now_us):
        self.last = self.inner.update(samples, now_us)
        return self.last


def followed(batches, model, **how):
    """(the whole estimate, that of the base curve) after all samples."""
    inner = Watched()
    estimator = ExtendedEstimator(inner, model, **how)
    estimate = None
    for samples in batches:
        estimate = estimator.update(samples, int(samples.t_us[-1]) + STEP_US)
    return estimate, inner.last, estimator


@pytest.mark.parametrize("name", NAMED)
def test_base_curve_and_present_peak_of_every_effect(name):
    formula = NAMED[name][0]
    w, adhesion = world_of(formula)
    now, base, estimator = followed(w.batches(adhesion), model_of(name))
    assert base.mu_max == pytest.approx(HEIGHT, rel=0.005)
    assert base.lambda_m == pytest.approx(PEAK, rel=0.06)
    (mu_max, lambda_m), axles = present_peaks(w, formula)
    assert now.mu_max == pytest.approx(mu_max, rel=0.007)
    assert now.lambda_m == pytest.approx(lambda_m, rel=0.07)
    assert now.identifiable.both
    assert now.mu_max_interval[0] < now.mu_max < now.mu_max_interval[1]
    for axle, (mu, place) in enumerate(axles, start=1):
        assert now.per_axle[axle][0] == pytest.approx(mu, rel=0.01)
        assert now.per_axle[axle][1] == pytest.approx(place, rel=0.1)
    # The parameters give this peak.
    c1, c2, c3 = now.theta
    at = log(c1 * c2 / c3) / c2
    assert at == pytest.approx(now.lambda_m, rel=1e-6)
    assert c1 * (1 - exp(-c2 * at)) - c3 * at == pytest.approx(now.mu_max, rel=1e-6)
    # Close to no slip a curve leaves next to nothing.
    assert sum(estimator.left_out.values()) <= (30 if name == "curve_creep" else 0)


@pytest.mark.parametrize("name", ["speed_dependence", "humidity", "load power"])
def test_without_the_model_the_base_curve_is_missed(name):
    """What the test above shows is not there for every estimator anyway."""
    w, adhesion = world_of(NAMED[name][0])
    plain = Tracker()
    for samples in w.batches(adhesion):
        estimate = plain.update(samples, int(samples.t_us[-1]))
    (mu_max, _), _ = present_peaks(w, NAMED[name][0])
    wrong = abs(estimate.mu_max / mu_max - 1), abs(estimate.mu_max / HEIGHT - 1)
    assert max(wrong) > 0.02


def test_a_spline_over_the_speed():
    w, adhesion = world_of(spline)
    model = ExtendedModel(BASE, splines=(Empirical("speed", "factor", KNOTS, WEIGHTS),))
    now, base, _ = followed(w.batches(adhesion), model)
    assert base.mu_max == pytest.approx(HEIGHT, rel=0.005)
    (mu_max, _), _ = present_peaks(w, spline)
    assert now.mu_max == pytest.approx(mu_max, rel=0.007)


def test_a_spline_counts_beyond_its_knots_as_at_the_last_of_them():
    own = Empirical("speed", "factor", KNOTS, WEIGHTS)
    x = np.array([-3.0, 5.0, 25.0, 80.0])
    assert own.at(x).tolist() == [WEIGHTS[0], WEIGHTS[0], WEIGHTS[-1], WEIGHTS[-1]]


def test_relaxation_is_settled_in_the_present_curve():
    """(0.5/v) dλ'/dt + λ' = λ, by small steps; a slip that is kept ends on the base curve."""
    w = World()
    fine = 50
    lagging = np.empty_like(w.slip)
    state = w.slip[0].copy()
    for i in range(len(w.t)):
        before = w.slip[max(i - 1, 0)]
        for j in range(fine):
            target = before + (w.slip[i] - before) * (j + 1) / fine
            state = state + (target - state) * w.v[i] / 0.5 * (STEP_US * 1e-6 / fine)
        lagging[i] = state
    model = ExtendedModel(BASE, effects=(ActiveEffect(effect_by_id("creep_relaxation"), (0.5,)),))
    now, base, _ = followed(w.batches(rail(lagging)), model)
    assert base.mu_max == pytest.approx(HEIGHT, rel=0.005)
    assert base.lambda_m == pytest.approx(PEAK, rel=0.06)
    assert now.theta == pytest.approx(base.theta, rel=1e-9)


def test_recovery_keeps_its_state_in_the_current_curve():
    """Factor 1 + gain W with dW/dt = |μ N v_s| − W/T, by small steps, for each axle."""
    gain, time, fine = 1e-6, 2.0, 20
    w = World()
    work = np.zeros(6)
    adhesion = np.empty_like(w.slip)
    adhesion[0] = rail(w.slip[0])
    for i in range(1, len(w.t)):
        creep = np.abs(w.slip[i] * w.v[i])
        for _ in range(fine):
            mu = np.abs((1 + gain * work) * rail(w.slip[i]))
            work = work + (mu * w.load[i] * creep - work / time) * (STEP_US * 1e-6 / fine)
        adhesion[i] = (1 + gain * work) * rail(w.slip[i])
    assert np.ptp(gain * work) > 0.01
    active = ActiveEffect(effect_by_id("adhesion_recovery"), (gain, time))
    now, base, _ = followed(w.batches(adhesion), ExtendedModel(BASE, effects=(active,)))
    assert base.mu_max == pytest.approx(HEIGHT, rel=0.006)
    assert now.mu_max == pytest.approx(HEIGHT * np.mean(1 + gain * work), rel=0.008)
    for k in range(6):
        assert now.per_axle[k + 1][0] == pytest.approx(HEIGHT * (1 + gain * work[k]), rel=0.012)


def test_in_reverse_the_last_axle_leads():
    w = World()
    adhesion = np.stack([(1 + 0.02 * (5 - k)) * rail(w.slip[:, k]) for k in range(6)], axis=1)
    batches = [
        replace(s, covariates={**s.covariates, "travel": -np.ones(len(s))})
        for s in w.batches(adhesion)
    ]
    now, base, _ = followed(batches, model_of("rail_cleaning"))
    assert base.mu_max == pytest.approx(HEIGHT, rel=0.005)
    assert now.per_axle[1][0] == pytest.approx(1.1 * HEIGHT, rel=0.01)
    assert now.per_axle[6][0] == pytest.approx(HEIGHT, rel=0.01)


def test_two_effects_act_together():
    def both(w, slip, i, k):
        return slip, speed(w, slip, i, k)[1] * humidity(w, slip, i, k)[1]

    w, adhesion = world_of(both)
    effects = (*model_of("speed_dependence").effects, *model_of("humidity").effects)
    now, base, _ = followed(w.batches(adhesion), ExtendedModel(BASE, effects=effects))
    assert base.mu_max == pytest.approx(HEIGHT, rel=0.005)
    assert now.mu_max == pytest.approx(present_peaks(w, both)[0][0], rel=0.007)


# ------------------------------------------------------------------------------ slow drift, batch


def test_a_batch_without_the_effect_gives_the_base_curve():
    w, adhesion = world_of(speed)
    whole = w.whole(adhesion)
    result = correct_samples(whole, model_of("speed_dependence"), 6)
    assert fit(result.samples).mu_max == pytest.approx(HEIGHT, rel=0.003)
    assert abs(fit(whole).mu_max / HEIGHT - 1) > 0.05
    assert result.kept.all()


def test_slow_drift_is_taken_out_of_a_batch_and_left_to_the_tracker_online():
    w = World()
    adhesion = (1 - 0.01 * w.t[:, None]) * rail(w.slip)
    model = ExtendedModel(BASE, effects=(ActiveEffect(effect_by_id("slow_drift"), (-0.01,)),))
    result = correct_samples(w.whole(adhesion), model, 6)
    assert fit(result.samples).mu_max == pytest.approx(HEIGHT, rel=0.003)
    assert model.online == ()
    plain = load_configuration()
    made = replace(plain, model=model).make_estimator()
    assert type(made) is type(plain.make_estimator())


def test_a_model_of_instruments_alone_leaves_the_estimator_as_it_is():
    model = ExtendedModel(BASE, effects=(ActiveEffect(effect_by_id("effort_bias"), (3000.0,)),))
    plain = load_configuration()
    made = replace(plain, model=model).make_estimator()
    assert type(made) is type(plain.make_estimator())


def test_every_estimator_made_is_a_fresh_one():
    config = replace(load_configuration(), model=model_of("speed_dependence"))
    w, adhesion = world_of(speed, seconds=2.0)
    batches = list(w.batches(adhesion))
    ends = []
    for _ in range(2):
        estimator = config.make_estimator()
        assert isinstance(estimator.inner, ExtendedEstimator)
        for samples in batches:
            estimate = estimator.update(samples, int(samples.t_us[-1]))
        ends.append(estimate)
    assert ends[0].theta == ends[1].theta
    assert ends[0].mu_max_interval == ends[1].mu_max_interval


# ---------------------------------------------------------------------------- doubt, what is lost


class Fixed:
    """Says the same curve of a growing number of samples."""

    def __init__(self):
        self.samples = 0

    def update(self, samples, now_us):
        self.samples += len(samples)
        return Estimate(
            *BASE,
            covariance=np.diag([1e-6, 1.0, 1e-6]),
            mu_max=HEIGHT,
            mu_max_std=0.001,
            lambda_m=PEAK,
            lambda_m_std=0.002,
            noise_std=0.002,
            samples=self.samples,
            identifiable=Identifiable(mu_max=True, lambda_m=True),
            surface_since_us=0,
            mu_max_interval=(HEIGHT - 0.002, HEIGHT + 0.002),
            lambda_m_interval=(PEAK - 0.004, PEAK + 0.003),
        )


def at_speeds(speeds, model):
    w = World(seconds=len(speeds) * UPDATE_US * 1e-6)
    w.v = np.repeat(np.asarray(speeds, dtype=float), UPDATE_US // STEP_US)
    estimator = ExtendedEstimator(Fixed(), model)
    return [estimator.update(s, int(s.t_us[-1])) for s in w.batches(rail(w.slip))]


def test_doubt_about_an_effect_counts_where_the_condition_is_another_one():
    std = 0.2
    model = model_of("speed_dependence", ((std**2,),))
    estimates = at_speeds([8.0] * 60 + [20.0] * 12, model)

    def factor(v):
        return 1 + 0.9 * (curtius_kniffler(v) - 1)

    def slope(v):
        return (curtius_kniffler(v) - 1) / factor(v)

    same, other = estimates[59], estimates[-1]
    assert same.mu_max == pytest.approx(HEIGHT * factor(8.0), rel=1e-9)
    assert same.mu_max_std == pytest.approx(0.001 * factor(8.0), rel=1e-6)
    # The base curve was seen at 8 m/s but for the share of the latest samples.
    most = std * abs(slope(20.0) - slope(8.0))
    added = sqrt(other.mu_max_std**2 - (0.001 * factor(20.0)) ** 2) / other.mu_max
    assert 0.75 * most < added < 1.01 * most
    assert same.identifiable.mu_max
    assert not other.identifiable.mu_max, "a peak that is doubtful by more than 3 % is not known"
    widened = hypot(0.002 * factor(20.0), 1.645 * added * other.mu_max)
    assert other.mu_max_interval[1] - other.mu_max == pytest.approx(widened, rel=1e-6)


@pytest.mark.parametrize(
    ("steeper", "known"), [(1.0, True), (1.4, True), (2.0, False), (0.5, False)]
)
def test_a_shape_is_not_extrapolated_to_peaks_far_from_where_it_was_learnt(steeper, known):
    c1, c2, c3 = BASE
    base = (c1, steeper * c2, steeper * c3)  # its λ_m is that of BASE over `steeper`
    model = ExtendedModel(base=base, curve=BaseCurve(FAMILIES["burckhardt"], base))
    estimate = at_speeds([8.0] * 5, model)[-1]
    assert estimate.mu_max == pytest.approx(HEIGHT, rel=1e-6)
    assert (estimate.identifiable.mu_max, estimate.identifiable.lambda_m) == (known, known)


def test_no_covariance_adds_no_doubt():
    estimate = at_speeds([8.0] * 30 + [20.0] * 6, model_of("speed_dependence"))[-1]
    assert estimate.mu_max_std / estimate.mu_max == pytest.approx(0.001 / HEIGHT)
    assert estimate.lambda_m_interval == (PEAK - 0.004, PEAK + 0.003)
    np.testing.assert_allclose(
        estimate.covariance.diagonal()[1:], [1.0, 1e-6 * (estimate.mu_max / HEIGHT) ** 2]
    )


def warm_and_wet(w, slip, k, _axle):
    """Two channels in one law."""
    wet = np.maximum(w.humidity[k] - 70.0, 0.0) * (w.warmth[k] - 5.0)
    return slip, 1.0 + 4e-4 * wet


def formula_model():
    text = "1 + a * max(relative_humidity_percent - b, 0) * (rail_temperature_degC - 5)"
    return ExtendedModel(
        BASE, effects=(ActiveEffect(formula_of(text, {"a": 1e-3, "b": 60.0}), (4e-4, 70.0)),)
    )


def test_a_formula_over_two_channels_follows_the_present_peak():
    w, adhesion = world_of(warm_and_wet)
    now, base, estimator = followed(w.batches(adhesion), formula_model())
    (mu_max, _), _ = present_peaks(w, warm_and_wet)
    assert base.mu_max == pytest.approx(HEIGHT, rel=0.005)
    assert now.mu_max == pytest.approx(mu_max, rel=0.007)
    assert not sum(estimator.left_out.values())


def test_a_formula_needs_each_of_its_channels():
    w, adhesion = world_of(warm_and_wet, seconds=2.0)
    batches = []
    for number, s in enumerate(w.batches(adhesion)):
        one = {"rail_temperature_degC": s.covariates["rail_temperature_degC"]}
        batches.append(replace(s, covariates=one) if number % 2 else s)
    _, _, estimator = followed(batches, formula_model())
    why = "relative_humidity_percent and rail_temperature_degC not available"
    assert estimator.left_out == {why: 10 * 60}
    with pytest.raises(ConfigError, match="needs relative_humidity_percent, which the bus"):
        require_channels(formula_model(), ["rail_temperature_degC"], "the bus", "map it")


def test_a_missing_channel_beside_one_that_steps_is_no_fault():
    """Sand is switched while the humidity is not available: the samples are left out, no more."""
    w, adhesion = world_of(humidity, seconds=3.0)
    batches = []
    for number, s in enumerate(w.batches(adhesion)):
        lacking = {k: v for k, v in s.covariates.items() if k != "relative_humidity_percent"}
        batches.append(replace(s, covariates=lacking) if 10 <= number < 20 else s)
    steps = {float(s.covariates["sanding_active"][0]) for s in batches[10:20]}
    assert len(steps) == 2
    effects = tuple(
        ActiveEffect(effect_by_id(name), NAMED[name][2]) for name in ("humidity", "sanding")
    )
    _, _, estimator = followed(batches, ExtendedModel(BASE, effects=effects))
    assert estimator.left_out == {"relative_humidity_percent not available": 10 * 60}


def test_samples_without_a_covariate_are_left_out_and_counted():
    w, adhesion = world_of(humidity, seconds=4.0)
    batches = []
    for number, s in enumerate(w.batches(adhesion)):
        if number % 4 == 0:
            batches.append(replace(s, covariates={}))
        elif number % 4 == 1:
            column = s.covariates["relative_humidity_percent"].copy()
            column[:7] = np.nan
            spoilt = s.adhesion.copy()
            spoilt[:7] = 3.0  # what is left out must not be seen
            named = {**s.covariates, "relative_humidity_percent": column}
            batches.append(replace(s, covariates=named, adhesion=spoilt))
        else:
            batches.append(s)
    now, base, estimator = followed(batches, model_of("humidity"))
    assert estimator.left_out == {"relative_humidity_percent not available": 10 * 60 + 10 * 7}
    assert base.mu_max == pytest.approx(HEIGHT, rel=0.01)
    assert np.isfinite(now.mu_max)


def test_a_sample_of_which_little_is_left_is_left_out():
    w, adhesion = world_of(falling, seconds=1.0)
    active = ActiveEffect(effect_by_id("falling_friction", "burckhardt"), (2.0,))
    result = correct_samples(w.whole(adhesion), ExtendedModel(BASE, effects=(active,)), 6)
    factor = np.exp(-2.0 * np.abs(w.slip * w.v[:, None])).ravel()
    assert result.kept.tolist() == (factor >= 0.2).tolist()
    assert sum(result.left_out.values()) == (factor < 0.2).sum() > 0


def test_noise_raised_by_a_small_factor_is_in_the_samples_variance():
    w, adhesion = world_of(humidity, seconds=1.0)
    whole = w.whole(adhesion)
    result = correct_samples(whole, model_of("humidity"), 6).samples
    factor = np.repeat(1 - 0.003 * (w.humidity - 60), 6)
    np.testing.assert_allclose(result.adhesion, whole.adhesion / factor)
    np.testing.assert_allclose(result.adhesion_var, whole.adhesion_var / factor**2)
    more = np.maximum(1 / factor**2 - 1, 0) * whole.adhesion_var
    np.testing.assert_allclose(result.transient_var, more, atol=1e-20)


def test_without_samples_the_estimate_stays():
    w, adhesion = world_of(speed, seconds=2.0)
    inner = Tracker()
    estimator = ExtendedEstimator(inner, model_of("speed_dependence"))
    nothing = Samples.from_rows([])
    assert estimator.update(nothing, 0) is None
    for samples in w.batches(adhesion):
        estimate = estimator.update(samples, int(samples.t_us[-1]))
    again = estimator.update(nothing, int(w.t_us[-1]) + 20_000)
    assert again.mu_max == pytest.approx(estimate.mu_max, rel=1e-3)


# -------------------------------------------------------------------- what a model asks of the data


def test_a_channel_that_nobody_gives_is_an_error_at_the_start():
    config = load_configuration()
    choices = tuple(c for c in config.choices if c.role is not Role.HUMIDITY)
    without = replace(config, choices=choices, model=model_of("humidity"))
    replace(config, model=model_of("humidity")).require_identification()
    with pytest.raises(ConfigError, match=r"humidity needs relative_humidity_percent, which no ro"):
        without.require_identification()
    own = Empirical("position_m", "factor", KNOTS, WEIGHTS)
    with pytest.raises(ConfigError, match="spline needs position_m"):
        replace(config, model=ExtendedModel(BASE, splines=(own,))).require_identification()
    # One of two is enough.
    require_channels(model_of("curve_creep"), ["slip_angle_deg"], "x", "y")


def test_an_axle_that_the_vehicle_does_not_have_is_an_error_at_the_start():
    active = ActiveEffect(effect_by_id("wheel_radius"), (0.01, 7.0))
    config = replace(load_configuration(), model=ExtendedModel(BASE, effects=(active,)))
    with pytest.raises(ConfigError, match="axle 7 of a vehicle with 6"):
        config.require_identification()


def test_what_the_effects_depend_on():
    used = {name: channels_used(model_of(name).effects[0]) for name in NAMED}
    for name in ("speed_dependence", "falling_friction", "falling polach"):
        assert used.pop(name) == {"speed"}
    for name in ("load_dependence", "load power"):
        assert used.pop(name) == {"load"}
    assert used.pop("rail_cleaning") == {"place"}
    assert all(not channels for channels in used.values())
    recovery = ActiveEffect(effect_by_id("adhesion_recovery"), (4e-7, 3.0))
    assert channels_used(recovery) == {"speed", "load"}
    relaxation = ActiveEffect(effect_by_id("creep_relaxation"), (0.5,))
    assert channels_used(relaxation) == {"speed"}


def test_a_table_without_the_column_is_an_error():
    table = Samples.curve(np.linspace(0, 0.1, 50), rail(np.linspace(0, 0.1, 50)))
    for name, column in (
        ("load power", "normal_load_N"),
        ("speed_dependence", "speed_mps"),
        ("rail_cleaning", "'axle'"),
        ("humidity", "relative_humidity_percent"),
    ):
        with pytest.raises(InputError, match=column):
            require_columns(model_of(name), table, "t.csv")
    require_columns(model_of("traction_braking_asymmetry"), table, "t.csv")


def test_errors_of_the_instruments_in_a_table():
    n = 40
    v, load_ = np.linspace(5, 20, n), np.linspace(2e5, 2.4e5, n)
    slip, axle = np.linspace(-0.1, 0.1, n), np.arange(n) % 3 + 1
    mu = rail(slip)
    # Measured: v too high by 2 %, axle 2 configured 1 % too small, effort high by 3 kN.
    radius = np.where(axle == 2, 1 / 1.01, 1.0)
    seen = (1 + slip) * v * radius / (1.02 * v) - 1
    table = replace(Samples.curve(seen, mu + 3000 / load_), speed=1.02 * v, load=load_, axle=axle)
    true = Instruments(radius_error={2: 0.01}, speed_error=0.02, effort_bias=3000.0)
    result = remove_instrument_errors(table, true, "t.csv")
    np.testing.assert_allclose(result.slip, slip, atol=1e-12)
    np.testing.assert_allclose(result.adhesion, mu, atol=1e-12)
    np.testing.assert_allclose(result.speed, v)
    np.testing.assert_allclose(result.creep_speed, slip * v, atol=1e-12)
    assert remove_instrument_errors(table, PERFECT, "t.csv") is table
    for late in (Instruments(speed_delay=0.1), Instruments(inertia_error=300.0)):
        with pytest.raises(InputError, match="give the recording"):
            remove_instrument_errors(table, late, "t.csv")


# ----------------------------------------------------------------- instruments, in sample formation

CYCLES = {
    Role.WHEEL_SPEED: 10_000,
    Role.VEHICLE_SPEED: 20_000,
    Role.TRACTIVE_EFFORT: 10_000,
    Role.AXLE_LOAD: 200_000,
    Role.DIRECTION: 20_000,
}
VEHICLE = Locomotive()
NONE = {"radius": {}, "inertia": 0.0, "scale": 0.0, "late_v": 0.0, "bias": 0.0, "late_f": 0.0}


def v_at(t):
    return 12 + 3 * np.sin(0.4 * t)


def omega_at(t, axle):
    slip = 0.06 + 0.04 * np.sin(0.9 * t + axle)
    return (1 + slip) * v_at(t)  # over the true radius


def force_at(t, axle):
    """In the contact."""
    return 5e4 + 2e4 * np.sin(1.1 * t + 2 * axle)


def readings(error, seconds=4.0, direction=Direction.FORWARD):
    """What sensors say of the true drive, each with the error that it has."""
    error = {**NONE, **error}
    rows = []
    for t_us in range(0, round(seconds * 1e6), 10_000):
        t = t_us * 1e-6
        if t_us % 20_000 == 0:
            v = (1 + error["scale"]) * v_at(t - error["late_v"])
            rows.append(Reading(t_us, Role.VEHICLE_SPEED, 0, float(v)))
            rows.append(Reading(t_us, Role.DIRECTION, 0, float(direction)))
        for axle in range(1, 7):
            r = 0.625 * (1 + error["radius"].get(axle, 0.0))
            rows.append(Reading(t_us, Role.WHEEL_SPEED, axle, float(omega_at(t, axle) / r)))
            then, h = t - error["late_f"], 1e-5
            turning = (omega_at(then + h, axle) - omega_at(then - h, axle)) / (2 * h) / r
            own = (200.0 + error["inertia"]) * turning / r
            effort = force_at(then, axle) + own + error["bias"]
            rows.append(Reading(t_us, Role.TRACTIVE_EFFORT, axle, float(effort)))
            if t_us % 200_000 == 0:
                rows.append(Reading(t_us, Role.AXLE_LOAD, axle, 2.4e5))
        if t_us % 500_000 == 0:
            rows.append(Reading(t_us, Role.CURVATURE, 0, t))
    return rows


def formed(rows, instruments, **how):
    former = SampleFormer(VEHICLE, CYCLES, instruments=instruments, **how)
    samples = []
    for number, row in enumerate(rows):
        former.add(row)
        if number % 40 == 0:
            samples += former.collect(row.t_us).to_rows()
    return samples + former.collect(rows[-1].t_us).to_rows(), former


ERRORS = {
    "none": ({}, PERFECT),
    "radius": ({"radius": {3: -0.02}}, Instruments(radius_error={3: -0.02})),
    "inertia": ({"inertia": 900.0}, Instruments(inertia_error=900.0)),
    "scale": ({"scale": 0.02}, Instruments(speed_error=0.02)),
    "speed late": ({"late_v": 0.237}, Instruments(speed_delay=0.237)),
    "speed very late": ({"late_v": 1.0}, Instruments(speed_delay=1.0)),
    "effort late": ({"late_f": 0.083}, Instruments(effort_delay=0.083)),
    "bias": ({"bias": -4000.0}, Instruments(effort_bias=-4000.0)),
    "all": (
        {"radius": {1: 0.01}, "inertia": 300.0, "scale": -0.01, "late_v": 0.2, "bias": 2e3,
         "late_f": 0.05},
        Instruments({1: 0.01}, 300.0, -0.01, 0.2, 2e3, 0.05),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ERRORS)
def test_samples_are_what_was_really_there(name):
    error, instruments = ERRORS[name]
    samples, former = formed(readings(error), instruments)
    assert len(samples) > 6 * (390 - 100 * max(instruments.speed_delay, instruments.effort_delay))
    # Bracketed from the first moment of which a speed and an effort are known: nothing is dropped.
    assert sum(former.dropped.values()) <= 6
    for s in samples:
        t = s.t_us * 1e-6
        v = v_at(t)
        assert s.slip == pytest.approx(omega_at(t, s.axle) / v - 1, abs=3e-5)
        assert s.adhesion == pytest.approx(force_at(t, s.axle) / 2.4e5, abs=1e-4)
        assert s.speed == pytest.approx(v, rel=3e-5)
    if name != "none":
        plain, _ = formed(readings(error), PERFECT)
        wrong = max(
            max(abs(s.slip - omega_at(s.t_us * 1e-6, s.axle) / v_at(s.t_us * 1e-6) + 1) * 10,
                abs(s.adhesion - force_at(s.t_us * 1e-6, s.axle) / 2.4e5))
            for s in plain
        )  # fmt: skip
        assert wrong > 1e-3, "the error would be seen"


def test_samples_that_waited_carry_the_covariates_of_their_own_time():
    for s in formed(readings({}), Instruments(speed_delay=1.0))[0]:
        assert s.covariates == {"curvature_per_m": s.t_us // 500_000 * 0.5}


def test_the_direction_is_a_covariate_where_it_is_asked_for():
    rows = readings({}, 1.0, Direction.REVERSE)
    assert {s.covariates["travel"] for s in formed(rows, PERFECT, with_travel=True)[0]} == {-1.0}
    assert all("travel" not in s.covariates for s in formed(rows, PERFECT)[0])


def test_delays_cost_no_memory():
    former = SampleFormer(VEHICLE, CYCLES, instruments=Instruments(speed_delay=0.5))
    sizes = []
    for row in readings({}, 20.0):
        former.add(row)
        if row.t_us % 1_000_000 == 0 and row.axle == 6 and row.role is Role.TRACTIVE_EFFORT:
            former.collect(row.t_us).to_rows()
            sizes.append(len(former._speed.times) + len(former._history))
    assert max(sizes[5:]) <= max(sizes[2:6]) + 2
