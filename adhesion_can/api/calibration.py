"""Calibration of wheel radii and of the vehicle speed from recordings with coasting."""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from adhesion_can.api.configuration import ConfigurationLike, as_configuration
from adhesion_can.api.inputs import RecordingLike, as_recordings, name_of
from adhesion_can.bus.block import Block
from adhesion_can.calibration.coasting import CalibrationSettings, CoastingDrive
from adhesion_can.calibration.fit import Calibration
from adhesion_can.calibration.fit import calibrate as _calibrate
from adhesion_can.config.configuration import Configuration
from adhesion_can.errors import ConfigError, InputError, RecordingError
from adhesion_can.offline.load_traces import LoadedTraces, load_traces
from adhesion_can.physics.readings import Role
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.sequence import blocks_in_sequence
from adhesion_can.sampling.traces import Trace


def calibrate(
    recordings: RecordingLike | Iterable[RecordingLike],
    configuration: ConfigurationLike = None,
    settings: CalibrationSettings | None = None,
) -> Calibration:
    """Wheel radii, zero error and delay of the vehicle speed, from coasting.

    Args:
        recordings: Recordings of one vehicle, or their paths, each a drive of its own.
        configuration: Vehicle, database and roles.
        settings: Definition of coasting, and limits of the estimates.

    Returns:
        Calibration; axles without enough coasting have no estimate.

    Raises:
        ConfigError: No role gives a wheel speed or the vehicle speed.
        RecordingError: A recording cannot be read, or lacks a signal.

    """
    config = as_configuration(configuration)
    require_calibration_roles(config)
    opened = as_recordings(recordings)
    drives = [
        build_coasting_drive(traces, config) for traces in load_coasting_traces(opened, config)
    ]
    require_calibration_signals(drives, name_of(opened))
    return _calibrate(drives, config.vehicle, settings or CalibrationSettings())


def load_coasting_traces(
    recordings: Sequence[Recording],
    config: Configuration,
    reference: Trace | None = None,
    watched: Callable[[Iterable[Block]], Iterator[Block]] = iter,
) -> Iterator[LoadedTraces]:
    """Traces of recordings, each a drive of its own, read as they are asked for.

    Efforts may be missing, because steady speeds can be used without.

    Args:
        recordings: Recordings.
        config: Messages and roles.
        reference: Vehicle speed of another recorder, where one is used.
        watched: Passes the blocks on, for a display of the progress.

    """
    needed = {Role.WHEEL_SPEED} | ({Role.VEHICLE_SPEED} if reference is None else set())
    for recording in recordings:
        blocks = watched(blocks_in_sequence([recording], config.service.restart_s))
        yield load_traces(blocks, config, str(recording.path), needed, partly=True)


def build_coasting_drive(
    loaded: LoadedTraces, config: Configuration, reference: Trace | None = None
) -> CoastingDrive:
    """Signals of one drive for the calibration.

    Args:
        loaded: Traces of the recording.
        config: Roles.
        reference: Vehicle speed of another recorder, m/s, in place of the recording's own.

    """

    def traces(role: Role) -> dict[int, Trace]:
        axles = sorted(choice.axle for choice in config.choices if choice.role is role)
        return {axle: loaded.trace(role, axle) for axle in axles}

    return CoastingDrive(
        reference or traces(Role.VEHICLE_SPEED)[0],
        traces(Role.WHEEL_SPEED),
        traces(Role.TRACTIVE_EFFORT),
    )


def require_calibration_roles(config: Configuration, reference: Trace | None = None) -> None:
    """Raise a ConfigError where no role gives the speeds that a calibration compares."""
    roles = config.roles()
    if Role.WHEEL_SPEED not in roles:
        raise ConfigError(
            config.where, "no role gives a wheel speed", "map wheel_speed.1, .. under [roles]"
        )
    if reference is None and Role.VEHICLE_SPEED not in roles:
        raise ConfigError(
            config.where,
            "no role gives the vehicle speed",
            "map vehicle_speed under [roles], or give --speed CSV[:COLUMN]",
        )


def require_calibration_signals(
    drives: Sequence[CoastingDrive], where: str, speed: str | None = None
) -> None:
    """Raise an InputError where a signal has no reading, or a reference is of another time.

    Args:
        drives: Signals of the drives.
        where: Names of the recordings, for errors.
        speed: Text of the option `--speed`; None where the vehicle speed is the recording's own.

    """
    wheels = [trace for drive in drives for trace in drive.wheel_speed.values()]
    _require_readings(wheels, "wheel speed", where, "check the roles wheel_speed")
    if speed is None:
        speeds = [drive.speed for drive in drives]
        _require_readings(
            speeds,
            "vehicle speed that is independent of the driven axles",
            where,
            "give the speed of another recorder with --speed CSV[:COLUMN]",
        )
    else:
        stamps = np.concatenate([trace.t_us for trace in wheels]) / 1e6
        times = drives[0].speed.t_us / 1e6
        if times[-1] < stamps.min() or times[0] > stamps.max():
            raise InputError(
                f"--speed {speed}",
                f"its times ({times[0]:.1f} to {times[-1]:.1f} s) lie outside the recording's "
                f"({stamps.min():.1f} to {stamps.max():.1f} s)",
                "convert both to one clock",
            )
    efforts = [trace for drive in drives for trace in drive.effort.values()]
    if efforts:
        _require_readings(
            efforts,
            "tractive effort, so coasting cannot be detected",
            where,
            "check the roles tractive_effort; without them, calibration uses spans of steady speed",
        )


def _require_readings(traces: list[Trace], what: str, where: str, fix: str) -> None:
    if not any(np.isfinite(trace.value).any() for trace in traces):
        raise RecordingError(where, f"has no {what}", fix)
