"""What the rows of a benchmark share: printing beside a target, and work over all cores."""

import sys
import time

from tools.processes import results_as_done


class Report:
    """Prints figures as they come, and counts the targets."""

    def __init__(self):
        self.met = 0
        self.missed = []
        self.checks = []
        """Figure, value, target and whether it was met, of each target so far."""

    def write(self, text):
        print(f"  {text}", flush=True)

    def check(self, what, value, target, *, met):
        """A figure beside its target, both as text."""
        self.write(f"{what}: {value} (target {target}: {'met' if met else 'MISSED'})")
        self.checks.append({"what": what, "value": value, "target": target, "met": bool(met)})
        if met:
            self.met += 1
        else:
            self.missed.append(what)

    def at_most(self, what, value, most, form=".3f"):
        self.check(what, format(value, form), f"at most {most:{form}}", met=value <= most)

    def summarise(self):
        """How many targets were met, and which were missed."""
        print(f"\n{self.met} of {self.met + len(self.missed)} targets met")
        for what in self.missed:
            print(f"  MISSED: {what}")


def aside(text):
    """A line about the progress."""
    print(text, file=sys.stderr, flush=True)


def over_cores(work, tasks, jobs, what):
    """Results of `work` in the order of the tasks, from processes of their own."""
    began = time.perf_counter()
    results = {}
    step = max(len(tasks) // 10, 1)
    for done, (number, result) in enumerate(results_as_done(work, tasks, jobs), start=1):
        results[number] = result
        if done % step == 0 or done == len(tasks):
            seconds = time.perf_counter() - began
            aside(f"{what}: {done} of {len(tasks)} parts, {seconds:.0f} s")
    return [results[number] for number in range(len(tasks))]
