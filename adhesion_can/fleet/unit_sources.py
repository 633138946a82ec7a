"""A recording or a TABLE as the source of all steps of a unit."""

from collections.abc import Iterator
from datetime import UTC, date, datetime

import numpy as np

from adhesion_can.api.calibration import build_coasting_drive, require_calibration_signals
from adhesion_can.api.diagnosis import LoadedInput, load_from_traces, load_inputs
from adhesion_can.api.inputs import describe_left_out
from adhesion_can.api.replayed_models import ReplayedModels
from adhesion_can.api.samples import LoadedSamples, clean_samples, load_table_samples
from adhesion_can.bus.block import Block
from adhesion_can.calibration.fit import calibrate
from adhesion_can.config import Configuration
from adhesion_can.config.calibrated_radii import with_radii
from adhesion_can.diagnosis.result import InputFile
from adhesion_can.errors import RecordingError
from adhesion_can.estimation.batch_fit import identify
from adhesion_can.estimation.batch_result import BatchResult
from adhesion_can.fleet.calibrated_radii import SETTINGS, choose_radii
from adhesion_can.fleet.rows import Row, SetpointStatistics, calibration_fields, check_fields
from adhesion_can.offline.check import CheckResult, check_scan
from adhesion_can.offline.check_table import check_table
from adhesion_can.offline.recording_fit import find_misfit, require_accepted
from adhesion_can.offline.scan import Scan, scan
from adhesion_can.offline.stamps import in_seconds
from adhesion_can.physics.readings import Role
from adhesion_can.recordings.problems import describe_problems
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.sequence import blocks_in_sequence
from adhesion_can.recordings.tables.sample_table import SampleTable, read_table

EARLIEST, LATEST = (
    int(datetime(year, 1, 1, tzinfo=UTC).timestamp()) * 1_000_000 for year in (2000, 2100)
)
"""Stamps between which a recording was made by a clock that was set, µs."""


def _fit(loaded: LoadedSamples, config: Configuration) -> BatchResult | None:
    estimators = config.estimators
    return identify(
        loaded.samples,
        estimators.identifiability,
        labels=loaded.labels,
        noise=estimators.noise,
    )


def day_of(first_us: int | None) -> date | None:
    """Day of a stamp, UTC; None where it is of a clock that was not set.

    Args:
        first_us: First stamp of a recording, µs.

    """
    at = _instant(first_us)
    return None if at is None else at.date()


def _instant(first_us: int | None) -> datetime | None:
    if first_us is None or not EARLIEST <= first_us < LATEST:
        return None
    return datetime.fromtimestamp(first_us // 1_000_000, UTC).replace(
        microsecond=first_us % 1_000_000
    )


def _times(first_us: int | None) -> Row:
    return {"started_at": _instant(first_us), "day": day_of(first_us)}


class RecordingUnit:
    """A recording: decoded once for all steps but the replay, which runs the service on it.

    Where the calibration changes radii it is decoded again, and the steps after it work with them.
    """

    def __init__(self, file: InputFile, config: Configuration) -> None:
        self.file, self._config = file, config
        recording = Recording(file.path)
        self._contents: Scan = scan(self._blocks(recording), config)
        self._problems = describe_problems([recording], names=[file.name])
        extractor = self._contents.extractor
        received = extractor.receiver, extractor.counts["frames"], extractor.seen
        require_accepted(*received, config, file.name)
        receiver, _, seen = received
        misfit = find_misfit(receiver, seen, config, samples=len(self._contents.samples))
        if misfit is not None and misfit.of_other_bus:
            raise RecordingError(file.name, misfit.what, misfit.fix)
        self._checked: CheckResult | None = None

    def _blocks(self, recording: Recording) -> Iterator[Block]:
        return in_seconds(
            blocks_in_sequence([recording], self._config.service.restart_s),
            self._config.messages,
            self.file.name,
        )

    def describe(self) -> Row:
        """Times and sizes."""
        contents = self._contents
        return {
            **_times(contents.extractor.first_us),
            "duration_s": contents.duration_s,
            "frames": contents.extractor.counts["frames"],
            "axles": sum(choice.role is Role.WHEEL_SPEED for choice in self._config.choices),
            "samples": len(contents.samples),
        }

    def check(self) -> Row:
        """Columns of `check`."""
        self._checked = check_scan(self._contents, self._config)
        return check_fields(self._checked, self._problems)

    def calibrate(self) -> Row:
        """Columns of `calibrate`."""
        drives = [build_coasting_drive(self._contents.traces, self._config)]
        require_calibration_signals(drives, self.file.name)
        result = calibrate(drives, self._config.vehicle, SETTINGS)
        applied = choose_radii(result)
        if applied.ratio:
            config = with_radii(self._config, applied.ratio)
            # Samples hold slips, which the radii are in; traces of rim speeds hold the radii, too.
            self._contents = scan(self._blocks(Recording(self.file.path)), config)
            self._config, self._checked = config, None
        return calibration_fields(result, applied)

    def replay(self) -> Row:
        """Columns of `replay`."""
        recording, statistics = Recording(self.file.path), SetpointStatistics()
        models = ReplayedModels([recording])
        core = models.make_core(self._config, None, statistics.add)
        models.run(self._blocks(recording), core, lambda _: None)
        return statistics.fields()

    def identify(self) -> BatchResult | None:
        """Batch fit: that of the check, where there is one and no model is to be removed."""
        config, samples = self._config, self._contents.samples
        loaded = clean_samples(samples, config, self.file.name, self._problems)
        if self._checked is not None and config.model is None:
            return self._checked.fit
        return _fit(loaded, config)

    def position(self, _from_us: int, _to_us: int) -> tuple[float | None, float | None]:
        """Latitude and longitude of a span: not known."""
        return None, None

    def load_drive(self) -> LoadedInput:
        """Drive data for the diagnosis."""
        return load_from_traces(self.file, self._contents.traces, self._problems, self._config)


class TableUnit:
    """A TABLE of samples, which has no coasting and no frames to replay."""

    def __init__(self, file: InputFile, config: Configuration) -> None:
        self.file, self._config = file, config
        self._table: SampleTable = read_table(file.path, config.columns)

    def describe(self) -> Row:
        """Times and sizes."""
        t_us = self._table.samples.t_us
        first_us = int(t_us.min()) if self._table.timed and len(t_us) else None
        return {
            **_times(first_us),
            "duration_s": None if first_us is None else (int(t_us.max()) - first_us) / 1e6,
            "samples": len(t_us),
            "axles": len(np.unique(self._table.samples.axle)),
        }

    def check(self) -> Row:
        """Columns of `check`."""
        slip_max = self._config.estimators.identifiability.slip_max
        left_out = describe_left_out(self._table, slip_max)
        return check_fields(check_table(self.file.name, self._table, left_out, self._config))

    def calibrate(self) -> Row:
        """Nothing: a TABLE has no wheel speeds."""
        return {}

    def replay(self) -> Row:
        """Nothing: a TABLE has no frames."""
        return {}

    def identify(self) -> BatchResult | None:
        """Batch fit."""
        return _fit(load_table_samples([self.file.path], self._config), self._config)

    def position(self, from_us: int, to_us: int) -> tuple[float | None, float | None]:
        """Latitude and longitude in the middle of a span, °; None where none of its rows has one.

        Args:
            from_us: First stamp of the span, µs.
            to_us: Last stamp of the span, µs.

        """
        t_us, known = self._table.samples.t_us, self._table.position
        if known is None:
            return None, None
        inside = known[(t_us >= from_us) & (t_us <= to_us)]
        inside = inside[np.isfinite(inside).all(axis=1)]
        if not len(inside):
            return None, None
        # A point that was driven through, and not one beside a bent line.
        latitude, longitude = inside[len(inside) // 2]
        return float(latitude), float(longitude)

    def load_drive(self) -> LoadedInput:
        """Drive data for the diagnosis."""
        return load_inputs([self.file], self._config, lambda _work, _share: None)[0]
