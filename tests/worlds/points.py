"""A table of independent points of a contact, as they are read off a measured plot."""

from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from tests.worlds.contact_laws import (
    FILE_LOAD,
    draw_parameters,
    make_law,
    nearest_burckhardt,
)
from tests.worlds.fitted_curve import project
from tests.worlds.hidden import Hidden
from tests.worlds.kinds import contact_of
from tests.worlds.rail import Floats, curve
from tests.worlds.truth import Peak, Surface, Truth

COLUMNS = ("slip", "adhesion", "speed_mps", "normal_load_N")
COUNTS = (60, 140, 400)


@dataclass(frozen=True)
class PointsJudge:
    """As `truth.DriveJudge`, for points; `t` is the number of the row."""

    t: Floats
    slip: Floats
    adhesion: Floats
    noise: Floats

    def errors(self, inside: NDArray[np.bool_]) -> tuple[float, float]:
        """RMSE on the rows inside, of the plain model fitted to the others and of the truth."""
        return self._before(~inside if not inside.all() else inside, self, inside)

    def errors_on(self, other: "PointsJudge") -> tuple[float, float]:
        """RMSE on other points of the same contact, of the plain model and of the truth."""
        return self._before(np.ones(len(self.t), bool), other, np.ones(len(other.t), bool))

    def _before(
        self, rows: NDArray[np.bool_], other: "PointsJudge", inside: NDArray[np.bool_]
    ) -> tuple[float, float]:
        ones = np.ones(int(rows.sum()))
        c = project(self.slip[rows], ones, self.adhesion[rows], ones)
        left = (other.adhesion - curve(c, other.slip))[inside]
        return float(np.sqrt(np.mean(left * left))), other.floor(inside)

    def floor(self, inside: NDArray[np.bool_]) -> float:
        """RMSE on the rows inside of the true model with its true curve: noise alone."""
        return float(np.sqrt(np.mean(self.noise[inside] ** 2)))


def make_points(kind: str, seed: int, path: Path) -> Truth:
    """Write a table of points of a contact; arguments as of `make_world`."""
    rng = np.random.default_rng([seed, crc32(kind.encode())])
    name = contact_of(kind)
    assert name is not None
    hidden = Hidden("curve_shape", name, draw_parameters(rng, name))
    law = make_law(name, hidden.parameters)
    n = int(rng.choice(COUNTS))
    speed = rng.choice(np.round(rng.uniform(5, 20, int(rng.choice((1, 3)))), 1), n)
    load = np.full(n, FILE_LOAD)
    slip = np.sort(np.exp(rng.uniform(np.log(1e-3), np.log(0.25), n)))
    noise = rng.uniform(0.003, 0.02) * rng.standard_normal(n)
    adhesion = law.adhesion(slip, speed, load) + noise
    np.savetxt(
        path,
        np.stack([slip, adhesion, speed, load], axis=1),
        fmt="%.7g",
        delimiter=",",
        header=",".join(COLUMNS),
        comments="",
    )
    judge = PointsJudge(np.arange(n, dtype=float), slip, adhesion, noise)
    before, floor = judge.errors(np.ones(n, dtype=bool))
    middle = float(np.mean(speed))
    c = nearest_burckhardt(law, middle, FILE_LOAD)
    mu_max, lambda_m = law.peak(middle, FILE_LOAD)
    return Truth(
        kind=kind,
        seed=seed,
        path=str(path),
        effects=(hidden,),
        channel=None,
        surfaces=(Surface(0.0, *(float(x) for x in c)),),
        noise_floor=floor,
        rmse_before=before,
        excess=(before / floor - 1,),
        fresh=None,
        judge=judge,
        peak=Peak(mu_max, lambda_m, interior=law.falls, speed=middle, load=FILE_LOAD),
    )
