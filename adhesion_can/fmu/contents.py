"""What an FMU holds beside its library, written and read: the files of its resources.

    fmu.toml       kind, version of adhesion-can, GUID
    config.toml    the configuration, where one was given
    database.*     the database, with the suffix of its format
    model.toml     the extended model, where one was given
    python.txt     interpreter of the export, tried first

All but the last are read by the process of the FMU.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

from adhesion_can.config import Configuration, load_configuration
from adhesion_can.config.model_file import read_model
from adhesion_can.config.toml_tables import load_toml, reject_unknown_keys, typed
from adhesion_can.config.toml_text import quoted
from adhesion_can.errors import InputError
from adhesion_can.fmu.controller import ControllerSlave
from adhesion_can.fmu.locomotive import LocomotiveSlave
from adhesion_can.fmu.service import ServiceSlave
from adhesion_can.fmu.slave import Slave
from adhesion_can.version import __version__

Kind = Literal["service", "locomotive", "controller"]
KINDS: tuple[Kind, ...] = get_args(Kind)
SLAVES: Mapping[Kind, Callable[[Configuration], Slave]] = {
    "service": ServiceSlave,
    "locomotive": LocomotiveSlave,
    "controller": ControllerSlave,
}
"""Maker of the slave of each kind."""
FMU, CONFIG, DATABASE, MODEL, PYTHON = (
    "fmu.toml", "config.toml", "database", "model.toml", "python.txt",
)  # fmt: skip
"""Names in the resources; that of the database has the suffix of its format besides."""
_AGAIN = "export the FMU again with the adhesion-can that is installed"


@dataclass(frozen=True)
class FmuContents:
    """What makes an FMU.

    Attributes:
        kind: What it is.
        configuration: Vehicle, database, roles, settings and extended model.
        config_file: File of the configuration; None: the defaults.
        model_file: File of the extended model; None: there is none.
        integers: Whether enumerations are shown as Integers.
        lenient: Whether faulty messages of the database are left out.

    """

    kind: Kind
    configuration: Configuration
    config_file: Path | None = None
    model_file: Path | None = None
    integers: bool = False
    lenient: bool = False

    def make_slave(self) -> Slave:
        """A slave of the kind.

        Raises:
            InputError: The configuration does not suffice, or the kind has no use for a model.

        """
        if self.kind == "controller" and self.configuration.model is not None:
            raise InputError("--model", "the controller uses no model", "leave --model out")
        return SLAVES[self.kind](self.configuration)

    def resources(self, guid: str, python: str) -> dict[str, bytes]:
        """Files of the resources by name.

        Args:
            guid: GUID of the description.
            python: Path of the interpreter to try first.

        """
        database = self.configuration.database.path
        lines = [
            f"kind = {quoted(self.kind)}",
            f"version = {quoted(__version__)}",
            f"guid = {quoted(guid)}",
            f"lenient = {str(self.lenient).lower()}",
        ]
        files = {
            FMU: ("\n".join(lines) + "\n").encode(),
            DATABASE + database.suffix: database.read_bytes(),
            PYTHON: f"{python}\n".encode(),
        }
        if self.config_file is not None:
            files[CONFIG] = self.config_file.read_bytes()
        if self.model_file is not None:
            files[MODEL] = self.model_file.read_bytes()
        return files


def read_contents(folder: Path) -> tuple[FmuContents, str]:
    """Contents and GUID of the FMU whose resources are in a folder.

    Raises:
        InputError: A file is missing or wrong, or of another version of adhesion-can.

    """
    document, _ = load_toml(folder / FMU)
    reject_unknown_keys(document, FMU, ("kind", "version", "guid", "lenient"))
    values = {}
    for key in ("kind", "version", "guid"):
        if key not in document:
            raise InputError(f"{FMU}: {key}", "missing", _AGAIN)
        values[key] = typed(document[key], str, f"{FMU}: {key}")
    if values["version"] != __version__:
        here = f"{__version__} is installed for {sys.executable}"
        what = f"exported by adhesion-can {values['version']}, and {here}"
        raise InputError("this FMU", what, f"{_AGAIN}, or install that version")
    kind = next((known for known in KINDS if known == values["kind"]), None)
    databases = sorted(folder.glob(f"{DATABASE}.*"))
    if kind is None or len(databases) != 1:
        raise InputError(str(folder), "not the resources of an FMU of this package", _AGAIN)
    config = folder / CONFIG if (folder / CONFIG).exists() else None
    model = folder / MODEL if (folder / MODEL).exists() else None
    lenient = typed(document.get("lenient", False), bool, f"{FMU}: lenient")
    configuration = load_configuration(config, databases[0], lenient=lenient)
    if model is not None:
        configuration = replace(configuration, model=read_model(model))
    contents = FmuContents(kind, configuration, config, model, lenient=lenient)
    return contents, values["guid"]
