"""Play of a case: its drive, spoilt, through the service's core, and the verdict on its answers."""

from collections import Counter
from dataclasses import dataclass
from functools import cache, lru_cache
from math import inf, isfinite

import numpy as np

from adhesion_can.bus import frame as bus
from adhesion_can.config import Configuration, load_configuration
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.replay import replay
from tests.faults.case import Case
from tests.faults.catalogue import find
from tests.faults.judge import MU_SHARE, SLIP_SHARE, Setpoints, Verdict, decode, judge
from tests.faults.kinds import Kind
from tests.faults.locomotive import RADIUS, Truth, World, simulate
from tests.faults.rail import Rail
from tests.faults.sensors import SILENT, SPEED_S, Readings, draw_noise, read
from tests.faults.wire import Frame, frames, pack, queues

ONSET_S, CHANGE_AFTER_S, LASTS_S = (13.0, 16.0), 5.0, 4.0
END_S = 28.0
OVER_ROWS = 10
"""Rows of 20 ms over which an error is taken together."""


@cache
def configuration() -> Configuration:
    """The configuration that the database comes with."""
    return load_configuration()


def draw_rails(seed: int) -> tuple[Rail, Rail]:
    """A dry rail and a wet one; their fall lies between a straight one and that of friction that
    hardly falls any more at high creep speed."""
    rng = np.random.default_rng([seed, 4405])
    share = 0.7 * float(rng.uniform(0.0, 1.0))

    def rail(levels: tuple[float, float], steepness: tuple[float, float], fall: float) -> Rail:
        level, rise = float(rng.uniform(*levels)), 1 / float(rng.uniform(*steepness))
        # The same fall at small creep speeds, whatever is left of the friction at high ones.
        return Rail(level, rise, share, fall * (1 - share))

    return rail((0.38, 0.41), (54, 62), 14.0), rail((0.25, 0.28), (60, 68), 11.0)


def make_case(name: str, size: float, seed: int, *, stays: bool) -> Case:
    """A case of a kind.

    Args:
        name: Name of the kind.
        size: Size of the fault.
        seed: Seed of the drive.
        stays: Whether the fault stays and the rail turns wet 5 s later; else it ends after 4 s on
            the same rail.

    """
    rng = np.random.default_rng([seed, 4406])
    onset_s = round(float(rng.uniform(*ONSET_S)), 3)
    dry, wet = draw_rails(seed)
    rails: tuple[tuple[float, Rail], ...] = ((0.0, dry),)
    if stays and find(name).event is None:
        rails = (*rails, (onset_s + CHANGE_AFTER_S, wet))
    braking = ((0.0, END_S),) if seed % 4 == 3 else ()
    world = World(seed, END_S, rails, braking)
    return Case(world, onset_s, inf if stays else onset_s + LASTS_S, size)


@dataclass(frozen=True)
class Played:
    """A case that was played.

    Attributes:
        name: Name of the kind.
        case: The case.
        error_s: Time at which the fault's error became big, s; that of its onset where it never
            did.
        is_big: Whether it did.
        verdict: Verdict on the setpoints.
        largest: Largest adhesion that was sent with TRACKING after the onset.
        words: Reasons that the service gave from the onset on, with their shares of the time.
        early: Reasons that it gave before.

    """

    name: str
    case: Case
    error_s: float
    is_big: bool
    verdict: Verdict
    largest: float
    words: dict[str, float]
    early: dict[str, float]


def play(name: str, case: Case) -> Played:
    """Play a case through a fresh core."""
    kind = find(name)
    world = case.world if kind.event is None else kind.event(case.world, case)
    truth = simulate(world)
    sent, reasons = answers(on_the_bus(kind, case, read(truth, draw_noise(world.seed))))
    setpoints = decode(sent)
    error_s = find_error(kind, case, truth)
    # An event is no fault: what it does to the estimate is the estimator's to follow.
    from_s = case.onset_s if error_s is None else error_s
    end_s = case.until_s if isfinite(case.until_s) and kind.event is None else None
    twin = sound_setpoints(world) if kind.event is None else None
    verdict = judge(setpoints, truth, case.onset_s, from_s, end_s, twin)
    told = setpoints.mu[(setpoints.t >= case.onset_s) & (setpoints.status == 1)]
    largest = float(np.nanmax(told)) if len(told) and np.isfinite(told).any() else 0.0
    early, words = (
        _shares([word for t_s, word in reasons if (t_s >= case.onset_s) == later])
        for later in (False, True)
    )
    return Played(name, case, from_s, error_s is not None, verdict, largest, words, early)


@lru_cache(8)
def sound_setpoints(world: World) -> Setpoints:
    """Setpoints of a drive without a fault."""
    readings = read(simulate(world), draw_noise(world.seed))
    sent, _ = answers(frames({name: pack(one, name) for name, one in queues(readings).items()}))
    return decode(sent)


def _shares(words: list[str]) -> dict[str, float]:
    """Share of each word that is not empty, the most frequent first."""
    counts = Counter(word for word in words if word)
    return {word: count / len(words) for word, count in counts.most_common()}


def on_the_bus(kind: Kind, case: Case, readings: Readings) -> list[Frame]:
    """Frames of a drive, spoilt."""
    if kind.spoil is not None:
        readings = kind.spoil(readings, case)
    waiting = queues(readings)
    if kind.queue is not None:
        waiting = kind.queue(waiting, case)
    sent = {name: pack(queue, name) for name, queue in waiting.items()}
    if kind.wire is not None:
        sent = kind.wire(sent, case)
    return frames(sent)


def answers(given: list[Frame]) -> tuple[list[Frame], list[tuple[float, str]]]:
    """Frames that a fresh core sends, and at each setpoint its time, s, and the reason, if any, for
    which the core does not vouch for its estimate."""
    sent: list[bus.Frame] = []
    reasons: list[tuple[float, str]] = []

    def note(t_us: int, _: object) -> None:
        objection = getattr(core.estimate, "objection", None)
        reasons.append((t_us / 1e6, objection.name.lower() if objection else ""))

    core = ServiceCore(configuration(), on_setpoint=note)
    received = (bus.Frame(*frame) for frame in given)
    with np.errstate(all="ignore"):
        replay(received, core, sent.append)
    return [Frame(*frame[:3]) for frame in sent], reasons


def find_error(kind: Kind, case: Case, truth: Truth) -> float | None:
    """Time at which a fault of the readings is big enough to matter, s; None: never, or of none.

    The readings are those without noise, sound and spoilt. The error of an axle is that of its slip
    ratio over 5 % of the true optimal one, or that of effort over load over 2 % of the true largest
    adhesion; it is big when the root of its mean square over 0.2 s exceeds 1 on any axle.
    """
    if kind.spoil is None:
        return None
    sound = read(truth, SILENT)
    slip, adhesion = _contact(sound)
    with np.errstate(all="ignore"):
        spoilt_slip, spoilt_adhesion = _contact(kind.spoil(sound, case))
    rows = np.searchsorted(truth.t, sound.times("speed"))
    rows = np.minimum(rows, len(truth.t) - 1)
    ratios = np.stack(
        [
            (spoilt_slip - slip) / (SLIP_SHARE * truth.slips[0][rows, None]),
            (spoilt_adhesion - adhesion) / (MU_SHARE * truth.peaks[0][rows, None]),
        ]
    )
    squares = np.nan_to_num(ratios, nan=1e3, posinf=1e3, neginf=1e3).clip(-1e3, 1e3) ** 2
    sums = np.cumsum(squares, axis=1)
    sums[:, OVER_ROWS:] -= sums[:, :-OVER_ROWS].copy()
    big = (sums / OVER_ROWS > 1.0).any(axis=(0, 2))
    t = sound.times("speed")
    found = np.flatnonzero(big & (t >= case.onset_s))
    return float(t[found[0]]) if len(found) else None


def _contact(readings: Readings) -> tuple[np.ndarray, np.ndarray]:
    """Slip ratio and effort over load of each axle, (n, 6) each, a row each 20 ms."""
    held = np.arange(len(readings.speed)) * SPEED_S
    loads = np.minimum((held / 0.2 + 1e-6).astype(int), len(readings.load) - 1)
    slip = RADIUS * readings.wheel[::2] / readings.speed[:, None] - 1
    return slip, readings.effort[::2] / readings.load[loads]


def cases(name: str, seed: int) -> list[Case]:
    """Cases of a kind in one round: each size, with a fault that stays and with one that ends."""
    kind = find(name)
    return [
        make_case(name, size, seed, stays=stays)
        for size in kind.sizes
        for stays in ((True, False) if kind.event is None else (True,))
    ]
