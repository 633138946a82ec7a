"""The service's doubt on a recording, with the plain curve and with an extended model."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from adhesion_can.config import Configuration
from adhesion_can.estimation.doubt.doubt_share import compute_doubt_share
from adhesion_can.estimation.extended.correction import correct_samples
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.offline.extract_samples import extract_samples
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.instruments import PERFECT
from adhesion_can.physics.samples import Samples
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings

LONGEST_US = 240_000_000
"""Part of a recording, from its first sample on, that is used at most, µs."""


class DoubtShares(NamedTuple):
    """Shares of the time in which the service would doubt its model.

    Attributes:
        before: Share with the plain curve, 0..1.
        after: Share with the extended model, 0..1.

    """

    before: float
    after: float


def compute_doubt_shares(
    path: Path,
    configuration: Configuration,
    model: ExtendedModel,
    start: CurveParameters,
    changes_us: Sequence[int] = (),
) -> DoubtShares | None:
    """Doubt on a recording with the plain curve and with a model; None where it is too short.

    A slow drift that the model holds is taken out as well, which the service leaves to its tracker.

    Args:
        path: Path of the recording.
        configuration: Messages, roles, vehicle and settings, without a model.
        model: Extended model.
        start: Parameters (c1, c2, c3) of the plain curve of the first surface.
        changes_us: Stamps from which on the surface is another one, µs, ascending.

    Raises:
        ConfigError: The roles do not suffice to form adhesion, or for the model.
        RecordingError: No frame of a known id was accepted.

    """
    axles = configuration.vehicle.axles
    formed = _extract(path, replace(configuration, model=model))
    corrected = correct_samples(formed, model, axles).samples
    plain = formed if model.instruments == PERFECT else _extract(path, configuration)
    slip_max = configuration.estimators.identifiability.slip_max

    def share(samples: Samples, curve: CurveParameters) -> float | None:
        settings = configuration.estimators
        return compute_doubt_share(
            samples,
            curve,
            axles,
            slip_max,
            changes_us=changes_us,
            doubt=settings.doubt,
            noise=settings.noise,
        )

    before, after = share(plain, start), share(corrected, model.base)
    return None if before is None or after is None else DoubtShares(before, after)


def _extract(path: Path, configuration: Configuration) -> Samples:
    """Samples of the first part of a recording."""
    blocks = blocks_in_sequence(open_recordings([path]), configuration.service.restart_s)
    samples, _ = extract_samples(blocks, configuration, str(path))
    if not len(samples):
        return samples
    return samples.select(samples.t_us < samples.t_us[0] + LONGEST_US)
