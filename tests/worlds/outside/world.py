"""Make a drive with a mechanism that no library has.

Every one has a rail of its own, dry or wet; a share of traction and braking; and an error of the
vehicle's speed with a memory of its own.
"""

from dataclasses import replace
from pathlib import Path
from zlib import crc32

import numpy as np

from tests.worlds.drive_profile import (
    LEAD,
    STEP_S,
    STYLES,
    DriveProfile,
    draw_profile,
    draw_vehicle,
)
from tests.worlds.hidden import Hidden
from tests.worlds.mechanism import Change, Law, Scene
from tests.worlds.outside.car import CARS, make_car
from tests.worlds.outside.families import FAMILIES
from tests.worlds.outside.kinds import MEMORIES, OUTSIDE_KINDS
from tests.worlds.outside.registry import LABELS, MECHANISMS
from tests.worlds.outside.signals import coloured
from tests.worlds.plant import SPEED_STD, Noise, draw_noise
from tests.worlds.rail import Rail, draw_curve, peak
from tests.worlds.truth import Truth
from tests.worlds.world import PAIR_EXCESS, TooWeakError, World

LEAST_FAMILY_EXCESS, MOST_FAMILY_EXCESS = 0.02, 1.0
SPEED_STDS = (SPEED_STD, 4 * SPEED_STD)
"""Root mean square of the speed's error in nulls, m/s; with something hidden it is the first."""


def make_outside(
    kind: str, seed: int, path: Path, *, duration_s: float = 240.0, fresh: bool = False,
    label: str | None = None,
) -> Truth:  # fmt: skip
    """Write a drive; arguments as of `make_world`.

    Args:
        kind: one of `OUTSIDE_KINDS` or `CARS`.
        seed: draws all there is.
        path: of the log.
        duration_s: Duration of the drive, s.
        fresh: also write a second drive of the same world.
        label: 'small', 'medium' or 'large'; None: drawn.

    """
    if kind in CARS:
        return make_car(kind, seed, Path(path), duration_s=duration_s)
    return find_outside(kind, seed, path, duration_s=duration_s, fresh=fresh, label=label)[1]


def find_outside(
    kind: str, seed: int, path: Path, *, duration_s: float = 240.0, fresh: bool = False,
    label: str | None = None,
) -> tuple["OutsideWorld", Truth]:  # fmt: skip
    """The world of `make_outside`, for further drives in it, and what it wrote.

    Args:
        kind: one of `OUTSIDE_KINDS`; the other arguments are those of `make_outside`.

    """
    if kind not in OUTSIDE_KINDS:
        raise ValueError(
            f"no kind {kind!r}: outside:NAME, mech:EFFECT, beside:EFFECT+NAME, null:.."
        )
    for attempt in range(60):
        try:
            world = OutsideWorld(kind, seed, attempt, duration_s, label)
            return world, world.written(world.names, Path(path), PAIR_EXCESS, fresh)
        except TooWeakError:
            continue
    raise RuntimeError(f"{kind}, seed {seed}: no drive of sixty lets it be felt")


class OutsideWorld(World):
    """Rail, vehicle, mechanism and first drive of one attempt."""

    def __init__(
        self, kind: str, seed: int, attempt: int, duration_s: float, label: str | None = None
    ) -> None:
        self.kind, self.seed, self.duration_s = kind, seed, duration_s
        self.rng = rng = np.random.default_rng([seed, crc32(kind.encode()), attempt, 1])
        self.shape = ()
        wet = bool(rng.random() < 0.5)
        self.rail = draw_rail(rng, wet=wet)
        self.vehicle = draw_vehicle(rng, self.rail)
        style = str(rng.choice(list(STYLES)))
        memory, std = float(rng.choice(MEMORIES)), SPEED_STD
        self.label = label or str(rng.choice(LABELS))
        head, _, rest = kind.partition(":")
        self.names: tuple[str, ...] = ()
        self.channel: str | None = None
        if head == "null":
            memory, std = float(rest.removeprefix("memory-")), float(rng.choice(SPEED_STDS))
        elif head == "mech":
            drawn = FAMILIES[rest](rng)
            self.mechanism = drawn.law
            self.beside = (Hidden(rest, drawn.form, drawn.parameters),)
        else:
            effect, _, name = rest.rpartition("+")
            self.names = (effect,) if effect else ()
            self._hide(name)
        self.memory, self.std, self.style = memory, std, STYLES[style]
        self.conditions = {
            "rail": "wet" if wet else "dry", "style": style, "speed_memory_s": memory,
            "speed_std": std, "size": self.label if head in ("outside", "beside") else None,
        }  # fmt: skip
        self.profile, self.noise = self._drive()

    def _hide(self, name: str) -> None:
        hidden = MECHANISMS[name]
        size = hidden.sizes[LABELS.index(self.label)]
        constants = int(self.rng.integers(2**31))

        def law(scene: Scene) -> Change:
            # The same constants in every drive of this world.
            return hidden.law(scene, size, np.random.default_rng(constants))

        self.mechanism: Law | None = law
        self.channel = hidden.channel
        self.beside = (Hidden(f"outside:{name}", self.label, {"size": size}),)

    def _drive(self) -> tuple[DriveProfile, Noise]:
        profile = draw_profile(self.rng, self.duration_s, self.vehicle, self.rail, style=self.style)
        noise = draw_noise(self.rng, len(profile.t) - LEAD, 0.0)
        speed = self.std * coloured(self.rng, len(noise.speed), 2 * STEP_S, self.memory)
        return profile, replace(noise, speed=speed)

    def written(
        self, names: tuple[str, ...], path: Path, excess: tuple[float, float], fresh: bool
    ) -> Truth:
        """As of the parent; a family that can hardly be felt is drawn again."""
        truth = super().written(names, path, excess, fresh)
        share = truth.excess[-1] if truth.excess else 0.0
        if self.kind.startswith("mech:") and not (
            LEAST_FAMILY_EXCESS <= share <= MOST_FAMILY_EXCESS
        ):
            raise TooWeakError(self.kind)
        return truth


def draw_rail(rng: np.random.Generator, *, wet: bool) -> Rail:
    """A dry rail with a peak above 0.28, or a wet one with a peak below 0.25."""
    while True:
        c = draw_curve(rng)
        if (peak(c)[0] < 0.25) if wet else (peak(c)[0] > 0.28):
            return Rail(c[None], (0.0,))
