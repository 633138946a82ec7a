"""Feeding a creep controller: what a drive does with the frames of the service.

    python controller.py [DURATION_S]

`SetpointReceiver` is the part to bring into your drive, in whatever language. It supervises
checksum, counter and cycle, and gives a slip to hold only where the service is sure. The rest of
the file feeds it: frames of a simulated drive through `ServiceCore`, the service without a bus.
"""

import sys
from collections import Counter
from dataclasses import dataclass, field

import cantools
from e2e.p01 import e2e_p01_protect

import adhesion_can
from adhesion_can.bus.database import packaged_path

SETPOINT, QUALITY = 0x201, 0x203
TRACKING, SURFACE_CHANGE = 1, 3
NO_DOUBT = 0
NOT_AVAILABLE = 0xFFFF
"""All ones: test the raw value, before it is scaled."""
CAUTIOUS_SLIP = 0.01
"""Slip to hold without the service: below the peak of every rail."""
WIDE = 0.1
"""Relative standard deviation of the peak's slip from which one stays below it."""


@dataclass
class SetpointReceiver:
    """Slip to hold, from frames of the service."""

    slip: float = CAUTIOUS_SLIP
    why: str = "nothing received yet"
    lambda_m_std: float = 1.0
    doubt: int = 15
    latest_us: int = -1
    counts: dict[int, int] = field(default_factory=dict)

    def receive(self, t_us: int, identifier: int, payload: bytes) -> None:
        """Take a frame; one that fails its checks counts as silence."""
        if identifier not in (SETPOINT, QUALITY) or not self._is_good(identifier, payload):
            return
        status_or_doubt = payload[1] >> 4
        first, second, third = (int.from_bytes(payload[n : n + 2], "little") for n in (2, 4, 6))
        if identifier == QUALITY:
            self.doubt = status_or_doubt
            self.lambda_m_std = 1.0 if second == NOT_AVAILABLE else second * 1e-5
            return
        self.latest_us = t_us
        mu_max, lambda_m, creep = first, second, third
        if NOT_AVAILABLE in (mu_max, lambda_m, creep):
            self.slip, self.why = CAUTIOUS_SLIP, "no value: the drive's own control holds it"
        elif status_or_doubt == SURFACE_CHANGE:
            self.slip, self.why = CAUTIOUS_SLIP, "the rail changed: ease off, then probe"
        elif status_or_doubt != TRACKING or self.doubt not in (NO_DOUBT, 15):
            self.slip, self.why = 0.5 * lambda_m * 1e-5, "the peak is not sure: stay well below it"
        else:
            # The wider it is, the further below the peak: one standard deviation, at most half.
            self.slip = max(lambda_m * 1e-5 - self.lambda_m_std, 0.5 * lambda_m * 1e-5)
            wide = self.lambda_m_std > WIDE * lambda_m * 1e-5
            self.why = "the peak is known roughly: stay one standard deviation below it"
            if not wide:
                self.why = "the peak is known"

    def advance(self, t_us: int) -> None:
        """Without a setpoint for three cycles of 20 ms the drive is on its own."""
        if self.latest_us >= 0 and t_us - self.latest_us > 60_000:
            self.slip, self.why = CAUTIOUS_SLIP, "silence"
        if t_us - self.latest_us > 200_000:
            self.counts = {}  # after ten cycles any count is taken

    def _is_good(self, identifier: int, payload: bytes) -> bool:
        """AUTOSAR E2E profile 1: checksum, and a counter that moves on by 1 to 3."""
        again = bytearray(payload)
        e2e_p01_protect(again, identifier, increment_counter=False)
        count = payload[1] & 0x0F
        step = (count - self.counts.get(identifier, count - 1)) % 15
        if again[0] != payload[0] or count > 14 or not 1 <= step <= 3:
            return False
        self.counts[identifier] = count
        return True


def main(duration_s: float = 40.0) -> None:
    drive = adhesion_can.simulate("dry-wet-dry", duration_s, seed=1)
    core = adhesion_can.ServiceCore(adhesion_can.load_configuration())
    receiver, reasons = SetpointReceiver(), Counter()
    said = ""
    begin = drive.frames[0].t_us
    for frame in drive.frames:
        receiver.advance(frame.t_us)
        for answer in core.feed(frame):  # on a bench this is bus.recv()
            receiver.receive(answer.t_us, answer.arbitration_id, answer.data)
            if answer.arbitration_id == SETPOINT:
                reasons[receiver.why] += 1
        if receiver.why != said:
            said = receiver.why
            time_s = (frame.t_us - begin) / 1e6
            print(f"{time_s:6.2f} s  hold a slip of {receiver.slip:.4f}: {said}")
    print("; ".join(f"{count} setpoints: {why}" for why, count in reasons.most_common()))

    # A forged frame changes nothing.
    before = receiver.slip
    message = cantools.database.load_file(packaged_path()).get_message_by_frame_id(SETPOINT)
    values = dict.fromkeys(("MuMax", "LambdaM", "CreepSpeedSetpoint"), 0.6)
    forged = message.encode({"Crc": 0, "Alive": 0, "Status": 1, **values})
    receiver.receive(drive.frames[-1].t_us, SETPOINT, forged)
    print("forged frame refused" if receiver.slip == before else "forged frame TAKEN")


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
