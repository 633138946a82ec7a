"""Channels of the data and their splines: which there are, and what their columns span."""

from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.diagnosis.regression.channel_splines import (
    Channel,
    ChannelKind,
    _compute_slip_rate,
    build_channels,
)
from adhesion_can.diagnosis.regression.model import EvaluatedModel, RegressionData, evaluate_model
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.physics.curves import Conditions
from tests.diagnosis.diagnosis_helpers import C1, C2, C3, SyntheticDrive, build_table_drive

N = 400
CURVE = SegmentCurves(np.array([[C1, np.log(C2), C3]]))
FACTOR, OFFSET = ChannelKind.FACTOR, ChannelKind.OFFSET


def evaluated(slip=None, factor=1.0):
    """Rows on a curve of 2 λ, whose prediction is a factor times it."""
    slip = np.linspace(-0.1, 0.1, N) if slip is None else slip
    one = np.ones(len(slip))
    return EvaluatedModel(0 * slip, slip, factor * one, 2.0 * slip, Conditions(10.0 * one))


def draw(shape=N):
    return np.random.default_rng(1).uniform(-3.0, 8.0, shape)


@pytest.mark.parametrize("columns", [4, 6, 14])
def test_a_spline_may_be_any_cubic_polynomial_and_its_columns_add_up_to_1(columns):
    x = draw()
    basis = Channel("dew", OFFSET, x, columns).build_basis(evaluated())
    assert basis.shape == (N, columns)
    assert basis.min() >= 0.0
    assert basis.sum(axis=1) == pytest.approx(np.ones(N))
    cubic = 0.3 - 2.0 * x + 0.7 * x**2 - 0.1 * x**3
    rest = cubic - basis @ np.linalg.lstsq(basis, cubic, rcond=None)[0]
    assert rest == pytest.approx(np.zeros(N), abs=1e-9)


def test_inner_knots_lie_at_quantiles_and_the_ends_count_four_times():
    x = draw() ** 3
    knots = Channel("dew", FACTOR, x).knots
    assert knots[:4].tolist() == [x.min()] * 4
    assert knots[-4:].tolist() == [x.max()] * 4
    assert knots[4:-4] == pytest.approx(np.quantile(x, [1 / 3, 2 / 3]))
    # A value that most rows have is one knot.
    often = np.where(np.arange(N) < 300, 5.0, x)
    assert len(np.unique(Channel("dew", FACTOR, often).knots)) < 4


def test_the_kind_says_whether_the_curve_grows_or_something_is_added():
    at, x = evaluated(factor=1.5), draw()
    basis = Channel("dew", OFFSET, x).build_basis(at)
    by_curve = Channel("dew", ChannelKind.CURVE, x).build_basis(at)
    by_factor = Channel("dew", FACTOR, x).build_basis(at)
    assert by_curve == pytest.approx(basis * np.sign(at.slip)[:, None])
    assert by_factor == pytest.approx(basis * (3.0 * at.slip)[:, None])


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_channel_of_few_values_has_a_column_for_each(number):
    x = np.arange(N) % number * 2.5
    channel = Channel("dew", OFFSET, x)
    assert channel.levels.tolist() == [2.5 * k for k in range(number)]
    wanted = np.eye(number)[np.arange(N) % number]
    assert channel.build_basis(evaluated()).tolist() == wanted.tolist()


def test_four_values_are_a_range_but_axles_are_never():
    x = np.arange(N) % 4 + 1.0
    assert Channel("dew", OFFSET, x).levels is None
    assert Channel("axle", OFFSET, x).levels.tolist() == [1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize(
    ("values", "constant"),
    [
        (np.full(N, 7.0), True),
        (np.zeros(N), True),
        (np.empty(0), True),
        (7.0 + 1e-9 * np.linspace(0, 1, N), True),
        (7.0 + 1e-7 * np.linspace(0, 1, N), False),
        (np.where(np.arange(N) == 3, -1.0, 0.0), False),
        (-7.0 - 1e-9 * np.linspace(0, 1, N), True),
    ],
)
def test_a_channel_that_hardly_varies_is_constant(values, constant):
    assert Channel("dew", FACTOR, values).constant is constant


def test_channels_of_a_drive_are_those_that_vary():
    drive = SyntheticDrive(8.0, axles=2).build_drive_data(np.random.default_rng(1))
    drive.covariates.update(dew=np.sin(drive.t_s), rust=np.zeros(len(drive)))
    data = RegressionData((drive,), np.zeros(len(drive), dtype=np.int64), 1)
    at = evaluate_model(data, CURVE)
    found = {channel.name: channel for channel in build_channels(data, at)}
    assert set(found) == {
        *("slip", "tractive_effort", "slip_rate", "speed", "axle_load", "axle", "time"),
        *("position", "dew"),
    }
    kinds = {name for name, channel in found.items() if channel.kind is not FACTOR}
    assert kinds == {"tractive_effort", "slip_rate"}
    assert found["slip"].values.min() >= 0.0
    seen = drive.observe()
    assert found["tractive_effort"].values == pytest.approx(np.abs(at.predicted) * seen.load)
    assert found["dew"].values == pytest.approx(np.sin(drive.t_s))
    assert found["dew"].unit == ""
    assert found["speed"].unit == "m/s"
    # More may happen along a drive than along any other channel.
    assert found["time"].columns == found["position"].columns > 2 * found["speed"].columns
    rate = np.gradient(seen.slip) / np.gradient(drive.t_s)
    first = np.flatnonzero(np.diff(drive.axle)) + 1  # rows of the next axle from here on
    inner = ~np.isin(np.arange(len(rate)), [first - 1, first])
    inner &= np.abs(rate) < np.quantile(np.abs(rate), 0.9)
    assert found["slip_rate"].values[inner] == pytest.approx(rate[inner], rel=1e-6, abs=1e-9)
    assert np.abs(found["slip_rate"].values).max() <= np.quantile(np.abs(rate), 0.9991)


@pytest.mark.parametrize(("rows", "rates"), [(0, []), (1, [0.0]), (2, [0.2, 0.2])])
def test_two_rows_have_a_rate_of_the_slip_and_one_has_none(rows, rates):
    t_s, slip = np.arange(rows) * 0.1, 0.01 + 0.02 * np.arange(rows)
    data = SimpleNamespace(column=lambda _: t_s)
    assert _compute_slip_rate(data, slip) == pytest.approx(np.array(rates))


def test_the_slip_has_no_rate_where_the_next_axle_or_the_same_stamp_follows():
    """Central differences, as far as the stamps ascend."""
    t_s = np.array([0.0, 0.1, 0.2, 0.3, 0.0, 0.1, 0.2, 0.2, 0.2, 0.3])
    slip = np.array([0.0, 0.01, 0.02, 0.03, 0.5, 0.51, 0.52, 0.53, 0.54, 0.55])
    found = _compute_slip_rate(SimpleNamespace(column=lambda _: t_s), slip)
    wanted = [0.1, 0.1, 0.1, 0.0, 0.0, 0.1, 0.2, 0.0, 0.2, 0.1]
    assert found == pytest.approx(np.array(wanted), rel=0.01)


def test_a_spline_has_four_columns_at_least():
    basis = Channel("dew", OFFSET, draw(), 2).build_basis(evaluated())
    assert basis.shape == (N, 4)


def test_points_in_any_order_have_no_time_and_only_what_all_recordings_have_counts():
    time_s = np.arange(400) * 0.05
    slip = 0.05 + 0.04 * np.sin(time_s)
    points = build_table_drive(slip[:80], 2.0 * slip[:80], np.zeros(80))
    assert points.independent
    series = build_table_drive(slip, 2.0 * slip, time_s, covariates={"dew": slip, "rust": slip})
    more = build_table_drive(slip, 2.0 * slip, time_s, covariates={"rust": slip})
    both = RegressionData((series, more), np.zeros(800, dtype=np.int64), 1)
    names = {channel.name for channel in build_channels(both, evaluate_model(both, CURVE))}
    assert {"slip_rate", "time", "rust"} <= names
    assert "dew" not in names
    one = RegressionData((points,), np.zeros(80, dtype=np.int64), 1)
    names = {channel.name for channel in build_channels(one, evaluate_model(one, CURVE))}
    assert not names & {"slip_rate", "time", "position"}
    assert "slip" in names
