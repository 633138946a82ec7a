"""The file of an extended model, `model.toml`: written and read without losing a digit.

[base]                      # c1, c2, c3; covariance
[curve]                     # family, covariance, peak_std, where the base curve is not Burckhardt's
[curve.parameters]          # its numbers by name
[[effect]]                  # id, form or expression, covariance; its numbers by name below; for an
                            # expression also acts_on: "adhesion", "speed" or "effort"
[effect.parameters]
[[spline]]                  # channel, kind, knots, coefficients
[provenance]                # texts
"""

import re
import tomllib
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from adhesion_can.config.toml_tables import (
    array_of_tables,
    load_toml,
    reject_unknown_keys,
    section_with,
    table_of,
    typed,
)
from adhesion_can.config.toml_text import quoted, toml_value
from adhesion_can.errors import ConfigError
from adhesion_can.estimation.extended.model import (
    BaseCurve,
    ExtendedModel,
    Matrix,
    require_covariance,
    require_value,
)
from adhesion_can.files import whole_file
from adhesion_can.physics.curves import FAMILIES
from adhesion_can.physics.effects import (
    ActiveEffect,
    Effect,
    Parameter,
    forms_of_effect,
    known_effects,
)
from adhesion_can.physics.effects.empirical import Empirical
from adhesion_can.physics.effects.expression import ExpressionError
from adhesion_can.physics.effects.formula import (
    ADHESION,
    FORMULA,
    READINGS,
    AnyFormula,
    ReadingFormula,
    formula_of,
)

_KEYS = ("base", "curve", "effect", "spline", "provenance")
_CURVE_KEYS = ("family", "parameters", "covariance", "peak_std")
_EFFECT_KEYS = ("id", "form", "expression", "acts_on", "parameters", "covariance")
_SPLINE_KEYS = ("channel", "kind", "knots", "coefficients")
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
    document, digest = load_toml(path)
    return replace(_model(document, path.name), where=str(path), sha256=digest)


def parse_model(text: str, where: str) -> ExtendedModel:
    """Extended model from the text of its file.

    Args:
        text: Text that `model_text` made.
        where: Place of the text, for errors.

    Raises:
        ConfigError: It is not TOML, or has unknown keys or wrong values.

    """
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigError(where, f"not TOML ({error})", "correct the line that is named") from error
    return replace(_model(document, where), where=where, sha256=sha256(text.encode()).hexdigest())


def _model(document: dict[str, Any], where: str) -> ExtendedModel:
    if "base" not in document:
        raise ConfigError(where, "no [base]", "write the base curve's c1, c2 and c3 below it")
    base = section_with(_Base, document.pop("base"), f"{where}: base", ("c1", "c2", "c3"))
    pairs = [_effect(t, w) for t, w in array_of_tables(document.pop("effect", []), where, "effect")]
    curve = _curve(document.pop("curve"), f"{where}: curve") if "curve" in document else None
    splines = [
        section_with(Empirical, t, w, _SPLINE_KEYS)
        for t, w in array_of_tables(document.pop("spline", []), where, "spline")
    ]
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
            curve=curve,
            provenance=texts,
        )
    except ValueError as error:
        raise ConfigError(where, str(error), "correct the value") from error


def _effect(table: dict[str, Any], where: str) -> tuple[ActiveEffect, Matrix | None]:
    reject_unknown_keys(table, where, _EFFECT_KEYS)
    effect = _definition(table, where)
    values = _values(table, effect.parameters, f"{where}.parameters")
    covariance = _covariance(table, len(values), f"{where}.covariance")
    return ActiveEffect(effect, values), covariance


def _curve(value: object, where: str) -> BaseCurve:
    """Base curve of another family than Burckhardt's."""
    table = table_of(value, where)
    reject_unknown_keys(table, where, _CURVE_KEYS)
    if "family" not in table:
        raise ConfigError(f"{where}.family", "missing", "write the name of the curve family")
    name = typed(table["family"], str, f"{where}.family")
    if name not in FAMILIES:
        raise ConfigError(
            f"{where}.family", f"no curve family {name!r}", f"known: {', '.join(FAMILIES)}"
        )
    values = _values(table, FAMILIES[name].parameters, f"{where}.parameters")
    covariance = _covariance(table, len(values), f"{where}.covariance")
    return BaseCurve(FAMILIES[name], values, covariance, _peak_std(table, f"{where}.peak_std"))


def _peak_std(table: dict[str, Any], where: str) -> tuple[float, float]:
    """Relative standard deviations of μ_max and λ_m by the form; 0 where they are left out."""
    match table.get("peak_std", [0.0, 0.0]):
        case [int() | float() as mu_max, int() | float() as lambda_m]:
            return float(mu_max), float(lambda_m)
    raise ConfigError(where, "not two numbers", "write [of mu_max, of lambda_m], relative")


def _values(
    table: dict[str, Any], parameters: tuple[Parameter, ...], place: str
) -> tuple[float, ...]:
    """Numbers by name, each within its bounds."""
    given = table_of(table.get("parameters", {}), place)
    values = []
    for parameter in parameters:
        key = f"{place}.{parameter.name}"
        if parameter.name not in given:
            raise ConfigError(key, "missing", f"write {parameter.meaning}, {parameter.unit}")
        value = typed(given.pop(parameter.name), float, key)
        try:
            require_value(parameter, value, parameter.name)
        except ValueError as error:
            raise ConfigError(key, str(error), "correct the value") from error
        values.append(value)
    reject_unknown_keys(given, place, tuple(p.name for p in parameters))
    return tuple(values)


def _covariance(table: dict[str, Any], size: int, key: str) -> Matrix | None:
    """Covariance of so many numbers; None where the table has none."""
    if "covariance" not in table:
        return None
    covariance: Matrix = typed(table["covariance"], _MATRIX, key)
    try:
        require_covariance(covariance, size)
    except ValueError as error:
        raise ConfigError(key, str(error), "write it row by row") from error
    return covariance


def _definition(table: dict[str, Any], where: str) -> Effect:
    if "id" not in table:
        raise ConfigError(f"{where}.id", "missing", "write the id of the effect")
    name = typed(table["id"], str, f"{where}.id")
    form = typed(table.get("form", ""), str, f"{where}.form")
    if name == FORMULA:
        return _formula(table, where)
    for key in ("expression", "acts_on"):
        if key in table:
            raise ConfigError(
                f"{where}.{key}",
                f"{name} takes none",
                f"write id = {quoted(FORMULA)}, or remove this key",
            )
    forms = forms_of_effect(name)
    if not forms:
        known = ", ".join((*dict.fromkeys(effect.id for effect in known_effects()), FORMULA))
        raise ConfigError(f"{where}.id", f"no effect {name!r}", f"known: {known}")
    for effect in forms:
        if effect.form == form:
            return effect
    known = ", ".join(repr(effect.form) for effect in forms)
    raise ConfigError(f"{where}.form", f"{name} has no form {form!r}", f"known: {known}")


def _formula(table: dict[str, Any], where: str) -> AnyFormula:
    """Formula with the names of the constants under `parameters`."""
    key = f"{where}.expression"
    fix = "write the factor of the adhesion, as '1 + a * max(wind - b, 0)'"
    if "expression" not in table:
        raise ConfigError(key, "missing", fix)
    expression = typed(table["expression"], str, key)
    acts_on = typed(table.get("acts_on", ADHESION), str, f"{where}.acts_on")
    if acts_on not in (ADHESION, *READINGS):
        known = ", ".join((ADHESION, *READINGS))
        raise ConfigError(f"{where}.acts_on", f"not known: {acts_on!r}", f"known: {known}")
    given = table_of(table.get("parameters", {}), f"{where}.parameters")
    constants = {
        name: typed(value, float, f"{where}.parameters.{name}") for name, value in given.items()
    }
    try:
        return formula_of(expression, constants, acts_on)
    except ExpressionError as error:
        raise ConfigError(key, str(error), fix) from error


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
        "# Extended model of adhesion-can: pass it to run, replay or identify with --model.",
        "",
    ]
    c1, c2, c3 = map(toml_value, model.base)
    lines += ["[base]", f"c1 = {c1}", f"c2 = {c2}", f"c3 = {c3}", *_matrix(model.base_covariance)]
    lines += _curve_lines(model.curve)
    for active, covariance in zip(model.effects, model.covariances, strict=True):
        effect = active.effect
        lines += ["", "[[effect]]", _comment(effect.title), f"id = {quoted(effect.id)}"]
        if effect.form:
            key = "expression" if effect.id == FORMULA else "form"
            lines.append(f"{key} = {quoted(effect.form)}")
        if isinstance(effect, ReadingFormula):
            lines.append(f"acts_on = {quoted(effect.acts_on)}")
        lines += [*_matrix(covariance), "[effect.parameters]"]
        lines += _parameters(effect.parameters, active.values)
    for spline in model.splines:
        lines += [
            "",
            "[[spline]]",
            "# adhesion over a channel as observed; no known effect describes it",
        ]
        lines += [f"{key} = {toml_value(getattr(spline, key))}" for key in _SPLINE_KEYS]
    if model.provenance:
        lines += ["", "[provenance]"]
        lines += [f"{quoted(key)} = {quoted(value)}" for key, value in model.provenance.items()]
    return "\n".join(lines) + "\n"


def _curve_lines(curve: BaseCurve | None) -> list[str]:
    """Lines of a base curve of another family; none for Burckhardt's."""
    if curve is None:
        return []
    family = curve.family
    lines = ["", "[curve]", f"# {family.title}; c1, c2, c3 above: the nearest Burckhardt curve"]
    lines += [f"family = {quoted(family.name)}", *_matrix(curve.covariance)]
    if any(curve.peak_std):
        where = "of mu_max and lambda_m, from the uncertain form"
        lines.append(f"peak_std = {toml_value(curve.peak_std)}  # {where}")
    return [*lines, "[curve.parameters]", *_parameters(family.parameters, curve.values)]


def _comment(text: str) -> str:
    """A line of comment; TOML allows no control character in it, and a line break would end it."""
    return "# " + "".join(c if c.isprintable() else " " for c in text)


def _key(name: str) -> str:
    """A key, in quotes where TOML wants them: a constant's name may have other letters."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else quoted(name)


def _matrix(matrix: Matrix | None) -> list[str]:
    return [] if matrix is None else [f"covariance = {toml_value(matrix)}"]


def _parameters(parameters: tuple[Parameter, ...], values: tuple[float, ...]) -> list[str]:
    return [
        f"{_key(p.name)} = {toml_value(value)}  # {p.unit and p.unit + '; '}{p.meaning}"
        for p, value in zip(parameters, values, strict=True)
    ]
