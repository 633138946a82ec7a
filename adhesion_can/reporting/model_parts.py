"""Parts of a page that describe an extended model."""

from collections.abc import Collection

from adhesion_can.diagnosis.formatting import effect_name, measured, short
from adhesion_can.estimation.extended.model import BaseCurve, ExtendedModel
from adhesion_can.physics.channels import channel_label
from adhesion_can.physics.effects import ActiveEffect
from adhesion_can.physics.effects.empirical import Empirical
from adhesion_can.physics.parameter import Parameter
from adhesion_can.reporting.page import Items, Part, Table, Text


def model_parts(model: ExtendedModel, named: Collection[str]) -> list[Part]:
    """Text and tables that describe an extended model, without what is said of named effects.

    Args:
        model: Extended model.
        named: Ids of the effects that the page describes elsewhere.

    """
    c1, c2, c3 = model.base
    parts: list[Part] = []
    if model.curve is not None:
        parts.append(_curve_table(model.curve))
    which = "Base curve" if model.curve is None else "Burckhardt curve nearest to the base curve"
    text = f"{which}: c1 = {c1:.4f}, c2 = {c2:.2f}, c3 = {c3:.4f}."
    if model.effects:
        effects = ", ".join(_name(active) for active in model.effects)
        text += (
            f" Effects in the order in which they are applied: {effects}. Errors of sensors and "
            "vehicle data come first, then changes of the slip, then factors of the adhesion."
        )
    parts.append(Text(text))
    others = [active for active in model.effects if active.effect.id not in named]
    rows = []
    for active in others:
        stds = model.covariance_of(active).diagonal() ** 0.5
        for p, value, std in zip(active.effect.parameters, active.values, stds, strict=True):
            cells = (_name(active), p.name, _cell(p, value, float(std)), p.meaning)
            rows.append(cells)
    if rows:
        columns = ("effect", "parameter", "value", "meaning")
        caption = "Effects of the extended model that are not named, ± standard deviation."
        parts.append(Table(caption, columns, rows, sentence_columns=(3,)))
        parts.append(Items([f"{_name(a)}: {a.effect.title}." for a in others]))
    parts += [Text(_spline(spline)) for spline in model.splines]
    return parts


def _curve_table(curve: BaseCurve) -> Table:
    """Base curve of another family than Burckhardt's."""
    stds = (0.0,) * len(curve.values)
    if curve.covariance is not None:
        stds = tuple(row[i] ** 0.5 for i, row in enumerate(curve.covariance))
    rows = [
        (p.name, _cell(p, value, std), p.meaning)
        for p, value, std in zip(curve.family.parameters, curve.values, stds, strict=True)
    ]
    caption = f"Base curve: {curve.family.title} ({curve.family.literature}), ± standard deviation."
    return Table(caption, ("parameter", "value", "meaning"), rows, sentence_columns=(2,))


def _name(active: ActiveEffect) -> str:
    return effect_name(active.effect.id, active.effect.form)


def _cell(parameter: Parameter, value: float, std: float) -> str:
    known = None if parameter.axle or std == 0.0 else std
    return measured(value, known, parameter.unit)


def _spline(spline: Empirical) -> str:
    low, high = spline.knots[0], spline.knots[-1]
    return (
        f"Empirical: a curve over {channel_label(spline.channel)} multiplies the adhesion, a "
        f"cubic spline with {len(spline.coefficients)} coefficients from {short(low)} to "
        f"{short(high)}. It describes the data without an explanation; beyond this range it "
        "keeps its last value."
    )
