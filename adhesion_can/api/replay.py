"""The service over recordings, its setpoints as a table."""

from collections.abc import Iterable
from math import isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesion_can.api.configuration import ConfigurationLike, ModelLike, as_configuration
from adhesion_can.api.inputs import RecordingLike, as_recordings, name_of
from adhesion_can.api.replayed_models import ReplayedModels
from adhesion_can.offline.recording_fit import SeenIds, require_fit
from adhesion_can.offline.stamps import in_seconds
from adhesion_can.recordings.sequence import blocks_in_sequence
from adhesion_can.reporting.setpoints import setpoint_columns, setpoint_row
from adhesion_can.result_text import html_table
from adhesion_can.service.outputs import Outputs
from adhesion_can.service.replay import require_frames_in_span


class SetpointTable(dict[str, NDArray[Any]]):
    """Columns of setpoints by name, a row for each `AdhesionSetpoint` message.

    `time_s` (s, on the clock of the recording), `status` (text), `mu_max`, `mu_max_std`,
    `lambda_m`, `lambda_m_std`, `c1`, `c2`, `c3`, `surface_age_s` (s), `mu_max_ax1` and so on, and
    as texts `doubt` (a name of `AdhesionQuality.Doubt`), `family` (the most probable family of
    curves) and `objection` (what the readings cannot be, or NONE), and where the service observes
    the vehicle speed `speed_source`; where not available numbers are NaN and texts empty. It is a
    dict, so `pandas.DataFrame(table)` takes it as it is.
    """

    def to_dict(self) -> dict[str, list[Any]]:
        """Lists in place of arrays, as JSON has them; None where not available."""
        return {
            name: [None if _is_missing(value) else value for value in column.tolist()]
            for name, column in self.items()
        }

    def _repr_html_(self) -> str:
        names, counts = np.unique(self["status"], return_counts=True)
        rows = zip(names.tolist(), counts.tolist(), strict=True)
        title = f"{len(self['time_s'])} setpoints in {len(self)} columns, by status"
        return html_table(title, ("status", "setpoints"), rows)


def _is_missing(value: float | str) -> bool:
    """Whether a cell means 'not available'."""
    return value == "" or (isinstance(value, float) and isnan(value))


def replay(
    recordings: RecordingLike | Iterable[RecordingLike],
    configuration: ConfigurationLike = None,
    *,
    estimator: str | None = None,
    model: ModelLike = None,
    from_s: float = 0.0,
    to_s: float | None = None,
) -> SetpointTable:
    """Setpoints that the service would have sent while recordings were made.

    Args:
        recordings: Recordings or their paths, in the order of their times.
        configuration: Vehicle, database, roles and settings.
        estimator: Name of the estimator; None for the configured one.
        model: Extended model, whose effects are removed from what is measured.
        from_s: Start of the part that is replayed, s after the first frame.
        to_s: End of that part, s after the first frame; None for the last frame.

    Raises:
        ConfigError: The roles do not suffice to estimate adhesion, or the estimator is unknown.
        RecordingError: A recording cannot be read, or is not one of the configured bus.

    """
    settings = as_configuration(configuration, model)
    chosen = setpoint_columns(speed_observed=settings.observes_speed)
    times: list[int] = []
    rows: list[list[float]] = []

    def add(t_us: int, outputs: Outputs) -> None:
        times.append(t_us)
        rows.append(setpoint_row(outputs, chosen))

    opened, seen = as_recordings(recordings), SeenIds()
    where = name_of(opened)
    models = ReplayedModels(opened)
    core = models.make_core(settings, estimator, add)
    blocks = in_seconds(
        blocks_in_sequence(opened, settings.service.restart_s), settings.messages, where
    )
    read = seen.watch(blocks)
    summary = models.run(read, core, lambda _: None, from_s=from_s, to_s=to_s)
    require_frames_in_span(summary, from_s, where)
    samples = core.counts.samples
    require_fit(core.receiver, summary.frames, seen, settings, where, samples=samples)
    numbers = np.array(rows, dtype=np.float64).reshape(-1, len(chosen)).T
    columns = {
        column.field.name: column.values(n) for column, n in zip(chosen, numbers, strict=True)
    }
    return SetpointTable({"time_s": np.array(times, dtype=np.float64) / 1e6, **columns})
