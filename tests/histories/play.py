"""Play of a history: the service on the simulated bus."""

from collections.abc import Iterator
from itertools import count

from adhesion_can.config import load_configuration
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.live import LiveService
from adhesion_can.service.reconnecting_bus import ReconnectingBus
from tests.histories.checker import Violation, check
from tests.histories.faults import Fault, draw
from tests.histories.simulated_bus import Record, SimulatedBus
from tests.histories.traffic import START_US, make_traffic
from tests.service.test_core import FixedEstimator

CONFIG = load_configuration()
WITH_TRACKER = 4
"""One in so many histories has the tracker: it takes several times the time."""


def estimator_of(seed: int):
    """Maker of a history's estimator: a fixed one, or None for the configured one, the tracker."""
    return None if seed % WITH_TRACKER == 0 else FixedEstimator


def play(
    seed: int, duration_us: int, faults: tuple[Fault, ...], estimator=FixedEstimator
) -> Record:
    """Record of the bus after a history; estimator None: the configured one, the tracker."""
    bus = SimulatedBus(make_traffic(seed, duration_us, faults), faults, START_US + duration_us)
    service = _serve(bus, ServiceCore(CONFIG, estimator))
    _run_to_end(bus, service)
    return bus.record


def play_on(seed: int, duration_us: int, per_minute: float) -> Iterator[int]:
    """Numbers of histories after each of which the caller may look: one service for all of them.

    It estimates by the tracker, and nothing is recorded, so that memory which grows is the
    service's own.
    """
    bus = SimulatedBus(iter(()), (), START_US, Record.of_nothing())
    service = _serve(bus, ServiceCore(CONFIG))
    for number in count(1):
        faults = draw(seed + number, duration_us, per_minute)
        traffic = make_traffic(seed + number, duration_us, faults, bus.now_us)
        bus.go_on(traffic, faults, bus.now_us + duration_us)
        _run_to_end(bus, service)
        yield number


def _run_to_end(bus: SimulatedBus, service: LiveService) -> None:
    """Turns of the service's loop until a history ends."""
    while bus.now_us < bus.end_us:
        service._step()
        bus.turn()


def _serve(bus: SimulatedBus, core: ServiceCore) -> LiveService:
    """A service on a simulated bus."""
    record = bus.record
    opened = ReconnectingBus(
        bus.open,
        (),
        record.notices.append,
        clock=lambda: bus.now_us / 1e6,
        sleep=bus.sleep,
        wait_for_it=True,
        count_unsent=lambda _: bus.unsent,
    )
    return LiveService(
        core, opened, clock=bus.clock, write_log=record.log.append, notify=record.notices.append
    )


def judge(
    seed: int, duration_us: int, faults: tuple[Fault, ...], estimator=FixedEstimator
) -> list[Violation]:
    """Violations in a history."""
    record = play(seed, duration_us, faults, estimator)
    return check(record, faults, START_US, START_US + duration_us, estimator)


def shrink(
    seed: int, duration_us: int, faults: tuple[Fault, ...], estimator=FixedEstimator
) -> tuple[Fault, ...]:
    """The fewest and shortest of some faults with which a history still fails."""
    rules = {one.rule for one in judge(seed, duration_us, faults, estimator)}

    def fails(some: tuple[Fault, ...]) -> bool:
        return bool(rules & {one.rule for one in judge(seed, duration_us, some, estimator)})

    shrunk = True
    while shrunk:
        shrunk = False
        for place in range(len(faults)):
            fewer = (*faults[:place], *faults[place + 1 :])
            if fails(fewer):
                faults, shrunk = fewer, True
                break
    return faults
