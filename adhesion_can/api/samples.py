"""Samples of recordings and of tables, less the effects of an extended model."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.api.inputs import describe_table, name_of, require_plausible
from adhesion_can.bus.block import Block
from adhesion_can.config.configuration import Configuration
from adhesion_can.errors import InputError
from adhesion_can.offline.extract_samples import extract_samples
from adhesion_can.offline.plausibility import inspect_samples
from adhesion_can.physics.samples import Samples
from adhesion_can.recordings.problems import describe_problems, distinct_names
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.sequence import blocks_in_sequence
from adhesion_can.recordings.tables.sample_table import is_table, read_table


class LoadedSamples(NamedTuple):
    """Samples of input files.

    Attributes:
        samples: Samples of all files, one after another.
        labels: Number of each sample's segment, shape (n,); None where it is to be found.
        problems: Sentences about what was passed over.
        left_out: Number of samples to which the extended model could not be applied, by reason.
        factor: Factor of the adhesion by the effects of the extended model, mean of the samples.

    """

    samples: Samples
    labels: NDArray[np.int64] | None
    problems: list[str]
    left_out: Counter[str]
    factor: float = 1.0


def are_tables(paths: Sequence[Path], config: Configuration) -> bool:
    """Whether files are tables of samples rather than recordings.

    Args:
        paths: Paths of the files.
        config: Columns that stand for known ones.

    Raises:
        InputError: A file is missing, or both kinds are there.

    """
    for path in paths:
        if not path.exists():
            raise InputError(str(path), "No such file or directory", "check the path")
    tables = [path for path in paths if is_table(path, config.columns)]
    if tables and len(tables) < len(paths):
        raise InputError("identify", "recordings and tables together", "give one kind at a time")
    return bool(tables)


def load_recording_samples(
    recordings: Sequence[Recording],
    config: Configuration,
    watched: Callable[[Iterable[Block]], Iterator[Block]] = iter,
) -> LoadedSamples:
    """Samples of recordings one after another.

    Args:
        recordings: Recordings in the order of their times.
        config: Vehicle, roles, and the extended model whose effects are removed.
        watched: Passes the blocks on, for a display of the progress.

    Raises:
        ConfigError: The roles do not suffice to form adhesion.
        RecordingError: A recording cannot be read, or holds no known frame.

    """
    blocks = watched(blocks_in_sequence(recordings, config.service.restart_s))
    name = name_of(recordings)
    samples, _ = extract_samples(blocks, config, name)
    return clean_samples(samples, config, name, describe_problems(recordings))


def clean_samples(
    samples: Samples, config: Configuration, name: str, problems: list[str]
) -> LoadedSamples:
    """Samples of recordings, looked at and less the effects of the extended model.

    Args:
        samples: Samples in the order of their stamps.
        config: Vehicle, and the extended model whose effects are removed.
        name: Names of the recordings, for errors.
        problems: Sentences about what was passed over while they were read.

    Raises:
        InputError: With the data as they are no honest answer is possible.

    """
    odd = require_plausible(
        name,
        inspect_samples(samples, table=False, vehicle=config.vehicle),
        assumed=config.assume_plausible,
    )
    left_out: Counter[str] = Counter()
    factor = 1.0
    if config.model is not None:
        # Imported by whoever has a model: it has all effects behind it.
        from adhesion_can.api.effect_removal import remove_from_samples  # noqa: PLC0415

        samples, factor = remove_from_samples(samples, config.model, config.vehicle.axles, left_out)
    return LoadedSamples(samples, None, [*problems, *odd], left_out, factor)


def load_table_samples(paths: Sequence[Path], config: Configuration) -> LoadedSamples:
    """Samples of tables, each a drive of its own.

    Args:
        paths: Paths of the tables.
        config: Extended model whose effects are removed.

    Raises:
        TableError: A table cannot be read, or lacks a column.

    """
    tables = [read_table(path, config.columns) for path in paths]
    problems: list[str] = []
    for name, sample_table in zip(distinct_names(paths), tables, strict=True):
        odd = inspect_samples(sample_table.samples, table=True, timed=sample_table.timed)
        problems += require_plausible(name, odd, assumed=config.assume_plausible)
        problems += describe_table(name, sample_table, config.estimators.identifiability.slip_max)
    left_out: Counter[str] = Counter()
    factor = 1.0
    if config.model is not None:
        from adhesion_can.api.effect_removal import remove_from_table  # noqa: PLC0415

        model = config.model
        parts = [
            remove_from_table(t, model, str(path), left_out)
            for path, t in zip(paths, tables, strict=True)
        ]
        tables = [table for table, _ in parts]
        rows = [len(table.samples) for table in tables]
        factor = float(
            np.average([table_factor for _, table_factor in parts], weights=np.maximum(rows, 1))
        )
    samples = Samples.concatenate([t.samples for t in tables])
    if len(tables) == 1 and tables[0].segment is None:
        return LoadedSamples(samples, None, problems, left_out, factor)
    # Each table, and each segment of one, is a segment of its own.
    labels, base = [], 0
    for t in tables:
        segments = t.segment if t.segment is not None else np.zeros(len(t.samples), dtype=np.int64)
        labels.append(segments + base)
        base += int(segments.max(initial=0)) + 1
    return LoadedSamples(samples, np.concatenate(labels), problems, left_out, factor)
