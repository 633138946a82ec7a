"""Samples with the vehicle speed that wheels and efforts show, from samples with a reference speed.

Each sample gives the speed of its rim back. From the rims and efforts of all axles the filter makes
vehicle speed and wheel radii, a value for each block of 50 ms. A sample waits for the blocks around
it, as it would for a vehicle speed with this cycle, and its slip is that of the true radius.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.observed_speed.axle_rows import (
    LONGEST_WAIT_US,
    AxleRows,
    SampleRow,
)
from adhesion_can.estimation.observed_speed.filter import ObservedSpeedFilter
from adhesion_can.estimation.observed_speed.result import ObservedSpeed
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.samples import NO_SAMPLES, Samples
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.equations import AID_COLUMNS
from adhesion_can.values import Stateful, Value

LONGEST_GAP_S = 0.1
"""Longest time without a sample of all axles that is bridged, s; then the filter starts again."""
LONGEST_AGE_S, LONGEST_AGE_CYCLES = 0.5, 4
"""Age of the latest block beyond which the speed is not known any more, s, and least in cycles."""


@dataclass(frozen=True, slots=True)
class ObservedBlock(Value):
    """What a block of samples has shown.

    Attributes:
        t_us: Middle of the block, µs.
        speed: Vehicle speed, m/s.
        white_variance: Variance of the speed that is independent from block to block, m²/s².
        radius_factor: True over configured radius of each wheel, 1, shape (axles,).
        slip_std: Standard deviation of the slips of the axles that pull, which lasts, 1.
        objection: Why the slips are not known; none where they are.

    """

    t_us: int
    speed: float
    white_variance: float
    radius_factor: Array
    slip_std: float
    objection: Objection


class ObservedSamples(NamedTuple):
    """Samples with their observed speed.

    Attributes:
        samples: Samples between the middles of two blocks.
        is_known: Whether their slips are known.

    """

    samples: Samples
    is_known: bool


@dataclass(frozen=True, slots=True)
class _Setup(Value):
    """Vehicle and settings of a filter, and the cycle of the wheel speeds, µs."""

    vehicle: Locomotive
    settings: ObservedSpeedSettings
    cycle_us: int

    def make_filter(self) -> ObservedSpeedFilter:
        """Filter that has seen nothing yet."""
        return ObservedSpeedFilter(self.vehicle, self.settings, net_efforts=True)


class SpeedObserver(Stateful):
    """Gives samples the observed vehicle speed.

    Args:
        vehicle: Vehicle that the samples come from.
        settings: Settings of the filter.
        cycle_us: Cycle of the wheel speeds, µs.

    """

    def __init__(self, vehicle: Locomotive, settings: ObservedSpeedSettings, cycle_us: int) -> None:
        self._setup = _Setup(vehicle, settings, cycle_us)
        self._radius = np.asarray(vehicle.wheel_radius)
        self._filter = self._setup.make_filter()
        self._rows = AxleRows(vehicle.axles, cycle_us)
        self._row_us: float | None = None
        """Stamp of the latest row; None before the first."""
        self._stamps: list[float] = []
        """Stamps of the rows since the last block."""
        self._result: ObservedSpeed | None = None
        self._waiting = NO_SAMPLES
        self.block: ObservedBlock | None = None
        """Latest block; None before the first is full."""

    def add(self, samples: Samples) -> list[ObservedSamples]:
        """Add samples in the order of their stamps; returns those that are complete by now."""
        waiting = Samples.concatenate([self._waiting, samples])
        if len(waiting) and waiting.t_us[-1] - waiting.t_us[0] > LONGEST_WAIT_US:
            waiting = waiting.select(waiting.t_us >= waiting.t_us[-1] - LONGEST_WAIT_US)
        self._waiting = waiting
        observed = []
        for row in self._rows.add(samples):
            observed += self._take(row)
        return observed

    def expire(self, now_us: int) -> None:
        """Forget the speed if no row of all axles has come for too long."""
        longest_us = max(LONGEST_AGE_S * 1e6, LONGEST_AGE_CYCLES * self._setup.cycle_us)
        if self.block is not None and now_us - self.block.t_us > longest_us:
            self._start_again()

    def _start_again(self) -> None:
        self._filter = self._setup.make_filter()
        self._stamps, self._result, self.block = [], None, None

    def _take(self, row: SampleRow) -> list[ObservedSamples]:
        """Take a row in; one that was lost is bridged by that after it."""
        cycle_us = self._setup.cycle_us
        observed = []
        for stamp_us in self._stamps_to(row.t_us):
            self._stamps.append(stamp_us)
            result = self._filter.update(
                cycle_us / 1e6,
                row.rim[None] / self._radius,
                (row.adhesion * row.load)[None],
                row.load[None],
                np.array([row.gnss]),
                np.array([row.acceleration]),
            )
            if result is not None and result is not self._result:
                self._result = result
                observed += self._end_block(result)
        return observed

    def _stamps_to(self, t_us: float) -> list[float]:
        """Stamps, µs, at which there should be rows since the latest one."""
        cycle_us, last_us, self._row_us = self._setup.cycle_us, self._row_us, t_us
        cycles = 1 if last_us is None else max(round((t_us - last_us) / cycle_us), 1)
        # One lost row is bridged, however seldom they come.
        if cycles > 2 and cycles * cycle_us > LONGEST_GAP_S * 1e6:
            self._start_again()
            return [t_us]
        return [t_us - missing * cycle_us for missing in range(cycles - 1, -1, -1)]

    def _end_block(self, result: ObservedSpeed) -> list[ObservedSamples]:
        """Samples between the middle of the block before and that of this one."""
        before = self.block
        self.block = block = ObservedBlock(
            t_us=round(sum(self._stamps) / len(self._stamps)),
            speed=float(result.speed[0]),
            white_variance=float(result.white_variance[0]),
            radius_factor=result.radius_factor[0],
            slip_std=float(result.overall_std[0]),
            objection=result.reasons[0],
        )
        self._stamps = []
        t_us = self._waiting.t_us
        complete = self._waiting.select(t_us <= block.t_us)
        self._waiting = self._waiting.select(t_us > block.t_us)
        if before is None:
            return []
        complete = complete.select(complete.t_us > before.t_us)
        if not len(complete):
            return []
        is_known = before.objection is Objection.NONE and block.objection is Objection.NONE
        return [ObservedSamples(with_speed(complete, before, block), is_known)]


def with_speed(samples: Samples, before: ObservedBlock, block: ObservedBlock) -> Samples:
    """Samples between the middles of two blocks, with the speed between those of the blocks."""
    rim = samples.speed * (1.0 + samples.slip) * block.radius_factor[samples.axle - 1]
    share = (samples.t_us - before.t_us) / (block.t_us - before.t_us)
    speed = before.speed + (block.speed - before.speed) * share
    aids = {name for columns in AID_COLUMNS.values() for name in columns}
    # A variance of the slip by the wheel was relative to the reference speed.
    scale = (samples.speed / speed) ** 2
    return replace(
        samples,
        slip=rim / speed - 1.0,
        creep_speed=rim - speed,
        speed=speed,
        slip_var=samples.slip_var * scale,
        slip_common_var=np.full(len(samples), block.white_variance) / speed**2,
        speed_us=np.full(len(samples), block.t_us),
        speed_share=share,
        covariates={name: c for name, c in samples.covariates.items() if name not in aids},
    )
