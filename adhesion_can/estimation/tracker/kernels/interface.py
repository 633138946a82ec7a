"""What the kernels compute: the arithmetic of an update, on plain arrays.

There are two implementations of the same bits, `plain` with NumPy and `compiled` with numba. They
hold additions, multiplications, divisions, square roots and comparisons alone, which IEEE 754
rounds in one way, and add in an order that is written down: one sample after the other, one node
after the other, curves in lanes (`LANES`). So neither depends on the processor's vector unit or on
a library for matrices. Exponentials and logarithms are taken between two kernels, by NumPy in both.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array

LANES = 16
"""Number of partial sums over curves: curve k goes to sum k modulo `LANES`, and they are added up
one after the other."""
NONE: Array = np.empty(0)
"""Placeholder of an argument that is not given."""
ADHESION_MAX = 5.0
"""Largest adhesion of a usable sample; larger ones are faults."""
COASTING_AGE_S = 0.5
"""Age of the means by which an axle is coasting beyond which they say nothing, s."""


class Kernels(Protocol):
    """An implementation of the kernels."""

    # ------------------------------------------------------------------------------- samples

    @staticmethod
    def find_valid(
        slip: Array,
        adhesion: Array,
        slip_var: Array,
        common_var: Array,
        adhesion_var: Array,
        transient_var: Array,
        load_std: Array,
        slip_max: float,
    ) -> NDArray[np.bool_]:
        """Whether slip and adhesion are within their limits and all else is finite, shape (n,)."""
        ...

    @staticmethod
    def pass_time(
        latest_us: NDArray[np.int64], axle: NDArray[np.int64], t_us: NDArray[np.int64]
    ) -> Array:
        """Time since the latest sample of each axle, s, shape (axles,).

        Args:
            latest_us: Stamp of each axle's latest sample, µs, shape (axles,); brought to those of
                the samples.
            axle: Number of each sample's axle, shape (n,).
            t_us: Stamps, µs, shape (n,).

        """
        ...

    @staticmethod
    def judge_coasting(
        slip: Array,
        adhesion: Array,
        slip_var: Array,
        common_var: Array,
        adhesion_var: Array,
        axle: NDArray[np.int64],
        age_s: Array,
        less: Array,
        means: Array,
        far: float,
    ) -> NDArray[np.bool_]:
        """Whether slip or adhesion of each sample's axle exceeds its error by far, shape (n,).

        Args:
            slip: Slip ratios, shape (n,).
            adhesion: Adhesion, shape (n,).
            slip_var: Variance of the slip by the wheel speed, shape (n,).
            common_var: Variance of the slip by the vehicle speed, shape (n,).
            adhesion_var: Variance of the adhesion, shape (n,).
            axle: Number of each sample's axle, shape (n,).
            age_s: Age of the means, s, shape (axles,).
            less: What is left of the means at that age, less 1, shape (axles,).
            means: Means of slip and adhesion before the samples, shape (2, axles); brought to
                those with the samples.
            far: Square of a value over its variance from which it exceeds its error by far.

        """
        ...

    @staticmethod
    def judge_residuals(
        slip: Array,
        adhesion: Array,
        private_var: Array,
        common_var: Array,
        transient_var: Array,
        theta: tuple[float, float, float],
        less: Array,
        decay: Array,
        noise_var: float,
    ) -> tuple[Array, float, float, float]:
        """Samples beside a curve.

        Args:
            slip: Slip ratio λ on the branch, shape (n,).
            adhesion: Adhesion on the branch, shape (n,).
            private_var: Variance of λ by the wheel speed, shape (n,).
            common_var: Variance of λ by the vehicle speed, shape (n,).
            transient_var: Variance of the adhesion beyond the noise, shape (n,).
            theta: Parameters (c1, c2, c3).
            less: e^(−c2 λ) − 1, shape (n,).
            decay: e^(−c2 λ), shape (n,).
            noise_var: Variance σ² of the adhesion noise.

        Returns:
            Rows of residual, slope of the curve, variance of the residual and residual in standard
            deviations, shape (4, n); the largest of the latter, and of both variances of λ.

        """
        ...

    @staticmethod
    def add_to_axles(
        normal: Array,
        axle: NDArray[np.int64],
        level: Array,
        shifted: Array,
        residual: Array,
        weight: Array,
    ) -> None:
        """Add samples to the normal equations of their axles, shape (axles, 5), in place."""
        ...

    # ---------------------------------------------------------------------- sums of an update

    @staticmethod
    def node_exponents(slip: Array, private_var: Array, exponents: Array) -> float:
        """Exponents of e^(−c2 λ) at the nodes, and of its expectation by the private errors.

        Args:
            slip: Slip ratio λ on the branch, shape (n,).
            private_var: Variance of λ by the wheel speed, shape (n,).
            exponents: Exponents of the samples, then those of the expectation; shape
                (n + 1, NODES), written to.

        Returns:
            Mean of the private variance.

        """
        ...

    @staticmethod
    def increment(
        slip: Array,
        adhesion: Array,
        private_var: Array,
        common_var: Array,
        transient_var: Array,
        group: NDArray[np.int64],
        sign: Array,
        share: Array,
        slope: Array,
        own_slope: Array,
        bend: Array,
        reached: Array,
        decay: Array,
        private: float,
        noise_var: float,
        slip_max: float,
    ) -> Array:
        """Sums of samples, both kinds, shape (2, LENGTH), as `curve_sums.increment` defines them.

        Args:
            slip: Slip ratio λ on the branch, shape (n,).
            adhesion: Adhesion on the branch, shape (n,).
            private_var: Variance of λ by the wheel speed, shape (n,).
            common_var: Variance of λ by the vehicle speed, shape (n,).
            transient_var: Variance of the adhesion beyond the noise, shape (n,).
            group: Number of the group between two vehicle speeds, shape (n,).
            sign: Sign of the branch, shape (n,).
            share: Place between the two vehicle speeds, shape (n,); `NONE` for the same place.
            slope: Slope of the current curve, shape (n,).
            own_slope: Slope for the weight of the private error, shape (n,).
            bend: Curvature of the current curve, shape (n,); `NONE`: not corrected.
            reached: Slip of the histogram, shape (n,).
            decay: Exponentials of `node_exponents`, shape (n + 1, NODES).
            private: Mean of the private variance.
            noise_var: Variance σ² of the adhesion noise.
            slip_max: Upper end of the histogram of slip.

        """
        ...

    # --------------------------------------------------------------------- curves and weights

    @staticmethod
    def cost_curves(
        nodal: Array, factors: Array, added: Array, scale: float, costs: Array, exponents: Array
    ) -> Array:
        """Sums of squares of new samples for each curve, from their parts A, B and C.

        Args:
            nodal: A, B and C of both kinds of sums at the c2 of each curve, shape (6, n).
            factors: Coefficients of the curves, shape (5, n).
            added: Sums of the samples, both kinds, shape (2, LENGTH).
            scale: Log likelihood per sum of squares.
            costs: J of the curves of each memory, shape (2, memories, size), written to.
            exponents: Log likelihood beside the largest of the memory, same shape, written to.

        Returns:
            Least J of each memory, shape (2, memories).

        """
        ...

    @staticmethod
    def weight_exponents(base: Array, logs: Array, halves: Array, exponents: Array) -> None:
        """Logarithms of the weights of curves beside the largest of their memory.

        Args:
            base: Log of prior density over density of the draw, shape (memories, size).
            logs: Logarithm of ν σ0² + J, shape (memories, size).
            halves: Half of the degrees of freedom, shape (memories,).
            exponents: Logarithms of the weights, shape (memories, size), written to.

        """
        ...

    @staticmethod
    def normalise(weights: Array, costs: Array, leader: int) -> Array:
        """Make weights add up to 1, in place.

        Args:
            weights: Weights of the curves of each memory, shape (memories, size).
            costs: J of the curves, shape (memories, size).
            leader: Index of the most probable memory.

        Returns:
            Effective number of curves of each memory, then the leader's mean J (those below 0
            count as 0), shape (memories + 1,).

        """
        ...

    @staticmethod
    def summarise(
        weights: Array,
        order: NDArray[np.int64],
        peaks: Array,
        limited: Array,
        columns: Array,
    ) -> Array:
        """Summary of weighted curves, shape (SUMMARY_LENGTH,); `layout` has its indices.

        Args:
            weights: Weights, which add up to 1, shape (n,).
            order: Indices that sort the curves by each of (μ_m, λ_m, s), shape (3, n).
            peaks: (μ_m, λ_m, s), each in its order, shape (3, n).
            limited: μ_max and λ_m within the range of slip, each in its order, shape (2, n).
            columns: c1, c2, c3, μ_max and λ_m, shape (5, n).

        """
        ...

    @staticmethod
    def count_reached(histogram: Array, share: float) -> int:
        """Number of the first bins that a share of the samples lies in or beyond."""
        ...

    # ------------------------------------------------------------------------- surface changes

    @staticmethod
    def score_terms(
        sums: Array, old_cost: Array, noise_var: float, freedom: float, logs: Array, gain: Array
    ) -> None:
        """Terms of the Bayes factor of each hypothesis at each node.

        Args:
            sums: Sums of each hypothesis, both kinds, shape (2, k, LENGTH).
            old_cost: J of the curve so far in them, shape (2, k).
            noise_var: Variance σ² of the adhesion noise.
            freedom: Degrees of freedom of that variance; below 0: it is exact.
            logs: Determinants, then the ratio of both noise estimates where there is one; shape
                (2, 2, k, NODES), written to.
            gain: Log likelihood ratio at that noise, shape (2, k, NODES), written to.

        """
        ...

    @staticmethod
    def score(logs: Array, gain: Array, log_prior: Array, halves: Array, exponents: Array) -> Array:
        """Log Bayes factor of each hypothesis at each node, beside the largest of them.

        Args:
            logs: Logarithms of what `score_terms` wrote, shape (2, 2, k, NODES).
            gain: Log likelihood ratio, shape (2, k, NODES).
            log_prior: Log prior of the nodes, shape (NODES,).
            halves: Half of the degrees of freedom of each hypothesis, shape (k,); `NONE` where the
                noise is exact.
            exponents: Log Bayes factors beside the largest, shape (k, NODES), written to.

        Returns:
            Largest log Bayes factor of each hypothesis, shape (k,).

        """
        ...
