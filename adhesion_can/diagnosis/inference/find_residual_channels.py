"""Step 6, find residual channels: measured quantities that a model's residual depends on.

A spline in every channel and the strongest wave along the rail are tested against the residual by
sign flips. They show what no effect of the library explains.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.inference.detect_effects import detect_groups
from adhesion_can.diagnosis.regression.channel_splines import Channel, ChannelKind, build_channels
from adhesion_can.diagnosis.regression.gram_matrices import solve_normal_equations
from adhesion_can.diagnosis.regression.model import EvaluatedModel, Model, compute_curve_jacobian
from adhesion_can.diagnosis.regression.whitened_regression import FittedModel, WhitenedRegression

WAVES_M = np.geomspace(6.0, 300.0, 500)
"""Wavelengths along the rail that are tested, m."""
LEAST_WAVES, LEAST_ROWS = 6, 1000
"""Wavelengths that the travelled distance must hold, and rows, for a wave to be tested."""
CELLS_PER_M = 4
"""Rows within a quarter of a metre see the same phase of every tested wave."""
FLIPS = 999
"""Number of random sign patterns for waves."""
SLIP = "slip"
"""Name of the channel that the curves are functions of."""


@dataclass(frozen=True, eq=False)
class ResidualChannel:
    """Dependence of a model's residual on a channel.

    Attributes:
        channel: Channel on which the residual depends.
        p_value: P-value of the dependence, all channels counted.
        gain: Share by which the RMSE of the adhesion falls with the channel's spline, on the rows
            that are not held out.
        basis: Spline basis of the channel, adhesion; shape (n, columns).
        jacobian: Jacobian of the model's curves, which are refitted along; shape (n, p).
        coefficients: Least-squares coefficients of `jacobian` and `basis`, shape (p + columns,).

    """

    channel: Channel
    p_value: float
    gain: float
    basis: Array
    jacobian: Array
    coefficients: Array

    def explained_square(self, rmse: float) -> float:
        """Mean square of the adhesion that the channel's spline takes off a residual."""
        return rmse**2 * (1.0 - (1.0 - self.gain) ** 2)

    @property
    def prediction_change(self) -> Array:
        """Change of the predicted adhesion with the curves refitted, shape (n,)."""
        return np.asarray(np.column_stack([self.jacobian, self.basis]) @ self.coefficients)

    @property
    def spline_change(self) -> Array:
        """Change of the predicted adhesion by the spline alone, shape (n,)."""
        return np.asarray(self.basis @ self.coefficients[self.jacobian.shape[1] :])

    @property
    def spline_coefficients(self) -> Array:
        """Coefficients of `basis` beside the curves of the model, shape (columns,).

        Curve and spline are both functions of the slip. Fitted together they may be far from what
        is measured, and only their product near it: there the spline has the whole change.
        """
        if self.channel.name != SLIP:
            return self.coefficients[-self.basis.shape[1] :]
        return np.asarray(np.linalg.lstsq(self.basis, self.prediction_change, rcond=None)[0])


def find_residual_channels(
    regression: WhitenedRegression, fitted: FittedModel, alpha: float, rng: np.random.Generator
) -> list[ResidualChannel]:
    """Every channel, and a significant wave, against a model's residual; largest gain first.

    Args:
        regression: Data with weights, filter and blocks.
        fitted: Fitted model whose residual is tested.
        alpha: Significance level of a wave.
        rng: Random generator of the signs.

    """
    data, model = regression.data, fitted.model
    corrected = regression.evaluate_corrected(model)
    channels = build_channels(data, corrected)
    bases = [channel.build_basis(corrected) for channel in channels]
    jacobian = compute_curve_jacobian(data, model.curves, corrected)
    dependences = fit_residual_channels(regression, fitted, channels, bases, jacobian, rng)
    wave = find_wave(regression, model, corrected, rng)
    if wave is not None and wave[2] <= alpha:
        channel, basis, p_value = wave
        (wave_dependence,) = fit_residual_channels(
            regression, fitted, [channel], [basis], jacobian, rng
        )
        dependences.append(replace(wave_dependence, p_value=p_value))
    return sorted(dependences, key=lambda dependence: -dependence.gain)


def fit_residual_channels(
    regression: WhitenedRegression,
    fitted: FittedModel,
    channels: Sequence[Channel],
    bases: Sequence[Array],
    jacobian: Array,
    rng: np.random.Generator,
) -> list[ResidualChannel]:
    """Fit and test each of several channels against a model's residual, largest gain first.

    Args:
        regression: Data with weights, filter and blocks.
        fitted: Fitted model whose residual is tested.
        channels: Channels that vary.
        bases: Spline basis of each channel, adhesion; shape (n, columns) each.
        jacobian: Jacobian of the model's curves, adhesion per unit of a parameter; shape (n, p).
        rng: Random generator of the signs.

    """
    if not channels:
        return []
    test = detect_groups(regression, fitted, bases, rng).test
    model, used = fitted.model, regression.used
    residual = regression.residual(model)
    before = float(np.sqrt(np.mean(residual[used] ** 2)))
    white = regression.whiten(np.column_stack([jacobian, *bases, residual]))
    total = regression.compute_grams(white).total
    dependences, first = [], jacobian.shape[1]
    for place, (channel, basis) in enumerate(zip(channels, bases, strict=True)):
        columns = [*range(jacobian.shape[1]), *range(first, first + basis.shape[1])]
        first += basis.shape[1]
        gram = total[np.ix_(columns, columns)]
        coefficients = solve_normal_equations(gram, total[columns, -1])
        remaining = residual - np.column_stack([jacobian, basis]) @ coefficients
        after = float(np.sqrt(np.mean(remaining[used] ** 2)))
        gain = 1.0 - after / max(before, 1e-300)
        p_value = float(test.p_value[place])
        dependences.append(ResidualChannel(channel, p_value, gain, basis, jacobian, coefficients))
    return sorted(dependences, key=lambda dependence: -dependence.gain)


def find_wave(
    regression: WhitenedRegression,
    model: Model,
    evaluation: EvaluatedModel,
    rng: np.random.Generator,
) -> tuple[Channel, Array, float] | None:
    """Strongest wave of the adhesion along the rail; None where the drive is too short.

    The periodogram of the weighted residual along the track is summed over the blocks. Random signs
    on the blocks give the distribution of its largest value, so all wavelengths are counted.

    Args:
        regression: Data with weights, filter and blocks.
        model: Model whose residual is tested.
        evaluation: The model evaluated at the estimated true slips.
        rng: Random generator of the signs.

    Returns:
        Channel with the wavelength as period, basis (cosine and sine, adhesion; shape (n, 2)), and
        p-value.

    """
    position = regression.data.column("position")
    used = np.flatnonzero(regression.used)
    if any(drive.independent for drive in regression.data.drives):
        return None
    if len(used) < LEAST_ROWS or float(np.ptp(position[used])) < 10 * WAVES_M[0]:
        return None
    lengths = WAVES_M[np.ptp(position[used]) / LEAST_WAVES > WAVES_M]
    amplitudes = _block_amplitudes(regression, model, evaluation, lengths)
    observed = np.abs(amplitudes.sum(axis=0))
    signs = np.where(rng.random((FLIPS, len(amplitudes))) < 0.5, -1.0, 1.0)
    chance = np.abs(signs @ amplitudes)
    scale = np.sqrt(np.sum(np.abs(amplitudes) ** 2, axis=0))
    ratio = observed / np.maximum(scale, 1e-300)
    best = int(np.argmax(ratio))
    largest = (chance / np.maximum(scale, 1e-300)).max(axis=1)
    p_value = (1.0 + np.count_nonzero(largest >= ratio[best])) / (FLIPS + 1.0)
    phase = 2 * np.pi * position / lengths[best]
    basis = np.stack([np.cos(phase), np.sin(phase)], axis=1) * evaluation.predicted[:, None]
    values = position % lengths[best]
    channel = Channel("position", ChannelKind.FACTOR, values, period=lengths[best])
    return channel, basis, float(p_value)


def _block_amplitudes(
    regression: WhitenedRegression, model: Model, evaluation: EvaluatedModel, lengths: Array
) -> NDArray[np.complex128]:
    """Complex amplitude of each wavelength, m, in each block; shape (blocks, wavelengths)."""
    residual = regression.residual(model)
    position = regression.data.column("position")
    weight = regression.scale**2 * evaluation.predicted
    used = np.flatnonzero(regression.used)
    order = used[np.argsort(regression.block[used], kind="stable")]
    starts = np.unique(regression.block[order], return_index=True)[1]
    amplitudes = np.zeros((len(starts), len(lengths)), dtype=np.complex128)
    for number, rows in enumerate(np.split(order, starts[1:])):
        cell = np.floor(position[rows] * CELLS_PER_M).astype(np.int64)
        first = cell.min()
        sums = np.bincount(cell - first, weight[rows] * residual[rows])
        middle = (np.arange(len(sums)) + first + 0.5) / CELLS_PER_M
        full = sums != 0.0
        wave = np.exp(2j * np.pi * middle[full, None] / lengths)
        amplitudes[number] = sums[full] @ wave
    return amplitudes
