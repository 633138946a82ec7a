"""The judge: what it calls wrong, and for how long."""

from dataclasses import replace

import numpy as np
import pytest

from tests.faults.judge import Setpoints, decode, errors, judge
from tests.faults.locomotive import Truth, World
from tests.faults.wire import Frame
from tests.worlds.encoding import database, packed

T = np.arange(0.0, 20.0, 0.02)
TRUTH_T = np.arange(0.0, 20.0, 0.005)


def truth(mu=0.37, slip=0.07):
    """A rail that stays."""
    row, many = np.full(len(TRUTH_T), 12.0), np.zeros((len(TRUTH_T), 6))
    return Truth(
        World(1), TRUTH_T, row, many, many, many, row,
        np.full((2, len(TRUTH_T)), mu), np.full((2, len(TRUTH_T)), slip),
        np.ones(len(TRUTH_T), dtype=bool),
    )  # fmt: skip


def setpoints(**values):
    """Right ones, with TRACKING, but for what is given."""
    of = {"status": 1, "mu": 0.37, "mu_std": 0.002, "slip": 0.07, "slip_std": 0.001} | values
    full = {name: np.broadcast_to(value, T.shape).copy() for name, value in of.items()}
    full["status"] = full["status"].astype(np.int64)
    return Setpoints(t=T, **full)


def wrong(sent, true=None):
    return errors(sent, true or truth())[2]


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({}, False),
        ({"mu": 0.378}, True),  # 2.2 %, four standard deviations
        ({"mu": 0.376}, False),  # 1.6 %
        ({"mu": 0.378, "mu_std": 0.003}, False),  # less than three
        ({"slip": 0.074}, True),
        ({"slip": 0.0733}, False),
        ({"slip": 0.074, "slip_std": 0.0014}, False),
        ({"mu": 0.5, "status": 2}, False),
        ({"mu": np.nan, "slip": np.nan, "status": 1}, False),
    ],
)
def test_wrong_is_beyond_three_deviations_and_a_share(values, expected):
    assert wrong(setpoints(**values)).all() == expected
    assert wrong(setpoints(**values)).any() == expected


def test_between_two_rails_any_value_between_theirs_is_right():
    true = truth()
    true.peaks[0] = 0.25
    assert not wrong(setpoints(mu=0.3), true).any()
    assert wrong(setpoints(mu=0.24, mu_std=0.001), true).all()


def test_times_and_shares():
    bad = (T >= 10.2) & (T < 11.2)
    sent = setpoints(mu=np.where(bad, 0.5, 0.37), status=np.where((T >= 11.2) & (T < 15), 2, 1))
    verdict = judge(sent, truth(), 10.0, 10.0, 14.0)
    assert verdict.before == 1.0
    assert verdict.wrong == pytest.approx(0.1)
    assert verdict.wrong_late == pytest.approx(0.7 / 9.5, abs=0.003)
    assert verdict.longest_s == pytest.approx(0.7, abs=0.021)
    assert verdict.leaves_s == pytest.approx(1.2, abs=0.021)
    assert verdict.back_s == pytest.approx(1.0, abs=0.021)
    assert verdict.tracking == pytest.approx(0.62, abs=0.003)
    assert verdict.worst_mu == pytest.approx(0.13 / 0.37)
    assert judge(setpoints(), truth(), 10.0, 10.0, None).leaves_s is None


def test_what_a_change_of_the_rail_makes_wrong_may_last_half_a_second():
    true = truth()
    passing = (TRUTH_T >= 10) & (TRUTH_T < 11)
    true = replace(true, settled=~passing)
    true.peaks[:, TRUTH_T >= 11] = 0.25
    short = judge(setpoints(mu=np.where(T < 11.4, 0.37, 0.25)), true, 5.0, 5.0, None)
    assert short.wrong > 0.02
    assert short.wrong_late == 0.0
    assert judge(setpoints(mu=np.where(T < 12, 0.37, 0.25)), true, 5.0, 5.0, None).wrong_late > 0.02


def test_what_is_wrong_without_the_fault_is_not_the_faults():
    sent = setpoints(mu=np.where((T > 12) & (T < 13), 0.5, 0.37))
    near = setpoints(mu=np.where((T > 12.4) & (T < 12.6), 0.5, 0.37))
    assert judge(sent, truth(), 10.0, 10.0, None).wrong_late > 0.09
    assert judge(sent, truth(), 10.0, 10.0, None, near).wrong_late == 0.0
    assert judge(sent, truth(), 10.0, 10.0, None, setpoints()).wrong_late > 0.09


def test_numbers_are_decoded_as_sent_and_what_is_not_available_is_none():
    def frame(name, t_us, **signals):
        message = database().get_message_by_name(name)
        columns = {key: np.array([value]) for key, value in signals.items()}
        return Frame(t_us, message.frame_id, packed(message, columns)[0].tobytes())

    sent = decode(
        [
            frame("AdhesionSetpoint", 20_000, Status=1, MuMax=0.37, LambdaM=0.07),
            frame("AdhesionQuality", 20_000, MuMaxStd=0.002, LambdaMStd=0.001),
            frame("AdhesionSetpoint", 40_000, Status=0, MuMax=1.3107, LambdaM=0.65535),
        ]
    )
    assert sent.t.tolist() == [0.02, 0.04]
    assert sent.status.tolist() == [1, 0]
    assert sent.mu[0] == pytest.approx(0.37)
    assert sent.slip_std.tolist() == pytest.approx([0.001, 0.001])
    assert np.isnan([sent.mu[1], sent.slip[1]]).all()
