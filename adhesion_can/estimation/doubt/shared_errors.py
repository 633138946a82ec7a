"""Errors that all axles share, estimated from a whole drive: the speed's scale, the efforts' bias.

Traction alone shows neither: a curve without them fits as well. Coasting and braking do, since a
curve is the same on both sides. Curve, form and both errors are estimated together, by the blocks
and corrected scores of `DoubtMonitor`.
"""

from collections.abc import Sequence
from math import hypot, sqrt
from typing import NamedTuple

from adhesion_can.estimation.doubt.blocks import CURVE
from adhesion_can.estimation.doubt.directions import (
    BIAS_UNIT,
    EFFORT_BIAS,
    SPEED_SCALE,
    TRACTION,
    build_directions,
)
from adhesion_can.estimation.doubt.doubt_share import pool_blocks
from adhesion_can.estimation.doubt.joint_peak import fit_jointly
from adhesion_can.estimation.doubt.lasting_errors import NONE, estimate_lasting_errors
from adhesion_can.estimation.doubt.score_tests import FEWEST_BLOCKS, select_directions
from adhesion_can.estimation.doubt.settings import DoubtSettings
from adhesion_can.estimation.noise.settings import NoiseSettings
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.samples import Samples

LOOK_ALIKE = frozenset({SPEED_SCALE, EFFORT_BIAS, TRACTION})
"""Directions of the residual that these errors lie in."""
SPEED_PRIOR, BIAS_PRIOR = 0.02, 20.0
"""Plausible sizes of both before the data show them: several times those of an instrument."""


class SharedError(NamedTuple):
    """An error that all axles share.

    Attributes:
        value: Error; above 0 where the instrument reads high.
        std: Standard deviation of it.

    """

    value: float
    std: float

    @property
    def covering(self) -> float:
        """Standard deviation of an instrument that covers what was found."""
        return hypot(self.value, self.std)


class SharedErrors(NamedTuple):
    """Errors that all axles share.

    Attributes:
        speed: Relative error of the vehicle speed, 1.
        effort: Bias of the efforts, N.

    """

    speed: SharedError
    effort: SharedError


def estimate_shared_errors(
    samples: Samples,
    start: CurveParameters,
    axles: int,
    slip_max: float,
    *,
    changes_us: Sequence[int] = (),
    noise: NoiseSettings | None = None,
) -> SharedErrors | None:
    """Errors of speed and efforts that all axles share.

    None where there are too few samples, or where the residual depends on more than these errors:
    they would then take the place of what is not modelled.

    Args:
        samples: Samples of a drive in the order of their stamps.
        start: Parameters (c1, c2, c3) of a curve of the first surface.
        axles: Number of axles of the vehicle.
        slip_max: Largest slip ratio of a usable sample.
        changes_us: Stamps from which on the surface is another one, µs, ascending.
        noise: Settings of the noise of the samples; None: the defaults.

    """
    directions = build_directions(axles)
    names = [direction.name for direction in directions]
    latest = None
    for latest in pool_blocks(  # noqa: B007  the last of them is of the whole drive
        samples, start, axles, slip_max, changes_us=changes_us, noise=noise
    ):
        pass
    if latest is None or len(latest[0]) < FEWEST_BLOCKS:
        return None
    series, curve = latest
    reduced = series.reduced(curve)
    selection = select_directions(reduced, directions, DoubtSettings())
    if not LOOK_ALIKE.issuperset(selection.names):
        return None
    lasting = estimate_lasting_errors(reduced, reduced.current) or NONE
    scale, bias = CURVE + names.index(SPEED_SCALE), CURVE + names.index(EFFORT_BIAS)
    fit = fit_jointly(
        reduced,
        (*range(CURVE), scale, bias),
        directions,
        inflation=lasting.inflation,
        prior_std={scale: SPEED_PRIOR, bias: BIAS_PRIOR},
    )

    def error(coefficient: int, unit: float, prior: float) -> SharedError:
        if coefficient not in fit.chosen:
            return SharedError(0.0, unit * prior)
        place = fit.chosen.index(coefficient)
        std = sqrt(float(fit.covariance[place, place]))
        return SharedError(unit * float(fit.change[place]), unit * std)

    return SharedErrors(error(scale, 1.0, SPEED_PRIOR), error(bias, BIAS_UNIT, BIAS_PRIOR))
