"""The model of the data: a curve for each surface and effects in front of it; its fit.

    e = z(φ) − factor(φ) · curve(slip(φ); θ_s)

with z the adhesion as observed, θ_s = (c1, ln c2, c3) of the surface of a row, and φ the parameters
of the effects. Every fit is least squares on residuals that are scaled by what the sensors leave in
doubt and whitened (`whitening`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import Course
from adhesion_can.diagnosis.formatting import effect_name
from adhesion_can.physics import burckhardt
from adhesion_can.physics.effects import (
    EFFECTS,
    ActiveEffect,
    Contact,
    Effect,
    LagStates,
    Parameter,
    acts_in_contact,
    build_instruments,
    compute_change,
)

SLOPE_STEP, CHORD_STEP, FAR_STEP = 0.01, 0.3, 3.0
"""Steps of a parameter, in its typical size: for a slope, and for an effect without a size yet,
which may look otherwise where it is large."""
EXCLUDED = -1
"""Surface of a row that belongs to none: close to a change of the rail."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """An effect that may be at work, with the axle that it may be at.

    Attributes:
        effect: see there.
        axle: for an effect at one axle; 0 for the others.

    """

    effect: Effect
    axle: int = 0

    @property
    def size(self) -> int:
        """Number of parameters that are looked for."""
        return len(self.limits)

    @property
    def name(self) -> str:
        """Effect, form and axle in one word."""
        return effect_name(self.effect.id, self.effect.form, self.axle)

    def active(self, values: Sequence[float]) -> ActiveEffect:
        """With values of the parameters that are looked for."""
        given = iter(values)
        return ActiveEffect(
            self.effect,
            tuple(
                float(self.axle) if p.axle else float(next(given)) for p in self.effect.parameters
            ),
        )

    def least(self, limit: Parameter) -> float:
        """Smallest value that a difference may use.

        A delay may be tried on both sides of none: a one-sided difference of a noisy signal goes
        with its noise, and finds a delay of milliseconds where there is none.
        """
        return limit.lower if acts_in_contact(self.effect) else -limit.upper

    @property
    def none(self) -> tuple[float, ...]:
        """Values at which nothing changes."""
        return (0.0, *(p.typical for p in self.limits[1:]))

    @property
    def limits(self) -> tuple[Parameter, ...]:
        """The parameters that are looked for."""
        return tuple(p for p in self.effect.parameters if not p.axle)

    @property
    def chords(self) -> tuple[float, ...]:
        """Sizes, in the typical one, at which an effect without a size is looked at.

        What has one sign is a delay, a length, a share that is lost: seldom linear.
        """
        return (CHORD_STEP, FAR_STEP) if self.limits[0].lower == 0.0 else (CHORD_STEP,)

    @property
    def starts(self) -> tuple[tuple[float, ...], ...]:
        """Values without size from which a search begins: the other parameters at a few sizes."""
        rest = self.limits[1:]
        if not rest:
            return (self.none,)
        return tuple(
            (0.0, *(float(np.clip(scale * p.typical, p.lower, p.upper)) for p in rest))
            for scale in (0.3, 1.0, 3.0)
        )


@dataclass(frozen=True, eq=False)
class Study:
    """Recordings that are looked at together.

    Attributes:
        courses: one a recording.
        surface: number of each row's surface over all courses, `EXCLUDED` for none; shape (n,).
        surfaces: how many there are.

    """

    courses: tuple[Course, ...]
    surface: NDArray[np.int64]
    surfaces: int

    def __len__(self) -> int:
        return len(self.surface)

    def column(self, name: str) -> Array:
        """An attribute of the courses' rows, all together."""
        return np.concatenate([getattr(course, name) for course in self.courses])


@dataclass(frozen=True, slots=True)
class Theta:
    """(c1, ln c2, c3) of every surface, shape (surfaces, 3)."""

    values: Array

    def rows(self, surface: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        """c1, c2, c3 of each row."""
        c1, log_c2, c3 = self.values[np.maximum(surface, 0)].T
        return c1, np.exp(log_c2), c3


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A model on the rows of a study, shape (n,) each.

    Attributes:
        adhesion: as observed with the model's instruments.
        slip: as it enters the curve.
        factor: of the adhesion.
        predicted: adhesion by the model.

    """

    adhesion: Array
    slip: Array
    factor: Array
    predicted: Array

    @property
    def residual(self) -> Array:
        """Observed less predicted adhesion."""
        return self.adhesion - self.predicted


def evaluate(
    study: Study,
    theta: Theta,
    actives: Sequence[ActiveEffect] = (),
    shift: Array | None = None,
) -> Evaluation:
    """Adhesion as observed and as predicted, in every row.

    Args:
        study: see there.
        theta: curves of the surfaces.
        actives: effects.
        shift: what is added to every measured slip, shape (n,).

    """
    ends = np.cumsum([len(course) for course in study.courses])[:-1]
    shifts = [None] * len(study.courses) if shift is None else np.split(shift, ends)
    parts = [
        _contact(course, actives, own) for course, own in zip(study.courses, shifts, strict=True)
    ]
    adhesion, slip, factor = (np.concatenate(column) for column in zip(*parts, strict=True))
    curve = burckhardt.adhesion(slip, *theta.rows(study.surface))
    return Evaluation(adhesion, slip, factor, factor * curve)


def _contact(
    course: Course, actives: Sequence[ActiveEffect], shift: Array | None
) -> tuple[Array, Array, Array]:
    seen = course.observe(build_instruments(actives))
    contact = Contact(
        slip=seen.slip if shift is None else seen.slip + shift,
        creep_speed=seen.creep_speed if shift is None else seen.creep_speed + shift * seen.speed,
        speed=seen.speed,
        load=seen.load,
        time_s=course.time_s,
        axle=course.axle.astype(np.float64),
        place=course.place,
        adhesion=seen.adhesion,
        covariates=course.covariates,
    )
    change = compute_change(actives, contact, LagStates())
    return seen.adhesion, change.slip, np.broadcast_to(change.factor, change.slip.shape)


def curve_slopes(study: Study, theta: Theta, at: Evaluation) -> Array:
    """∂predicted/∂(c1, ln c2, c3) of each surface, shape (n, 3·surfaces); 0 in other rows."""
    c1, c2, _ = theta.rows(study.surface)
    size = np.abs(at.slip)
    signed = np.copysign(at.factor, at.slip)
    fallen = np.exp(-c2 * size)
    own = np.stack([signed * (1.0 - fallen), signed * c1 * c2 * size * fallen, -signed * size], 1)
    if study.surfaces == 1:
        return own
    columns = np.zeros((len(study), 3 * study.surfaces))
    for number in range(study.surfaces):
        rows = study.surface == number
        columns[rows, 3 * number : 3 * number + 3] = own[rows]
    return columns


@dataclass(frozen=True, slots=True)
class Model:
    """Curves and effects with their values.

    Attributes:
        theta: of every surface.
        candidates: the effects.
        values: of each one's parameters.
        fixed: effects that are as they are: no parameter of theirs is looked for.

    """

    theta: Theta
    candidates: tuple[Candidate, ...] = ()
    values: tuple[tuple[float, ...], ...] = ()
    fixed: tuple[ActiveEffect, ...] = ()

    @property
    def actives(self) -> tuple[ActiveEffect, ...]:
        """The effects as they act, in the order of the list of all effects."""
        pairs = sorted(
            zip(self.candidates, self.values, strict=True),
            key=lambda pair: EFFECTS.index(pair[0].effect),
        )
        return (*(candidate.active(values) for candidate, values in pairs), *self.fixed)

    @property
    def vector(self) -> Array:
        """All parameters: θ surface by surface, then φ effect by effect."""
        return np.concatenate([self.theta.values.ravel(), *map(np.array, self.values)])

    def at(self, vector: Array) -> "Model":
        """With other parameters, kept where they make sense."""
        size = self.theta.values.size
        theta = vector[:size].reshape(-1, 3).copy()
        theta[:, 0] = np.clip(theta[:, 0], 1e-6, 10.0)
        theta[:, 1] = np.clip(theta[:, 1], 0.0, np.log(1000.0))
        theta[:, 2] = np.clip(theta[:, 2], 0.0, 10.0)
        values, first = [], size
        for candidate in self.candidates:
            last = first + candidate.size
            values.append(
                tuple(
                    float(np.clip(v, p.lower, p.upper))
                    for v, p in zip(vector[first:last], candidate.limits, strict=True)
                )
            )
            first = last
        return replace(self, theta=Theta(theta), values=tuple(values))

    def with_effect(self, candidate: Candidate, values: tuple[float, ...] | None = None) -> "Model":
        """With one more effect, at no size where no values are given."""
        given = candidate.none if values is None else values
        return replace(self, candidates=(*self.candidates, candidate), values=(*self.values, given))


def without(model: Model, place: int) -> tuple[Model, Candidate, tuple[float, ...]]:
    """A model without one of its effects, and that effect with its values."""
    rest = [i for i in range(len(model.candidates)) if i != place]
    less = replace(
        model,
        candidates=tuple(model.candidates[i] for i in rest),
        values=tuple(model.values[i] for i in rest),
    )
    return less, model.candidates[place], model.values[place]


def effect_slopes(
    study: Study,
    model: Model,
    candidate: Candidate,
    values: tuple[float, ...],
    shift: Array | None = None,
) -> Array:
    """∂predicted/∂φ of an effect, shape (n, size), by central differences.

    Args:
        study: see there.
        model: the effects that are there besides.
        candidate: the effect.
        values: of its parameters. A step that leaves the range is one-sided.
        shift: see `evaluate`.

    """
    columns = []
    for place, limit in enumerate(candidate.limits):
        step = SLOPE_STEP * abs(limit.typical)
        columns.append(_per_step(study, model, candidate, values, place, step, shift))
    return np.stack(columns, axis=1)


def signature(
    study: Study,
    model: Model,
    candidate: Candidate,
    start: tuple[float, ...],
    shift: Array | None = None,
    chord: float = CHORD_STEP,
) -> Array:
    """Change of the prediction per size of an effect that the model does not have, shape (n,).

    A chord, not a slope: some effects begin flat.

    Args:
        study: see there.
        model: what is there besides.
        candidate: the effect.
        start: values without size; the others as they are to be.
        shift: see `evaluate`.
        chord: size that it is given for this, in its typical one.

    """
    step = chord * abs(candidate.limits[0].typical)
    return _per_step(study, model, candidate, start, 0, step, shift)


def _per_step(
    study: Study,
    model: Model,
    candidate: Candidate,
    values: tuple[float, ...],
    place: int,
    step: float,
    shift: Array | None,
) -> Array:
    """Change of −e per unit of one parameter, from a step to either side of it, shape (n,)."""
    limit = candidate.limits[place]
    ends = []
    for side in (1.0, -1.0):
        at = float(np.clip(values[place] + side * step, candidate.least(limit), limit.upper))
        moved = (*values[:place], at, *values[place + 1 :])
        actives = model.with_effect(candidate, moved).actives
        ends.append((at, evaluate(study, model.theta, actives, shift).residual))
    (high, above), (low, below) = ends
    return np.asarray((below - above) / (high - low))
