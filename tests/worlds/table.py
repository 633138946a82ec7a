"""A sample table from a rig with covariates of which one acts on the adhesion."""

from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from tests.worlds.drive_profile import wander
from tests.worlds.fitted_curve import project
from tests.worlds.hidden import Hidden
from tests.worlds.rail import Floats, curve, draw_curve
from tests.worlds.truth import Surface, Truth

STEP_S = 0.05
ADHESION_STD = 0.01
COVARIATES = {
    "oil_film_um": (0.2, 3.0),
    "roughness_um": (0.5, 6.0),
    "supply_pressure_kPa": (300.0, 700.0),
    "lamp_current_A": (1.0, 2.0),
    "roller_temperature_degC": (20.0, 70.0),
    "belt_tension_N": (80.0, 220.0),
}
SHAPES = ("bend", "step", "wave")


@dataclass(frozen=True)
class TableJudge:
    """As `truth.DriveJudge`, for a table."""

    t: Floats
    slip: Floats
    adhesion: Floats
    factor: Floats
    noise: Floats

    def errors(self, inside: NDArray[np.bool_]) -> tuple[float, float]:
        """RMSE on the rows inside, of the plain and of the true model fitted to the others."""
        rows = ~inside if not inside.all() else inside
        return self._fitted(rows, self, inside)

    def errors_on(self, other: "TableJudge") -> tuple[float, float]:
        """RMSE on another table of the same world, of both models fitted to this one."""
        return self._fitted(np.ones(len(self.t), dtype=bool), other, np.ones(len(other.t), bool))

    def _fitted(
        self, rows: NDArray[np.bool_], other: "TableJudge", inside: NDArray[np.bool_]
    ) -> tuple[float, float]:
        """Fit to rows of this table, RMSE on rows of the other: plain and true model."""
        found = []
        for known in (False, True):
            factor = self.factor if known else np.ones_like(self.factor)
            c = project(
                np.abs(self.slip[rows]),
                (np.sign(self.slip) * factor)[rows],
                self.adhesion[rows],
                np.full(int(rows.sum()), 1 / ADHESION_STD),
            )
            left = other.adhesion - (other.factor if known else 1.0) * curve(c, other.slip)
            found.append(float(np.sqrt(np.mean(left[inside] ** 2))))
        return found[0], found[1]

    def floor(self, inside: NDArray[np.bool_]) -> float:
        """RMSE on the rows inside of the true model with its true curve: noise alone."""
        return float(np.sqrt(np.mean(self.noise[inside] ** 2)))


def make_table(
    seed: int, path: Path, *, duration_s: float, excess: tuple[float, float], fresh: bool
) -> Truth:
    """Write the table; arguments as of `make_world`."""
    rng = np.random.default_rng([seed, crc32(b"out:table")])
    c = draw_curve(rng)
    names = [str(name) for name in rng.permutation(list(COVARIATES))][:4]
    acting, shape = names[int(rng.integers(4))], str(rng.choice(SHAPES))
    wanted, sign = rng.uniform(*excess), float(rng.choice((-1, 1)))
    columns = _columns(rng, duration_s, names)
    noise = ADHESION_STD * rng.standard_normal(len(columns["time_s"]))
    size = 0.05
    for _ in range(12):
        judge = _judge(columns, noise, c, acting, shape, sign * size)
        everything = np.ones(len(noise), dtype=bool)
        before, after = judge.errors(everything)
        share = before / max(after, float(np.sqrt(np.mean(noise**2)))) - 1
        if abs(share - wanted) < 0.01:
            break
        step = np.sqrt(((1 + wanted) ** 2 - 1) / max((1 + share) ** 2 - 1, 1e-4))
        size *= float(np.clip(step, 0.2, 5.0))
    hidden = Hidden("out:table", shape, {"size": sign * size})

    def written(where: Path, columns: dict[str, Floats], noise: Floats) -> Truth:
        judge = _judge(columns, noise, c, acting, shape, sign * size)
        _write(where, columns, judge.adhesion)
        before, _ = judge.errors(np.ones(len(noise), dtype=bool))
        return Truth(
            kind="out:table",
            seed=seed,
            path=str(where),
            effects=(hidden,),
            channel=acting,
            surfaces=(Surface(0.0, *(float(x) for x in c)),),
            noise_floor=float(np.sqrt(np.mean(noise**2))),
            rmse_before=before,
            excess=(float(share),),
            fresh=written(*second) if fresh and where == path else None,
            judge=judge,
        )

    again = _columns(rng, duration_s, names)
    beside = path.with_name(f"{path.stem}_fresh{path.suffix}")
    second = (beside, again, ADHESION_STD * rng.standard_normal(len(again["time_s"])))
    return written(path, columns, noise)


def _columns(rng: np.random.Generator, duration_s: float, names: list[str]) -> dict[str, Floats]:
    t = np.arange(round(duration_s / STEP_S)) * STEP_S
    period = rng.uniform(4, 15)
    swing = 0.11 * (1 - np.cos(2 * np.pi * t / period)) * (0.7 + 0.3 * wander(rng, t, 10, 60))
    direction = np.where(np.floor(t / period) % 3 == 2, -1.0, 1.0)
    columns = {
        "time_s": t,
        "slip": direction * swing,
        "normal_load_N": 4000 * (1 + 0.1 * wander(rng, t, 10, 60)),
        "speed_mps": 10 + 5 * wander(rng, t, 15, 80),
    }
    for name in names:
        low, high = COVARIATES[name]
        columns[name] = (low + high) / 2 + (high - low) / 2 * wander(rng, t, 8, 60)
    return columns


def _judge(
    columns: dict[str, Floats], noise: Floats, c: Floats, acting: str, shape: str, size: float
) -> TableJudge:
    low, high = COVARIATES[acting]
    x = 2 * (columns[acting] - low) / (high - low) - 1
    form = {"bend": x * x - 1 / 3, "step": np.tanh(3 * x), "wave": np.sin(2.5 * x)}[shape]
    factor = 1 + size * form
    slip = columns["slip"]
    return TableJudge(columns["time_s"], slip, factor * curve(c, slip) + noise, factor, noise)


def _write(path: Path, columns: dict[str, Floats], adhesion: Floats) -> None:
    written = dict(columns)
    written["longitudinal_force_N"] = adhesion * columns["normal_load_N"]
    np.savetxt(
        path,
        np.stack(list(written.values()), axis=1),
        fmt="%.7g",
        delimiter=",",
        header=",".join(written),
        comments="",
    )
