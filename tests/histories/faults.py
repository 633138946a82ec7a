"""Schedule of faults: what goes wrong on the bus and in the host, from when to when."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from tests.wire import REQUIRED

S = 1_000_000


@dataclass(frozen=True)
class Fault:
    """A fault.

    Attributes:
        kind: Kind, a key of `KINDS`.
        from_us: Time at which it begins, µs.
        until_us: Time at which it ends, µs; a clock that was set stays so.
        target: Name of the message that it spoils, or what the names of several begin with; ''
            where it spoils none.
        size: Rate, time (s) or other size, by its kind.

    """

    kind: str
    from_us: int
    until_us: int
    target: str = ""
    size: float = 0.0

    def active(self, t_us: int) -> bool:
        """Whether it is at work."""
        return self.from_us <= t_us < self.until_us


def any_active(faults: Iterable[Fault], t_us: int) -> bool:
    """Whether any of some faults is at work."""
    # Not by any(): asked several times for each frame, mostly of no fault at all.
    for fault in faults:  # noqa: SIM110
        if fault.active(t_us):
            return True
    return False


@dataclass(frozen=True)
class Kind:
    """A kind of fault.

    Attributes:
        targets: Messages of which it spoils one.
        sizes: Sizes that are drawn.
        longest_s: Longest duration, s.
        disturbs: Whether sending is disturbed: frames may be late or not be there.
        at_start: Whether it is there from the start.

    """

    targets: tuple[str, ...] = ()
    sizes: tuple[float, ...] = (0.0,)
    longest_s: float = 5.0
    disturbs: bool = False
    at_start: bool = False


RATES = (0.001, 0.01, 0.1, 0.5)
BY_AXLE = tuple(name for name in REQUIRED if name != "VehicleSpeed")
QUANTITIES = ("WheelSpeeds", "VehicleSpeed", "TractiveEffort")
"""What messages begin with that carry the same quantity."""
KINDS: Mapping[str, Kind] = {
    "silent": Kind(targets=REQUIRED),
    "lost": Kind(targets=REQUIRED, sizes=RATES),
    "corrupt": Kind(targets=REQUIRED, sizes=RATES),
    "repeated": Kind(targets=REQUIRED, sizes=RATES),
    "twice": Kind(targets=REQUIRED, sizes=RATES),
    "delayed": Kind(targets=REQUIRED, sizes=(0.002, 0.02, 0.2)),
    "not_available": Kind(targets=REQUIRED),
    "frozen": Kind(targets=REQUIRED),
    "jumped": Kind(targets=REQUIRED),
    "drifted": Kind(targets=REQUIRED, sizes=(0.01, 0.1)),
    "saturated": Kind(targets=REQUIRED, sizes=(0.03, 0.05)),
    "blinded": Kind(targets=QUANTITIES, sizes=(0.0, 1.0)),
    "axles_lost": Kind(targets=BY_AXLE, sizes=(1.0, 2.0)),
    "other_sender": Kind(targets=REQUIRED),
    "second_service": Kind(),
    "flood": Kind(sizes=(1.0, 10.0), longest_s=2.0),
    "error_frames": Kind(sizes=RATES),
    "clock_set": Kind(sizes=(-3600.0, -3.0, -0.05, 0.05, 2.0, 3600.0), longest_s=0.0),
    "stopped": Kind(longest_s=4.0, disturbs=True),
    "slow": Kind(sizes=(0.0025, 0.004, 0.01), longest_s=4.0, disturbs=True),
    "bus_down": Kind(longest_s=4.0, disturbs=True),
    "link_missing": Kind(longest_s=4.0, disturbs=True, at_start=True),
    "bus_off": Kind(longest_s=4.0, disturbs=True),
    "no_buffer": Kind(longest_s=1.0, disturbs=True),
    "listen_only": Kind(longest_s=2.0, disturbs=True),
}


def draw(seed: int, duration_us: int, per_minute: float) -> tuple[Fault, ...]:
    """Faults at random times; the first second and the last four are without."""
    rng = np.random.default_rng([seed, 77])
    number = rng.poisson(per_minute * duration_us / (60 * S))
    return tuple(sorted((_draw(rng, duration_us) for _ in range(number)), key=lambda f: f.from_us))


def _draw(rng: np.random.Generator, duration_us: int) -> Fault:
    name = str(rng.choice(list(KINDS)))
    kind = KINDS[name]
    from_us = 0 if kind.at_start else int(rng.integers(S, max(duration_us - 9 * S, S + 1)))
    lasts_us = round(kind.longest_s * S * rng.uniform(0.02, 1.0))
    return Fault(
        name,
        from_us,
        from_us + max(lasts_us, 1),
        str(rng.choice(kind.targets)) if kind.targets else "",
        float(rng.choice(kind.sizes)),
    )
