"""The file of an extended model, `model.toml`: written and read without losing a digit.

[base]                      # c1, c2, c3; covariance
[[effect]]                  # id, form, covariance; its numbers by name below
[effect.parameters]
[[spline]]                  # channel, kind, knots, coefficients
[provenance]                # texts
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from adhesion_can.config.toml_tables import load_toml, reject_unknown_keys, section, table_of, typed
from adhesion_can.errors import ConfigError
from adhesion_can.estimation.extended.model import (
    ExtendedModel,
    Matrix,
    require_covariance,
    require_value,
)
from adhesion_can.files import whole_file
from adhesion_can.physics.effects import ActiveEffect, Effect, known_effects
from adhesion_can.physics.effects.empirical import Empirical

_KEYS = ("base", "effect", "spline", "provenance")
_EFFECT_KEYS = ("id", "form", "parameters", "covariance")
_MATRIX = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class _Base:
    """Table `[base]` of the file.

    Attributes:
        c1: Level of the curve, 1.
        c2: Steepness of the curve, 1.
        c3: Fall of the curve beyond its peak, 1.
        covariance: Covariance of (c1, c2, c3), shape (3, 3).

    """

    c1: float
    c2: float
    c3: float
    covariance: _MATRIX | None = None


def read_model(path: Path) -> ExtendedModel:
    """Extended model from a file.

    Raises:
        ConfigError: The file cannot be read, or has unknown keys or wrong values.

    """
    document, sha256 = load_toml(path)
    return replace(_model(document, path.name), where=str(path), sha256=sha256)


def _model(document: dict[str, Any], where: str) -> ExtendedModel:
    if "base" not in document:
        raise ConfigError(where, "no [base]", "write the base curve's c1, c2 and c3 below it")
    base = _stated(_Base, document.pop("base"), f"{where}: base", ("c1", "c2", "c3"))
    pairs = [_effect(t, w) for t, w in _tables(document.pop("effect", []), where, "effect")]
    splines = [_spline(t, w) for t, w in _tables(document.pop("spline", []), where, "spline")]
    provenance = table_of(document.pop("provenance", {}), f"{where}: provenance")
    reject_unknown_keys(document, where, _KEYS)
    texts = {
        key: typed(value, str, f"{where}: provenance.{key}") for key, value in provenance.items()
    }
    try:
        return ExtendedModel(
            base=(base.c1, base.c2, base.c3),
            base_covariance=base.covariance,
            effects=tuple(active for active, _ in pairs),
            covariances=tuple(covariance for _, covariance in pairs),
            splines=tuple(splines),
            provenance=texts,
        )
    except ValueError as error:
        raise ConfigError(where, str(error), "mend the value") from error


def _tables(value: object, where: str, key: str) -> Iterator[tuple[dict[str, Any], str]]:
    """Tables of an array of tables, each with its place for errors: `effect[2]`."""
    if not isinstance(value, list):
        raise ConfigError(f"{where}: {key}", "not a list of tables", f"write [[{key}]] for each")
    for number, table in enumerate(value, start=1):
        place = f"{where}: {key}[{number}]"
        yield table_of(table, place), place


def _stated(kind: type, value: object, where: str, keys: tuple[str, ...]) -> Any:
    """Dataclass from a table in which some keys are required."""
    table = table_of(value, where)
    for key in keys:
        if key not in table:
            raise ConfigError(f"{where}.{key}", "missing", "write it")
    return section(kind, table, where)


def _effect(table: dict[str, Any], where: str) -> tuple[ActiveEffect, Matrix | None]:
    reject_unknown_keys(
        {k: v for k, v in table.items() if k not in _EFFECT_KEYS}, where, _EFFECT_KEYS
    )
    effect = _definition(table, where)
    place = f"{where}.parameters"
    given = table_of(table.get("parameters", {}), place)
    names = tuple(p.name for p in effect.parameters)
    values = []
    for parameter in effect.parameters:
        key = f"{place}.{parameter.name}"
        if parameter.name not in given:
            raise ConfigError(key, "missing", f"write {parameter.meaning}, {parameter.unit}")
        value = typed(given.pop(parameter.name), float, key)
        try:
            require_value(parameter, value, parameter.name)
        except ValueError as error:
            raise ConfigError(key, str(error), "mend the value") from error
        values.append(value)
    reject_unknown_keys(given, place, names)
    covariance = None
    if "covariance" in table:
        key = f"{where}.covariance"
        covariance = typed(table["covariance"], _MATRIX, key)
        try:
            require_covariance(covariance, len(values))
        except ValueError as error:
            raise ConfigError(key, str(error), "write it row by row") from error
    return ActiveEffect(effect, tuple(values)), covariance


def _definition(table: dict[str, Any], where: str) -> Effect:
    if "id" not in table:
        raise ConfigError(f"{where}.id", "missing", "write the id of the effect")
    name = typed(table["id"], str, f"{where}.id")
    form = typed(table.get("form", ""), str, f"{where}.form")
    forms = [effect for effect in known_effects() if effect.id == name]
    if not forms:
        known = ", ".join(dict.fromkeys(effect.id for effect in known_effects()))
        raise ConfigError(f"{where}.id", f"no effect {name!r}", f"known: {known}")
    for effect in forms:
        if effect.form == form:
            return effect
    known = ", ".join(repr(effect.form) for effect in forms)
    raise ConfigError(f"{where}.form", f"{name} has no form {form!r}", f"known: {known}")


def _spline(table: dict[str, Any], where: str) -> Empirical:
    keys = ("channel", "kind", "knots", "coefficients")
    spline: Empirical = _stated(Empirical, table, where, keys)
    return spline


# ------------------------------------------------------------------------------------ writing


def write_model(model: ExtendedModel, path: Path) -> None:
    """Write a model where `read_model` finds it; whole or not at all.

    Raises:
        InputError: The folder does not exist or cannot be written to.

    """
    with whole_file(path) as file:
        file.write(model_text(model))


def model_text(model: ExtendedModel) -> str:
    """Text of a model's file."""
    lines = [
        "# Extended model of adhesion-can: give it to run, replay or identify with --model.",
        "",
    ]
    lines += ["[base]"]
    lines += [
        f"{key} = {_number(v)}" for key, v in zip(("c1", "c2", "c3"), model.base, strict=True)
    ]
    lines += _matrix(model.base_covariance)
    for active, covariance in zip(model.effects, model.covariances, strict=True):
        effect = active.effect
        lines += ["", "[[effect]]", f"# {effect.title}", f"id = {_text(effect.id)}"]
        if effect.form:
            lines.append(f"form = {_text(effect.form)}")
        lines += [*_matrix(covariance), "[effect.parameters]"]
        lines += [
            f"{p.name} = {_number(value)}  # {p.unit}; {p.meaning}"
            for p, value in zip(effect.parameters, active.values, strict=True)
        ]
    for spline in model.splines:
        lines += [
            "",
            "[[spline]]",
            "# adhesion over a channel, as it was seen: no known effect",
        ]
        lines += [f"channel = {_text(spline.channel)}", f"kind = {_text(spline.kind)}"]
        lines += [f"knots = {_list(spline.knots)}", f"coefficients = {_list(spline.coefficients)}"]
    if model.provenance:
        lines += ["", "[provenance]"]
        lines += [f"{_text(key)} = {_text(value)}" for key, value in model.provenance.items()]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    """Number with all its digits."""
    return repr(float(value))


def _list(values: tuple[float, ...]) -> str:
    return f"[{', '.join(map(_number, values))}]"


def _matrix(matrix: Matrix | None) -> list[str]:
    if matrix is None:
        return []
    return [f"covariance = [{', '.join(_list(row) for row in matrix)}]"]


def _text(text: str) -> str:
    """A TOML string; a character that UTF-8 does not have is written as its number."""
    valid = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return json.dumps(valid, ensure_ascii=False).replace("\x7f", "\\u007f")
