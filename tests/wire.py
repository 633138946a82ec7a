"""A bench of the tests' own: frames made with cantools and a bitwise CRC."""

from pathlib import Path

import cantools

from adhesion_can.bus.frame import Frame

DBC = Path(__file__).resolve().parent.parent / "dbc" / "adhesion.dbc"
DB = cantools.database.load_file(DBC)
INPUTS = {
    "WheelSpeeds1": 0x101,
    "WheelSpeeds2": 0x102,
    "VehicleSpeed": 0x111,
    "TractiveEffort1": 0x121,
    "TractiveEffort2": 0x122,
    "AxleLoads1": 0x131,
    "AxleLoads2": 0x132,
    "Environment": 0x141,
    "TrackGeometry": 0x151,
}
CYCLES_MS = {
    "WheelSpeeds1": 10,
    "WheelSpeeds2": 10,
    "VehicleSpeed": 20,
    "TractiveEffort1": 10,
    "TractiveEffort2": 10,
    "AxleLoads1": 200,
    "AxleLoads2": 200,
    "Environment": 1000,
    "TrackGeometry": 200,
}
REQUIRED = ("WheelSpeeds1", "WheelSpeeds2", "VehicleSpeed", "TractiveEffort1", "TractiveEffort2")


def divided(byte):
    """Remainder of one byte by the polynomial 0x1D, bit by bit."""
    for _ in range(8):
        byte = ((byte << 1) ^ 0x1D if byte & 0x80 else byte << 1) & 0xFF
    return byte


REMAINDERS = [divided(byte) for byte in range(256)]


def crc8(data):
    """CRC-8, polynomial 0x1D, init 0, no final xor."""
    crc = 0
    for byte in data:
        crc = REMAINDERS[crc ^ byte]
    return crc


def sealed(data_id, payload, count):
    """Payload with counter and checksum of E2E profile 1."""
    data = bytearray(payload)
    data[1] = (data[1] & 0xF0) | count
    data[0] = crc8(bytes([data_id & 0xFF, data_id >> 8]) + bytes(data[1:]))
    return bytes(data)


def seal_ok(frame):
    """Whether an output frame carries the right checksum; its data id is its id."""
    data = frame.data
    number = frame.arbitration_id
    return data[0] == crc8(bytes([number & 0xFF, number >> 8]) + data[1:])


def decoded(frame):
    """Signals by name; text where the value table has one."""
    return DB.decode_message(frame.arbitration_id, frame.data)


def values(name, **signals):
    """Unsealed payload of a message; signals not named are zero."""
    message = DB.get_message_by_name(name)
    full = {s.name: 0 for s in message.signals} | signals
    return message.encode(full, strict=False)


class Bench:
    """Sends each message with its own counter.

    A steady drive: speed 10 m/s, wheel speeds and efforts as given.
    """

    def __init__(self):
        self.counts = dict.fromkeys(INPUTS, 0)

    def frame(self, name, t_us, **signals):
        payload = sealed(INPUTS[name], values(name, **signals), self.counts[name])
        self.counts[name] = (self.counts[name] + 1) % 15
        return Frame(t_us, INPUTS[name], payload)

    def steady(self, name, t_us, speed=10.0, slip=0.05, adhesion=0.3, source=1, radius=0.625):
        """The frame of a drive in which every axle slips and pulls alike."""
        if name.startswith("WheelSpeeds"):
            omega = speed * (1 + slip) / radius
            signals = {f"WheelSpeed_Ax{i}": omega for i in axles(name)}
        elif name.startswith("TractiveEffort"):
            signals = {f"TractiveEffort_Ax{i}": adhesion * 245e3 for i in axles(name)}
        elif name.startswith("AxleLoads"):
            signals = {f"AxleLoad_Ax{i}": 245e3 for i in axles(name)}
        elif name == "VehicleSpeed":
            signals = {"VehicleSpeed": speed, "VehicleSpeedSource": source, "Direction": 1}
        else:
            signals = {}
        return self.frame(name, t_us, **signals)

    def drive(self, from_us, to_us, names=REQUIRED, **how):
        """Frames of a steady drive, each message at its cycle, in the order of their stamps."""
        for t_us in range(from_us, to_us, 10_000):
            for name in names:
                if (t_us - from_us) % (CYCLES_MS[name] * 1000) == 0:
                    yield self.steady(name, t_us, **how)


def axles(name):
    """Axles of a message with three of them."""
    first = 1 if name.endswith("1") else 4
    return range(first, first + 3)
