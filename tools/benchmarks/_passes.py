"""What a process of the ladder measures of itself: only Python's own modules are behind it."""

import gc
import json
import time

from _diagnosis import peak_mib

SPEND_S = 1.0
"""A pass that takes less is done again until they take this together."""


def timed(work):
    """(clock, processor) seconds of each pass, and the result of the last one."""
    passes, result, spent = [], None, 0.0
    while spent < SPEND_S:
        result = None
        gc.collect()
        clock, processor = time.perf_counter(), time.process_time()
        result = work()
        passes.append((time.perf_counter() - clock, time.process_time() - processor))
        spent += passes[-1][0]
    return passes, result


def print_result(frames, passes, **more):
    """Print a last line that `_reading_speed.run_process` reads; frames None: not counted."""
    print(json.dumps({"frames": frames, "passes": passes, "mib": peak_mib(), **more}))
