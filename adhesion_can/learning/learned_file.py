"""The file of a learned model, with its validity in `[provenance]`."""

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from math import sqrt
from pathlib import Path

from adhesion_can.config.model_file import model_text, read_model
from adhesion_can.errors import InputError
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.files import whole_file
from adhesion_can.learning.confirmation import SPAN_S, LearningState, ModelConfirmation
from adhesion_can.learning.proposal import LearnedModel
from adhesion_can.learning.report import LearnedCause
from adhesion_can.version import __version__

_PREFIX = "learned-"


def learned_path(folder: Path, learned: LearnedModel) -> Path:
    """Path of a model's file: one for each set of causes, which a later model replaces."""
    return folder / f"{_PREFIX}{learned.name.replace(':', '-')}.toml"


def write_learned(
    folder: Path, learned: LearnedModel, confirmation: ModelConfirmation, vehicle: str
) -> Path:
    """Write a learned model for `--model`, with its state; returns the path.

    Args:
        folder: Folder of the file.
        learned: Model with its causes.
        confirmation: What fresh readings have said about it so far.
        vehicle: Fingerprint of the vehicle that it belongs to.

    Raises:
        InputError: The folder does not exist or cannot be written to.

    """
    path = learned_path(folder, learned)
    provenance = {
        "version": __version__,
        "command": "adhesion-can run --learn",
        "state": confirmation.state.value,
        "found": learned.found,
        "record": learned.record,
        "halves": "both halves of the record name each cause with the same size",
        "fresh readings": (
            f"{confirmation.won} of {confirmation.spans} spans of {SPAN_S:g} s were predicted "
            "better than by the plain curve"
        ),
        "checked until": datetime.fromtimestamp(confirmation.checked_us / 1e6, UTC).isoformat(),
        "vehicle": vehicle,
    }
    if confirmation.reason:
        provenance["reason"] = confirmation.reason
    with whole_file(path, durable=True, own_name=True) as file:
        file.write(model_text(replace(learned.model, provenance=provenance)))
    return path


def find_confirmed(
    folder: Path,
    vehicle: str,
    now_us: int,
    most_age_s: float,
    in_use: Collection[str],
    pass_over: Callable[[InputError], None],
) -> LearnedModel | None:
    """The model of an earlier service that was confirmed last; None where there is none.

    Args:
        folder: Folder of the files.
        vehicle: Fingerprint of the vehicle that asks for it.
        now_us: Present time, µs.
        most_age_s: Largest time since readings last bore it out, s.
        in_use: Names of effects; a model of these alone is none.
        pass_over: Callback with what is wrong with each file that cannot be read.

    """
    known: list[tuple[float, LearnedModel]] = []
    for path in sorted(folder.glob(f"{_PREFIX}*.toml")):
        try:
            model = read_model(path)
            until_us = _checked_until_us(path, model, vehicle)
        except InputError as error:
            pass_over(error)
            continue
        if until_us is None or now_us - until_us > most_age_s * 1e6:
            continue
        if not set(in_use).issuperset(model.names):
            known.append((until_us, _from_file(path, model)))
    return max(known, key=lambda dated_model: dated_model[0])[1] if known else None


def _checked_until_us(path: Path, model: ExtendedModel, vehicle: str) -> float | None:
    """Time up to which readings bore a model out, µs; None where it is not confirmed for a vehicle.

    Raises:
        InputError: The file says no such time.

    """
    told = model.provenance
    if told.get("state") != LearningState.CONFIRMED or told.get("vehicle") != vehicle:
        return None
    until = told.get("checked until", "")
    try:
        return datetime.fromisoformat(until).timestamp() * 1e6
    except ValueError:
        raise InputError(
            f"{path}: provenance",
            f"'checked until' is not a time: {until!r}",
            "remove the file; the model is learned again",
        ) from None


def _from_file(path: Path, model: ExtendedModel) -> LearnedModel:
    told = model.provenance
    name = path.stem.removeprefix(_PREFIX)
    return LearnedModel(
        name,
        told.get("found", name),
        tuple(_sizes(model)),
        replace(model, provenance={}),
        told.get("record", "unknown"),
    )


def _sizes(model: ExtendedModel) -> Iterator[LearnedCause]:
    """First parameter of each effect."""
    covariances = model.covariances or (None,) * len(model.effects)
    for active, covariance in zip(model.effects, covariances, strict=True):
        std = None if covariance is None else sqrt(covariance[0][0])
        unit = active.effect.parameters[0].unit
        yield LearnedCause(active.effect.id, active.values[0], std, unit)
