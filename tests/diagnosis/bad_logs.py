"""Recordings in which something is wrong with the readings, but every frame is in order."""

from functools import cache

import numpy as np

from tests.worlds.encoding import _text, database, messages, packed
from tests.worlds.plant import drive
from tests.worlds.world import World

MISSING = {
    "wheel_speed": 65535 * 0.002,
    "speed": 65535 * 0.002,
    "effort": 32767 * 10.0,
    "load": 65535 * 10.0,
    "humidity": 255 * 0.5,
    "rail_temperature": 255 * 0.5 - 40,
    "ambient_temperature": 255 * 0.5 - 40,
    "curvature": 32767 * 1e-6,
    "gradient": 32767 * 1e-5,
}
"""What stands for 'not available': all ones."""
CYCLE_S = {"wheel_speed": 0.01, "effort": 0.01, "speed": 0.02, "load": 0.2, "humidity": 1.0}


@cache
def world(duration_s=52.0, seed=3):
    """A drive in which nothing is hidden."""
    return World("null:0", seed, 0, duration_s)


def readings(duration_s=52.0, seed=3):
    """Its readings, to be spoilt."""
    one = world(duration_s, seed)
    return drive(one.profile, one.vehicle, one.rail, (), one.noise)


def write(path, given, *, without=(), kept=None, stamps=None):
    """Write readings as a recording.

    Args:
        path: of the file.
        given: readings.
        without: names of messages that are absent.
        kept: tells which frames are there, from name and stamps in s.
        stamps: changes the stamps, µs, of all frames in the order of their sending.

    """
    t_us, number, data = [], [], []
    for name, signals in messages(given).items():
        if name in without:
            continue
        message = database().get_message_by_name(name)
        frames = packed(message, signals)
        t = np.arange(len(frames), dtype=np.int64) * message.cycle_time * 1000
        there = np.ones(len(t), dtype=bool) if kept is None else kept(name, t / 1e6)
        t_us.append(t[there])
        number.append(np.full(int(there.sum()), message.frame_id))
        data.append(frames[there])
    t_us, number, data = np.concatenate(t_us), np.concatenate(number), np.concatenate(data)
    order = np.lexsort((number, t_us))
    t_us, number, data = t_us[order], number[order], data[order]
    if stamps is not None:
        t_us = np.asarray(stamps(t_us), dtype=np.int64)
        # The writer groups stamps by their digits: lines must keep their order.
        lines = [
            _text(t_us[i : i + 1], number[i : i + 1], data[i : i + 1]) for i in range(len(t_us))
        ]
        path.write_bytes(b"".join(lines))
        return path
    path.write_bytes(_text(t_us, number, data))
    return path
