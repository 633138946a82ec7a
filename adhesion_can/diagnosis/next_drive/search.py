"""Search of the shortest sequence of manoeuvres that distinguishes explanations.

A beam search: sequences are extended by every manoeuvre, and those are kept that promise to reach
the wanted discrepancy soonest. What a sequence has reached is the least discrepancy of all pairs
(T-optimality with several rivals); when it would reach the wanted one is extrapolated.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.next_drive.discrepancy import Pair, Part, add_grams
from adhesion_can.diagnosis.next_drive.planned_drive import DriveStart
from adhesion_can.physics.driving_plan import PlanLimits, PlanStep

BEAM = 6
"""Number of sequences that are extended."""
LEAST_REACHED = 1e-3
"""Discrepancy below which a sequence promises nothing."""

BuildPart = Callable[[Sequence[PlanStep], DriveStart], Part]
Compute = Callable[[Mapping[Pair, Array]], dict[Pair, float]]


@dataclass(frozen=True, eq=False)
class DriveSequence:
    """Manoeuvres one after another.

    Attributes:
        steps: Their steps.
        grams: Sums of their Gram matrices by pair.
        state: State at their end.
        reached: Least discrepancy of all pairs.
        duration_s: Duration, s.

    """

    steps: tuple[PlanStep, ...]
    grams: Mapping[Pair, Array]
    state: DriveStart
    reached: float
    duration_s: float

    def rank(self, wanted: float, least_s: float) -> tuple[float, float]:
        """Duration at which the wanted would be reached at the rate so far, s; then what is."""
        duration = self.duration_s * max(wanted / max(self.reached, LEAST_REACHED), 1.0)
        return max(duration, least_s), -self.reached


def find_shortest(
    manoeuvres: Sequence[tuple[PlanStep, ...]],
    start: DriveStart,
    limits: PlanLimits,
    wanted: float,
    least_s: float,
    build_part: BuildPart,
    compute: Compute,
) -> tuple[DriveSequence | None, DriveSequence | None]:
    """Shortest sequence that reaches the wanted discrepancy, and the one that promises most.

    Args:
        manoeuvres: Manoeuvres that may be driven.
        start: State at the start.
        limits: Limits of effort, speed and duration.
        wanted: Least discrepancy of all pairs.
        least_s: Least duration, s.
        build_part: Function that predicts a part of a drive from a state on.
        compute: Function that gives the discrepancy of each pair from Gram matrices.

    Returns:
        The shortest sequence, None where none reaches it; and the most promising one, None where
        no manoeuvre is within the limits.

    """
    beam: list[DriveSequence] = []
    best: DriveSequence | None = None
    most: DriveSequence | None = None
    level: list[DriveSequence | None] = [None]
    while level:
        extended: list[DriveSequence] = []
        for sequence in level:
            for manoeuvre in manoeuvres:
                longer = _extend(sequence, manoeuvre, start, limits, build_part, compute)
                if longer is None:
                    continue
                extended.append(longer)
                # Shortest first, and of equal ones that which reaches most.
                if longer.reached >= wanted and longer.duration_s >= least_s:
                    best = min(best or longer, longer, key=lambda x: (x.duration_s, -x.reached))
        if best is not None:
            extended = [x for x in extended if x.duration_s < best.duration_s]
        extended.sort(key=lambda x: x.rank(wanted, least_s))
        beam = _distinct(extended)[:BEAM]
        if beam and (most is None or beam[0].reached > most.reached):
            most = beam[0]
        level = [*beam]
    return best, most


def _extend(
    sequence: DriveSequence | None,
    manoeuvre: tuple[PlanStep, ...],
    start: DriveStart,
    limits: PlanLimits,
    build_part: BuildPart,
    compute: Compute,
) -> DriveSequence | None:
    """A sequence with one more manoeuvre; None where that exceeds a limit."""
    duration = (sequence.duration_s if sequence else 0.0) + sum(
        step.duration_s for step in manoeuvre
    )
    if duration > limits.duration_max - start.time_s:
        return None
    part = build_part(manoeuvre, sequence.state if sequence else start)
    if part.effort_max > limits.effort_max:
        return None
    if part.speeds[0] < limits.speed_min or part.speeds[1] > limits.speed_max:
        return None
    grams = add_grams(sequence.grams, part.grams) if sequence else dict(part.grams)
    reached = min(compute(grams).values())
    steps = (*sequence.steps, *manoeuvre) if sequence else manoeuvre
    return DriveSequence(steps, grams, part.end, reached, duration)


def _distinct(sequences: Sequence[DriveSequence]) -> list[DriveSequence]:
    """Sequences without those that reorder the steps of a better one."""
    seen: set[tuple[str, ...]] = set()
    out = []
    for sequence in sequences:
        key = tuple(sorted(repr(step) for step in sequence.steps))
        if key not in seen:
            seen.add(key)
            out.append(sequence)
    return out
