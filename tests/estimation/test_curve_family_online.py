"""A base curve of another family online: setpoints on a contact that is not Burckhardt's."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.config import load_configuration
from adhesion_can.config.model_file import model_text, read_model, write_model
from adhesion_can.errors import ConfigError
from adhesion_can.estimation.extended.estimator import ExtendedEstimator
from adhesion_can.estimation.extended.model import BaseCurve, ExtendedModel
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.physics.curves import family_by_name
from tests.diagnosis.diagnosis_helpers import samples
from tests.seeds import first_quick

KA, KS, MU0, A, B = 0.5, 0.2, 0.42, 0.4, 0.6
LOAD, AXLES, CYCLE_S = 210e3, 4, 0.05
MODEL = ExtendedModel(
    base=(0.335, 240.0, 0.75), curve=BaseCurve(family_by_name("polach"), (KA, KS, MU0, A, B))
)


def polach(slip, speed, stiffness):
    """Polach 2005, written out; `stiffness` is G a b c11/Q of the clean contact."""
    size = np.abs(slip)
    mu = MU0 * ((1 - A) * np.exp(-B * size * speed) + A)
    e = np.pi / 4 * stiffness * size / mu
    k = KA * e
    return np.sign(slip) * 2 * mu / np.pi * (k / (1 + k * k) + np.arctan(KS * e))


def stiffness():
    """Slope of the family's curve at zero slip with kA = kS = 1, from its own definition."""
    from adhesion_can.physics.contact_stiffness import initial_stiffness

    return float(initial_stiffness(LOAD, 0.625))


def run(estimator, seed, duration_s=40.0):
    """Feed a drive step by step; the last estimate and the speed at the end."""
    rng = np.random.default_rng(seed)
    found = None
    for step in range(round(duration_s / CYCLE_S)):
        t = step * CYCLE_S
        speed = 10.0 + 3.0 * np.sin(2 * np.pi * t / 23.0)
        axle = np.arange(1, AXLES + 1)
        phase = 2 * np.pi * t / 5.0 + 0.9 * axle
        slip = 0.12 * (0.5 - 0.5 * np.cos(phase)) ** 1.6
        mu = polach(slip, speed, stiffness()) + 0.003 * rng.standard_normal(AXLES)
        one = np.ones(AXLES)
        given = samples(slip, mu, t * one, axle=axle, speed=speed * one, load=LOAD * one)
        now = estimator.update(given, round(t * 1e6))
        found = found if now is None else now
    grid = np.linspace(0.002, 0.2, 20_000)
    curve = polach(grid, speed, stiffness())
    return found, float(curve.max()), float(grid[curve.argmax()])


SEEDS = first_quick([1, 2, 3])


@pytest.mark.costly
@pytest.mark.parametrize("seed", SEEDS)
def test_the_peak_of_polachs_contact_is_found_with_its_model(seed):
    found, mu_max, lambda_m = run(ExtendedEstimator(Tracker(), MODEL, AXLES), seed)
    assert found.mu_max == pytest.approx(mu_max, rel=0.01)
    assert found.lambda_m == pytest.approx(lambda_m, rel=0.08)


@pytest.mark.costly
def test_what_the_form_may_be_wrong_by_is_part_of_the_standard_deviations():
    curve = BaseCurve(MODEL.curve.family, MODEL.curve.values, peak_std=(0.005, 0.04))
    vague = ExtendedModel(base=MODEL.base, curve=curve)
    found, sure = (
        run(ExtendedEstimator(Tracker(), model, AXLES), 1, 20.0)[0] for model in (vague, MODEL)
    )
    for name, std in (("mu_max", 0.005), ("lambda_m", 0.04)):
        value = getattr(found, name)
        assert value == getattr(sure, name)
        expected = np.hypot(getattr(sure, f"{name}_std"), std * value)
        assert getattr(found, f"{name}_std") == pytest.approx(expected)


def test_the_prior_of_the_shape_is_not_counted_beside_a_measured_one():
    config = load_configuration()
    estimators = [
        replace(config, model=model).make_estimator()
        for model in (replace(MODEL, curve=None), MODEL)
    ]
    plain, shaped = (run(one, 1, 2.0)[0] for one in estimators)
    assert plain.lambda_m_std > 0.2 * plain.lambda_m
    assert shaped.lambda_m_std < 0.2 * shaped.lambda_m


@pytest.mark.costly
def test_without_the_model_the_peak_is_elsewhere():
    found, _, lambda_m = run(Tracker(), 1)
    assert abs(found.lambda_m / lambda_m - 1.0) > 0.1


def test_the_file_holds_the_curve(tmp_path):
    path = tmp_path / "model.toml"
    covariance = tuple(tuple(1e-4 * float(i == j) for j in range(5)) for i in range(5))
    curve = BaseCurve(MODEL.curve.family, MODEL.curve.values, covariance, (0.005, 0.04))
    model = ExtendedModel(base=MODEL.base, curve=curve)
    write_model(model, path)
    assert read_model(path) == model
    assert read_model(path).to_dict()["curve"]["family"] == "polach"


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('"polach"', '"kalker"', "no curve family 'kalker'; known: burckhardt, "),
        ("mu0 = 0.42", "mu0 = 42.0", "mu0 = 42 is not within"),
        ("mu0 = 0.42", "mu1 = 0.42", "parameters.mu0: missing"),
        ("[curve]", "[curve]\nspeed = 3.0", "speed"),
        ("[curve]", "[curve]\npeak_std = 0.1", "peak_std: not two numbers"),
        ("[curve]", '[curve]\npeak_std = [0.1, "wide"]', "peak_std: not two numbers"),
        ("[curve]", "[curve]\npeak_std = [0.1, -0.1]", "finite and not negative"),
    ],
)
def test_a_wrong_curve_is_refused(tmp_path, old, new, complaint):
    path = tmp_path / "model.toml"
    text = model_text(MODEL)
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(ConfigError) as refused:
        read_model(path)
    assert complaint in str(refused.value)
