"""Both refutations on rows whose mechanism is written out here: a true cause survives, others fall.

The drives have sweeps of creep on a known curve and white noise. What multiplies the adhesion is a
formula of the test; what must explain it is an effect of the library.
"""

import numpy as np
import pytest
import scipy

from adhesion_can.diagnosis.formatting import short_apart
from adhesion_can.diagnosis.refutation.block_variance import (
    MOST_LEFT,
    compute_block_variance,
    compute_variance_left,
)
from adhesion_can.diagnosis.refutation.environments import Partition, _divide, build_partitions
from adhesion_can.diagnosis.refutation.invariance import (
    _cochran,
    _SplitEffect,
    _spread,
    compute_sizes,
    find_refuting,
)
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.gram_matrices import BlockGramMatrices
from adhesion_can.diagnosis.regression.model import Model, RegressionData, remove_effect
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression, fit_model
from adhesion_can.diagnosis.regression.whitening import ContiguousRuns, Whitener
from adhesion_can.physics.effects import effect_by_id
from tests.diagnosis.diagnosis_helpers import C1, C2, C3, build_table_drive, burckhardt

STEP_S, BLOCK_S = 0.05, 4.0
STD = 0.004
AXLES = 6


def sweeps(seed, factor, *, duration_s=160.0):
    """Regression on sweeps of six axles whose adhesion has a factor(t, axle, slip, humidity)."""
    rng = np.random.default_rng(seed)
    t = np.tile(np.arange(0.0, duration_s, STEP_S), AXLES)
    axle = np.repeat(np.arange(1, AXLES + 1), len(t) // AXLES)
    side = np.where(np.floor(t / 9.0) % 3 == 2, -1.0, 1.0)
    slip = side * 0.11 * (0.5 - 0.5 * np.cos(2 * np.pi * t / 9.0 + 0.4 * axle))
    humidity = 60.0 + 20.0 * np.sin(2 * np.pi * t / 47.0)
    adhesion = burckhardt(slip) * factor(t, axle, slip, humidity)
    drive = build_table_drive(
        slip,
        adhesion + STD * rng.standard_normal(len(t)),
        t,
        axle=axle,
        speed=np.full(len(t), 12.0),
        covariates={"relative_humidity_percent": humidity},
    )
    n = len(drive)
    data = RegressionData((drive,), np.zeros(n, dtype=np.int64), 1)
    breaks = np.zeros(n, dtype=bool)
    breaks[0] = True
    runs = ContiguousRuns.find(drive.t_s, drive.axle, breaks)
    return WhitenedRegression(
        data,
        np.full(n, 1.0 / STD),
        np.zeros(n),
        np.zeros((n, 0)),
        np.zeros(1),
        np.zeros(n),
        Whitener(np.array([1.0]), runs),
        np.ones(n),
        np.floor(drive.time_s / BLOCK_S).astype(np.int64),
    )


def fitted(regression, *effects):
    curves = SegmentCurves(np.array([[C1, np.log(C2), C3]]))
    model = Model(curves)
    for effect in effects:
        model = model.with_effect(Candidate(effect_by_id(effect)))
    return fit_model(regression, model).model


def tried(regression, *effects):
    """Variance left and sizes by environment of the first of some effects."""
    model = fitted(regression, *effects)
    without = fit_model(regression, remove_effect(model, 0)[0]).model
    left = compute_variance_left(regression, model, without)
    partitions = build_partitions(regression.data, regression.evaluate_corrected(model).slip)
    return left, compute_sizes(regression, model, 0, partitions)


def plain(_t, _axle, _slip, _humidity):
    return 1.0


def humid(_t, _axle, _slip, humidity):
    return 1.0 - 0.004 * (humidity - 60.0)


def humid_at_two_axles(_t, axle, _slip, humidity):
    return 1.0 - np.where(np.isin(axle, (1, 4)), 0.012, 0.0) * (humidity - 60.0)


def wandering(t, _axle, _slip, _humidity):
    """What changes with time by no law that the effects of the test have."""
    return 1.0 + 0.1 * np.sin(2 * np.pi * t / 31.0) + 0.05 * np.sin(2 * np.pi * t / 13.0)


@pytest.mark.parametrize("seed", range(6))
def test_the_blocks_of_independent_rows_have_no_excess_variance(seed):
    """Its mean is 1 with the standard error √(2/cells) of squared normal variables."""
    regression = sweeps(seed, plain)
    variance = compute_block_variance(regression, fitted(regression))
    error = np.sqrt(2.0 / len(variance.ratio))
    assert variance.ratio.mean() == pytest.approx(1.0, abs=4.0 * error)
    assert len(np.unique(variance.block)) == 160.0 / BLOCK_S


def test_the_ratio_is_that_of_sums_written_out():
    regression = sweeps(3, wandering)
    model = fitted(regression)
    rest = regression.residual(model) / STD
    drive = regression.data.drives[0]
    slip = drive.observe().slip
    ratios = []
    for block in np.unique(regression.block):
        for axle in range(1, AXLES + 1):
            for side in (-1, 1):
                rows = (regression.block == block) & (drive.axle == axle) & (np.sign(slip) == side)
                if rows.sum() >= 8:
                    ratios.append(rest[rows].sum() ** 2 / rows.sum())
    square = np.mean(rest[slip != 0.0] ** 2)
    expected = np.sort(np.array(ratios) / square)
    assert np.sort(compute_block_variance(regression, model).ratio) == pytest.approx(expected)


@pytest.mark.parametrize("seed", range(6))
def test_a_true_cause_leaves_nothing_and_has_one_size(seed):
    left, sizes = tried(sweeps(seed, humid), "humidity")
    assert left.share < MOST_LEFT
    assert not left.refutes
    assert find_refuting(sizes) is None
    by_axle = next(one for one in sizes if one.partition == "axle")
    assert by_axle.sizes == pytest.approx(np.full(AXLES, -0.004), abs=4.0 * by_axle.stds.max())


@pytest.mark.parametrize("seed", range(6))
def test_a_cause_of_some_axles_alone_has_not_one_size(seed):
    _, sizes = tried(sweeps(seed, humid_at_two_axles), "humidity")
    refuting = find_refuting(sizes)
    assert refuting is not None
    assert refuting.partition == "axle"
    shown = dict(zip(refuting.labels, refuting.sizes, strict=True))
    assert shown["axle 1"] == pytest.approx(-0.012, rel=0.1)
    assert shown["axle 4"] == pytest.approx(-0.012, rel=0.1)
    assert abs(shown["axle 2"]) < 0.001


@pytest.mark.parametrize("seed", range(6))
def test_a_cause_that_only_helps_leaves_too_much(seed):
    """A straight line in time through what swings gains, and is not the cause."""
    left, _ = tried(sweeps(seed, wandering), "slow_drift")
    assert left.share > 2.0 * MOST_LEFT
    assert left.refutes


def test_a_true_cause_beside_another_has_one_size():
    def both(t, axle, slip, humidity):
        return humid(t, axle, slip, humidity) * np.where(slip < 0.0, 1.1, 1.0)

    for seed in range(3):
        regression = sweeps(seed, both)
        for order in (("humidity", "traction_braking_asymmetry"),
                      ("traction_braking_asymmetry", "humidity")):  # fmt: skip
            left, sizes = tried(regression, *order)
            assert not left.refutes
            assert find_refuting(sizes) is None


def test_environments_without_information_are_left_out():
    """An asymmetry shows in braking alone: there are no two directions to compare."""
    regression = sweeps(1, lambda _t, _axle, slip, _h: np.where(slip < 0.0, 1.1, 1.0))
    _, sizes = tried(regression, "traction_braking_asymmetry")
    assert "direction" not in {one.partition for one in sizes}
    assert "axle" in {one.partition for one in sizes}


def test_every_partition_covers_all_rows_and_names_its_environments():
    regression = sweeps(2, plain)
    partitions = build_partitions(regression.data, regression.data.drives[0].observe().slip)
    names = [one.name for one in partitions]
    assert len(set(names)) == len(names)
    assert {"creep", "time", "axle", "bogie", "direction", "slip_work"} <= set(names)
    for one in partitions:
        assert one.number.min() == 0
        assert one.number.max() == len(one.labels) - 1
        assert len(one.number) == len(regression.data)
        assert len(set(one.labels)) == len(one.labels)


def test_a_channel_that_is_mostly_0_is_divided_at_0():
    rng = np.random.default_rng(10)
    values = np.where(rng.random(900) < 0.7, 0.0, rng.normal(size=900))
    made = _divide("curvature_per_m", values)
    assert [label.split()[-3:] for label in made.labels] == [
        ["below", "0", "1/m"], ["curvature", "0", "1/m"], ["above", "0", "1/m"],
    ]  # fmt: skip
    assert (made.number == np.sign(values) + 1).all()
    one_side = _divide("curvature_per_m", np.abs(values))
    assert len(one_side.labels) == 2
    assert (one_side.number == (values != 0)).all()


def test_cochrans_q_is_uniform_where_sizes_agree():
    """Kolmogorov and Smirnov's distance of 400 p-values is above 0.085 in 0.6 % of such draws."""
    rng = np.random.default_rng(7)
    values = []
    for _ in range(400):
        root = rng.standard_normal((5, 5))
        covariance = root @ root.T + 0.1 * np.eye(5)
        sizes = 3.0 + np.linalg.cholesky(covariance) @ rng.standard_normal(5)
        values.append(_cochran(sizes, covariance, 10_000))
    assert scipy.stats.kstest(values, "uniform").statistic < 0.085


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1e6, 1e12])
def test_no_p_value_depends_on_a_unit(unit):
    """In 1/J beside s, information of 1e14 and of 1, a pseudo-inverse dropped one of the two."""
    rng = np.random.default_rng(9)
    root = rng.standard_normal((4, 4))
    covariance = root @ root.T + 0.1 * np.eye(4)
    sizes = np.array([1.0, 3.0, -2.0, 6.0])
    expected = _cochran(sizes, covariance, 60)
    assert _cochran(unit * sizes, unit**2 * covariance, 60) == pytest.approx(expected, rel=1e-6)


def test_a_parameter_answers_for_its_own_differences_alone():
    """A gain that varies by chance beside a time that differs for certain, by a quarter."""
    split = _SplitEffect(
        Partition("parts", ("a", "b", "c"), np.zeros(1, dtype=int)),
        BlockGramMatrices(np.zeros((60, 2, 2)), np.zeros(60)), 1, 2,
    )  # fmt: skip
    gain, time = effect_by_id("adhesion_recovery").parameters
    gains, times = np.array([0.05, 0.2, 0.4]), np.array([1.5, 2.0, 2.5])
    of_gain = split._of_parameter(0, gain, 0.2, gains, 0.12**2 * np.eye(3))
    of_time = split._of_parameter(1, time, 2.0, times, 0.08**2 * np.eye(3))
    assert of_gain.p_value > 0.05
    assert of_gain.spread > 0.3
    assert of_time.p_value < 1e-6
    assert of_time.spread < 0.3
    assert not of_gain.refutes
    assert not of_time.refutes


def test_the_ends_of_an_environment_can_be_told_apart():
    assert short_apart(8.2, 12.44) == ("8.2", "12.4")
    assert short_apart(244_871.0, 245_122.0) == ("244900", "245100")
    assert short_apart(-0.0, 0.0) == ("-0", "0")
    assert short_apart(1.0, 1.0) == ("1", "1")


def test_the_spread_is_that_between_environments():
    """Mean over draws: sizes of standard deviation 0.5 about 2, each known to 0.2."""
    rng = np.random.default_rng(8)
    squares = [
        _spread(2.0 + 0.5 * rng.standard_normal(6) + 0.2 * rng.standard_normal(6),
                np.full(6, 0.04), 2.0) ** 2
        for _ in range(2000)
    ]  # fmt: skip
    assert np.sqrt(np.mean(squares)) == pytest.approx(0.25, rel=0.05)


def test_the_spread_is_nothing_where_chance_explains_the_sizes():
    assert _spread(np.array([1.0, 1.1, 0.9]), np.full(3, 0.04), 1.0) == 0.0
