"""The least error that μ_max can have while its peak has not been reached.

Surfaces are drawn from the tracker's prior: a wide component and a narrow one around each known
surface, Student's t in φ = (ln c1, ln c2, ln s), s = c2 λ_m. The information that a t distribution
of ν degrees of freedom in d dimensions has about its place is (ν + d) / (ν + d + 2) Σ⁻¹. With it

- van Trees: for each component E[g]ᵀ (E[I] + J)⁻¹ E[g], no estimator is better on average;
- local: E[gᵀ (I + J)⁻¹ g], larger or equal; nearly a bound where the prior tells little,

with I the information of the samples at φ, J that of the component and g the slope of ln μ_max.
"""

import numpy as np

from adhesion_can.estimation.tracker.prior import FREEDOM, from_shape_coordinates
from adhesion_can.estimation.tracker.settings import C1_MAX, C2_RANGE
from adhesion_can.physics.burckhardt import adhesion, peak

POINTS = 200
"""Slips over which the information of evenly spread samples is averaged."""
STEP = 1e-4
LARGEST_SLIP = 0.4
"""Largest λ_m of a surface: the range of slips ends at 0.5."""
DIMENSIONS = 3


def components(settings):
    """Weight, centre and scale of each component, the wide one first."""
    c1, c2, s = settings.wide_theta
    known = [(x.c1, x.c2, np.log(x.c1 * x.c2 / x.c3)) for x in settings.surfaces()]
    centres = np.log([(c1, c2, s), *known])
    share = (1.0 - settings.wide_weight) / max(len(known), 1)
    weights = [settings.wide_weight if known else 1.0] + [share] * len(known)
    scales = [settings.wide_std] + [settings.narrow_std] * len(known)
    return list(zip(weights, centres, np.array(scales), strict=True))


def draw_surface(rng, centre, scale):
    """φ of a surface of one component that has its peak within the range."""
    low, high = np.log(C2_RANGE)
    while True:
        chi = np.sqrt(rng.chisquare(FREEDOM) / FREEDOM)
        phi = centre + scale * rng.standard_normal(DIMENSIONS) / chi
        if not (low <= phi[1] <= high and phi[0] < np.log(C1_MAX)):
            continue
        # s = c2 λ_m: below 0.5 there is no curve that is worth the name.
        if 0.5 < np.exp(phi[2]) < LARGEST_SLIP * np.exp(phi[1]):
            return phi


def theta_of(phi):
    """(c1, c2, c3) of φ."""
    return from_shape_coordinates(np.atleast_2d(phi))[0]


def log_peak(phi):
    return float(np.log(peak(*theta_of(phi), slip_max=1.0).mu_max))


def slip_at_use(theta, used):
    """Slip before the peak at which a share of μ_max is used."""
    top = peak(*theta, slip_max=1.0)
    low, high = 0.0, float(top.lambda_m)
    for _ in range(60):
        middle = 0.5 * (low + high)
        if adhesion(np.array([middle]), *theta)[0] < used * float(top.mu_max):
            low = middle
        else:
            high = middle
    return high


def information(phi, used, samples, noise_std):
    """Information (3, 3) of evenly spread samples up to a share of μ_max, and slope of ln μ_max."""
    slip = (np.arange(POINTS) + 0.5) / POINTS * slip_at_use(theta_of(phi), used)
    moves = STEP * np.eye(DIMENSIONS)
    gradient = np.array(
        [
            (adhesion(slip, *theta_of(phi + m)) - adhesion(slip, *theta_of(phi - m))) / (2 * STEP)
            for m in moves
        ]
    )
    slope = np.array([(log_peak(phi + m) - log_peak(phi - m)) / (2 * STEP) for m in moves])
    return samples / POINTS * (gradient @ gradient.T) / noise_std**2, slope


def prior_information(scale):
    """Information of a component about φ, (3, 3)."""
    share = (FREEDOM + DIMENSIONS) / (FREEDOM + DIMENSIONS + 2)
    return share * np.diag(scale**-2.0)


def local_variance(phi, scale, used, samples, noise_std):
    """Local bound of the variance of ln μ_max at one surface of a component."""
    data, slope = information(phi, used, samples, noise_std)
    return float(slope @ np.linalg.solve(data + prior_information(scale), slope))


def van_trees_variance(phis, scale, used, samples, noise_std):
    """Bound of the mean square error of ln μ_max over surfaces of one component."""
    found = [information(phi, used, samples, noise_std) for phi in phis]
    mean = np.mean([slope for _, slope in found], axis=0)
    data = np.mean([each for each, _ in found], axis=0)
    return float(mean @ np.linalg.solve(data + prior_information(scale), mean))
