"""Which frames of a bench in live time had a prompt past: what a test may claim on a busy machine.

A machine that is busy holds senders, receivers and the service up. Inputs are stale then, and the
service says so. What it says where nobody was late is claimed as on an idle machine.
"""

import pytest

from tests.wire import INPUTS, REQUIRED

GAP_US = 40_000
"""Longest time between two frames of one id where nobody is late, µs: four cycles of most."""
PAST_US = 3_000_000
"""Least time since the last such gap, µs."""
ON_TIME = tuple(INPUTS[name] for name in REQUIRED)


def frames_with_prompt_past(
    frames, number, past_us=PAST_US, gap_us=GAP_US, of=ON_TIME, is_whole=False
):
    """Frames of an id before which it and some others came without a gap.

    Args:
        frames: Frames of a bus, in the order of their stamps.
        number: The id.
        past_us: Time for which there was no gap, µs.
        gap_us: Longest time between two frames of one id, µs.
        of: The other ids; by default those of the required inputs.
        is_whole: Whether the search ends at the first gap after all ids came. What the service
            says may depend on all that it saw, for longer than `past_us`: a claim on that needs
            a run in which nobody was ever late.

    """
    watched = {*of, number}
    latest_us: dict[int, int] = {}
    late_us, found = 0, []
    for frame in frames:
        if frame.arbitration_id not in watched:
            continue
        is_first = frame.arbitration_id not in latest_us
        if is_first or frame.t_us - min(latest_us.values()) > gap_us:
            if is_whole and not is_first and len(latest_us) == len(watched):
                break
            late_us = frame.t_us
        latest_us[frame.arbitration_id] = frame.t_us
        is_complete = len(latest_us) == len(watched)
        if frame.arbitration_id == number and is_complete and frame.t_us - late_us >= past_us:
            found.append(frame)
    return found


def need_prompt(share, least):
    """Skip the rest of a test, which is about a bench where few are late, where many were.

    Args:
        share: Share of the frames with a prompt past, or of another count with what is due.
        least: Least share that the rest of the test needs.

    """
    if share < least:
        pytest.skip(f"the machine is busy: {share:.0%} came in time, the test needs {least:.0%}")
