"""A creep controller that uses the service, from frames to efforts.

    python controller.py [DURATION_S]                  simulated locomotive and service, no bus
    python controller.py DURATION_S INTERFACE CHANNEL  on a bus, in place of `adhesion-can control`

    Supervision       is a frame good, and what does it say?
    SetpointReceiver  is the service's creep speed to be held?
    SlipChooser       slip of each axle: the service's with excursions, or a small one with probes
    CreepLoop         effort of each axle, so that its wheel has that slip
    Controller        frames of the vehicle and of the service in, demands out

Bring receiver and chooser into your drive, in whatever language. The loop is a plain one; the
reference controller (adhesion_can/control) has a better one, and a search of its own.
"""

import sys
from dataclasses import dataclass, field
from enum import Enum

import can
import cantools
from e2e.p01 import e2e_p01_protect

import adhesion_can
from adhesion_can.bus.database import packaged_path
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

AXLES, RADIUS_M, INERTIA_KGM2, EFFORT_MAX_N = 6, 0.625, 200.0, 120e3
"""The vehicle."""
CYCLE_S = 0.01
DATABASE = cantools.database.load_file(packaged_path())
WHEELS = ("WheelSpeeds1", "WheelSpeeds2")
SERVICE = ("AdhesionSetpoint", "AdhesionModel", "AdhesionQuality")
DEMANDS = ("EffortDemand1", "EffortDemand2")
MESSAGES = {m.name: m for m in DATABASE.messages}
WANTED = {MESSAGES[name].frame_id: MESSAGES[name] for name in (*WHEELS, "VehicleSpeed", *SERVICE)}
Values = dict[str, float | None]

INIT, TRACKING, LOW_EXCITATION, SURFACE_CHANGE, STALE_INPUT, FAULT = range(6)
KNOWN = 0.3
"""Standard deviation of LambdaM over LambdaM up to which the peak is known."""
CAUTIOUS_SLIP = 0.01
"""Slip without the service: below the peak of the rails of all scenarios."""
PROBE_SLIP, PROBE_GROWS, PROBE_MAX = 0.12, 1.5, 0.3
"""How far the first probe goes, how much further each next one, and the furthest."""
PROBE_S, PAUSE_S, CALM_PAUSE_S = 1.2, 0.4, 1.8
"""Duration of a probe or an excursion, and the pause after it; the longer one in TRACKING."""
SLIP_RATE = 0.5
"""Fastest change of the wanted slip, 1/s: a jump would make the wheels swing."""


class Supervision:
    """AUTOSAR E2E profile 1: a checksum, and a counter that moves on by 1 to 3."""

    def __init__(self) -> None:
        self.seen: dict[int, tuple[int, int]] = {}

    def read(self, t_us: int, identifier: int, payload: bytes) -> tuple[str, Values]:
        """Name and values of a good frame that is wanted; '' of any other."""
        message = WANTED.get(identifier)
        if message is None:
            return "", {}
        again = bytearray(payload)
        e2e_p01_protect(again, identifier, increment_counter=False)
        count = payload[1] & 0x0F
        before, then_us = self.seen.get(identifier, (count - 1, t_us))
        silent = t_us - then_us > 10_000 * message.cycle_time  # ten cycles: any count is taken
        step = (count - before) % 15
        if again[0] != payload[0] or count > 14 or not (silent or 1 <= step <= 3):
            return "", {}
        self.seen[identifier] = count, t_us
        raw = message.decode(payload, decode_choices=False, scaling=False)
        return message.name, {s.name: scaled(s, raw[s.name]) for s in message.signals}


def scaled(signal: cantools.database.Signal, raw: int) -> float | None:
    """Value of a signal; None for 'not available': all ones in the raw value, before scaling."""
    unknown = signal.length >= 8 and raw == (1 << (signal.length - signal.is_signed)) - 1
    return None if unknown else signal.conversion.raw_to_scaled(raw, decode_choices=False)


class Action(Enum):
    """What to do; the value says it."""

    HOLD = "hold the service's creep speed"
    PROBE = "hold a small slip and probe"
    ALONE = "hold a small slip, without probes"


class SetpointReceiver:
    """Latest contents of the service's messages, and what to do with them."""

    def __init__(self) -> None:
        self.values: Values = {}
        self.came_us: dict[str, int] = {}

    def receive(self, t_us: int, name: str, values: Values) -> None:
        """Take the values of a good frame."""
        self.came_us[name] = t_us
        self.values.update(values)

    def judge(self, t_us: int) -> tuple[Action, str]:
        """What to do, and why: the first of these that is so."""
        get = self.values.get
        status, doubt = get("Status"), get("Doubt")
        slip, std, creep = get("LambdaM"), get("LambdaMStd"), get("CreepSpeedSetpoint")
        unknown = not slip or std is None or creep is None or std > KNOWN * slip
        reasons = (
            (self._is_silent(t_us), Action.ALONE, "silence"),
            (status == STALE_INPUT, Action.ALONE, "the service lacks an input"),
            (status == FAULT, Action.ALONE, "the service has failed"),
            (get("Objection") != 0, Action.ALONE, "a reading cannot be right"),
            (status == INIT, Action.PROBE, "no estimate yet"),
            (status == SURFACE_CHANGE, Action.PROBE, "the rail changed"),
            (doubt == 15, Action.PROBE, "the curve is not tested yet"),  # 'not available'
            (doubt != 0, Action.PROBE, "the curve is in doubt"),
            (unknown, Action.PROBE, "the peak is not known"),
            (True, Action.HOLD, "the peak is known"),  # in TRACKING or LOW_EXCITATION
        )
        return next((action, why) for is_so, action, why in reasons if is_so)

    def _is_silent(self, t_us: int) -> bool:
        """Whether one of the messages has not come for three cycles."""
        return any(
            name not in self.came_us or t_us - self.came_us[name] > 3000 * MESSAGES[name].cycle_time
            for name in SERVICE
        )


@dataclass
class SlipChooser:
    """Slip of each axle. One axle at a time leaves the slip of the others, which go on pulling."""

    slips: list[float] = field(default_factory=lambda: [0.0] * AXLES)
    action: Action | None = None
    axle: int = 0
    since_s: float | None = None
    next_s: float = 0.0
    furthest: float = PROBE_SLIP

    def choose(self, t_s: float, speed: float, action: Action, values: Values) -> list[float]:
        """Wanted slips at a time, from what to do and the service's values."""
        if action is not self.action:  # pause first: the slips go over to the new ones
            self.action, self.since_s, self.next_s = action, None, t_s + PAUSE_S
            self.furthest = PROBE_SLIP
        wanted = [CAUTIOUS_SLIP] * AXLES
        if action is Action.HOLD:
            wanted = [values["CreepSpeedSetpoint"] / max(speed, 1.0)] * AXLES
        if action is not Action.ALONE:
            self._leave(t_s, values, wanted)
        most = SLIP_RATE * CYCLE_S
        changes = (w - s for w, s in zip(wanted, self.slips, strict=True))
        self.slips = [
            s + min(max(c, -most), most) for s, c in zip(self.slips, changes, strict=True)
        ]
        return self.slips

    def _leave(self, t_s: float, values: Values, wanted: list[float]) -> None:
        """Give one axle another slip: a probe, or an excursion to both sides of the known peak."""
        if self.since_s is None and t_s >= self.next_s:
            self.since_s = t_s
        if self.since_s is None:
            return
        holds = self.action is Action.HOLD
        part = (t_s - self.since_s) / PROBE_S
        if part >= 1.0:  # over: the next axle is next, and goes further if the peak is not found
            self.next_s = t_s + (
                CALM_PAUSE_S if holds and values["Status"] == TRACKING else PAUSE_S
            )
            self.axle, self.since_s = (self.axle + 1) % AXLES, None
            self.furthest = min(PROBE_GROWS * self.furthest, PROBE_MAX)
        elif holds:
            wanted[self.axle] = (0.6 if part < 0.4 else 1.2) * values["LambdaM"]
        else:  # up and down again
            wanted[self.axle] += (self.furthest - CAUTIOUS_SLIP) * min(2 * part, 2 - 2 * part)


class CreepLoop:
    """PI control of the creep speed of each axle.

    At the peak the wheelset is an integrator of mass J/r², which sets the gain. The velocity form
    needs no anti-windup. It starts without effort: the integral builds it up as the slip rises.
    """

    gain = 40.0 * INERTIA_KGM2 / RADIUS_M**2  # N per m/s: crossover at 40 rad/s
    integral = 15.0 * gain  # N/s per m/s

    def __init__(self) -> None:
        self.efforts, self.errors = [0.0] * AXLES, [0.0] * AXLES

    def step(self, speed: float, rims: list[float | None], slips: list[float]) -> list[float]:
        """Efforts for the next cycle, N, from speeds in m/s; an axle without one gets none."""
        for i, (rim, slip) in enumerate(zip(rims, slips, strict=True)):
            if rim is None:
                self.efforts[i] = self.errors[i] = 0.0
                continue
            error = slip * max(speed, 1.0) - (rim - speed)
            change = self.gain * (error - self.errors[i]) + self.integral * CYCLE_S * error
            self.efforts[i] = min(max(self.efforts[i] + change, 0.0), EFFORT_MAX_N)
            self.errors[i] = error
        return self.efforts


class Controller:
    """Frames in, demands out: two with each WheelSpeeds2, every 10 ms."""

    def __init__(self) -> None:
        self.supervision, self.receiver = Supervision(), SetpointReceiver()
        self.chooser, self.loop = SlipChooser(), CreepLoop()
        self.measured: Values = {}
        self.speed_us: int | None = None
        self.begin_us: int | None = None
        self.count, self.why = 0, ""

    def feed(self, t_us: int, identifier: int, payload: bytes) -> list[tuple[int, bytes]]:
        """Take a frame; returns id and payload of the demands that it is time for."""
        name, values = self.supervision.read(t_us, identifier, payload)
        if name in SERVICE:
            self.receiver.receive(t_us, name, values)
        elif name in WHEELS:
            self.measured.update(values)
        elif name and values[name] is not None:
            self.measured[name], self.speed_us = values[name], t_us
        if name != WHEELS[-1] or self.speed_us is None:
            return []  # without wheel speeds no demand: the motors stop after three cycles
        speed = self.measured["VehicleSpeed"]
        rims = [self.measured.get(f"WheelSpeed_Ax{i + 1}") for i in range(AXLES)]
        blind = t_us - self.speed_us > 60_000  # three cycles without a vehicle speed
        rims = [None if blind or w is None else RADIUS_M * w for w in rims]
        action, why = self.receiver.judge(t_us)
        self.begin_us = t_us if self.begin_us is None else self.begin_us
        if why != self.why:
            self.why = why
            print(f"{(t_us - self.begin_us) / 1e6:6.2f} s  {why}: {action.value}", flush=True)
        slips = self.chooser.choose(t_us / 1e6, speed, action, self.receiver.values)
        return self._demands(self.loop.step(speed, rims, slips))

    def _demands(self, efforts: list[float]) -> list[tuple[int, bytes]]:
        values = {f"EffortDemand_Ax{i + 1}": effort for i, effort in enumerate(efforts)}
        values |= {"Crc": 0, "Alive": self.count, "SandDemand": 0}
        self.count = (self.count + 1) % 15
        demands = []
        for message in (MESSAGES[name] for name in DEMANDS):
            payload = bytearray(message.encode({s.name: values[s.name] for s in message.signals}))
            e2e_p01_protect(payload, message.frame_id, increment_counter=False)
            demands.append((message.frame_id, bytes(payload)))
        return demands


def drive_simulated(duration_s: float) -> None:
    """Locomotive, service and controller in simulated time."""
    config = adhesion_can.load_configuration()
    settings = RunSettings(scenario_by_name("dry-wet-dry"), duration_s, obey=True)
    locomotive = Simulation(settings, config.database)
    service, controller = adhesion_can.ServiceCore(config), Controller()
    locomotive.await_demands()
    used = available = 0.0
    for frames in locomotive.run():
        for frame in frames:
            for each in (*service.feed(frame), frame):
                for demand in controller.feed(each.t_us, each.arbitration_id, each.data):
                    locomotive.receive(adhesion_can.Frame(each.t_us, *demand))
        used += locomotive.adhesion_used()
        available += locomotive.find_peaks()[0].mean()
    print(f"used {100 * used / available:.0f} % of the force that the rail could give")


def drive_on_bus(duration_s: float, interface: str, channel: str) -> None:
    """The controller on a bus, from the first frame on."""
    options = {"hop_limit": 0} if interface == "udp_multicast" else {}
    controller, begin_s = Controller(), None
    with can.Bus(interface=interface, channel=channel, **options) as bus:
        for frame in bus:  # Ctrl-C ends it if nothing comes
            begin_s = begin_s or frame.timestamp
            if frame.timestamp - begin_s > duration_s:
                break
            t_us = round(frame.timestamp * 1e6)
            for identifier, data in controller.feed(t_us, frame.arbitration_id, frame.data):
                bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))


if __name__ == "__main__":
    duration_s = float(sys.argv[1]) if len(sys.argv) > 1 else 40.0
    if len(sys.argv) > 2:
        drive_on_bus(duration_s, *sys.argv[2:4])
    else:
        drive_simulated(duration_s)
