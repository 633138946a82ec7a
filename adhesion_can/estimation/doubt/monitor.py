"""The running comparison of a drive with the model: doubt, and what the peak may be off by.

Block by block of the drive:

    samples -> RowBuilder -> BlockSums -> BlockSeries -> pooled curve -> score tests -> joint peak
"""

from collections import deque
from math import ceil, hypot, inf, sqrt

import numpy as np

from adhesion_can.estimation.batch_means import FEWEST
from adhesion_can.estimation.curves.binned_samples import BinnedSamples
from adhesion_can.estimation.curves.online_comparison import FamilyComparison, FamilyTracker
from adhesion_can.estimation.doubt.assessment import UNKNOWN, Assessment
from adhesion_can.estimation.doubt.blocks import (
    CURVE,
    TANGENTS,
    BlockSeries,
    BlockSums,
    ReducedBlocks,
    fit_blocks,
)
from adhesion_can.estimation.doubt.directions import (
    BIAS_UNIT,
    EFFORT_BIAS,
    SPEED_SCALE,
    TIME,
    WORK_S,
    build_directions,
)
from adhesion_can.estimation.doubt.joint_peak import (
    JointFit,
    compute_joint_peak,
    fit_jointly,
)
from adhesion_can.estimation.doubt.lasting_errors import (
    LastingErrors,
    estimate_lasting_errors,
    slip_inflation,
)
from adhesion_can.estimation.doubt.level_scatter import FLAT_SLOPE, LevelScatter
from adhesion_can.estimation.doubt.peak_scatter import slip_scatter
from adhesion_can.estimation.doubt.pooled_curve import PooledCurve
from adhesion_can.estimation.doubt.rows import RowBuilder
from adhesion_can.estimation.doubt.score_tests import FEWEST_BLOCKS, Selection, select_directions
from adhesion_can.estimation.doubt.settings import DoubtSettings, InstrumentUncertainty
from adhesion_can.estimation.doubt.slip_basis import SIZE
from adhesion_can.estimation.doubt.speed_wander import SpeedWander
from adhesion_can.estimation.doubt.surface_changes import find_confirmed_change
from adhesion_can.estimation.tracker.points import is_valid
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.estimate import Estimate, PeakEstimate, has_peak
from adhesion_can.physics.samples import Samples
from adhesion_can.values import Stateful

FEWEST_SAMPLES = 20
"""Number of samples below which a block is left out."""
REACH = 0.97
"""Quantile of the slips of a block that counts as reached."""
UNSEEN_S = 3.0
"""Age of blocks that may hold a change of the surface that is not detected yet, s."""
MIXED = 2
"""Number of blocks before a possible change that may hold samples of both surfaces."""
RECENT_S = 0.5
"""Duration of the samples that are compared with the leading family, s."""
HISTORY = frozenset({TIME, *WORK_S})
"""Directions that stand for what happened before."""
RECENT = 40
"""Number of such comparisons that are kept."""
KEPT_REACH = 0.995
"""Share of the reached slip that is kept from block to block."""


class DoubtMonitor(Stateful):
    """Compares the samples of a drive with the model, by blocks.

    Args:
        axles: Number of axles of the vehicle.
        settings: Significance of the tests.
        instruments: Errors of the instruments before the data show them.
        slip_max: Largest slip ratio of a usable sample.

    """

    def __init__(
        self,
        axles: int,
        settings: DoubtSettings,
        instruments: InstrumentUncertainty,
        slip_max: float,
    ) -> None:
        self._settings, self._slip_max = settings, slip_max
        self._directions = build_directions(axles)
        names = [direction.name for direction in self._directions]
        stds = {
            SPEED_SCALE: instruments.speed_error_std,
            EFFORT_BIAS: instruments.used_bias_std / BIAS_UNIT,
        }
        # What may be wrong before the data show it, by coefficient.
        self._instruments = {
            CURVE + names.index(name): std for name, std in stds.items() if std > 0.0
        }
        self._scale = CURVE + names.index(SPEED_SCALE)
        self._wander = SpeedWander(SIZE + names.index(SPEED_SCALE), instruments.speed_wander_std)
        self._prior_std = dict(self._instruments)
        if settings.shape_std > 0.0:
            self._prior_std |= dict.fromkeys(range(TANGENTS, CURVE), settings.shape_std)
        self._rows = RowBuilder(self._directions, axles)
        self._families = FamilyTracker()
        self._recent: list[Samples] = []
        self._series = BlockSeries(len(names), [names.index(TIME)])
        self._theta: CurveParameters | None = None
        self._waiting: list[Samples] = []
        self._since_us: int | None = None
        self.reached = 0.0
        """Slip ratio that the wheels have reached lately."""
        self.assessment = UNKNOWN
        """Latest assessment."""
        self._level_squares: deque[float] = deque(maxlen=RECENT)
        self._scatter = LevelScatter(slip_max)
        self._waits = False
        """Whether the latest block was not assessed."""
        self.surface_holds = True
        """Whether the latest samples lie on the curve of the leading family."""

    @property
    def level_std(self) -> float:
        """Standard deviation of the rail's level lately, about the leading family's curve.

        As a share of the adhesion; it is that of the means over `RECENT_S`.
        """
        squares = self._level_squares
        return sqrt(max(sum(squares) / len(squares), 0.0)) if squares else 0.0

    @property
    def inflation(self) -> float:
        """Inflation of the variance by errors that last, for a fit that takes them for noise."""
        return max(self.assessment.lasting.beyond_chance, self._wander.inflation)

    def slip_error(self, lambda_m: float) -> float:
        """Standard deviation of an estimated λ_m by errors that last, as a share of it.

        The tracker forgets fast where samples contradict each other, as on a rail that dries. An
        error of the speed that lasts for seconds makes it do so as well, and λ_m then follows that
        error: the distance to the curve of all samples is a part of its standard deviation. Where
        the surface may have changed, that curve is of both surfaces.
        """
        assessment = self.assessment
        if assessment.plain is None:
            return 0.0
        distance = 0.0 if self._series.candidates else assessment.plain.lambda_m / lambda_m - 1.0
        return hypot(distance, assessment.lambda_m_scatter)

    def level_error(self, mu_max: float) -> float:
        """Standard deviation of an estimated μ_max by a speed that wanders, as a share of it.

        The tracker takes such errors for noise; the curve of all samples does not, and the distance
        to it shows what they did.
        """
        plain = self.assessment.plain
        if plain is None or not self._wander.acts or self._series.candidates:
            return 0.0
        return hypot(plain.mu_max / mu_max - 1.0, plain.mu_max_std / mu_max)

    @property
    def level_scatter(self) -> float:
        """Standard deviation by which estimates missed the level of the next half second lately.

        As a share of the adhesion; 0 where chance explains it.
        """
        return self._scatter.std

    def add(self, samples: Samples, estimate: Estimate) -> bool:
        """Add samples; whether there is a new assessment.

        Args:
            samples: Samples of an update, at least one.
            estimate: Estimate after them.

        """
        if self._since_us != estimate.surface_since_us:
            if self._since_us is not None:
                self._end_block(estimate)
                self._series.add_candidate()
            self._since_us = estimate.surface_since_us
        self._waiting.append(samples)
        self._scatter.add(samples, estimate)
        self._look_back(samples, estimate)
        begun_us, now_us = int(self._waiting[0].t_us[0]), int(samples.t_us[-1])
        if now_us - begun_us < self._series.block_s * 1e6:
            return False
        present = self._end_block(estimate)
        if present is None or self._theta is None:
            return False
        self._theta = self._confirm_changes(self._theta)
        # The block after a change that may be one is of an unknown surface: what was known before
        # holds for as long, but never for two blocks, since errors look like changes as well.
        self._waits = not self._waits and self._series.awaits_change
        if self._waits:
            return False
        self._assess(present, PooledCurve(self._theta))
        return True

    def _end_block(self, estimate: Estimate) -> dict[str, float] | None:
        """Make a block of the waiting samples; present conditions, None where there is none."""
        if not self._waiting:
            return None
        samples = Samples.concatenate(self._waiting)
        self._waiting = []
        samples = samples.select(is_valid(samples, self._slip_max))
        if len(samples) < FEWEST_SAMPLES:
            return None
        if self._theta is None:
            c1, c2, c3 = estimate.theta
            if estimate.mu_max_std == inf or not 0.0 < c3 < c1 * c2:
                return None
            self._theta = estimate.theta
        rows = self._rows.build(samples, self._theta, estimate.noise_std)
        binned = BinnedSamples.from_samples(samples, estimate.noise_std)
        error = self._wander.add_block(rows, self._series.block_s)
        self._series.append(BlockSums.from_rows(rows, binned, error))
        self._theta = fit_blocks(self._series.blocks, self._theta).theta
        reached = float(np.quantile(np.abs(samples.slip), REACH))
        self.reached = max(reached, KEPT_REACH * self.reached)
        return dict(rows.present)

    def _confirm_changes(self, theta: CurveParameters) -> CurveParameters:
        """End the surface before a confirmed change; parameters of the current surface's curve."""
        series = self._series
        place = find_confirmed_change(series, PooledCurve(theta), self._directions)
        if place is None:
            return theta
        series.end_surface(place, fit_blocks(series.blocks[:place], theta))
        self._rows.begin_surface()
        self._families.restart()
        self._level_squares.clear()
        return fit_blocks(series.blocks, theta).theta

    def _assess(self, present: dict[str, float], curve: PooledCurve) -> None:
        """Test the directions, and compute what they make of the peak."""
        series = self._series
        if len(series) < FEWEST_BLOCKS:
            return
        reduced = series.reduced(curve)
        lasting = self._lasting_errors(reduced, curve)
        selection = select_directions(reduced, self._directions, self._settings)
        plain = fit_jointly(
            reduced,
            range(TANGENTS),
            self._directions,
            inflation=lasting.inflation,
            prior_std={},
        )
        full = self._fit_all(reduced, selection, lasting.inflation)
        # What the directions explain no longer lasts.
        spread = full.spread(reduced.scores.shape[1])
        left = estimate_lasting_errors(reduced, reduced.current, spread) or lasting
        full = self._fit_all(reduced, selection, left.inflation)
        by_speed = slip_inflation(reduced, self._scale)
        reached = max(self.reached, curve.lambda_m)

        def peak(fit: JointFit) -> PeakEstimate:
            return compute_joint_peak(fit, curve, self._directions, present, reached)

        full_peak = peak(full)
        if by_speed > left.inflation:
            # The scale of the speed does not become known by samples that share its lasting error.
            slow = peak(self._fit_all(reduced, selection, by_speed))
            full_peak = full_peak._replace(lambda_m_std=slow.lambda_m_std)
        plain_peak, families = peak(plain), self._compare_families(selection, lasting, curve)
        instrument_std = (0.0, 0.0)
        if families is not None:
            known = self._fit_instruments(reduced, lasting.inflation)
            known_peak = peak(known)
            instrument_std = (
                _shares_of_change(plain_peak, known_peak) if has_peak(plain_peak) else (inf, inf)
            )
        self.assessment = Assessment(
            selection.doubt,
            selection.names,
            lasting,
            left,
            plain_peak,
            full_peak,
            families,
            instrument_std,
            slip_scatter(reduced, curve),
        )

    def _compare_families(
        self, selection: Selection, lasting: LastingErrors, curve: PooledCurve
    ) -> FamilyComparison | None:
        """Families on all samples of the surface, where Burckhardt's is in doubt.

        None where the adhesion depends on what happened before: the rail's mean is not its present
        or its next adhesion.
        """
        doubtful = selection.doubt is not Doubt.NONE or lasting.beyond_chance > 1.0
        if not doubtful or not HISTORY.isdisjoint(selection.names):
            return None
        blocks = [block.binned for block in self._series.blocks]
        return self._families.compare(blocks, curve.theta)

    def _look_back(self, samples: Samples, estimate: Estimate) -> None:
        """Compare the latest samples with the leading family: the surface may be another one."""
        comparison = self.assessment.families
        if comparison is None:
            self._recent = []
            return
        self._recent.append(samples)
        begun_us, now_us = int(self._recent[0].t_us[0]), int(samples.t_us[-1])
        if now_us - begun_us < RECENT_S * 1e6:
            return
        recent = Samples.concatenate(self._recent)
        self._recent = []
        recent = recent.select(is_valid(recent, self._slip_max))
        if not len(recent):
            return
        binned = BinnedSamples.from_samples(recent, estimate.noise_std)
        error = comparison.level_error(binned, estimate.theta)
        if error is not None:
            self.surface_holds = error.holds
        level = comparison.level_error(binned, estimate.theta, FLAT_SLOPE)
        if level is not None:
            self._level_squares.append(level.share**2 - level.noise**2)

    def _lasting_errors(self, reduced: ReducedBlocks, curve: PooledCurve) -> LastingErrors:
        """Lasting errors about the curve, of the time before a change that may be one."""
        series, before = self._series, self.assessment.lasting
        if not series.candidates:
            known = reduced.current - ceil(UNSEEN_S / series.block_s)
            return estimate_lasting_errors(reduced, known) or before
        known = series.candidates[0] - MIXED
        if known < FEWEST:
            return before
        reduced = series.reduced(fit_blocks(series.blocks[:known], curve.theta))
        return estimate_lasting_errors(reduced, known) or before

    def _fit_instruments(self, reduced: ReducedBlocks, inflation: float) -> JointFit:
        """Fit of the curve and of what the instruments may be wrong by, nothing else."""
        chosen = (*range(TANGENTS), *self._instruments)
        prior_std = self._instruments
        return fit_jointly(
            reduced, chosen, self._directions, inflation=inflation, prior_std=prior_std
        )

    def _fit_all(self, reduced: ReducedBlocks, selection: Selection, inflation: float) -> JointFit:
        """Fit of the selected coefficients, and of what may be wrong before the data show it."""
        chosen = selection.coefficients
        further = {k: std for k, std in self._prior_std.items() if k not in chosen}
        return fit_jointly(
            reduced,
            (*chosen, *further),
            self._directions,
            inflation=inflation,
            prior_std=further,
        )


def further_std(assessment: Assessment, estimate: Estimate) -> tuple[float, float]:
    """Standard deviations of μ_max and λ_m by what the model leaves out, as shares of them.

    With a doubt they contain the distance to the peak of the full model. Without one they contain
    what the instruments may be wrong by, beyond what the plain curve knows.

    Args:
        assessment: Fits with and without what the model leaves out.
        estimate: Estimate with a peak.

    """
    plain, full = assessment.plain, assessment.full
    if plain is None or full is None:
        return 0.0, 0.0
    if not has_peak(plain):
        return inf, inf
    if assessment.doubt is not Doubt.NONE:
        return (
            sqrt((full.mu_max - estimate.mu_max) ** 2 + full.mu_max_std**2) / estimate.mu_max,
            sqrt((full.lambda_m - estimate.lambda_m) ** 2 + full.lambda_m_std**2)
            / estimate.lambda_m,
        )
    return _shares_of_change(plain, full)


def _shares_of_change(plain: PeakEstimate, other: PeakEstimate) -> tuple[float, float]:
    """How far the peak of another fit is, and what it is less certain of, as shares of it."""
    far_mu = (other.mu_max - plain.mu_max) / plain.mu_max
    far_lambda = (other.lambda_m - plain.lambda_m) / plain.lambda_m
    mu_share = sqrt(max(other.mu_max_std**2 - plain.mu_max_std**2, 0.0)) / plain.mu_max
    lambda_share = sqrt(max(other.lambda_m_std**2 - plain.lambda_m_std**2, 0.0)) / plain.lambda_m
    return hypot(far_mu, mu_share), hypot(far_lambda, lambda_share)
