"""A wheel whose sensor is dead: what `check` and `identify` say, and that they say it."""

import json

import numpy as np
import pytest

from adhesion_can.cli.main import main
from adhesion_can.offline.plausibility import inspect_points
from adhesion_can.offline.points import MeasuredPoints
from adhesion_can.sampling.noise import estimate_signal
from adhesion_can.sampling.traces import Trace
from tests.diagnosis.bad_logs import readings, write

SAYS = "the wheel does not turn while the vehicle moves"
N = 600


def rows(standing, *, noise=0.0, braking=False, seed=1):
    """Rows of an axle that pulls and coasts, whose wheel speed is dead in a share of them."""
    rng = np.random.default_rng(seed)
    slip = np.abs(0.05 * np.sin(np.arange(N) / 40.0))
    adhesion = 0.35 * (1 - np.exp(-40 * slip)) + 0.005 * rng.standard_normal(N)
    dead = np.arange(N) < standing * N
    slip[dead] = -1.0 + noise * rng.random(int(dead.sum()))
    adhesion[dead] = -0.2 if braking else adhesion[dead]
    return MeasuredPoints(slip, adhesion, table=False, name="axle 3")


@pytest.mark.parametrize("noise", [0.0, 0.0005])
@pytest.mark.parametrize(
    ("share", "fatal"), [(1.0, True), (0.6, True), (0.3, False), (0.05, False)]
)
def test_a_dead_wheel_is_named_with_its_axle_and_nothing_else_is_said_of_it(share, fatal, noise):
    (finding,) = [one for one in inspect_points(rows(share, noise=noise)) if SAYS in one.what]
    assert finding.what.startswith(f"axle 3: {SAYS}, in {round(share * N)} of {N} samples")
    assert finding.fatal is fatal
    assert "radius" not in " ".join(one.sentence for one in inspect_points(rows(share)))


def test_a_wheel_that_a_brake_locks_is_none():
    assert not [one for one in inspect_points(rows(0.3, braking=True)) if SAYS in one.what]


def test_a_few_samples_at_rest_are_no_dead_sensor():
    assert not [one for one in inspect_points(rows(10 / N)) if SAYS in one.what]


def test_a_table_with_locked_wheels_is_no_matter():
    slip = rows(0.3).slip
    assert not [one for one in inspect_points(MeasuredPoints(slip, 0.0 * slip)) if SAYS in one.what]


@pytest.fixture(scope="module")
def dead_log(tmp_path_factory):
    """A drive of which axle 2 says 0 rad/s throughout."""
    given = readings(12.0)
    given.wheel_speed[:, 1] = 0.0
    return write(tmp_path_factory.mktemp("dead") / "dead.log", given)


def test_check_says_what_it_is(dead_log, tmp_path):
    assert main(["check", str(dead_log), "--json", str(tmp_path / "c.json")]) == 1
    failures = json.loads((tmp_path / "c.json").read_text())["failures"]
    assert [one for one in failures if one.startswith(f"axle 2: {SAYS}")]


def test_identify_refuses_in_one_line(dead_log, capsys):
    assert main(["identify", str(dead_log)]) == 2
    err = capsys.readouterr().err
    assert f"axle 2: {SAYS}" in err
    assert len(err.splitlines()) == 1


def test_a_signal_that_stands_still_mostly_has_no_noise_that_is_known():
    """Its differences are 0 at the low quantile: nothing can be divided by them."""
    rng = np.random.default_rng(3)
    value = np.where(np.arange(4000) % 40 < 38, 0.0, rng.standard_normal(4000).round(3))
    t_us = np.arange(4000) * 10_000
    for step in (0.0, 0.002):
        found = estimate_signal(Trace(t_us, value), step)
        assert found.std is None or np.isfinite(found.std)
    still = np.concatenate([np.zeros(3500), rng.standard_normal(500)])
    assert estimate_signal(Trace(t_us, still), 0.002).reason
