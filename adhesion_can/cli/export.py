"""`export`: service, locomotive or creep controller as an FMU."""

import argparse
import sys
from pathlib import Path

from adhesion_can.cli.common import add_configuration, add_model, configuration, progress
from adhesion_can.cli.outputs import require_outputs
from adhesion_can.errors import InputError
from adhesion_can.fmu.contents import KINDS, FmuContents
from adhesion_can.fmu.export import export_fmu
from adhesion_can.fmu.library import PLATFORMS, possible_platforms
from adhesion_can.printable import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Writes an FMU (FMI 2.0, co-simulation). The machine that runs it needs Python with this "
        "version of adhesion-can: the FMU starts it as a process of its own. "
        "ADHESION_CAN_PYTHON names its interpreter there."
    )
    parser.add_argument("--fmu", required=True, choices=KINDS, help="part of the bench")
    parser.add_argument("out", type=Path, metavar="OUT.fmu", help="file to write")
    add_model(
        parser,
        "the service removes its effects from the readings, the locomotive has them; the "
        "controller takes none",
    )
    parser.add_argument(
        "--integers",
        action="store_true",
        help="status, doubt and other enumerations as Integers, for masters that skip enumerations",
    )
    parser.add_argument(
        "--platform",
        action="append",
        choices=tuple(PLATFORMS),
        help="platform to compile for; may be repeated (default: every one that can be)",
    )
    add_configuration(parser)
    parser.set_defaults(outputs=())


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    config = configuration(options)
    outputs = {"OUT.fmu": options.out}
    require_outputs(options, [config.database.path], own=outputs)
    if options.out.suffix != ".fmu":
        what = "has no suffix .fmu, by which tools know the format"
        raise InputError(str(options.out), what, f"write {options.out.with_suffix('.fmu')}")
    platforms = list(dict.fromkeys(options.platform or possible_platforms()))
    contents = FmuContents(
        options.fmu,
        config,
        config_file=options.config,
        model_file=options.model,
        integers=options.integers,
        lenient=options.lenient,
    )
    with progress("compiling", len(platforms), "platforms") as compiled:
        export_fmu(contents, options.out, platforms, compiled)
    say(f"{options.out}: {options.fmu} for {', '.join(platforms)}", sys.stdout)
    return 0
