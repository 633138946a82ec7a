"""Diagnosis of readings that were kept, without a file: of a whole record and of its halves."""

from pathlib import Path

import numpy as np

from adhesion_can.api.diagnosis import diagnose_inputs, load_from_traces
from adhesion_can.config import Configuration
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.result import Diagnosis, InputFile
from adhesion_can.offline.load_traces import LoadedTraces
from adhesion_can.sampling.column_former import Readings

RECORD = InputFile(Path("record of the service"), "record of the service", "")
"""What stands for a file in diagnoses and errors of readings that were kept."""


def load_readings(readings: Readings) -> LoadedTraces:
    """Readings of all signals as traces."""
    traces = LoadedTraces()
    traces.add(readings)
    return traces


def build_drive(readings: Readings, configuration: Configuration) -> DriveData:
    """Drive data of readings.

    Args:
        readings: Readings of all signals.
        configuration: Vehicle, roles and settings.

    Raises:
        InputError: The readings cannot be those of a vehicle.

    """
    return load_from_traces(RECORD, load_readings(readings), [], configuration).drive


def examine(readings: Readings, configuration: Configuration) -> Diagnosis:
    """Diagnosis of readings.

    Args:
        readings: Readings of all signals.
        configuration: Vehicle, roles and settings.

    Raises:
        InputError: Not one row is usable, or the readings cannot be those of a vehicle.

    """
    loaded = load_from_traces(RECORD, load_readings(readings), [], configuration)
    return diagnose_inputs([loaded], lambda _work, _share: None)


def halves(readings: Readings) -> tuple[Readings, Readings]:
    """Readings before the middle of their time, and the others; both empty where there are none."""
    stamps = [times for times, _ in readings.values() if len(times)]
    if not stamps:
        return {}, {}
    middle_us = (
        min(int(times[0]) for times in stamps) + max(int(times[-1]) for times in stamps)
    ) // 2
    first, second = {}, {}
    for key, (t_us, value) in readings.items():
        place = int(np.searchsorted(t_us, middle_us))
        if place:
            first[key] = t_us[:place], value[:place]
        if place < len(t_us):
            second[key] = t_us[place:], value[place:]
    return first, second
