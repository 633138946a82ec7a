"""The service on any frames and marks, frame by frame and in blocks."""

from dataclasses import replace
from functools import cache
from math import isfinite

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import ADVANCE, SECOND_SENDER, STOP, Frame, Mark
from adhesion_can.config import load_configuration
from adhesion_can.physics.status import Status
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.replay import replay, replay_blocks
from tests.fuzz.octets import Octets
from tests.wire import INPUTS, REQUIRED, Bench, decoded, seal_ok, sealed

_NAMES = tuple(INPUTS)
_DRIVE_US = 100_000
_LATEST_US = 1 << 62
_ESTIMATORS = (*["rls"] * 7, "tracker")  # the one of the service takes a hundred times as long
_MOST_ITEMS = 100
_MOST_SENT = 100_000


def service(data):
    """Frames and marks at any times: valid answers, and the same of blocks as of single frames."""
    choices = Octets(data)
    configuration = _configuration(choices.among(_ESTIMATORS))
    size = 1 + choices.below(100)
    items = list(_items(choices))
    core, sent = _played(replay, items, configuration)
    setpoints = [frame for frame in sent if frame.arbitration_id == 0x201]
    assert len(sent) < _MOST_SENT
    assert all(map(seal_ok, sent))
    for frame in setpoints[:1] + setpoints[-1:]:
        assert str(decoded(frame)["Status"]) in Status.__members__
    assert core.outputs.status in Status
    assert core.outputs.theta is None or all(map(isfinite, core.outputs.theta))
    whole = Block.from_frames(items) if items else None
    blocks = [whole.select(slice(begin, begin + size)) for begin in range(0, len(items), size)]
    _, again = _played(replay_blocks, blocks, configuration)
    assert again == sent


def _played(run, items, configuration):
    core, sent = ServiceCore(configuration), []
    run(items, core, sent.append)
    return core, sent


@cache
def _configuration(estimator):
    return replace(load_configuration(), estimator=estimator)


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
            left -= 10
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
        return t_us + (code - 252) * 60_000_000 + 3_000_000  # a silence of 3 s, or a hole
    return min(choices.number(8) >> choices.below(64), _LATEST_US // 1000)


@cache
def _drive(slip, adhesion):
    """Frames of a steady drive of 0.1 s from time 0 on."""
    bench = Bench()
    names = (*REQUIRED, "AxleLoads1", "AxleLoads2")
    return tuple(bench.drive(0, _DRIVE_US, names, slip=slip, adhesion=adhesion))


def _sealed(frame, t_us, counts):
    """The frame at a time with the next count of its message."""
    name = _NAMES[list(INPUTS.values()).index(frame.arbitration_id)]
    payload = sealed(frame.arbitration_id, frame.data, counts[name])
    counts[name] = (counts[name] + 1) % 15
    return frame._replace(t_us=t_us, data=payload)
