"""Manoeuvres from which a plan is put together, within limits."""

from collections.abc import Iterator

from adhesion_can.physics.driving_plan import Mode, PlanLimits, PlanStep

LOW = 0.002
"""Lower end of a sweep, slip ratio."""
BEYOND, RISE, STEADY = 2.0, 0.6, 0.8
"""Upper end of a sweep beyond the peak, of one on the rising side, and a steady slip, as multiples
of the slip ratio of the peak."""
SLOW_S, QUICK_S = 6.0, 2.0
"""Durations of a sweep up and down, s."""
PART_S = 6.0
"""Duration of a manoeuvre, s."""
COAST_S = 3.0
"""Duration of coasting, s."""
REVERSAL_S = 3.0
"""Duration of traction and of braking that follow each other, s."""
APPROACH_S = 10.0
"""Duration of pulling or braking that changes the speed, s."""


def build_catalogue(
    limits: PlanLimits,
    axles: int,
    peak_slip: float,
    *,
    sand: bool,
    stable: bool = False,
    quick: bool = True,
) -> tuple[tuple[PlanStep, ...], ...]:
    """Manoeuvres of one or a few steps each.

    Args:
        limits: Limits of the plan.
        axles: Number of axles of the vehicle.
        peak_slip: Slip ratio of the expected curve's peak.
        sand: Whether an explanation depends on sand.
        stable: Whether the slips stay below that of the peak: beyond it a slow creep control does
            not hold them.
        quick: Whether sweeps may be quicker than the window in which the vehicle speed is smoothed:
            what a delay of it does within the window is not seen as it was.

    """
    beyond = RISE if stable else BEYOND
    manoeuvres = _manoeuvres(limits, axles, peak_slip, beyond, sand=sand and limits.sand)
    return tuple(m for m in manoeuvres if quick or all(step.period_s != QUICK_S for step in m))


def _manoeuvres(
    limits: PlanLimits, axles: int, peak_slip: float, highest: float, *, sand: bool
) -> Iterator[tuple[PlanStep, ...]]:
    beyond, rise, steady = (
        min(share * peak_slip, limits.slip_max) for share in (highest, RISE, min(STEADY, highest))
    )
    yield (PlanStep(COAST_S, "coast"),)
    modes: tuple[Mode, ...] = ("traction", "braking")
    pull, brake = (PlanStep(APPROACH_S, mode, (steady, steady)) for mode in modes)
    for mode in modes if limits.braking else modes[:1]:
        slow = PlanStep(PART_S, mode, (LOW, beyond), SLOW_S, stagger=True)
        yield (slow,)
        yield (PlanStep(PART_S, mode, (LOW, beyond), QUICK_S, stagger=True),)
        yield (PlanStep(PART_S, mode, (LOW, beyond), SLOW_S),)
        yield (PlanStep(PART_S, mode, (LOW, rise), QUICK_S),)
        yield (PlanStep(PART_S, mode, (steady, steady)),)
        yield (PlanStep(PART_S, mode, (beyond, beyond)),)
        yield (pull, slow)
        if limits.braking:
            yield (brake, slow)
            yield (
                PlanStep(REVERSAL_S, mode, (rise, rise)),
                PlanStep(REVERSAL_S, _other(mode), (rise, rise)),
            )
        if sand:
            yield (PlanStep(PART_S, mode, (LOW, beyond), SLOW_S, stagger=True, sand=True),)
        if limits.single_axles and axles > 1:
            for group in _axle_groups(axles):
                yield (PlanStep(PART_S, mode, (LOW, beyond), SLOW_S, axles=group),)


def _other(mode: Mode) -> Mode:
    return "braking" if mode == "traction" else "traction"


def _axle_groups(axles: int) -> Iterator[tuple[int, ...]]:
    """Axles that pull alone: the first, the last, every other one, and the front half."""
    yield (1,)
    yield (axles,)
    if axles > 2:
        yield tuple(range(1, axles + 1, 2))
        yield tuple(range(1, axles // 2 + 1))
