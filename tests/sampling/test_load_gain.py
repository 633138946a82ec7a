"""The gain with which loads follow their transfer, against known gains and errors."""

import numpy as np
import pytest

from adhesion_can.sampling.load_gain import Changes, LoadGain

STATIC = 2e5
NOISE = 0.01 * STATIC
"""Standard deviation that is assumed of a change of the load beforehand."""


def changes(gain, n=4000, noise=NOISE, seed=3, size=2e4):
    """Loads that follow a gain, which may differ from change to change."""
    rng = np.random.default_rng(seed)
    transfer = rng.normal(0.0, size, n)
    gains = gain(rng, n) if callable(gain) else gain
    return Changes(np.arange(n) * 200 + 200, transfer, gains * transfer + rng.normal(0.0, noise, n))


def learnt(*parts):
    gain = LoadGain(STATIC)
    for part in parts:
        gain.learn(part)
    return gain


def at(gain, *t_us):
    values, stds = gain.at(np.array(t_us))
    return values.tolist(), stds.tolist()


def test_before_any_change_a_load_stays_and_all_of_a_transfer_is_doubt():
    assert at(learnt(), 0, 10**9) == ([0.0, 0.0], [1.0, 1.0])
    nothing = Changes(np.empty(0, dtype=np.int64), np.empty(0), np.empty(0))
    assert at(learnt(nothing), 5) == ([0.0], [1.0])


@pytest.mark.parametrize("gain", [1.0, 0.4, 0.0, -0.7])
@pytest.mark.parametrize("noise", [0.5 * NOISE, 3.0 * NOISE])
def test_many_changes_show_the_gain_whatever_their_noise(gain, noise):
    """The standard error of a slope is that of the noise over the root of the sum of squares."""
    given = changes(gain, noise=noise)
    (value,), (std,) = at(learnt(given), 10**9)
    error = noise / np.sqrt(np.sum(given.transfer**2))
    assert value == pytest.approx(gain, abs=4.0 * error)
    assert std == pytest.approx(error, rel=0.05)


@pytest.mark.parametrize(
    ("draw", "mean", "spread"),
    [
        (lambda rng, n: rng.integers(0, 2, n), 0.5, 0.5),
        (lambda rng, n: rng.normal(0.8, 0.2, n), 0.8, 0.2),
    ],
)
def test_gains_that_differ_from_change_to_change_stay_as_doubt(draw, mean, spread):
    (value,), (std,) = at(learnt(changes(draw, n=20_000, noise=0.3 * NOISE)), 10**9)
    assert value == pytest.approx(mean, abs=0.02)
    assert std == pytest.approx(spread, rel=0.05)


def test_a_scatter_is_found_where_all_transfers_have_one_size():
    """Transfers of ±1e4 N: what the errors exceed the expected noise by is the scatter."""
    rng = np.random.default_rng(5)
    transfer = 1e4 * rng.choice([-1.0, 1.0], 20_000)
    load = rng.normal(0.8, 0.3, 20_000) * transfer + rng.normal(0.0, NOISE, 20_000)
    (value,), (std,) = at(learnt(Changes(np.arange(20_000) * 200, transfer, load)), 10**9)
    assert value == pytest.approx(0.8, abs=0.02)
    assert std == pytest.approx(0.3, rel=0.05)


def test_one_change_counts_as_much_as_what_is_known_beforehand_says():
    """A normal gain of mean 0 and variance 1: x y / (x² + σ²) with σ² of ten changes and this."""
    x, y = 3e3, 2e3
    gain = learnt(Changes(np.array([100]), np.array([x]), np.array([y])))
    slope = x * y / (x * x + NOISE**2)
    var = (10.0 * NOISE**2 + (y - slope * x) ** 2) / 11.0
    assert at(gain, 100)[0] == pytest.approx([x * y / (x * x + var)])
    assert 0.0 < at(gain, 100)[1][0] < 1.0


def test_stamps_see_what_was_learnt_up_to_them_in_any_division_into_blocks():
    given = changes(0.8, n=60)
    whole = learnt(given)
    parts = learnt(*(Changes(*(column[a : a + 7] for column in given)) for a in range(0, 60, 7)))
    stamps = [0, 199, 200, 201, 399, 400, 6000, 12_000, 10**6]
    assert at(whole, *stamps) == at(parts, *stamps)
    for t_us in stamps:
        count = int(np.sum(given.t_us <= t_us))
        assert at(whole, t_us) == at(learnt(Changes(*(column[:count] for column in given))), 10**9)


def test_what_is_forgotten_is_needed_at_no_later_stamp_and_learning_goes_on():
    given, more = changes(0.8, n=60), changes(0.3, n=60, seed=4)
    more = more._replace(t_us=more.t_us + 12_000)
    kept, gain = learnt(given), learnt(given)
    gain.forget_before(6000)
    assert len(gain._t_us) == 30
    assert at(gain, 6000, 7000, 12_000) == at(kept, 6000, 7000, 12_000)
    for one in (kept, gain):
        one.learn(more)
    assert at(gain, 13_000, 10**6) == at(kept, 13_000, 10**6)
