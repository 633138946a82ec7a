"""What the steps found, and the verdict that follows from it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.inference.channel_splines import channels_of
from adhesion_can.diagnosis.inference.find_residual_channels import LINE_SIZE, Left, Line
from adhesion_can.diagnosis.inference.select_effects import SECOND_WORTH, Naming
from adhesion_can.diagnosis.regression.gram_matrices import solve
from adhesion_can.diagnosis.regression.model import Candidate, curve_slopes, evaluate
from adhesion_can.diagnosis.regression.prepare_regression import Prepared

NOISELESS = 1e-6
"""RMSE of the adhesion below which there is nothing to explain: no sensor is as good."""
HALF = 0.5
"""Share of what is explained in all that named effects must explain to be the answer."""


@dataclass(frozen=True, eq=False)
class Findings:
    """What the steps found.

    Attributes:
        prepared: see there.
        naming: see there.
        absorbed: share of each candidate's signature that the curve imitates.
        cosines: between what is left of the signatures.
        left_plain: what channels explain of the plain model's residual, most first.
        left: of the best model's.
        line: a line in the wheel speeds.
        pinned: recording, axle, effort and share of readings at a limit that the model exceeds.
        times: of the changes of the rail, by recording, s.
        length_s: of a block.
        alpha: see the settings.

    """

    prepared: Prepared
    naming: Naming
    absorbed: Array
    cosines: Array
    left_plain: tuple[Left, ...]
    left: tuple[Left, ...]
    line: Line | None
    pinned: tuple[tuple[str, int, float, float], ...]
    times: list[list[float]]
    length_s: float
    alpha: float

    def p_value(self, candidate: Candidate) -> float:
        """Of a named effect."""
        return self.naming.p_value(candidate, self.prepared.candidates)

    @cached_property
    def named(self) -> tuple[Candidate, ...]:
        """Effects that are sure, and explain most of what is explained."""
        if self.swings or self.pinned or self.naming.base.rmse < NOISELESS:
            return ()
        best, base = self.naming.best, self.naming.base
        if not best.candidates or any(self.p_value(c) > self.alpha for c in best.candidates):
            return ()
        explained = 1.0 - (best.rmse / base.rmse) ** 2
        strongest = next((one for one in self.left if one.p_value <= self.alpha / 2), None)
        rest = 0.0
        if strongest is not None:
            left = best.rmse * (1.0 - strongest.gain)
            rest = (best.rmse**2 - left**2) / base.rmse**2
        return best.candidates if explained >= HALF * (explained + rest) else ()

    @cached_property
    def swings(self) -> bool:
        """Whether the drive train swings so much that the force balance feels it."""
        return self.line is not None and self.line.adhesion > LINE_SIZE * self.noise_floor

    @cached_property
    def unknown(self) -> Left | None:
        """The channel that an unexplained residual depends on; None: none."""
        if self.naming.base.rmse < NOISELESS:
            return None
        for one in self.left_plain:
            in_question = not self.pinned or one.channel.name == "tractive_effort"
            if in_question and one.p_value <= self.alpha / 2 and one.gain >= SECOND_WORTH:
                return one
        return None

    @cached_property
    def noise_floor(self) -> float:
        """RMSE of the fullest model on the rows that decided, its parameters paid for."""
        stage, best = self.prepared.stage, self.naming.best.fit.model
        likely = evaluate(stage.study, best.theta, best.actives, stage.shift)
        columns = [channel.basis(likely) for channel in channels_of(stage.study, likely)]
        columns += [one.columns for one in self.left if one.channel.period]
        raw = np.column_stack([curve_slopes(stage.study, best.theta, likely), *columns])[stage.used]
        left = evaluate(stage.study, best.theta, best.actives).residual[stage.used]
        rest = left - raw @ solve(raw.T @ raw, raw.T @ left)
        free = max(len(rest) - raw.shape[1], 1)
        return float(np.sqrt(np.sum(rest**2) / free))
