"""What the rows of a benchmark share: printing beside a target, and work over all cores."""

import signal
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context


class Report:
    """Prints figures as they come, and counts the targets."""

    def __init__(self):
        self.met = 0
        self.missed = []

    def write(self, text):
        print(f"  {text}", flush=True)

    def check(self, what, value, target, *, met):
        """A figure beside its target, both as text."""
        self.write(f"{what}: {value} (target {target}: {'met' if met else 'MISSED'})")
        if met:
            self.met += 1
        else:
            self.missed.append(what)

    def at_most(self, what, value, most, form=".3f"):
        self.check(what, format(value, form), f"at most {most:{form}}", met=value <= most)


def aside(text):
    """A line about the progress."""
    print(text, file=sys.stderr, flush=True)


def over_cores(work, tasks, jobs, what):
    """Results of `work` in the order of the tasks, from processes of their own."""
    began = time.perf_counter()
    results = {}
    with ProcessPoolExecutor(
        min(jobs, len(tasks)),
        mp_context=get_context("spawn"),
        # Ctrl-C ends the workers without a word of their own.
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_DFL),
    ) as pool:
        waiting = {pool.submit(work, task): number for number, task in enumerate(tasks)}
        step = max(len(tasks) // 10, 1)
        for done, future in enumerate(as_completed(waiting), start=1):
            results[waiting[future]] = future.result()
            if done % step == 0 or done == len(tasks):
                seconds = time.perf_counter() - began
                aside(f"{what}: {done} of {len(tasks)} parts, {seconds:.0f} s")
    return [results[number] for number in range(len(tasks))]
