"""The file of a learned model, with its validity in `[provenance]`."""

from dataclasses import replace
from pathlib import Path

from adhesion_can.config.model_file import model_text
from adhesion_can.files import whole_file
from adhesion_can.learning.confirmation import SPAN_S, ModelConfirmation
from adhesion_can.learning.proposal import LearnedModel
from adhesion_can.learning.sentences import describe_causes
from adhesion_can.result_text import TimeScale
from adhesion_can.version import __version__


def learned_path(folder: Path, learned: LearnedModel) -> Path:
    """Path of a model's file: one for each set of causes, which a later model replaces."""
    return folder / f"learned-{learned.name.replace(':', '-')}.toml"


def write_learned(folder: Path, learned: LearnedModel, confirmation: ModelConfirmation) -> Path:
    """Write a learned model for `--model`, with its state; returns the path.

    Args:
        folder: Folder of the file.
        learned: Model with its causes.
        confirmation: What fresh readings have said about it so far.

    Raises:
        InputError: The folder does not exist or cannot be written to.

    """
    path = learned_path(folder, learned)
    provenance = {
        "version": __version__,
        "command": "adhesion-can run --learn propose",
        **describe_validity(learned, confirmation),
    }
    model = replace(learned.model, provenance=provenance)
    with whole_file(path, durable=True, own_name=True) as file:
        file.write(model_text(model))
    return path


def describe_validity(learned: LearnedModel, confirmation: ModelConfirmation) -> dict[str, str]:
    """State of a learned model, and what it rests on, as texts."""
    told = {
        "state": confirmation.state.value,
        "found": describe_causes(learned.causes),
        "record": _times(learned.from_us, learned.to_us),
        "halves": "both halves of the record name each cause with the same size",
        "fresh readings": (
            f"{confirmation.won} of {confirmation.spans} spans of {SPAN_S:g} s were predicted "
            "better than by the plain curve"
        ),
    }
    return {**told, "reason": confirmation.reason} if confirmation.reason else told


def _times(from_us: int, to_us: int) -> str:
    """Begin and length of a record."""
    begin = TimeScale.beginning_at(from_us).begin or "the start"
    return f"{(to_us - from_us) / 1e6:.0f} s from {begin}"
