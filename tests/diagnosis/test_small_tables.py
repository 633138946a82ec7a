"""Tables of independent points: a verdict from 60 rows on, and what their number allows to see."""

import numpy as np
import pytest

from adhesion_can.diagnosis.diagnose import diagnose
from adhesion_can.diagnosis.inference.candidates import depends_on_sequence
from adhesion_can.physics.effects import known_effects
from tests.diagnosis.diagnosis_helpers import (
    build_table_drive,
    burckhardt,
    diagnosed,
    write_table,
)


def points(seed, rows=120, factor=1.0):
    """Points in the order of their slips, as a digitised plot has them."""
    rng = np.random.default_rng(seed)
    slip = np.sort(rng.uniform(0.002, 0.2, rows))
    return {"slip": slip, "adhesion": factor * burckhardt(slip) + 0.01 * rng.standard_normal(rows)}


def test_sixty_points_without_a_time_get_a_verdict(tmp_path):
    answer = diagnosed(tmp_path, write_table(tmp_path / "t.csv", points(1, 60)))
    assert answer.status == 0, answer.err
    gain = answer.document["gain"]
    assert "each point in turn" in gain["held_out"]
    assert gain["noise_floor"] == pytest.approx(0.01, rel=0.3)
    assert "60 points, treated as independent" in answer.notes
    few = diagnosed(tmp_path, write_table(tmp_path / "t.csv", points(1, 59)))
    assert few.document["gain"] is None
    assert "at least 60 are needed" in few.notes


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_each_point_is_predicted_by_the_others(seed):
    """The mean square of leave-one-out exceeds that of the noise by about the parameters' share."""
    given = points(seed)
    found = diagnose([build_table_drive(given["slip"], given["adhesion"], np.zeros(120))])
    assert found.gain is not None
    residual = given["adhesion"] - burckhardt(given["slip"])
    # Three parameters of 120 points: 2.5 % of the RMSE; a third of it is left for chance.
    share = found.gain.rmse_before / np.sqrt(np.mean(residual**2))
    assert 0.98 < share < 1.06


def test_the_order_of_points_means_nothing():
    """Sorted by slip or not, with stamps or without: the same points give the same numbers."""
    given = points(4)
    order = np.random.default_rng(4).permutation(120)
    found = [
        diagnose([build_table_drive(given["slip"][o], given["adhesion"][o], t)])
        for o, t in ((slice(None), np.zeros(120)), (order, np.arange(120.0)))
    ]
    before, after = (one.gain.rmse_before for one in found)
    assert before == pytest.approx(after, rel=1e-6)


def test_effects_that_need_a_sequence_are_not_tested_on_points():
    needs = {effect.id for effect in known_effects() if depends_on_sequence(effect)}
    assert needs == {
        "speed_delay", "wheel_speed_delay", "effort_delay", "creep_relaxation",
        "adhesion_recovery", "contact_heating", "sanding", "slow_drift", "effort_gain",
        "speed_error", "wheel_once_per_turn",
    } & {effect.id for effect in known_effects()}  # fmt: skip
