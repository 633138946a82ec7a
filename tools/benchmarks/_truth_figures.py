"""How true the setpoints of a drive are. The rules are here and nowhere else.

Wrong is an estimate that is off by more than 3 of its own standard deviations and by more than
2 % (μ_max) or 5 % (λ_m). Only TRACKING is judged, from 20 s on.
"""

from dataclasses import asdict, dataclass

import numpy as np

FROM_S = 20.0
STDS = 3.0
LEAST_ERROR = {"mu_max": 0.02, "lambda_m": 0.05}
SHARES = np.linspace(0.0, 1.0, 101)
LEAST_REACHED = 0.97
OF_EACH, OF_ALL, OF_ALL_WITH_MODEL = 0.05, 0.02, 0.01


@dataclass(frozen=True)
class Setpoints:
    """Setpoints beside the truth, n of them.

    Attributes:
        t: s since the recording began, (n,).
        tracking: Whether the service said TRACKING, (n,).
        mu_max, mu_max_std, lambda_m, lambda_m_std: As sent; NaN where not available, (n,).
        true_mu_max, true_lambda_m: Peak that was there, (n,).
        interior: Whether the true curve falls beyond its peak; else λ_m is not judged, (n,).
        reached: Adhesion at the slip λ_m that was sent, as a share of what was there, (n,).
    """

    t: np.ndarray
    tracking: np.ndarray
    mu_max: np.ndarray
    mu_max_std: np.ndarray
    lambda_m: np.ndarray
    lambda_m_std: np.ndarray
    true_mu_max: np.ndarray
    true_lambda_m: np.ndarray
    interior: np.ndarray
    reached: np.ndarray


@dataclass(frozen=True)
class Figures:
    """Figures of some drives together.

    Attributes:
        rows: Number of setpoints from 20 s on.
        tracking: Number of those with TRACKING.
        peaks: Number of those for which λ_m is judged.
        wrong_mu_max: Number of wrong μ_max.
        wrong_lambda_m: Number of wrong λ_m.
        square_mu_max: Sum of squares of the relative error of μ_max.
        square_lambda_m: Sum of squares of the relative error of λ_m.
        reached: Quantiles at 0, 1 .. 100 % of the share of the adhesion that was reached.
    """

    rows: int = 0
    tracking: int = 0
    peaks: int = 0
    wrong_mu_max: int = 0
    wrong_lambda_m: int = 0
    square_mu_max: float = 0.0
    square_lambda_m: float = 0.0
    reached: tuple[float, ...] = ()

    def tracking_share(self):
        return self.tracking / self.rows if self.rows else np.nan

    def wrong(self, value):
        """Share of the TRACKING time in which a value is wrong."""
        of = self.tracking if value == "mu_max" else self.peaks
        return getattr(self, f"wrong_{value}") / of if of else np.nan

    def rms(self, value):
        """Relative error of a value, root mean square over the TRACKING time."""
        of = self.tracking if value == "mu_max" else self.peaks
        return float(np.sqrt(getattr(self, f"square_{value}") / of)) if of else np.nan

    def reached_at(self, share):
        """Quantile of the share of the adhesion that was reached."""
        return float(np.interp(share, SHARES, self.reached)) if self.reached else np.nan

    def to_dict(self):
        return asdict(self)


def figures_of(document):
    """Figures from what `to_dict` gave, also by way of JSON."""
    return Figures(**{**document, "reached": tuple(document["reached"])})


def is_wrong(error, std, least):
    """Whether estimates are wrong, from relative errors and relative standard deviations.

    Without a standard deviation an estimate claims nothing, and is not wrong.
    """
    return (np.abs(error) > STDS * np.where(np.isfinite(std), std, np.inf)) & (
        np.abs(error) > least
    )


def judge(setpoints):
    """Figures of one drive."""
    s = setpoints
    late = s.t >= FROM_S
    use = late & s.tracking & np.isfinite(s.mu_max) & np.isfinite(s.lambda_m)
    peaks = use & s.interior
    mu = s.mu_max[use] / s.true_mu_max[use] - 1
    slip = s.lambda_m[peaks] / s.true_lambda_m[peaks] - 1
    mu_std = s.mu_max_std[use] / s.true_mu_max[use]
    slip_std = s.lambda_m_std[peaks] / s.true_lambda_m[peaks]
    reached = np.quantile(s.reached[use], SHARES).round(5).tolist() if use.any() else []
    return Figures(
        rows=int(late.sum()),
        tracking=int(use.sum()),
        peaks=int(peaks.sum()),
        wrong_mu_max=int(is_wrong(mu, mu_std, LEAST_ERROR["mu_max"]).sum()),
        wrong_lambda_m=int(is_wrong(slip, slip_std, LEAST_ERROR["lambda_m"]).sum()),
        square_mu_max=float(mu @ mu),
        square_lambda_m=float(slip @ slip),
        reached=tuple(reached),
    )


def pooled(parts):
    """Figures of several drives as of one."""
    parts = list(parts)
    counts = {
        name: sum(getattr(part, name) for part in parts)
        for name in Figures.__dataclass_fields__
        if name != "reached"
    }
    known = [part for part in parts if part.reached]
    if not known:
        return Figures(**counts)
    # A quantile function is an even sample of its distribution, one point for 1 % of the time.
    values = np.concatenate([part.reached for part in known])
    weights = np.repeat([part.tracking / len(SHARES) for part in known], len(SHARES))
    order = np.argsort(values)
    below = np.cumsum(weights[order]) - 0.5 * weights[order]
    reached = np.interp(SHARES, below / weights.sum(), values[order])
    return Figures(**counts, reached=tuple(float(x) for x in reached))
