"""Evaluation of an extended model on recordings or tables."""

from collections.abc import Iterable, Sequence

from adhesion_can.api.configuration import ConfigurationLike, ModelLike, as_configuration
from adhesion_can.api.diagnosis import LoadedInput, list_input_files, load_inputs, require_rows
from adhesion_can.api.inputs import RecordingLike, as_paths
from adhesion_can.config.configuration import Configuration
from adhesion_can.diagnosis.evaluate import Evaluation
from adhesion_can.diagnosis.evaluate import evaluate as _evaluate
from adhesion_can.errors import InputError


def evaluate(
    inputs: RecordingLike | Iterable[RecordingLike],
    model: ModelLike,
    *,
    configuration: ConfigurationLike = None,
) -> Evaluation:
    """A model as written, and with its curves refitted, beside the plain curve.

    Args:
        inputs: Recordings, or paths of recordings or of tables.
        model: Extended model, or path of its file.
        configuration: Vehicle, database, roles and settings.

    Raises:
        InputError: A file is missing, not one row is usable, or an effect of the model needs what
            the data do not have.
        ConfigError: The roles do not suffice to form adhesion, or the model cannot be read.

    """
    config = as_configuration(configuration, model)
    files = list_input_files(as_paths(inputs), columns=config.columns)
    return evaluate_inputs(load_inputs(files, config, lambda _work, _share: None), config)


def evaluate_inputs(loaded: Sequence[LoadedInput], config: Configuration) -> Evaluation:
    """Evaluation on loaded inputs.

    Raises:
        InputError: There is no model, not one row is usable, or an effect cannot be applied.

    """
    if config.model is None:
        raise InputError("model", "no model is given", "give a model or the path of its file")
    require_rows(loaded)
    return _evaluate([read.drive for read in loaded], config.model)
