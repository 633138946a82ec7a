"""An FMU as a file: description, libraries and resources in one archive.

The same contents give the same bytes, on any day.
"""

import io
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from adhesion_can.files import whole_file
from adhesion_can.fmu.contents import FmuContents
from adhesion_can.fmu.description import describe, model_identifier
from adhesion_can.fmu.library import PLATFORMS, build_library
from adhesion_can.fmu.slave import Slave
from adhesion_can.fmu.variables import with_integers
from adhesion_can.input_files import file_sha256
from adhesion_can.simulation.run import STEP_US

_DAY = (1980, 1, 1, 0, 0, 0)
"""Time of every entry: the first that the format has."""


def export_fmu(
    contents: FmuContents,
    path: Path,
    platforms: Iterable[str],
    compiled: Callable[[float], None] | None = None,
) -> None:
    """Write an FMU, whole or not at all.

    Args:
        contents: Kind, configuration and model.
        path: File to write.
        platforms: Names of the platforms, keys of `PLATFORMS`.
        compiled: Callback with the number of platforms that there is a library for.

    Raises:
        InputError: The slave cannot be made of the configuration, a library cannot be compiled, or
            the file cannot be written.

    """
    slave = contents.make_slave()
    description, guid = describe_contents(contents, slave)
    files = {"modelDescription.xml": description.encode()}
    identifier = model_identifier(contents.kind)
    for number, name in enumerate(platforms, 1):
        suffix = PLATFORMS[name].suffix
        files[f"binaries/{name}/{identifier}{suffix}"] = build_library(name)
        if compiled is not None:
            compiled(number)
    for name, data in contents.resources(guid, sys.executable).items():
        files[f"resources/{name}"] = data
    archive = io.BytesIO()
    with ZipFile(archive, "w", ZIP_DEFLATED) as file:
        for name, data in files.items():
            entry = ZipInfo(name, _DAY)
            entry.compress_type = ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            file.writestr(entry, data)
    with whole_file(path, "wb") as out:
        out.write(archive.getvalue())


def describe_contents(contents: FmuContents, slave: Slave) -> tuple[str, str]:
    """Description of an FMU, and its GUID.

    Args:
        contents: Kind, configuration and model.
        slave: Slave that was made of them.

    """
    variables = with_integers(slave.variables) if contents.integers else slave.variables
    database = contents.configuration.database
    origin = {"database": database.sha256}
    for name, file in (("config", contents.config_file), ("model", contents.model_file)):
        if file is not None:
            origin[name] = file_sha256(file)
    cycles = [variable.start for variable in variables if variable.name.startswith("cycle")]
    return describe(contents.kind, variables, min(cycles, default=STEP_US / 1e6), origin)
