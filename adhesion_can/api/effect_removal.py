"""Effects of an extended model, taken out of samples and tables."""

from collections import Counter
from dataclasses import replace

from adhesion_can.estimation.extended.correction import (
    correct_samples,
    mean_factor,
    require_columns,
)
from adhesion_can.estimation.extended.instrument_removal import remove_instrument_errors
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.samples import Samples
from adhesion_can.recordings.tables.sample_table import SampleTable


def remove_from_samples(
    samples: Samples, model: ExtendedModel, axles: int, left_out: Counter[str]
) -> tuple[Samples, float]:
    """Samples of recordings without the model's effects, and their mean factor.

    Args:
        samples: Samples in the order of their stamps, formed with the model's instruments.
        model: Extended model.
        axles: Number of axles of the vehicle.
        left_out: Number of samples to which the model could not be applied, by reason; added to.

    """
    result = correct_samples(samples, model, axles)
    left_out.update(result.left_out)
    return result.samples, mean_factor(samples.select(result.kept), result.samples)


def remove_from_table(
    table: SampleTable, model: ExtendedModel, where: str, left_out: Counter[str]
) -> tuple[SampleTable, float]:
    """Rows of a table without the model's effects, and their mean factor: a drive of its own.

    Args:
        table: Table as read from its file.
        model: Extended model.
        where: Name of the table, for errors.
        left_out: Number of rows to which the model could not be applied, by reason; added to.

    Raises:
        InputError: The table lacks a column that the model needs.

    """
    require_columns(model, table.samples, where)
    samples = remove_instrument_errors(table.samples, model.instruments, where)
    axles = int(samples.axle.max(initial=1))
    result = correct_samples(samples, model, axles)
    left_out.update(result.left_out)
    segment = None if table.segment is None else table.segment[result.kept]
    factor = mean_factor(samples.select(result.kept), result.samples)
    return replace(table, samples=result.samples, segment=segment), factor
