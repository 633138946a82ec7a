"""The simulator: its law, its balance, its instruments, and its frames."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.faults.locomotive import AXLES, BEHIND, INERTIA, RADIUS, World, simulate
from tests.faults.play import draw_rails
from tests.faults.rail import adhesion, peak
from tests.faults.sensors import SILENT, draw_noise, read
from tests.faults.wire import frames, pack, queues
from tests.wire import DB, seal_ok

DRY, WET = draw_rails(3)
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def truth():
    return simulate(World(4, 14.0, ((0.0, DRY), (8.0, WET))))


@pytest.mark.parametrize("seed", range(10))
def test_a_rail_has_a_peak_and_a_fall(seed):
    for rail in draw_rails(seed):
        (most,), (slip,) = peak(rail, np.array([12.0]))
        near = adhesion(slip + np.array([-0.003, 0.0, 0.003]), 12.0, rail)
        assert near[1] == pytest.approx(most, rel=1e-5)
        assert near.argmax() == 1
        assert 0.04 < slip < 0.1
        assert adhesion(np.array([3 * slip]), 12.0, rail)[0] < 0.97 * most


def test_the_rail_gives_what_the_effort_and_the_wheel_say(truth):
    """J dω/dt = r (T − μ N), where all axles run on the same rail."""
    rows = (truth.t > 2.0) & (truth.t < 7.5)
    slip = RADIUS * truth.wheel / truth.speed[:, None] - 1
    own = INERTIA * np.gradient(truth.wheel, truth.t, axis=0) / RADIUS
    shown = (truth.effort - own) / truth.load
    law = adhesion(slip, truth.speed[:, None], DRY)
    assert np.abs(shown - law)[rows].max() < 0.004
    assert np.abs(slip[rows]).max() > 1.8 * truth.slips[0][rows].max()


def test_a_change_of_the_rail_passes_from_the_first_axle_to_the_last(truth):
    passing = truth.t[~truth.settled]
    speed = float(np.interp(8.5, truth.t, truth.speed))
    assert passing[0] == pytest.approx(8.0, abs=0.02)
    assert passing[-1] - passing[0] == pytest.approx(BEHIND[-1] / speed, abs=0.05)
    assert truth.peaks[1][-1] < 0.8 * truth.peaks[0][0]


def test_instruments_read_with_their_noise(truth):
    noise, silent = draw_noise(4), read(truth, SILENT)
    readings = read(truth, noise)
    for name, size in (("wheel", noise.wheel), ("speed", noise.speed), ("effort", noise.effort)):
        away = getattr(readings, name) - getattr(silent, name)
        assert np.std(away) == pytest.approx(size, rel=0.1)


def test_frames_are_sealed_and_carry_the_readings(truth):
    readings = read(truth, draw_noise(4))
    given = frames({name: pack(queue, name) for name, queue in queues(readings).items()})
    assert all(map(seal_ok, given[:500]))
    speeds = [f for f in given if f.arbitration_id == 0x111]
    found = [DB.decode_message(0x111, f.data)["VehicleSpeed"] for f in speeds[:100]]
    assert np.abs(np.array(found) - readings.speed[:100]).max() <= 0.001 + 1e-9
    assert readings.wheel.shape[1] == AXLES


@pytest.mark.costly
def test_nothing_but_the_play_uses_the_product():
    names = "tests.faults.catalogue, tests.faults.judge, tests.faults.locomotive"
    code = f"import sys, {names}; print([m for m in sys.modules if 'adhesion_can' in m])"
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout == "[]\n"


def test_the_same_seed_gives_the_same_drive():
    first, second = (simulate.__wrapped__(World(9, 3.0)) for _ in range(2))
    assert np.array_equal(first.wheel, second.wheel)
    assert not np.array_equal(first.wheel, simulate(World(10, 3.0)).wheel)
