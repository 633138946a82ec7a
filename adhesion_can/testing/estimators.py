"""What holds of every estimator, as a class of tests."""

from copy import deepcopy

import numpy as np

from adhesion_can.estimation.estimator import Estimator
from adhesion_can.physics.burckhardt import RAIL, CurveParameters, adhesion, peak
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples
from adhesion_can.testing.require import require

NOTHING = Samples.from_rows([])
UPDATE = 12
"""Samples of an update: two of each of six axles."""


def draw_samples(
    theta: CurveParameters, seed: int = 1, *, n: int = 1500, top: float = 0.2, noise: float = 0.01
) -> Samples:
    """Points of a curve with noise.

    Args:
        theta: c1, c2 and c3 of the curve.
        seed: Seed of the draw.
        n: Number of points.
        top: Largest slip ratio; the slips are uniform.
        noise: Standard deviation of the adhesion.

    """
    rng = np.random.default_rng(seed)
    slip = rng.uniform(0.0, top, n)
    return Samples.curve(slip, adhesion(slip, *theta) + noise * rng.standard_normal(n))


class EstimatorSuite:
    """Tests that every estimator passes.

    Attributes:
        mu_within: Largest relative error of μ_max after 1500 samples of a dry rail.

    """

    mu_within = 0.03

    def make(self) -> Estimator:
        """A fresh estimator."""
        raise NotImplementedError("a suite of estimators has a method `make`")

    def feed(self, estimator: Estimator, samples: Samples) -> list[Estimate | None]:
        """Estimates after each update of `UPDATE` samples."""
        starts = range(0, len(samples), UPDATE)
        return [estimator.update(samples.select(slice(k, k + UPDATE)), 0) for k in starts]

    def test_it_finds_the_peak_of_a_dry_rail(self) -> None:
        """From 1500 samples on both sides of the peak."""
        theta = RAIL[0].theta
        last = self.feed(self.make(), draw_samples(theta))[-1]
        if last is None:
            raise AssertionError("no estimate after 1500 samples")
        wanted = float(peak(*theta).mu_max)
        error = last.mu_max / wanted - 1.0
        require(abs(error) <= self.mu_within, f"mu_max is {error:+.1%} off after 1500 samples")

    def test_slips_far_below_the_peak_do_not_identify_it(self) -> None:
        """Up to a twentieth of λ_m the curve is a straight line."""
        theta = RAIL[0].theta
        top = 0.05 * float(peak(*theta).lambda_m)
        for estimate in self.feed(self.make(), draw_samples(theta, top=top)):
            if estimate is not None:
                claims = estimate.identifiable
                require(not (claims.mu_max or claims.lambda_m), f"slips up to {top:.4f}: {claims}")

    def test_a_single_slip_does_not_identify_the_peak(self) -> None:
        """Whatever the slip."""
        theta = RAIL[0].theta
        for slip in (0.0, 0.02, 0.3):
            rng = np.random.default_rng(1)
            slips = np.full(1000, slip)
            heights = adhesion(slips, *theta) + 0.01 * rng.standard_normal(1000)
            last = self.feed(self.make(), Samples.curve(slips, heights))[-1]
            if last is not None:
                _require_numbers(last)
                claims = last.identifiable
                require(not claims.both, f"the slip {slip} alone: both counted as identifiable")

    def test_whatever_comes_it_answers_with_numbers(self) -> None:
        """Samples that are no numbers, outside the curve, all alike, or none."""
        odd = np.array([0.0, -0.0, 1.0, -1.0, 0.5, np.nan, np.inf, -np.inf, 1e9, 1e-300])
        for seed in range(20):
            rng, estimator, last = np.random.default_rng(seed), self.make(), None
            for n in rng.integers(0, 300, 4):
                draws = [rng.uniform(-2.0, 2.0, n) for _ in range(2)]
                slip, mu = (np.where(rng.random(n) < 0.3, rng.choice(odd, n), d) for d in draws)
                estimate = estimator.update(Samples.curve(slip, mu), 0)
                require(estimate is not None or last is None, "an estimate was given, then none")
                if estimate is not None:
                    _require_numbers(estimate)
                last = estimate

    def test_no_samples_give_no_other_estimate(self) -> None:
        """None before the first one."""
        estimator = self.make()
        require(estimator.update(NOTHING, 0) is None, "an estimate before the first sample")
        first = self.feed(estimator, draw_samples(RAIL[0].theta))[-1]
        again = estimator.update(NOTHING, 0)
        if first is None or again is None:
            raise AssertionError("no estimate after 1500 samples")
        require(again.theta == first.theta, "no samples: another curve")
        require(again.mu_max_std == first.mu_max_std, "no samples: another standard deviation")

    def test_the_same_samples_give_the_same_estimates(self) -> None:
        """Random numbers come from a seed in the settings; a copy goes on as the original."""
        samples = draw_samples(RAIL[1].theta, noise=0.05)
        half = len(samples) // 2
        first, second = self.make(), self.make()
        self.feed(first, samples.select(slice(0, half)))
        self.feed(second, samples.select(slice(0, half)))
        rest = samples.select(slice(half, None))
        copied = deepcopy(first)
        ends = [self.feed(each, rest)[-1] for each in (first, second, copied)]
        results = [None if end is None else (end.theta, end.covariance.tolist()) for end in ends]
        require(results[0] == results[1], f"two runs end with {results[0]} and {results[1]}")
        require(results[0] == results[2], f"a copy ends with {results[2]}, it with {results[0]}")


def _require_numbers(estimate: Estimate) -> None:
    """Nothing is nan, only standard deviations are infinite, and none is negative."""
    finite = (*estimate.theta, estimate.mu_max, estimate.lambda_m, estimate.noise_std)
    require(np.isfinite(finite).all(), f"not finite: {finite}")
    require(estimate.mu_max >= 0.0, f"mu_max {estimate.mu_max}")
    for name in ("mu_max_std", "lambda_m_std", "noise_std"):
        require(getattr(estimate, name) >= 0.0, f"{name} {getattr(estimate, name)}")
    require(not np.isnan(estimate.covariance).any(), "the covariance is not a number")
