"""What the user typed, for the line with the step that follows."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from adhesion_can.cli.common import own_command
from adhesion_can.reporting.next_steps.next_step import Typed


def typed_words(
    options: argparse.Namespace, inputs: Sequence[Path], *, tables: bool = False
) -> Typed:
    """What the user typed, from which the next command is made.

    Args:
        options: Options of the command.
        inputs: Recordings or tables, one at least.
        tables: Whether they are tables.

    """
    configuration = []
    for name in ("config", "dbc"):
        path = getattr(options, name, None)
        if path is not None:
            configuration += [f"--{name}", str(path)]
    if getattr(options, "lenient", False):
        configuration.append("--lenient")
    columns = [word for text in getattr(options, "column", ()) for word in ("--column", text)]
    assume = getattr(options, "assume", None)
    if assume is not None:
        columns += ["--assume", assume]
    return Typed(
        inputs=tuple(inputs),
        tables=tables,
        program=own_command(),
        configuration=tuple(configuration),
        columns=tuple(columns),
        formulas=tuple(getattr(options, "formula", ())),
        holdout=tuple(getattr(options, "holdout", ())),
        model=getattr(options, "model", None),
        outputs={
            one.option: Path(value)
            for one in options.outputs
            if one.is_file and (value := one.value(options)) not in (None, "-")
        },
    )
