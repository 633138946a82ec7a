"""Provenance of results: version and hashes, in every output."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from adhesion_can.bus.database import CanDatabase
from adhesion_can.input_files import file_sha256
from adhesion_can.version import __version__

if TYPE_CHECKING:
    from adhesion_can.config import Configuration


def provenance(configuration: "Configuration", inputs: Sequence[Path] = ()) -> dict[str, Any]:
    """Version, and hashes of inputs, database, configuration and, where one is used, model."""
    origin = provenance_of_database(configuration.database, inputs)
    used = {"path": configuration.where, "sha256": configuration.sha256 or None}
    model = configuration.model
    named = {} if model is None else {"model": {"path": model.where, "sha256": model.sha256}}
    return {**origin, "configuration": used, **named}


def provenance_of_database(database: CanDatabase, inputs: Sequence[Path]) -> dict[str, Any]:
    """Version, and hashes of inputs and database, where nothing is configured."""
    return {
        "version": __version__,
        "inputs": [{"path": str(path), "sha256": file_sha256(path)} for path in inputs],
        "dbc": {"path": database.path.name, "sha256": database.sha256},
        "configuration": {"path": "defaults", "sha256": None},
    }


def texts(origin: Mapping[str, Any]) -> dict[str, str]:
    """Provenance as the metadata of a file; entries without a name are left out."""
    return {
        f"adhesion_can.{key}": value if isinstance(value, str) else json.dumps(value)
        for key, value in origin.items()
        if not isinstance(value, Mapping) or value["sha256"]
    }
