"""Diagnoses and models that tests make by hand."""

import numpy as np

from adhesion_can.diagnosis.cause_result import Cause, ParameterValue
from adhesion_can.diagnosis.result import Diagnosis, Verdict
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.effects import ActiveEffect, forms_of_effect

BASE = (0.35, 40.0, 0.3)


def cause(effect="speed_scale", values=(-0.01,), stds=(0.0005,), form="", **more):
    """A cause with its parameters in the order of the effect's."""
    known = next(one for one in forms_of_effect(effect) if one.form == form)
    parameters = tuple(
        ParameterValue(p.name, value, std, p.unit, p.meaning)
        for p, value, std in zip(known.parameters, values, stds, strict=True)
    )
    more = {"p_value": 1e-4, "rivals": (), **more}
    return Cause(effect, form, known.title, "", parameters, **more)


def model(*causes):
    """Extended model with the effects of causes."""
    covariances = tuple(map(covariance, causes))
    return ExtendedModel(BASE, effects=tuple(map(active, causes)), covariances=covariances)


def covariance(one):
    """Covariance of a cause's parameters; None where a standard deviation is not known."""
    stds = [value.std for value in one.parameters]
    if None in stds:
        return None
    return tuple(tuple(row) for row in np.diag(np.square(stds)).tolist())


def active(one):
    known = next(own for own in forms_of_effect(one.effect) if own.form == one.form)
    return ActiveEffect(known, tuple(value.value for value in one.parameters))


def diagnosis(*causes, verdict=Verdict.NAMED):
    """A diagnosis that names causes; none: it found nothing."""
    if not causes:
        return Diagnosis(verdict=Verdict.NOTHING, model=ExtendedModel(BASE))
    return Diagnosis(verdict=verdict, causes=causes, model=model(*causes))
