"""Judge of a history, from the record of the bus and the schedule of faults alone."""

from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import Frame
from adhesion_can.recordings.candump import ReadReport, read_candump
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.replay import replay_blocks
from tests.histories.faults import KINDS, Fault
from tests.histories.inputs import SILENT_CYCLES, good_inputs, good_times, usable_times
from tests.histories.simulated_bus import Record
from tests.service.test_core import CONFIG, FixedEstimator
from tests.wire import CYCLES_MS, decoded, seal_ok

MS, S = 1_000, 1_000_000
CYCLES_US = {0x201: 20 * MS, 0x202: 100 * MS, 0x203: 100 * MS, 0x204: 20 * MS, 0x211: S}
COUNTERS = 15
LATEST_US = 2 * MS + 500
"""Latest sending after the due time: frames are waited for until 2 ms after it."""
OVERDUE_US = 120 * MS
"""Latest sending of a frame where the host was held up."""
SLACK_US = 30 * MS
"""Time within which a status follows: a cycle of the setpoints, and the time of a frame."""
ESTIMATE_US = round(CONFIG.service.estimate_s * S)
"""Age of the latest sample beyond which an estimate is no longer that of the rail."""
HOLD_US = S
"""Time for which the last values are held while an input is stale."""
RECOVERY_US = 3 * S
"""Time after the last fault within which the service tracks again."""
FAULT_US = S + SLACK_US
"""Time for which FAULT lasts after the last frame of another service."""
SLOW_GAP_US = 100 * MS
"""Time for which frames may be left out where the machine is slow."""
FIRST_US = 100 * MS
"""Latest time of the first setpoint after the first good input."""
WITHOUT_NUMBERS = ("INIT", "FAULT")
ESTIMATOR_DECIDES = {"TRACKING", "LOW_EXCITATION", "SURFACE_CHANGE"}
"""Statuses that say what an estimator knows, where inputs are good."""


class Violation(NamedTuple):
    """A rule that was broken.

    Attributes:
        rule: Name of the rule.
        t_us: Time, µs.
        text: What was seen.

    """

    rule: str
    t_us: int
    text: str


class Point(NamedTuple):
    """A setpoint on the bus.

    Attributes:
        at_us: Time at which it passed, µs.
        due_us: Its stamp, µs.
        status: Its status.
        values: Its numbers that are available.

    """

    at_us: int
    due_us: int
    status: str
    values: dict[str, float]


def check(
    record: Record,
    faults: tuple[Fault, ...],
    start_us: int,
    end_us: int,
    estimator=FixedEstimator,
) -> list[Violation]:
    """Violations of all rules.

    Args:
        record: Record of the bus.
        faults: Faults of the history, in its own time.
        start_us: Time of the host at the begin, µs.
        end_us: Time of the host at the end, µs.
        estimator: Maker of the service's estimator; None: of the configured one.

    """
    schedule = _Schedule(faults, start_us)
    points = [_point(at_us, f) for at_us, f in record.outputs if f.arbitration_id == 0x201]
    inputs = list(good_inputs(record.inputs, schedule.overtaken))
    return [
        *_frames(record, schedule),
        *_times(record, schedule, end_us),
        *_numbers(points),
        *_silence(points, good_times(inputs), schedule),
        *_blindness(points, usable_times(inputs)),
        *_recovery(points, schedule, estimator),
        *_second_service(points, schedule),
        *_first(points, record, schedule),
        *_replayed(record, estimator),
    ]


class _Schedule:
    """Times of the faults on the host's clock."""

    def __init__(self, faults: tuple[Fault, ...], start_us: int) -> None:
        self.faults = faults
        self.start_us = start_us

    def disturbed(self, from_us: int, until_us: int, but_for: str = "") -> bool:
        """Whether sending was disturbed between two times, or shortly before."""
        return any(
            KINDS[f.kind].disturbs
            and f.kind != but_for
            and self._overlaps(f, from_us - 8 * S, until_us, f.kind)
            for f in self.faults
        )

    def unheard(self, from_us: int, until_us: int) -> bool:
        """Whether frames that were sent got lost between two times, unknown to their sender."""
        return any(
            f.kind == "listen_only" and self._overlaps(f, from_us, until_us, "")
            for f in self.faults
        )

    def overtaken(self, name: str, at_us: int) -> bool:
        """Whether frames of a message may overtake each other at a time."""
        return any(
            f.kind == "delayed" and f.target == name and self._overlaps(f, at_us - S, at_us, "")
            for f in self.faults
        )

    def resumed_before(self, at_us: int) -> int:
        """End of the latest pause of the host before a time, µs; the start where there is none."""
        ends = (self.start_us + f.until_us for f in self.faults if f.kind == "stopped")
        return max((end for end in ends if end <= at_us), default=self.start_us)

    def any_fault(self, from_us: int, until_us: int) -> bool:
        """Whether any fault was at work between two times."""
        return any(self._overlaps(f, from_us, until_us, "") for f in self.faults)

    def _overlaps(self, fault: Fault, from_us: int, until_us: int, kind: str) -> bool:
        begin, end = self.start_us + fault.from_us, self.start_us + fault.until_us
        # A lost bus is opened again after pauses that grow to 5 s; a stop ends at once.
        settled = end + (6 * S if fault.kind in ("bus_down", "link_missing") else 50 * MS)
        if kind:
            return begin <= until_us and settled >= from_us + 8 * S
        return begin <= until_us and settled >= from_us


def _point(at_us: int, frame: Frame) -> Point:
    # Checksum and counter differ from frame to frame and say nothing of the content.
    status, available = _content(bytes([0, frame.data[1] & 0xF0]) + frame.data[2:])
    return Point(at_us, frame.t_us, status, available)


@lru_cache(1024)
def _content(data: bytes) -> tuple[str, dict[str, float]]:
    """Status and available numbers of a setpoint."""
    signals = decoded(Frame(0, 0x201, data))
    raw = int.from_bytes(data, "little")
    available = {
        name: float(signals[name])
        for name, place in (("MuMax", 16), ("LambdaM", 32), ("CreepSpeedSetpoint", 48))
        if raw >> place & 0xFFFF != 0xFFFF
    }
    return str(signals["Status"]), available


def _frames(record: Record, schedule: _Schedule) -> Iterator[Violation]:
    """Every frame is sealed, and its counter goes on by one."""
    last: dict[int, tuple[int, int]] = {}
    for at_us, frame in record.outputs:
        number = frame.arbitration_id
        if number not in CYCLES_US:
            yield Violation("foreign id", at_us, f"{number:#x} is none of ours")
            continue
        if not seal_ok(frame):
            yield Violation("checksum", at_us, f"{number:#x} {frame.data.hex()}")
        count = frame.data[1] & 0xF
        if number in last:
            before_us, before = last[number]
            step = (count - before) % COUNTERS
            # After as many frames as there are counts that nobody knows to be lost.
            repeats = step == 0 and not schedule.unheard(before_us, at_us)
            if repeats or (step > 1 and not schedule.disturbed(before_us, at_us)):
                yield Violation("counter", at_us, f"{number:#x}: {before} then {count}")
        last[number] = at_us, count


def _times(record: Record, schedule: _Schedule, end_us: int) -> Iterator[Violation]:
    """Every frame is due on the grid of its cycle, in time, and none is left out or in a burst."""
    sent: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for at_us, frame in record.outputs:
        sent[frame.arbitration_id].append((at_us, frame.t_us))
    for number, times in sent.items():
        cycle_us = CYCLES_US.get(number, S)
        for at_us, due_us in times:
            late_us = at_us - due_us
            latest_us = OVERDUE_US if schedule.disturbed(due_us, at_us) else LATEST_US
            latest_us = max(latest_us, cycle_us) if latest_us == OVERDUE_US else latest_us
            if not 0 <= late_us <= latest_us:
                yield Violation("late", at_us, f"{number:#x} is {late_us / MS:.1f} ms late")
        dues = sorted({due_us for _, due_us in times})
        for before_us, due_us in pairwise(dues):
            if (due_us - before_us) % cycle_us:
                yield Violation("grid", due_us, f"{number:#x} left its cycle")
            elif _is_gap(cycle_us, before_us, due_us, schedule):
                yield Violation("gap", due_us, f"{number:#x}: none for {due_us - before_us} us")
        ended = bool(dues) and end_us - dues[-1] > cycle_us + SLACK_US
        if ended and not schedule.disturbed(dues[-1], end_us):
            yield Violation("gap", end_us, f"{number:#x}: none at the end")
    bursts = Counter(at_us // (20 * MS) for at_us, _ in sent[0x201])
    for place, count in bursts.items():
        if count > 8:
            yield Violation("burst", place * 20 * MS, f"{count} setpoints within 20 ms")


def _is_gap(cycle_us: int, before_us: int, due_us: int, schedule: _Schedule) -> bool:
    """Whether frames are missing between two that should follow each other."""
    left_out_us = due_us - before_us - cycle_us
    if left_out_us > SLOW_GAP_US:
        return not schedule.disturbed(before_us, due_us, but_for="slow")
    return left_out_us > 0 and not schedule.disturbed(before_us, due_us)


def _numbers(points: list[Point]) -> Iterator[Violation]:
    """Numbers are in their range, and absent where the status says so."""
    for point in points:
        values = point.values
        if point.status in WITHOUT_NUMBERS and values:
            yield Violation("numbers", point.at_us, f"{point.status} with {values}")
        ranges = {"MuMax": (0.0, 1.0), "LambdaM": (0.0, 0.5), "CreepSpeedSetpoint": (0.0, 20.0)}
        for name, value in values.items():
            low, high = ranges[name]
            if not low < value <= high:
                yield Violation("range", point.at_us, f"{name} = {value}")


def _silence(
    points: list[Point], good: Mapping[str, list[int]], schedule: _Schedule
) -> Iterator[Violation]:
    """Never confident while a required input was silent for longer than allowed.

    Frames of a pause are dropped, and after ten cycles without any a counter is taken as it comes,
    also one that stood still meanwhile: silence that the service can know of begins with the end of
    the pause.
    """
    for point in points:
        for name, times in good.items():
            # What came until the setpoint was sent may be stamped before it was due: frames are
            # waited for, and a clock that was set back stamps too early.
            place = bisect_right(times, point.at_us)
            if not place:
                continue
            since_us = max(times[place - 1], schedule.resumed_before(point.at_us))
            silent_us = point.due_us - since_us
            allowed_us = SILENT_CYCLES * CYCLES_MS[name] * MS + SLACK_US
            if silent_us <= allowed_us:
                continue
            if point.status not in ("STALE_INPUT", *WITHOUT_NUMBERS):
                yield Violation(
                    "stale", point.at_us, f"{point.status}, {name} silent {silent_us / MS:.0f} ms"
                )
            elif point.values and silent_us > allowed_us + HOLD_US:
                yield Violation(
                    "held", point.at_us, f"numbers after {silent_us / MS:.0f} ms without {name}"
                )


def _blindness(points: list[Point], usable: Mapping[str, list[int]]) -> Iterator[Violation]:
    """Never TRACKING while blind: a sample needs a wheel speed, an effort and the vehicle speed."""
    allowed_us = ESTIMATE_US + CYCLES_US[0x201] + SLACK_US
    for point in points:
        if point.status != "TRACKING":
            continue
        for name, times in usable.items():
            place = bisect_right(times, point.at_us)
            blind_us = point.due_us - times[place - 1] if place else point.due_us
            if blind_us > allowed_us:
                yield Violation(
                    "blind", point.at_us, f"TRACKING, no usable {name} for {blind_us / S:.1f} s"
                )


def _recovery(points: list[Point], schedule: _Schedule, estimator) -> Iterator[Violation]:
    """Where no fault was for a while, it tracks, as far as the estimator is sure of itself."""
    expected = {"TRACKING"} if estimator is FixedEstimator else ESTIMATOR_DECIDES
    for point in points:
        from_us = point.due_us - RECOVERY_US
        calm = from_us >= schedule.start_us and not schedule.any_fault(from_us, point.due_us)
        if calm and point.status not in expected:
            yield Violation("recovery", point.at_us, f"{point.status} without any fault")


def _second_service(points: list[Point], schedule: _Schedule) -> Iterator[Violation]:
    """FAULT while another service sends our ids, and without one never."""
    others = [f for f in schedule.faults if f.kind == "second_service"]
    for point in points:
        if point.status == "FAULT" and not any(
            f.from_us <= point.due_us - schedule.start_us < f.until_us + FAULT_US for f in others
        ):
            yield Violation("no second service", point.at_us, "FAULT without another sender")
    for fault in others:
        from_us = schedule.start_us + fault.from_us + FIRST_US
        until_us = schedule.start_us + fault.until_us
        for point in points:
            heard = from_us <= point.due_us < until_us
            if heard and point.status != "FAULT" and not schedule.disturbed(from_us, until_us):
                yield Violation("second service", point.at_us, f"{point.status} beside another")


def _first(points: list[Point], record: Record, schedule: _Schedule) -> Iterator[Violation]:
    """The first setpoint follows the first input."""
    if not record.inputs:
        return
    first_us = record.inputs[0][0]
    late = not points or points[0].at_us - first_us > FIRST_US
    if late and not schedule.any_fault(first_us, first_us + FIRST_US):
        yield Violation("first", first_us, "no setpoint within 100 ms of the first input")


def _replayed(record: Record, estimator) -> Iterator[Violation]:
    """A replay of the service's log sends the same bytes."""
    report = ReadReport()
    items = list(read_candump([line.encode() for line in record.log], report))
    if report.passed_over:
        yield Violation("log", 0, f"{report.passed_over} lines of the log cannot be read")
    sent: list[Frame] = []
    replay_blocks([Block.from_frames(items)], ServiceCore(CONFIG, estimator), sent.append)
    again = {(f.t_us, f.arbitration_id, f.data) for f in sent if f.arbitration_id != 0x211}
    # Error frames have bits for an id, which may look like one of ours.
    frames = [item for item in items if isinstance(item, Frame) and item.is_data]
    own = [frame for frame in frames if frame.arbitration_id in CYCLES_US]
    for frame in own:
        if frame.arbitration_id == 0x211:
            continue
        if (frame.t_us, frame.arbitration_id, frame.data) not in again:
            yield Violation("replay", frame.t_us, f"{frame.arbitration_id:#x} differs in replay")
            return
