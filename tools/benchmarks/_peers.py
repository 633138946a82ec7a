"""The peers, in a process and an environment of their own: `_peers.py WAY FILE ..`.

Each pass is the peer's own documented way, without anything of ours in it; what is loaded once, as
the database, is loaded before. `sums` of the signals show what it found.
"""

import sys
from math import fsum
from pathlib import Path

from _passes import print_result, timed


def cantools_way(path, dbc):
    """python-can's reader and cantools' decode_message, nothing kept."""
    import can
    import cantools

    decode = cantools.database.load_file(dbc).decode_message

    def work():
        count = 0
        with can.LogReader(path) as reader:
            for message in reader:
                decode(message.arbitration_id, message.data, decode_choices=False)
                count += 1
        return count

    passes, count = timed(work)
    print_result(count, passes)


def cantools_columns(path, dbc):
    """The same into a list for each signal: what the other ways end with."""
    import can
    import cantools

    database = cantools.database.load_file(dbc)
    decode = database.decode_message

    def work():
        found = {}
        with can.LogReader(path) as reader:
            for message in reader:
                lists = found.setdefault(message.arbitration_id, {})
                lists.setdefault(None, []).append(message.timestamp)
                values = decode(message.arbitration_id, message.data, decode_choices=False)
                for signal, value in values.items():
                    lists.setdefault(signal, []).append(value)
        return found

    passes, found = timed(work)
    names = {message.frame_id: message.name for message in database.messages}
    sums = {
        f"{names[key]}.{signal}": fsum(values)
        for key, lists in found.items()
        for signal, values in lists.items()
        if signal is not None
    }
    print_result(sum(len(lists[None]) for lists in found.values()), passes, sums=sums)


def _databases(dbc):
    from asammdf.blocks.utils import load_can_database

    return {"CAN": [(load_can_database(dbc), 0)]}


def _values(extracted):
    """Every signal in its unit, beside its group."""
    places = [
        (None, group, place)
        for group, one in enumerate(extracted.groups)
        for place in range(1, len(one.channels))
    ]
    return places, extracted.select(places, ignore_value2text_conversions=True)


def _frames(extracted):
    """Number of frames; the pages of a multiplexer are groups of their own beside their message."""
    counts = {}
    for group in extracted.groups:
        counts.setdefault(group.channel_group.comment, []).append(group.channel_group.cycles_nr)
    return sum(max(numbers) for numbers in counts.values())


def asammdf_way(path, dbc):
    """extract_bus_logging of a file that is open."""
    from asammdf import MDF

    databases = _databases(dbc)
    with MDF(path) as opened:
        passes, extracted = timed(lambda: opened.extract_bus_logging(databases))
    sums = {}
    for (_, group, _), signal in zip(*_values(extracted), strict=True):
        # 'CAN1 - message <name> <id> ..'
        message = extracted.groups[group].channel_group.comment.split()[3]
        sums[f"{message}.{signal.name}"] = fsum(signal.samples)
    print_result(_frames(extracted), passes, sums=sums)


def asammdf_with_load(path, dbc):
    """Opening and extract_bus_logging."""
    from asammdf import MDF

    databases = _databases(dbc)
    passes, extracted = timed(lambda: MDF(path).extract_bus_logging(databases))
    print_result(_frames(extracted), passes)


def asammdf_with_values(path, dbc):
    """Opening, extract_bus_logging, and each signal in its unit: it is left raw until asked for."""
    from asammdf import MDF

    databases = _databases(dbc)

    def work():
        extracted = MDF(path).extract_bus_logging(databases)
        return _frames(extracted), _values(extracted)

    passes, (frames, _) = timed(work)
    print_result(frames, passes)


def write_mf4(path, out, payload_bytes, compression):
    """The recording as a bus logging in MF4.

    Records as python-can's own writer lays them out, which has room for 64 bytes and compresses,
    or as suits the reader best: 8 bytes, not compressed. Its writer takes a minute for this.
    """
    import numpy as np
    from asammdf import MDF, Signal, Source
    from asammdf.blocks.v4_constants import BUS_TYPE_CAN, SOURCE_BUS

    with Path(path).open() as file:
        lines = [line.split() for line in file]
    stamps = np.array([stamp[1:-1] for stamp, _, _ in lines]).astype(float)
    parts = [frame.partition("#") for _, _, frame in lines]
    samples = np.zeros(
        len(lines),
        [
            ("CAN_DataFrame.BusChannel", "<u1"),
            ("CAN_DataFrame.ID", "<u4"),
            ("CAN_DataFrame.IDE", "<u1"),
            ("CAN_DataFrame.DLC", "<u1"),
            ("CAN_DataFrame.DataLength", "<u1"),
            ("CAN_DataFrame.DataBytes", f"({payload_bytes},)u1"),
            ("CAN_DataFrame.Dir", "<u1"),
            ("CAN_DataFrame.EDL", "<u1"),
            ("CAN_DataFrame.BRS", "<u1"),
            ("CAN_DataFrame.ESI", "<u1"),
        ],
    )
    samples["CAN_DataFrame.BusChannel"] = 1
    samples["CAN_DataFrame.ID"] = [int(key, 16) for key, _, _ in parts]
    samples["CAN_DataFrame.IDE"] = [len(key) > 3 for key, _, _ in parts]
    lengths = [len(data) // 2 for _, _, data in parts]
    samples["CAN_DataFrame.DLC"] = samples["CAN_DataFrame.DataLength"] = lengths
    raw = b"".join(bytes.fromhex(data).ljust(8, b"\0") for _, _, data in parts)
    samples["CAN_DataFrame.DataBytes"][:, :8] = np.frombuffer(raw, np.uint8).reshape(-1, 8)
    with MDF(version="4.10") as file:
        source = Source("CAN1", "CAN1", "", SOURCE_BUS, BUS_TYPE_CAN)
        file.append(
            Signal(samples, stamps - stamps[0], name="CAN_DataFrame", source=source),
            acq_name="CAN1",
            acq_source=source,
        )
        file.save(out, overwrite=True, compression=int(compression))
    print_result(len(lines), [])


def versions():
    """Of the peers and of what they stand on."""
    from importlib.metadata import version

    names = ("python-can", "cantools", "asammdf", "numpy")
    print_result(None, [], versions={name: version(name) for name in names})


if __name__ == "__main__":
    ways = {
        "cantools": cantools_way,
        "cantools-columns": cantools_columns,
        "asammdf": asammdf_way,
        "asammdf-load": asammdf_with_load,
        "asammdf-values": asammdf_with_values,
        "write-mf4": write_mf4,
        "versions": versions,
    }
    ways[sys.argv[1]](*sys.argv[2:])
