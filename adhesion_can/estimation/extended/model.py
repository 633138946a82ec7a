"""The extended model: a base curve, and effects with their values on top of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf, isfinite
from operator import gt
from types import MappingProxyType
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.curves import CurveFamily
from adhesion_can.physics.effects import ActiveEffect, Parameter, acts_in_contact, build_instruments
from adhesion_can.physics.effects.empirical import Empirical
from adhesion_can.physics.effects.shape_factor import CURVE_SHAPE, CurveShape
from adhesion_can.physics.instruments import Instruments
from adhesion_can.result_text import html_table

Matrix = tuple[tuple[float, ...], ...]

LARGEST_BASE = (10.0, 1e5, 1e3)
"""Largest c1, c2 and c3 of a base curve: tyres reach c1 = 1.5, the stiffest contacts c2 = 1000."""

_NOTHING: Mapping[str, str] = MappingProxyType({})


def _require_base(base: CurveParameters) -> None:
    c1, c2, c3 = base
    if not (all(map(isfinite, base)) and c3 >= 0 and c1 * c2 > c3 and min(c1, c2) > 0):
        raise ValueError("c1 and c2 must be positive, c3 not negative and below c1 c2")
    if any(map(gt, base, LARGEST_BASE)):
        largest = ", ".join(f"{value:g}" for value in LARGEST_BASE)
        raise ValueError(f"c1, c2 and c3 are limited to {largest}")


@dataclass(frozen=True, slots=True)
class BaseCurve:
    """Base curve of another family than Burckhardt's.

    Attributes:
        family: Family of the curve.
        values: Values of the family's parameters.
        covariance: Covariance of the values, shape (k, k); None where it is not known.
        peak_std: Relative standard deviations of μ_max and λ_m by the form itself: the difference
            to another form that fits the same data about as well; 0: not known.

    """

    family: CurveFamily
    values: tuple[float, ...]
    covariance: Matrix | None = None
    peak_std: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class ExtendedModel:
    """Base curve and the effects on it.

    Attributes:
        base: Parameters (c1, c2, c3) of the base curve, or of the Burckhardt curve nearest to it.
        base_covariance: Covariance of (c1, c2, c3), shape (3, 3); None where it is not known.
        effects: Effects with their values, in the order in which they act.
        covariances: Covariance of each effect's parameters, shape (k, k); None where it is not
            known; () where none is.
        splines: Empirical splines over channels, for effects without a known mechanism.
        curve: Base curve where it is of another family than Burckhardt's; else None.
        provenance: Origin of the model as texts: version, command, inputs.
        where: Path of the model's file.
        sha256: SHA-256 of the model's file, hexadecimal.

    """

    base: CurveParameters
    base_covariance: Matrix | None = None
    effects: tuple[ActiveEffect, ...] = ()
    covariances: tuple[Matrix | None, ...] = ()
    splines: tuple[Empirical, ...] = ()
    curve: BaseCurve | None = None
    provenance: Mapping[str, str] = field(default_factory=lambda: _NOTHING)
    where: str = field(default="extended model", compare=False)
    sha256: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        _require_base(self.base)
        require_covariance(self.base_covariance, 3)
        if self.curve is not None and not all(0.0 <= std < inf for std in self.curve.peak_std):
            raise ValueError("peak_std must be finite and not negative")
        if not self.covariances:
            object.__setattr__(self, "covariances", (None,) * len(self.effects))
        if len(self.covariances) != len(self.effects):
            raise ValueError(f"{len(self.covariances)} covariances, {len(self.effects)} effects")
        for active, covariance in zip(self.effects, self.covariances, strict=True):
            require_values(active)
            require_covariance(covariance, len(active.values))
        for active in self.shape:
            require_values(active)
            if self.curve is not None:
                require_covariance(self.curve.covariance, len(active.values))
        for identity, following in pairwise(sorted(map(_identity, self.effects))):
            if identity == following:
                raise ValueError(f"{identity[0]} is given twice")

    @property
    def instruments(self) -> Instruments:
        """Errors of the sensors and of the vehicle's data."""
        return build_instruments(self.effects)

    @property
    def shape(self) -> tuple[ActiveEffect, ...]:
        """The base curve of another family as a factor of Burckhardt's; () where it is his."""
        if self.curve is None:
            return ()
        return (ActiveEffect(CurveShape(self.curve.family, self.base), self.curve.values),)

    @property
    def actives(self) -> tuple[ActiveEffect, ...]:
        """All effects, then the base curve's shape, splines last."""
        splines = (ActiveEffect(spline, ()) for spline in self.splines)
        return (*self.effects, *self.shape, *splines)

    @property
    def in_contact(self) -> tuple[ActiveEffect, ...]:
        """Effects in the contact, splines last."""
        return tuple(active for active in self.actives if acts_in_contact(active.effect))

    @property
    def online(self) -> tuple[ActiveEffect, ...]:
        """Effects for online estimation: those in the contact without those of time alone.

        A tracker follows a slow drift itself.
        """
        return tuple(active for active in self.in_contact if not active.effect.observability.drift)

    @property
    def names(self) -> tuple[str, ...]:
        """Ids of the effects, with their forms, and channels of the splines."""
        return tuple(f"{a.effect.id} {a.effect.form}".strip() for a in self.actives)

    def to_dict(self) -> dict[str, Any]:
        """Base curve, effects and channels of the splines, as JSON has them."""
        return {
            "base": dict(zip(("c1", "c2", "c3"), self.base, strict=True)),
            "effects": [
                {
                    "effect": active.effect.id,
                    "form": active.effect.form,
                    "parameters": {
                        p.name: value
                        for p, value in zip(active.effect.parameters, active.values, strict=True)
                    },
                }
                for active in self.effects
            ],
            "splines": [{"channel": s.channel, "kind": s.kind} for s in self.splines],
            **({} if self.curve is None else {"curve": self._curve_dict()}),
        }

    def _curve_dict(self) -> dict[str, Any]:
        """Base curve of another family, as JSON has it."""
        if self.curve is None:
            return {}
        names = (p.name for p in self.curve.family.parameters)
        values = dict(zip(names, self.curve.values, strict=True))
        return {"family": self.curve.family.name, "parameters": values}

    def _repr_html_(self) -> str:
        rows = [("base curve", name, f"{v:.6g}") for name, v in self.to_dict()["base"].items()]
        rows += [
            (effect["effect"], name, f"{value:.6g}")
            for effect in self.to_dict()["effects"]
            for name, value in effect["parameters"].items()
        ]
        rows += [("spline", spline.channel, "") for spline in self.splines]
        return html_table("Extended model", ("part", "parameter", "value"), rows)

    def covariance_of(self, active: ActiveEffect) -> Array:
        """Covariance of an effect's parameters, shape (k, k); zeros where it is not known."""
        for effect, covariance in zip(self.effects, self.covariances, strict=True):
            if effect is active and covariance is not None:
                return np.array(covariance)
        if active.effect.id == CURVE_SHAPE and self.curve is not None and self.curve.covariance:
            return np.array(self.curve.covariance)
        return np.zeros((len(active.values),) * 2)


def _identity(active: ActiveEffect) -> tuple[str, float]:
    """Key that no two effects of a model share: the mechanism, and what is given of it."""
    pairs = zip(active.effect.parameters, active.values, strict=True)
    return active.effect.id, sum(value for parameter, value in pairs if not parameter.free)


def require_values(active: ActiveEffect) -> None:
    """ValueError where a value of an effect is out of its bounds."""
    parameters = active.effect.parameters
    if len(parameters) != len(active.values):
        raise ValueError(f"{active.effect.id}: {len(active.values)} values, not {len(parameters)}")
    for parameter, value in zip(parameters, active.values, strict=True):
        require_value(parameter, value, f"{active.effect.id}.{parameter.name}")


def require_value(parameter: Parameter, value: float, name: str) -> None:
    """ValueError where a value is out of a parameter's bounds."""
    low, high = parameter.lower, parameter.upper
    if not low <= value <= high:
        raise ValueError(f"{name} = {value:g} is not within {low:g} .. {high:g} {parameter.unit}")
    if parameter.axle and value != round(value):
        raise ValueError(f"{name} = {value:g} is not the number of an axle")


def require_covariance(covariance: Matrix | None, size: int) -> None:
    """ValueError where a matrix is no covariance of `size` numbers."""
    if covariance is None:
        return
    if len(covariance) != size or any(len(row) != size for row in covariance):
        raise ValueError(f"covariance: not {size} rows of {size} numbers")
    matrix = np.array(covariance).reshape(size, size)
    if not np.isfinite(matrix).all() or (matrix.diagonal() < 0).any():
        raise ValueError("covariance: variances must be finite and not negative")
    # Parameters differ by many powers of ten: correlations are what can be compared.
    scale = np.sqrt(matrix.diagonal())
    scale = np.where(scale > 0, scale, 1.0)
    correlation = matrix / scale / scale[:, None]
    uneven = np.abs(correlation - correlation.T).max(initial=0.0)
    if uneven > 1e-6 or np.linalg.eigvalsh(correlation).min(initial=0.0) < -1e-6:
        raise ValueError("covariance: not symmetric, or with a negative direction")
