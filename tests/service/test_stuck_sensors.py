"""Sensors that freeze while their frames stay valid: what is sent meanwhile, and after it."""

import struct
from functools import cache

import numpy as np
import pytest

import adhesion_can
from adhesion_can.bus.frame import Frame
from adhesion_can.config import load_configuration
from adhesion_can.offline.check import check
from adhesion_can.recordings.candump import format_frame
from adhesion_can.recordings.recording import Recording
from adhesion_can.service.core import ServiceCore
from tests.seeds import first_quick
from tests.wire import CYCLES_MS, INPUTS, REQUIRED, Bench, sealed

FROM_S, UNTIL_S, DURATION_S = 12.0, 19.0, 25.0
NAMES = {number: name for name, number in INPUTS.items()}
WHEELS = ("WheelSpeeds1", "WheelSpeeds2")
EFFORTS = ("TractiveEffort1", "TractiveEffort2")
FROZEN = {
    "speed": {"VehicleSpeed": (2,)},
    "all wheels": dict.fromkeys(WHEELS, (2, 4, 6)),
    "a bogie's wheels": {"WheelSpeeds1": (2, 4, 6)},
    "all efforts": dict.fromkeys(EFFORTS, (2, 4, 6)),
    "a wheel": {"WheelSpeeds2": (4,)},
    "an effort": {"TractiveEffort1": (2,)},
}
"""Places of the frozen signals in the payloads of their messages."""


@cache
def drive(scenario, seed, folder):
    simulated = adhesion_can.simulate(scenario, DURATION_S, seed=seed)
    path = simulated.write(folder / f"{scenario}{seed}.log")
    blocks = list(Recording(path).blocks(1 << 20))
    return simulated.truth["surfaces"][0], [one for block in blocks for one in block.items()]


def frozen(frames, places):
    """The frames, sealed anew, with the values of the begin of the freeze in its time."""
    first_us, held = frames[0].t_us, {}
    for frame in frames:
        name = NAMES.get(frame.arbitration_id)
        time_s = (frame.t_us - first_us) / 1e6
        if name not in places or not FROM_S <= time_s < UNTIL_S:
            yield frame
            continue
        data = bytearray(frame.data)
        for place in places[name]:
            (raw,) = struct.unpack_from("<H", data, place)
            struct.pack_into("<H", data, place, held.setdefault((name, place), raw))
        payload = sealed(frame.arbitration_id, bytes(data), data[1] & 0xF)
        yield Frame(frame.t_us, frame.arbitration_id, payload, frame.channel)


@pytest.mark.costly
@pytest.mark.parametrize(
    ("scenario", "what"), first_quick([*(("dry", what) for what in FROZEN), ("wet", "speed")], 3)
)
def test_a_frozen_sensor_makes_no_confident_setpoint_wrong(what, scenario, tmp_path_factory):
    """Not found, a frozen speed gives λ_m up to 145 % too large, with status TRACKING."""
    folder = tmp_path_factory.getbasetemp()
    truth, frames = drive(scenario, 1, folder)
    path = folder / f"{scenario} {what}.log".replace(" ", "_").replace("'", "")
    path.write_text("".join(map(format_frame, frozen(frames, FROZEN[what]))))
    table = adhesion_can.replay(path)
    time_s = table["time_s"] - table["time_s"][0]
    tracking = (table["status"] == "TRACKING") & (time_s > FROM_S)
    assert np.abs(table["mu_max"][tracking] / truth["mu_max"] - 1.0).max() < 0.03
    assert np.abs(table["lambda_m"][tracking] / truth["lambda_m"] - 1.0).max() < 0.10
    inside = (time_s > FROM_S + 1.0) & (time_s < UNTIL_S)
    if what in ("a wheel", "an effort"):
        # Of a single axle the others tell all that is wanted.
        assert (table["status"][inside] == "TRACKING").mean() > 0.9
    else:
        assert set(table["status"][inside]) == {"STALE_INPUT"}
    after = time_s > UNTIL_S + 3.0
    assert (table["status"][after] == "TRACKING").mean() > 0.9


@pytest.mark.costly
def test_the_check_of_a_recording_tells_a_stuck_signal(tmp_path):
    _, frames = drive("dry", 1, tmp_path)
    path = tmp_path / "frozen.log"
    path.write_text("".join(map(format_frame, frozen(frames, FROZEN["speed"]))))
    blocks = Recording(path).blocks(1 << 20)
    result = check(blocks, load_configuration())
    (told,) = [one for one in result.failures if "stuck" in one]
    assert told.startswith("VehicleSpeed (0x111): ")
    readings = next(m["stuck"] for m in result.to_dict()["messages"] if m["name"] == "VehicleSpeed")
    assert 0.9 < readings / (50 * (UNTIL_S - FROM_S)) < 1.0
    assert f"{readings} readings" in told


@pytest.mark.costly
def test_wheels_that_stand_still_while_the_vehicle_moves_cause_no_failure():
    """A warning of numpy's, an error in these tests, would be a failure of the estimator."""
    core = ServiceCore(load_configuration())
    rng = np.random.default_rng(1)
    bench = Bench()
    for t_us in range(0, 12_000_000, 10_000):
        for name in REQUIRED:
            if t_us % (CYCLES_MS[name] * 1000) == 0:
                slip = -1.0 if t_us > 4_000_000 else 0.02 * rng.random()
                core.feed(bench.steady(name, t_us, 10 + rng.normal(0, 0.02), slip))
    assert core.faults == []
    assert core.counts.samples > 4000
