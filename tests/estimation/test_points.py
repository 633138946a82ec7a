"""The branch of samples whose slip is smaller than its own error."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.estimation.tracker.layout import CERTAIN_STDS
from adhesion_can.estimation.tracker.points import (
    CoastingGate,
    OutlierGate,
    build_points,
    carries_information,
    is_valid,
    shows_surface,
)
from adhesion_can.physics.samples import Samples

SLIP_STD, STD = 0.002, 0.01


def measured(slip, adhesion, rng, size=2):
    """Samples of an update, `size` from each axle, with noise in both."""
    axles = len(slip)
    n = size * axles
    h = np.tile(slip, size) + SLIP_STD * rng.standard_normal(n)
    z = np.tile(adhesion, size) + STD * rng.standard_normal(n)
    return replace(
        Samples.curve(h, z),
        axle=np.tile(np.arange(1, axles + 1), size),
        slip_var=np.full(n, SLIP_STD**2),
        adhesion_var=np.full(n, STD**2),
    )


def mean_points(slip, adhesion, seeds):
    """Mean slip and adhesion of each axle's points over many updates, shape (axles,) each."""
    found = []
    for seed in seeds:
        points = build_points(measured(slip, adhesion, np.random.default_rng(seed)))
        found.append((points.slip.reshape(2, -1).mean(0), points.adhesion.reshape(2, -1).mean(0)))
    slips, adhesions = np.mean(found, axis=0)
    return slips, adhesions


def test_axles_that_pull_beside_axles_that_brake_keep_their_own_branches():
    slip = np.array([0.003, 0.003, 0.003, 0.003, -0.003, -0.003])
    adhesion = np.array([0.1, 0.1, 0.1, 0.1, -0.08, -0.08])
    slips, adhesions = mean_points(slip, adhesion, range(400))
    # Means of 800 samples: six standard errors.
    np.testing.assert_allclose(slips, np.abs(slip), atol=6 * SLIP_STD / 28)
    np.testing.assert_allclose(adhesions, np.abs(adhesion), atol=6 * STD / 28)


@pytest.mark.parametrize("level", [0.01, 0.02, 0.03, 0.06])
def test_noise_folds_no_axle_where_all_pull(level):
    """Also where some axles are sure of their adhesion and others are not."""
    slips, adhesions = mean_points(np.full(6, 0.0005), np.full(6, level), range(400))
    np.testing.assert_allclose(slips, 0.0005, atol=6 * SLIP_STD / 28)
    np.testing.assert_allclose(adhesions, level, atol=6 * STD / 28)


def test_an_axle_that_hardly_pulls_goes_with_the_others():
    adhesion = np.array([0.1, 0.1, 0.1, 0.1, 0.1, 0.004])
    slips, adhesions = mean_points(np.full(6, 0.0005), adhesion, range(400))
    assert adhesions[5] == pytest.approx(0.004, abs=6 * STD / 28)
    assert slips[5] == pytest.approx(0.0005, abs=6 * SLIP_STD / 28)


def test_without_stated_noise_of_the_adhesion_the_mean_of_all_axles_decides():
    rng = np.random.default_rng(1)
    adhesion = np.array([0.1, 0.1, 0.1, 0.1, -0.08, -0.08])
    samples = replace(measured(np.zeros(6), adhesion, rng), adhesion_var=np.zeros(12))
    assert (build_points(samples).sign[np.abs(samples.slip) < 4 * SLIP_STD] == 1.0).all()


# --- what is used at all


def one_sample(**changes):
    """A usable sample with some columns replaced."""
    columns = {name: np.array([value]) for name, value in changes.items()}
    return replace(Samples.curve(np.array([0.02]), np.array([0.2])), **columns)


@pytest.mark.parametrize(
    ("changes", "valid"),
    [
        ({}, True),
        *(({"slip": slip}, abs(slip) <= 0.5) for slip in (0.5, -0.5, 0.51, -0.51, -1.0, 30.0)),
        *(({"adhesion": mu}, abs(mu) <= 5.0) for mu in (5.0, -5.0, 5.1, -5.1)),
        ({"slip": 0.51, "adhesion": 5.1}, False),
        *(
            ({name: bad}, False)
            for name in ("slip", "adhesion", "slip_var", "slip_common_var", "adhesion_var",
                         "transient_var", "load_std")
            for bad in (np.nan, np.inf)
        ),
        ({"slip": np.nan, "adhesion_var": np.nan}, False),
    ],
)  # fmt: skip
def test_a_sample_within_the_model_is_valid(changes, valid):
    assert is_valid(one_sample(**changes), 0.5).tolist() == [valid]


@pytest.mark.parametrize(("stds", "shown"), [(0.0, False), (7.9, False), (8.1, True), (50.0, True)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_slips_of_eight_standard_deviations_distinguish_surfaces(stds, shown, sign):
    slip = np.full(5, sign * stds * SLIP_STD)
    samples = replace(Samples.curve(slip, np.full(5, 0.1)), slip_var=np.full(5, SLIP_STD**2))
    assert shows_surface(samples) is shown


@pytest.mark.parametrize(
    ("slip", "adhesion", "carries"),
    [(0.0, 0.0, False), (2.9, 2.9, False), (3.1, 0.0, True), (0.0, 3.1, True), (-3.1, 0, True)],
)
def test_what_exceeds_its_error_by_far_carries_information(slip, adhesion, carries):
    stds = np.array([slip * CERTAIN_STDS / 3]), np.array([adhesion * CERTAIN_STDS / 3])
    found = carries_information(
        stds[0] * SLIP_STD, stds[1] * STD, np.array([SLIP_STD**2]), np.array([STD**2])
    )
    assert found.tolist() == [carries]


def update_of(t_us, axle, slip, adhesion):
    """Samples of an update, one of each axle, with stated errors."""
    count = len(axle)
    return replace(
        Samples.curve(np.array(slip, float), np.array(adhesion, float)),
        t_us=np.full(count, t_us),
        axle=np.array(axle),
        slip_var=np.full(count, SLIP_STD**2),
        adhesion_var=np.full(count, STD**2),
    )


def test_an_axle_that_has_pulled_is_used_whatever_its_next_sample_says():
    gate = CoastingGate()
    assert gate.passes(update_of(0, [1, 3], [0.02, 0.0], [0.2, 0.0])).tolist() == [True, False]
    # By its mean; the axle that coasts is not used for one sample that sticks out.
    later = update_of(20_000, [1, 3], [0.0, 0.02], [0.0, 0.2])
    assert gate.passes(later).tolist() == [True, False]
    # Half a second later a mean says nothing any more.
    late = update_of(700_000, [1, 3, 6], [0.0, 0.02, 0.02], [0.0, 0.2, 0.2])
    assert gate.passes(late).tolist() == [False, True, True]


def test_the_mean_of_an_axle_follows_within_a_tenth_of_a_second():
    """First order: after n samples each 20 ms, e^(-n/5) of the old value is left."""
    gate = CoastingGate()
    gate.passes(update_of(0, [2], [0.0], [0.2]))
    used = [bool(gate.passes(update_of(20_000 * k, [2], [0.0], [0.0]))[0]) for k in range(1, 30)]
    # The k-th sees the mean of the k before it: 0.2 e^(-(k-1)/5).
    wanted = [0.2 * np.exp(-(k - 1) / 5) > CERTAIN_STDS * STD for k in range(1, 30)]
    assert used == wanted
    assert 0 < sum(used) < 29


def test_without_stated_errors_nothing_is_left_out():
    samples = Samples.curve(np.zeros(4), np.zeros(4))
    assert CoastingGate().passes(samples).all()


def test_a_sure_slip_has_its_own_sign():
    """An axle that turns slower than it rolls brakes, though the noise of its effort says else."""
    samples = update_of(0, [1, 2, 3], [0.02, 0.02, -0.02], [0.1, 0.1, 0.005])
    points = build_points(samples)
    assert points.sign.tolist() == [1.0, 1.0, -1.0]
    assert points.slip == pytest.approx([0.02] * 3)
    assert points.adhesion == pytest.approx([0.1, 0.1, -0.005])


# --- an axle that contradicts all others


AXLES = np.array([0, 0, 1, 1, 2, 2])


def sizes(far, near=1.0, suspect=0):
    return np.where(suspect == AXLES, far, near)


@pytest.mark.parametrize("suspect", [0, 2])
def test_an_axle_that_is_far_off_alone_is_left_out_three_times(suspect):
    gate = OutlierGate()
    for _ in range(3):
        assert gate.passes(sizes(8.1, 3.9, suspect), AXLES).tolist() == (suspect != AXLES).tolist()
    assert gate.passes(sizes(8.1, 3.9, suspect), AXLES) is None
    # It agrees once, and is left out again when it does not.
    assert gate.passes(sizes(1.0, 1.0, suspect), AXLES) is None
    assert gate.passes(sizes(8.1, 3.9, suspect), AXLES) is not None


def test_each_axle_has_a_patience_of_its_own():
    gate = OutlierGate()
    for suspect in (0, 1, 0, 1, 0, 1):
        assert gate.passes(sizes(9.0, 1.0, suspect), AXLES) is not None


@pytest.mark.parametrize(
    ("far", "near", "axle"),
    [
        (8.0, 1.0, AXLES),
        (9.0, 4.0, AXLES),
        (9.0, 5.0, AXLES),
        (9.0, 1.0, np.minimum(AXLES, 1)),
    ],
    ids=["not far", "another one is not near", "all are off", "two axles"],
)
def test_else_all_are_used(far, near, axle):
    assert OutlierGate().passes(np.where(axle == 0, far, near), axle) is None
