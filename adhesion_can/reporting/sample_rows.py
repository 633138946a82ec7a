"""The samples of a replay as a table: `--samples` in CSV, Parquet or MF4.

`identify` and `diagnose` read it back as a TABLE.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import adhesion
from adhesion_can.physics.channels import channel_label, channel_unit
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples
from adhesion_can.reporting.export import WriteRows, open_table
from adhesion_can.reporting.export.layout import Field, FieldColumn

ROWS = 20_000
"""Number of rows written at once."""
USED, BEYOND = 0, 1
FIELDS = (
    Field("axle", np.dtype(np.uint8), comment="number of the axle"),
    Field("slip", unit="1", comment="slip ratio", spec=".9g"),
    Field("slip_std", unit="1", comment="standard deviation of slip", spec=".4g"),
    Field("adhesion", unit="1", comment="adhesion coefficient", spec=".9g"),
    Field("adhesion_std", unit="1", comment="standard deviation of adhesion", spec=".4g"),
    Field("speed_mps", unit="m/s", comment="vehicle speed", spec=".9g"),
    Field("longitudinal_force_N", unit="N", comment="force between wheel and rail", spec=".9g"),
    Field("normal_load_N", unit="N", comment="axle load", spec=".9g"),
    Field("segment", np.dtype(np.uint32), comment="number of surfaces found so far"),
    Field("residual", unit="1", optional=True, spec=".6g",
          comment="adhesion minus the curve before the row"),
    Field("left_out", np.dtype(np.uint8), comment="whether the estimator skipped the row",
          names={float(USED): "no", float(BEYOND): "slip beyond slip_max"}, text=True),
)  # fmt: skip
"""Columns beside `time_s` and the further channels."""


class SampleRows:
    """Buffer of samples, written many at once.

    Args:
        write: Function that appends rows to the table.
        channels: Names of the further channels.
        slip_max: Largest slip ratio that is used.

    """

    def __init__(self, write: WriteRows, channels: Sequence[str], slip_max: float) -> None:
        self._write, self._channels, self._slip_max = write, channels, slip_max
        self._waiting: list[Samples] = []
        self._curves: list[Array] = []
        self._surfaces: list[int] = []
        self._size = self._surface = 0
        self._since_us: int | None = None

    def add(self, samples: Samples, estimate: Estimate | None) -> None:
        """Add samples, and the estimate that was in force before them."""
        if estimate is not None and estimate.surface_since_us != self._since_us:
            self._surface += self._since_us is not None
            self._since_us = estimate.surface_since_us
        curve = np.full(len(samples), np.nan)
        if estimate is not None:
            size = adhesion(np.abs(samples.slip), *estimate.theta)
            curve = np.copysign(size, samples.slip)
        self._waiting.append(samples)
        self._curves.append(curve)
        self._surfaces.append(self._surface)
        self._size += len(samples)
        if self._size >= ROWS:
            self.flush()

    def flush(self) -> None:
        """Write what is waiting."""
        if not self._size:
            return
        lengths = [len(samples) for samples in self._waiting]
        channels = {name: self._channel(name) for name in self._channels}
        samples = Samples.concatenate(self._waiting)
        residual = samples.adhesion - np.concatenate(self._curves)
        beyond = np.abs(samples.slip) > self._slip_max
        columns = [
            FieldColumn(samples.axle.astype(np.uint8)),
            FieldColumn(samples.slip),
            FieldColumn(np.sqrt(samples.slip_total_var)),
            FieldColumn(samples.adhesion),
            FieldColumn(np.sqrt(samples.adhesion_var + samples.transient_var)),
            FieldColumn(samples.speed),
            FieldColumn(samples.adhesion * samples.load),
            FieldColumn(samples.load),
            FieldColumn(np.repeat(np.array(self._surfaces, dtype=np.uint32), lengths)),
            FieldColumn(residual, np.isnan(residual)),
            FieldColumn(np.where(beyond, BEYOND, USED).astype(np.uint8)),
            *(FieldColumn(values, np.isnan(values)) for values in channels.values()),
        ]
        order = np.argsort(samples.t_us, kind="stable")
        self._write(samples.t_us[order] * 1000, [column.select(order) for column in columns])
        self._waiting, self._curves, self._surfaces, self._size = [], [], [], 0

    def _channel(self, name: str) -> Array:
        """Values of a further channel at the waiting samples; NaN where it is not available."""
        return np.concatenate(
            [s.covariates.get(name, np.full(len(s), np.nan)) for s in self._waiting]
        )


@contextmanager
def sample_table(
    path: Path, origin: Mapping[str, str], channels: Sequence[str], slip_max: float
) -> Iterator[Callable[[Samples, Estimate | None], None]]:
    """A file with a row a sample; gives the function that adds samples.

    Args:
        path: Path of the file; its suffix selects the format.
        origin: Version, inputs and hashes, written where the format has a place for them.
        channels: Names of the further channels.
        slip_max: Largest slip ratio that is used.

    Raises:
        InputError: The format is unknown, an extra is missing, or the disk is full.

    """
    further = tuple(
        Field(name, unit=channel_unit(name), comment=channel_label(name), optional=True, spec=".9g")
        for name in channels
    )
    with open_table(path, (*FIELDS, *further), origin, name="Samples") as write:
        rows = SampleRows(write, channels, slip_max)
        yield rows.add
        rows.flush()
