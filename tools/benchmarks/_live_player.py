"""Plays a drive on a bus from a process of its own; prints how many frames it sent."""

import argparse
import sys

from _live_bus import Bus, drive_frames, play


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--interface", required=True)
    parser.add_argument("--channel", required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--foreign", type=float, default=0.0, help="foreign frames a second")
    parser.add_argument("--pause", type=float, nargs=2, action="append", default=[])
    options = parser.parse_args()
    frames = drive_frames(options.seconds, options.foreign)
    print("ready", flush=True)
    sys.stdin.readline()
    with Bus(options.interface, options.channel).open() as bus:
        print(play(bus, frames, options.pause), flush=True)


if __name__ == "__main__":
    main()
