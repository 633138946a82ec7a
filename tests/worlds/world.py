"""Make a drive that hides an effect.

The size is searched for: it must raise the residual RMSE, after c1..c3 were fitted anew, by a
random share above the noise floor. A drive in which the effect's range cannot do so is drawn again.
Beside a contact that is not Burckhardt's an effect has the size that it would need on the nearest
curve of Burckhardt's; this curve also says how far the creep goes.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from zlib import crc32

import numpy as np

from tests.worlds.contact_laws import draw_parameters, make_law, nearest_burckhardt
from tests.worlds.drive_profile import LEAD, STATIC_LOAD, DriveProfile, draw_profile, draw_vehicle
from tests.worlds.encoding import write_log
from tests.worlds.fitting import THIN, fitted_residual, rmse
from tests.worlds.hidden import Hidden
from tests.worlds.kinds import CHANNELS, Draft, contact_of, draft, effects_of, is_outside
from tests.worlds.mechanism import Law
from tests.worlds.plant import Noise, draw_noise, drive, view
from tests.worlds.points import make_points
from tests.worlds.rail import Rail, curve, one_surface, peak, several_surfaces
from tests.worlds.samples import write_samples
from tests.worlds.table import make_table
from tests.worlds.true_contact import TrueContact
from tests.worlds.truth import DriveJudge, Peak, Surface, Truth

LEAST_EXCESS = 0.10
LEAST_FACTOR = 0.1
"""An effect that takes more of the adhesion than this leaves is none."""
Excess = tuple[float, float]
SINGLE_EXCESS: Excess = (0.10, 0.60)
PAIR_EXCESS: Excess = (0.10, 0.40)


class TooWeakError(Exception):
    """Within its range the effect cannot be felt enough in this drive."""


def make_world(
    kind: str,
    seed: int,
    path: Path,
    *,
    duration_s: float = 240.0,
    excess: Excess | None = None,
    fresh: bool = False,
) -> Truth:
    """Write a drive (.log) or a table (.csv) that hides what `kind` says.

    Args:
        kind: one of `kinds.KINDS`.
        seed: the same kind, seed and options give the same bytes.
        path: Path of the file; a fresh drive lies beside it, `_fresh` added to its name. A drive in
            a .csv is a table of samples.
        duration_s: Duration of the drive, s.
        excess: lowest and highest share by which each effect shall raise the RMSE of the plain
            fit above the noise floor.
        fresh: also write a second drive of the same world: same effects, rail and vehicle, another
            profile.

    """
    excess = excess or (PAIR_EXCESS if kind.startswith("pair:") else SINGLE_EXCESS)
    path = Path(path)
    if kind.startswith("points:"):
        return make_points(kind, seed, path)
    if kind == "out:table":
        return make_table(seed, path, duration_s=duration_s, excess=excess, fresh=fresh)
    if is_outside(kind):
        from tests.worlds.outside.world import make_outside

        return make_outside(kind, seed, path, duration_s=duration_s, fresh=fresh)
    names = effects_of(kind)
    for attempt in range(60):
        try:
            return World(kind, seed, attempt, duration_s).written(names, path, excess, fresh)
        except TooWeakError:
            continue
    raise RuntimeError(f"{kind}, seed {seed}: no drive of sixty lets the effect be felt")


class World:
    """Rail, vehicle and first drive of one attempt.

    Attributes:
        mechanism: what no library has and acts besides; None: nothing.
        beside: How the truth states it.
        channel: Channel that its residual depends on.
        conditions: How the world was drawn.

    """

    mechanism: Law | None = None
    beside: tuple[Hidden, ...] = ()
    channel: str | None = None
    conditions: Mapping[str, object] = MappingProxyType({})

    def __init__(self, kind: str, seed: int, attempt: int, duration_s: float) -> None:
        self.channel = CHANNELS.get(kind)
        self.kind, self.seed, self.duration_s = kind, seed, duration_s
        self.rng = np.random.default_rng([seed, crc32(kind.encode()), attempt])
        self.shape: tuple[Hidden, ...] = ()
        law = contact_of(kind)
        if law is not None:
            self.shape, self.rail = draw_contact(self.rng, law)
        elif kind == "null:surfaces":
            self.rail = several_surfaces(self.rng, duration_s)
        else:
            self.rail = one_surface(self.rng)
        self.vehicle = draw_vehicle(self.rng, self.rail)
        self.profile, self.noise = self._drive()

    def _drive(self) -> tuple[DriveProfile, Noise]:
        law = make_law(self.shape[0].form, self.shape[0].parameters) if self.shape else None
        profile = draw_profile(self.rng, self.duration_s, self.vehicle, self.rail, law)
        of_noise = self.kind.removeprefix("null:")
        correlation_s = float(of_noise) if of_noise in ("1", "5") else 0.0
        return profile, draw_noise(self.rng, len(profile.t) - LEAD, correlation_s)

    def written(self, names: tuple[str, ...], path: Path, excess: Excess, fresh: bool) -> Truth:
        effects, shares = self._sized(names, excess)
        effects = (*self.shape, *effects)
        truth = self._write(self.profile, self.noise, effects, shares, path)
        if self.shape:
            truth = replace(truth, excess=(_excess_by_shape(truth), *shares))
        if names and truth.rmse_before < (1 + LEAST_EXCESS) * truth.noise_floor:
            # Two that hide each other, or a figure that one row in five flattered.
            raise TooWeakError(self.kind)
        if not fresh:
            return truth
        second = self._write(
            *self._drive(), effects, shares, path.with_name(f"{path.stem}_fresh{path.suffix}")
        )
        return replace(truth, fresh=second)

    def _sized(
        self, names: tuple[str, ...], excess: Excess
    ) -> tuple[tuple[Hidden, ...], tuple[float, ...]]:
        if not names:
            return (), ()
        largest = float(np.abs(curve(self.rail.curves[0], self.profile.slip)).max())
        largest *= float(self.vehicle.static_load.mean())
        effects, shares = [], []
        for name in names:
            by_other_law = self.kind.startswith("law:")
            curve_of_rail = self.rail.curves[0]
            drawn = draft(self.rng, name, curve_of_rail, largest, by_other_law=by_other_law)
            wanted = self.rng.uniform(excess[0] + 0.01, excess[1])
            hidden, share = size_for(drawn, wanted, self._excess)
            effects.append(hidden)
            shares.append(share)
        return tuple(effects), tuple(shares)

    def _excess(self, hidden: Hidden) -> float:
        """Share by which an effect alone lifts the plain fit's RMSE above the true model's."""
        readings = drive(self.profile, self.vehicle, self.rail, (hidden,), self.noise)
        # One row in five: enough for the figure, and no multiple of the 20 ms of the speed.
        true = view(readings, (hidden,), self.rail, self.vehicle, self.profile).thinned(THIN)
        if np.min(true.contact.factor) < LEAST_FACTOR:
            raise TooWeakError(hidden.effect)
        plain = view(readings, (), self.rail, self.vehicle).thinned(THIN)
        surface = self.rail.surface_at(plain.t)
        before = rmse(fitted_residual(plain, surface)[plain.use])
        return before / rmse(true.residual(self.rail.curves[surface])[true.use]) - 1

    def _write(
        self,
        profile: DriveProfile,
        noise: Noise,
        effects: tuple[Hidden, ...],
        shares: tuple[float, ...],
        path: Path,
    ) -> Truth:
        known = (profile, self.vehicle, self.rail, effects)
        readings = drive(*known, noise, self.mechanism)
        plain = view(readings, (), self.rail, self.vehicle)
        if path.suffix == ".csv":
            write_samples(readings, plain, path)
        else:
            write_log(readings, path)
        # The true model knows a mechanism beside the effects by what the drive is without it.
        bare = readings if self.mechanism is None else drive(*known, noise)
        true = view(bare, effects, self.rail, self.vehicle, profile)
        surface = self.rail.surface_at(plain.t)
        before = rmse(fitted_residual(plain, surface)[plain.use])
        floor = rmse(true.residual(self.rail.curves[surface])[true.use])
        still = replace(noise, speed=0 * noise.speed, wheel=0 * noise.wheel, load=0 * noise.load)
        if self.mechanism is not None:
            shares = (*shares, self._excess_by_mechanism(profile, effects, still, floor))
        return Truth(
            kind=self.kind,
            seed=self.seed,
            path=str(path),
            effects=(*effects, *self.beside),
            channel=self.channel,
            surfaces=tuple(
                Surface(begin, *(float(x) for x in c))
                for begin, c in zip(self.rail.begins_s, self.rail.curves, strict=True)
            ),
            noise_floor=floor,
            rmse_before=before,
            excess=shares,
            fresh=None,
            judge=DriveJudge(
                view(drive(*known, still, self.mechanism), (), self.rail, self.vehicle),
                view(drive(*known, still), effects, self.rail, self.vehicle, profile),
                true,
                surface,
                self.rail.curves[surface],
            ),
            peak=self._peak(profile),
            true_contact=None if self.mechanism else TrueContact(*known),
            conditions=dict(self.conditions),
        )

    def _excess_by_mechanism(
        self, profile: DriveProfile, effects: tuple[Hidden, ...], still: Noise, floor: float
    ) -> float:
        """Share by which what a mechanism leaves of a fit without noise raises the noise floor.

        Rows with noise are no measure: a mechanism that lowers the adhesion lowers what the noise
        of the slip makes of it.
        """
        silent = replace(still, effort=0 * still.effort)
        known = (profile, self.vehicle, self.rail, effects)
        # The effects beside it are taken out as the truth knows them.
        seen = view(
            drive(*known, silent, self.mechanism), effects, self.rail, self.vehicle, profile
        )
        left = fitted_residual(seen, self.rail.surface_at(seen.t))[seen.use]
        return float(np.hypot(1.0, rmse(left) / floor) - 1.0)

    def _peak(self, profile: DriveProfile) -> Peak:
        """Peak of the contact alone, in the mean conditions of the drive."""
        speed, load = float(profile.v[LEAD:].mean()), float(profile.load[LEAD:].mean())
        if not self.shape:
            mu_max, lambda_m = peak(self.rail.curves[-1])
            return Peak(mu_max, lambda_m, interior=True, speed=speed, load=load)
        law = make_law(self.shape[0].form, self.shape[0].parameters)
        mu_max, lambda_m = law.peak(speed, load)
        return Peak(mu_max, lambda_m, interior=law.falls, speed=speed, load=load)


def _excess_by_shape(truth: Truth) -> float:
    """Share by which the misfit of c1..c3, free of the kinematics' noise, raises the noise floor.

    The plain fit is no measure here: where a curve is steep, the noise of the slip makes most of
    what is left, and a curve that is too flat leaves less of it than the true one.
    """
    before, after = truth.judge.errors(np.ones(len(truth.judge.t), dtype=bool))
    misfit = max(before**2 - after**2, 0.0) ** 0.5
    return float(np.hypot(1.0, misfit / truth.noise_floor) - 1.0)


def draw_contact(rng: np.random.Generator, name: str) -> tuple[tuple[Hidden, ...], Rail]:
    """A contact law as something hidden, and the rail that makes the drive with it."""
    parameters = draw_parameters(rng, name)
    law = make_law(name, parameters)
    _, lambda_m = law.peak(12.0, STATIC_LOAD)
    # A drive control goes a few times beyond the peak, not to slips where all is long slid.
    low = float(np.clip(3 * lambda_m, 0.04, 0.15))
    rail = Rail(
        nearest_burckhardt(law, 12.0, STATIC_LOAD)[None],
        (0.0,),
        (low, float(np.clip(10 * lambda_m, 1.2 * low, 0.25))),
    )
    return (Hidden("curve_shape", name, parameters),), rail


def size_for(
    drawn: Draft, wanted: float, share_of: Callable[[Hidden], float]
) -> tuple[Hidden, float]:
    """Size of an effect that raises the RMSE by the share wanted, or as near as its range goes.

    Raises:
        TooWeakError: no size within the range raises it enough.

    """
    size, best = drawn.first, None
    for _ in range(8):
        hidden = drawn.sized(size)
        share = share_of(hidden)
        if share >= LEAST_EXCESS and (best is None or abs(share - wanted) < abs(best[1] - wanted)):
            best = hidden, share
        if abs(share - wanted) < 0.02 and share >= LEAST_EXCESS:
            break
        # Mean squares add, and what an effect adds grows with the square of its size.
        step = np.sqrt(((1 + wanted) ** 2 - 1) / max((1 + share) ** 2 - 1, 1e-4))
        new = size * float(np.clip(step, 0.1, 6.0))
        new = np.sign(drawn.limit) * min(abs(new), abs(drawn.limit))
        if new == size:
            break
        size = new
    # Far above what was wanted is as wrong as too little.
    if best is None or best[1] > wanted + 0.1:
        raise TooWeakError(drawn.effect)
    return best
