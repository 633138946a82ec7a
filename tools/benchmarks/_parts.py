"""Where the time of text to columns goes: the chain on one core, and its parts beside it."""

import re
import tempfile
import time
from pathlib import Path

import numpy as np
from _passes import timed

from adhesion_can.bus.block import to_micros
from adhesion_can.bus.database import e2e_data_id, load_database, packaged_path
from adhesion_can.bus.decoder import Decoder
from adhesion_can.bus.e2e import CounterSupervision, checksums_ok
from adhesion_can.recordings.recording import Recording


def unchecked_database():
    """Our database without the attribute that asks for E2E checks."""
    text = packaged_path().read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "unchecked.dbc"
        path.write_text(re.sub(r'(?m)^BA_\w* .*"E2EDataId".*\n', "", text), encoding="utf-8")
        return load_database(path)


class _Parts:
    """Seconds of the processor by part; each block goes through all of them while it is warm."""

    def __init__(self):
        self.seconds = {}

    def time(self, name, work):
        began = time.process_time()
        result = work()
        self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - began
        return result


def _check(one, supervisions, parts):
    """Checksums and counters of a message's frames, as the decoder has them done."""
    size, data_id = one.message.length, e2e_data_id(one.message)
    sound = parts.time("checksum", lambda: checksums_ok(one.words, size, data_id))
    if one.message.name not in supervisions:
        supervisions[one.message.name] = CounterSupervision(one.message.cycle_time * 1000)

    def supervise():
        counts = ((one.words[:, 0] >> np.uint64(8)) & np.uint64(15)).astype(np.uint8)
        supervisions[one.message.name].accept_all(counts, to_micros(one.t_ns), sound)

    parts.time("counter", supervise)


def once(path, databases):
    """Parts of a pass over a recording."""
    checked, unchecked = databases
    parts, supervisions = _Parts(), {}
    whole, bare = Decoder(checked), Decoder(unchecked)
    grouping = Decoder(unchecked, lambda _message, _signal: False)
    blocks = Recording(path).blocks()
    while (block := parts.time("parse", lambda: next(blocks, None))) is not None:
        columns = parts.time("decode", lambda: whole.decode(block))
        parts.time("bare", lambda: bare.decode(block))
        parts.time("group", lambda: grouping.decode(block))
        for one in columns:
            _check(one, supervisions, parts)
    seconds = parts.seconds
    checks = seconds["checksum"] + seconds["counter"]
    return {
        "text to frames": seconds["parse"],
        "group by id": seconds["group"],
        "gather rows, extract signals": seconds["bare"] - seconds["group"],
        "checksums": seconds["checksum"],
        "counters": seconds["counter"],
        "rest of the checks (outcomes, counts)": seconds["decode"] - seconds["bare"] - checks,
    }


def parts_of(path):
    """Passes, and the parts of the last one."""
    databases = load_database(), unchecked_database()
    return timed(lambda: once(path, databases))
