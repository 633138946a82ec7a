"""Channels that the user brought as candidates: each on the same footing as the library."""

from collections.abc import Iterator, Sequence

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData, observed_column
from adhesion_can.diagnosis.evidence import Untested
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.physics.channels import FEW_VALUES, UserChannel
from adhesion_can.physics.effects import known_effects
from adhesion_can.physics.effects.channel_factor import LINEAR, PREFIX, STEP, ChannelFactor

LEAST_LEVEL_ROWS = 5
"""Rows without which a value of a column cannot have a step."""
COPY = 0.98
"""Correlation from which a column is another measurement of slip, force or adhesion."""


def build_channel_candidates(
    drives: Sequence[DriveData],
) -> tuple[tuple[Candidate, ...], list[Untested]]:
    """Candidates of all channels that the user brought, and those that cannot be causes.

    A channel that an effect of the library depends on belongs to that effect.

    Args:
        drives: Rows of the recordings or tables, those that are held out included.

    """
    candidates: list[Candidate] = []
    untested: list[Untested] = []
    of_library = {name for effect in known_effects() for name in effect.requires.covariates}
    brought = {channel.name: channel for drive in drives for channel in drive.user_channels}
    for name in sorted(set(brought) - of_library):
        lacking = next((d.name for d in drives if name not in d.covariates), None)
        if lacking is not None:
            why = f"{lacking} does not have it, or lacks too many of its values"
            untested.append(Untested(PREFIX + name, why))
            continue
        values = np.concatenate([drive.covariates[name] for drive in drives])
        why = _why_no_cause(values, drives)
        if why:
            untested.append(Untested(PREFIX + name, why))
        else:
            candidates += map(Candidate, _forms(brought[name], values))
    return tuple(candidates), untested


def _why_no_cause(values: Array, drives: Sequence[DriveData]) -> str:
    """Why a channel cannot be a cause; '' where it can."""
    if float(np.ptp(values)) == 0.0:
        return "it does not change in these data"
    names = ("slip", "adhesion", "load")
    slip, adhesion, load = (observed_column(drives, name) for name in names)
    measured = {
        "slip": slip,
        "adhesion": adhesion,
        "force": adhesion * load,
        "size of the slip": np.abs(slip),
        "size of the adhesion": np.abs(adhesion),
    }
    for what, other in measured.items():
        if np.ptp(other) > 0.0 and abs(np.corrcoef(values, other)[0, 1]) > COPY:
            return f"it follows the {what}: another measurement of the same quantity is not a cause"
    return ""


def _forms(channel: UserChannel, values: Array) -> Iterator[ChannelFactor]:
    """A linear factor, and a step at each value of a channel that has a few."""
    levels, counts = np.unique(values, return_counts=True)
    # Kinds are numbered; a few readings of a quantity are not.
    few = len(levels) == 2 or (len(levels) <= FEW_VALUES and bool((levels % 1.0 == 0.0).all()))
    texts = channel.name, channel.unit, channel.label
    if len(levels) > 2 or not few:
        middle = float(np.mean(values))
        reach = float(np.abs(values - middle).max())
        yield ChannelFactor(*texts, LINEAR, middle, float(np.std(values)), reach)
    if few:
        # Of two values the step at one is that at the other.
        for level, count in list(zip(levels, counts, strict=True))[len(levels) == 2 :]:
            if LEAST_LEVEL_ROWS <= count <= len(values) - LEAST_LEVEL_ROWS:
                yield ChannelFactor(*texts, STEP, float(level))
