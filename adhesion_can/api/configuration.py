"""Configurations and extended models from files or objects."""

from dataclasses import replace
from pathlib import Path

from adhesion_can.config.configuration import Configuration
from adhesion_can.config.decimal_comma import decimal_commas_named
from adhesion_can.config.load import load_configuration as _load_file
from adhesion_can.config.model_file import read_model
from adhesion_can.estimation.extended.model import ExtendedModel

ConfigurationLike = Configuration | str | Path | None
"""Configuration, path of a TOML file, or None for the defaults on the package's own database."""
ModelLike = ExtendedModel | str | Path | None
"""Extended model, path of its file, or None for the plain curve."""


def load_configuration(
    path: str | Path | None = None, dbc: str | Path | None = None, model: ModelLike = None
) -> Configuration:
    """Configuration from a TOML file.

    Args:
        path: Path of the TOML file; None for the defaults.
        dbc: Path of the CAN database, in place of the one that the file names.
        model: Extended model, whose effects are taken into account.

    Raises:
        ConfigError: The file cannot be read, or holds an unknown key or a wrong value.
        DatabaseError: The database is missing or broken, or lacks a signal.

    Examples:
        >>> load_configuration().vehicle.axles
        6

    """
    file = None if path is None else Path(path)
    with decimal_commas_named(file):
        configuration = _load_file(file, None if dbc is None else Path(dbc))
    return _with_model(configuration, model)


def as_configuration(configuration: ConfigurationLike, model: ModelLike = None) -> Configuration:
    """Configuration from what a caller gave, with an extended model where one is given."""
    if not isinstance(configuration, Configuration):
        return load_configuration(configuration, model=model)
    return _with_model(configuration, model)


def _with_model(configuration: Configuration, model: ModelLike) -> Configuration:
    """Configuration with an extended model; unchanged where none is given."""
    if model is None:
        return configuration
    extended = model if isinstance(model, ExtendedModel) else read_model(Path(model))
    return replace(configuration, model=extended)
