"""The service on any frames and marks, frame by frame and in blocks."""

from functools import cache
from math import isfinite

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import ADVANCE, SECOND_SENDER, STOP, Frame, Mark
from adhesion_can.config import load_configuration
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.replay import replay, replay_blocks
from adhesion_can.service.states import Status
from tests.fuzz.octets import Octets
from tests.wire import INPUTS, REQUIRED, Bench, decoded, seal_ok, sealed

_NAMES = tuple(INPUTS)
_DRIVE_US = 200_000
_LATEST_US = 1 << 62
_MOST_ITEMS = 200
_MOST_SENT = 100_000


def service(data):
    """Frames and marks at any times: valid answers, and the same of blocks as of single frames."""
    items = list(_items(Octets(data)))
    core, sent = _played(replay, items)
    setpoints = [frame for frame in sent if frame.arbitration_id == 0x201]
    assert len(sent) < _MOST_SENT
    assert all(map(seal_ok, sent))
    for frame in setpoints[:1] + setpoints[-1:]:
        assert str(decoded(frame)["Status"]) in Status.__members__
    assert core.outputs.status in Status
    assert core.outputs.theta is None or all(map(isfinite, core.outputs.theta))
    choices = Octets(data)
    size = 1 + choices.below(100)
    whole = Block.from_frames(items) if items else None
    blocks = [whole.select(slice(begin, begin + size)) for begin in range(0, len(items), size)]
    _, again = _played(replay_blocks, blocks)
    assert again == sent


def _played(run, items):
    core, sent = ServiceCore(_configuration()), []
    run(items, core, sent.append)
    return core, sent


@cache
def _configuration():
    return load_configuration()


def _items(choices):
    """Frames and marks, from drives, sealed payloads and any bytes."""
    counts, t_us, left = dict.fromkeys(_NAMES, 0), 0, _MOST_ITEMS
    while choices and left > 0:
        t_us = _later(choices, t_us)
        kind = choices.number()
        left -= 1
        if kind < 64:
            for frame in _drive(choices.among((0.0, 0.01, 0.05, 0.3)), choices.among((0.0, 0.3))):
                yield _sealed(frame, t_us + frame.t_us, counts)
            t_us += _DRIVE_US
            left -= 20
        elif kind < 192:
            name = choices.among(_NAMES)
            yield _sealed(Frame(0, INPUTS[name], choices.take(8)), t_us, counts)
        elif kind < 224:
            number = choices.number(4)
            yield Frame(
                t_us,
                number & (0x1FFFFFFF if number >> 31 else 0x7FF),
                choices.take(choices.below(9)),
                is_extended=bool(number >> 31),
                is_remote=kind == 192,
                is_error=kind == 193,
            )
        else:
            yield Mark(t_us, choices.among((ADVANCE, ADVANCE, SECOND_SENDER, STOP)))


def _later(choices, t_us):
    """Time of the next item: about a cycle later, a silence, a hole, or earlier."""
    code = choices.number()
    if code < 200:
        return t_us + code * 100
    if code < 252:
        return t_us + (code - 199) * 5_000
    if code < 254:
        return t_us + (code - 251) * 40_000_000  # a silence of 40 s, or a hole of 80 s
    return min(choices.number(8) >> choices.below(64), _LATEST_US // 1000)


@cache
def _drive(slip, adhesion):
    """Frames of a steady drive of 0.2 s from time 0 on."""
    bench = Bench()
    names = (*REQUIRED, "AxleLoads1", "AxleLoads2")
    return tuple(bench.drive(0, _DRIVE_US, names, slip=slip, adhesion=adhesion))


def _sealed(frame, t_us, counts):
    """The frame at a time with the next count of its message."""
    name = _NAMES[list(INPUTS.values()).index(frame.arbitration_id)]
    payload = sealed(frame.arbitration_id, frame.data, counts[name])
    counts[name] = (counts[name] + 1) % 15
    return frame._replace(t_us=t_us, data=payload)
