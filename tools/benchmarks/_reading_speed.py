"""Ways to read a recording, each in a process of its own, in turn, and their ratios."""

import json
import os
import subprocess
from contextlib import contextmanager
from dataclasses import dataclass, field
from statistics import median

from _passes import SPEND_S
from _report import aside


@dataclass(frozen=True)
class Way:
    """A way to read the recording.

    Attributes:
        key: Short name.
        title: Description for the table.
        words: Command line of the process.
        frames: Number of frames of the recording.
        free: Whether the process may use all cores; then the clock counts, else the time of the
            processor.

    """

    key: str
    title: str
    words: tuple[str, ...]
    frames: int
    free: bool = False


@dataclass
class Figures:
    """Figures of one way, one value a round.

    Attributes:
        clock: Duration of a pass by the clock, s, the median of a process.
        processor: Duration of a pass by the processor's time, s, the median of a process.
        first: Duration of each process's first pass by the processor's time, s.
        mib: Peak of the memory, MiB.
        answer: Result of the last process.

    """

    clock: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)
    first: list[float] = field(default_factory=list)
    mib: list[float] = field(default_factory=list)
    answer: dict[str, object] = field(default_factory=dict)

    def add(self, answer):
        clock, processor = zip(*answer["passes"], strict=True)
        self.clock.append(median(clock))
        self.processor.append(median(processor))
        self.first.append(processor[0])
        self.mib.append(answer["mib"])
        self.answer = answer


@contextmanager
def on_core(number):
    """Hold what is started meanwhile to one core, another one for each number; None: to none."""
    allowed = os.sched_getaffinity(0)
    try:
        if number is not None:
            os.sched_setaffinity(0, {sorted(allowed)[number % len(allowed)]})
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def run_process(words, core=None):
    """Result of a process, which is JSON on its last line.

    Raises:
        RuntimeError: it failed.

    """
    with on_core(core):
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        reason = (done.stderr.strip() or done.stdout.strip() or "no word").splitlines()[-1]
        raise RuntimeError(f"{' '.join(words)} ended with {done.returncode}: {reason}")
    return json.loads(done.stdout.splitlines()[-1])


def climb(ways, rounds):
    """Figures of each way by key, and of those that failed the reason.

    All are done once a round, one after the other, and the rounds take the cores in turn.
    """
    figures, failed = {way.key: Figures() for way in ways}, {}
    for number in range(rounds):
        for way in (way for way in ways if way.key in figures):
            try:
                figures[way.key].add(_run_way(way, number))
            except RuntimeError as error:
                failed[way.key] = str(error)
                del figures[way.key]
        aside(f"{number + 1} of {rounds} rounds")
    return figures, failed


def _run_way(way, core):
    answer = run_process(way.words, None if way.free else core)
    if answer["frames"] not in (None, way.frames):
        raise RuntimeError(f"{way.key} read {answer['frames']} of {way.frames} frames")
    return answer


def cost(figures, way):
    """Seconds a frame, a value a round."""
    return _a_frame(figures, way, by_clock=way.free)


def _a_frame(figures, way, *, by_clock):
    of_way = figures[way.key]
    return [one / way.frames for one in (of_way.clock if by_clock else of_way.processor)]


def speed(figures, way):
    """Frames a second, the median over the rounds."""
    return median(1 / one for one in cost(figures, way))


def times_as_fast(figures, way, other):
    """How many times as fast as another way, by what counts for it: the median over the rounds."""
    ours, theirs = (_a_frame(figures, one, by_clock=way.free) for one in (way, other))
    return median(b / a for a, b in zip(ours, theirs, strict=True))


def _three_digits(value):
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"


def table(report, figures, ways, base):
    """The ladder, as a README can carry it."""
    print(f"\n| way | frames/s | times {base.title if base else 'a peer'} | MiB |")
    print("|---|---|---|---|")
    for way in ways:
        ratio = _three_digits(times_as_fast(figures, way, base)) if base else "?"
        mib = max(figures[way.key].mib)
        print(
            f"| {way.title} | {_three_digits(speed(figures, way) / 1e6)} M | {ratio} | {mib:.0f} |"
        )
    print(flush=True)
    held = [figures[way.key] for way in ways if not way.free]
    share = median(c / p for one in held for c, p in zip(one.clock, one.processor, strict=True))
    report.write(
        f"on one core, by seconds of the processor; 'all cores' by the clock. Each process goes "
        f"over the file until {SPEND_S:.0f} s have gone, its median counts; medians over the rounds"
    )
    report.write(f"clock/processor on one core: {share:.2f} (1: nothing else ran there)")
