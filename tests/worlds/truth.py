"""What a world knows of itself."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tests.worlds.fitting import fitted_curves, fitted_residual, residual_of, rmse
from tests.worlds.hidden import Hidden
from tests.worlds.plant import View
from tests.worlds.rail import Floats, Ints
from tests.worlds.true_contact import TrueContact

Span = tuple[float, float]


class Judge(Protocol):
    """What tells the gain that the true extended model has on rows held out."""

    @property
    def t(self) -> Floats:
        """Time of each row, s."""

    def errors(self, inside: NDArray[np.bool_]) -> tuple[float, float]:
        """RMSE on the rows inside, of the plain and of the true model fitted to the others."""

    def errors_on(self, other: Any) -> tuple[float, float]:
        """RMSE on another drive of the same world, of both models fitted to this one."""

    def floor(self, inside: NDArray[np.bool_]) -> float:
        """RMSE on the rows inside of the true model with its true curve: noise alone."""


@dataclass(frozen=True)
class DriveJudge:
    """Judge of a drive: the same readings as the plain model and as the truth see them.

    `plain` and `true` have the noise of the effort alone: a diagnosis may smooth the kinematics,
    and the gain that it can have is then the one over that noise. `noisy` is what it works with.
    c1..c3 are fitted anew for both, in the same way, to what is not held out; but where the sensor
    cuts off the truth keeps its own (n, 3), which what is left does not tell, and so does a contact
    that has no c1..c3.
    """

    plain: View
    true: View
    noisy: View
    surface: Ints
    curves: Floats

    @property
    def t(self) -> Floats:
        """Time of each row, s."""
        return self.plain.t

    @property
    def refits(self) -> bool:
        """Whether the true model has c1..c3, and what is left tells them."""
        return self.true.limits is None and self.true.contact.law is None

    def errors(self, inside: NDArray[np.bool_]) -> tuple[float, float]:
        """RMSE on the rows inside, of the plain and of the true model fitted to the others."""
        inside = inside & self.plain.use
        outside = np.flatnonzero(self.plain.use & ~inside)
        if len(outside) == 0:
            outside = np.flatnonzero(self.plain.use)
        before = fitted_residual(self.plain, self.surface, outside)[inside]
        if self.refits:
            after = fitted_residual(self.true, self.surface, outside)[inside]
        else:
            after = self.true.residual(self.curves)[inside]
        return rmse(before), rmse(after)

    def errors_on(self, other: "DriveJudge") -> tuple[float, float]:
        """RMSE on another drive of the same world, of both models fitted to this one."""
        use = other.plain.use
        curves = fitted_curves(self.plain, self.surface)
        before = residual_of(other.plain, other.surface, curves)[use]
        if not other.refits:
            return rmse(before), other.floor(use)
        curves = fitted_curves(self.true, self.surface)
        return rmse(before), rmse(residual_of(other.true, other.surface, curves)[use])

    def floor(self, inside: NDArray[np.bool_]) -> float:
        """RMSE on the rows inside of the true model with its true curve: noise alone."""
        return rmse(self.noisy.residual(self.curves)[inside & self.noisy.use])


@dataclass(frozen=True)
class Surface:
    """A surface, when it begins, and its curve."""

    from_s: float
    c1: float
    c2: float
    c3: float


@dataclass(frozen=True)
class Peak:
    """Peak of the contact alone, without the effects, in the mean conditions of a drive.

    Attributes:
        mu_max: Largest adhesion.
        lambda_m: Slip ratio that it stands at.
        interior: Whether the curve falls beyond it.
        speed: Mean speed, m/s.
        load: Mean load of a wheelset, N.

    """

    mu_max: float
    lambda_m: float
    interior: bool
    speed: float
    load: float


@dataclass(frozen=True)
class Truth:
    """What is hidden in a file.

    Attributes:
        kind: Kind of the world, one of `kinds.KINDS`.
        seed: Seed of the world.
        path: Path of the file.
        effects: what is hidden, with its parameters.
        channel: Channel that the residual of an effect outside the library depends on.
        surfaces: Surfaces of the rail in the order of time.
        noise_floor: RMSE of the true model on the measured samples, in adhesion.
        rmse_before: RMSE of c1..c3 fitted without the effects, in adhesion.
        excess: Share by which the effects raise the RMSE of that fit; of each effect
            alone, on the same noise.
        fresh: truth of a second drive in the same world.
        judge: Computes the true gain and noise floor; not part of the JSON.
        peak: Peak of the last surface; None: no contact of wheels.
        conditions: How a world was drawn: rail, share of braking, memory of the speed's error.
        true_contact: Curve that is there at each moment; None: no drive; not part of the JSON.

    """

    kind: str
    seed: int
    path: str
    effects: tuple[Hidden, ...]
    channel: str | None
    surfaces: tuple[Surface, ...]
    noise_floor: float
    rmse_before: float
    excess: tuple[float, ...]
    fresh: "Truth | None"
    judge: Judge = field(repr=False, compare=False)
    peak: Peak | None = None
    conditions: Mapping[str, object] = field(default_factory=dict)
    true_contact: TrueContact | None = field(default=None, repr=False, compare=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Ids of what is hidden."""
        return tuple(e.effect for e in self.effects)

    def true_gain_percent(self, spans: Sequence[Span] | None = None) -> float:
        """Gain in RMSE that the true extended model has on what was held out, %.

        Args:
            spans: from and to of each, s since the file's beginning; None: the whole drive, which
                the curves are then fitted to as well.

        """
        before, after = self.judge.errors(self._inside(spans))
        return 100 * (1 - after / before)

    def fresh_gain_percent(self) -> float:
        """Gain on the fresh drive of models that were fitted to this one, %."""
        if self.fresh is None:
            raise ValueError("no fresh drive was made")
        before, after = self.judge.errors_on(self.fresh.judge)
        return 100 * (1 - after / before)

    def floor_on(self, spans: Sequence[Span] | None = None) -> float:
        """Noise floor of the rows that were held out alone: it differs from place to place."""
        return self.judge.floor(self._inside(spans))

    def _inside(self, spans: Sequence[Span] | None) -> NDArray[np.bool_]:
        t = self.judge.t
        if spans is None:
            return np.ones(len(t), dtype=bool)
        inside = np.zeros(len(t), dtype=bool)
        for begin, end in spans:
            inside |= (t >= begin) & (t < end)
        return inside

    def to_dict(self) -> dict[str, Any]:
        """Everything but the judge and the curves in time, fit for JSON."""
        shallow = {name: getattr(self, name) for name in self.__dataclass_fields__}
        del shallow["judge"], shallow["true_contact"]
        shallow["peak"] = None if self.peak is None else asdict(self.peak)
        shallow["effects"] = [
            {"effect": e.effect, "form": e.form, "parameters": dict(e.parameters)}
            for e in self.effects
        ]
        shallow["surfaces"] = [asdict(s) for s in self.surfaces]
        shallow["excess"] = list(self.excess)
        shallow["fresh"] = None if self.fresh is None else self.fresh.to_dict()
        return shallow

    def to_json(self) -> str:
        """As `to_dict`, indented."""
        return json.dumps(self.to_dict(), indent=1)
