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
    return Typed(
        inputs=tuple(inputs),
        tables=tables,
        program=own_command(),
        configuration=configuration_words(options),
        columns=column_words(options),
        formulas=tuple(getattr(options, "formula", ())),
        holdout=tuple(getattr(options, "holdout", ())),
        model=getattr(options, "model", None),
        outputs={
            output.option: Path(value)
            for output in options.outputs
            if output.is_file and (value := output.value(options)) not in (None, "-")
        },
    )


def configuration_words(options: argparse.Namespace) -> tuple[str, ...]:
    """Options that name configuration and database, with their values."""
    named = {name: getattr(options, name, None) for name in ("config", "dbc")}
    words = (word for name, path in named.items() if path for word in (f"--{name}", str(path)))
    return (*words, *(["--lenient"] if getattr(options, "lenient", False) else []))


def column_words(options: argparse.Namespace) -> tuple[str, ...]:
    """Options that say what the columns of a table are, with their values."""
    columns = (word for text in getattr(options, "column", ()) for word in ("--column", text))
    assume = getattr(options, "assume", None)
    return (*columns, *([] if assume is None else ["--assume", assume]))
