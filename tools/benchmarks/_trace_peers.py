"""Peers that read traces, in a process and an environment of their own: `_trace_peers.py WAY FILE`.

Each pass gives every frame once and keeps none, in the way that the peer documents.
"""

import sys

from _passes import print_result, timed


def python_can(path):
    import can

    def work():
        with can.LogReader(path) as reader:
            return sum(1 for _ in reader)

    passes, count = timed(work)
    print_result(count, passes)


def vblf(path):
    from vblf.reader import BlfReader

    def work():
        with BlfReader(path) as reader:
            return sum(1 for _ in reader)

    passes, count = timed(work)
    print_result(count, passes)


def mdfr(path):
    """All channels of the bus logging as arrays in memory."""
    import mdfr

    def work():
        opened = mdfr.Mdfr(path)
        opened.load_all_channels_data_in_memory()
        (name,) = (n for n in opened.get_channel_names_set() if n.endswith("CAN_DataFrame.ID"))
        return len(opened.get_channel_data(name))

    passes, count = timed(work)
    print_result(count, passes)


def versions(*names):
    from importlib.metadata import version

    print_result(None, [], versions={name: version(name) for name in names})


if __name__ == "__main__":
    ways = {"python-can": python_can, "vblf": vblf, "mdfr": mdfr, "versions": versions}
    ways[sys.argv[1]](*sys.argv[2:])
