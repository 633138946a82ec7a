"""Snapshots made by hand: every part known."""

from math import inf

import numpy as np

from adhesion_can.bus.database import load_database
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.rejection import Rejection
from adhesion_can.config import load_configuration
from adhesion_can.monitoring.latest_frames import FrameKeeper
from adhesion_can.monitoring.snapshot import (
    AxleView,
    HistoryPoint,
    MessageRole,
    MessageState,
    MessageView,
    OperatingPoint,
    Origin,
    ServiceView,
    Snapshot,
    Transport,
)
from adhesion_can.physics.burckhardt import adhesion, peak
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.status import Status

THETA = (0.40, 60.0, 0.30)
TOP = peak(*THETA)
MU_MAX, LAMBDA_M = float(TOP.mu_max), float(TOP.lambda_m)
NOW_US = 60_000_000
PAYLOAD = bytes.fromhex("981A3827A71C4D05")


def service(**changes):
    known = {
        "t_us": NOW_US,
        "status": Status.TRACKING,
        "mu_max": MU_MAX,
        "mu_max_std": 0.004,
        "lambda_m": LAMBDA_M,
        "lambda_m_std": 0.004,
        "creep_speed": 0.5,
        "theta": THETA,
        "doubt": Doubt.NONE,
        "surface_age_s": 31.4,
        "rejected": 0,
        "lost": 2,
        "loop_time_us": 170.0,
    }
    return ServiceView(**(known | changes))


def message(name, frame_id, kind=MessageRole.INPUT, **changes):
    known = {
        "is_extended": False,
        "cycle_us": 10_000,
        "accepted": 6000,
        "rejected": {},
        "lost": 0,
        "age_us": 4_000,
        "rate": 100.0,
        "recent_faults": 0,
        "state": MessageState.OK,
    }
    return MessageView(name=name, frame_id=frame_id, kind=kind, **(known | changes))


MESSAGES = (
    message("WheelSpeeds1", 0x101),
    message("WheelSpeeds2", 0x102),
    message("TractiveEffort1", 0x121, lost=3, recent_faults=1, state=MessageState.FAULTY),
    message("TractiveEffort2", 0x122),
    message("VehicleSpeed", 0x111, age_us=61_000, rate=47.6, state=MessageState.SILENT),
    message("AxleLoads1", 0x131, rate=4.96, age_us=150_000),
    message(
        "AxleLoads2",
        0x132,
        rejected={"checksum": 123_456, "order": 2},
        recent_faults=3,
        state=MessageState.FAULTY,
    ),
    message("Environment", 0x141, accepted=0, age_us=None, rate=None, state=MessageState.NEVER),
    message("AdhesionSetpoint", 0x201, MessageRole.OUTPUT, rate=50.0),
    message(
        "AVeryLongMessageName_2", 0x18FEF100, MessageRole.OTHER, is_extended=True, cycle_us=None
    ),
    message("", 0x700, MessageRole.OTHER, cycle_us=None, rate=12_345.6),
)


def latest_frames():
    """A frame of every message that came, decoded by the packaged database."""
    database = load_database().db
    choices = load_configuration().choices
    keeper = FrameKeeper(database.messages, choices)
    for view in MESSAGES:
        if view.age_us is not None:
            frame = Frame(
                NOW_US - view.age_us, view.frame_id, PAYLOAD, is_extended=view.is_extended
            )
            reason = Rejection.CHECKSUM if view.rejected else None
            keeper.add(view.key, frame, reason)
    return keeper.latest()


def axle_view(axle):
    slip = 0.02 * axle
    return AxleView(
        axle,
        slip=slip,
        adhesion=float(adhesion(slip, *THETA)),
        creep_speed=slip * 10,
        mu_max=MU_MAX,
        lambda_m=LAMBDA_M,
        creep_setpoint=0.5,
    )


def history():
    changes = [Status.INIT, Status.LOW_EXCITATION, *[Status.TRACKING] * 8]
    changes += [Status.SURFACE_CHANGE, *[Status.TRACKING] * 6, Status.STALE_INPUT, Status.FAULT]
    found = []
    for k in range(300):
        status = changes[k * len(changes) // 300]
        known = status is not Status.INIT
        mu_max = MU_MAX if k > 150 else 0.7 * MU_MAX
        wide = inf if status is Status.LOW_EXCITATION else 0.01
        found.append(
            HistoryPoint(
                k * 200_000,
                status,
                mu_max if known else None,
                wide if known else None,
                LAMBDA_M if known else None,
                wide if known else None,
            )
        )
    return tuple(found)


def points():
    slips = np.linspace(0.002, 0.15, 60)
    return tuple(
        OperatingPoint(NOW_US - 1000 * k, 1 + k % 6, float(s), float(adhesion(s, *THETA)) + 0.004)
        for k, s in enumerate(slips)
    )


def snapshot(**changes):
    known = {
        "t_us": NOW_US,
        "first_us": 0,
        "frames": 43_210,
        "frame_rate": 720.4,
        "messages": MESSAGES,
        "latest": latest_frames(),
        "axles": tuple(axle_view(axle) for axle in range(1, 7)),
        "points": points(),
        "last_sample_us": NOW_US - 10_000,
        "speed": 10.0,
        "service": service(),
        "history": history(),
        "transport": Transport(name="vcan0"),
    }
    return Snapshot(**(known | changes))


RECORDING = Transport(
    name="a/very/long/folder/with/many/parts/for/a/recording/of/2026-11-25T00_50_21_drive.log",
    origin=Origin.ESTIMATED_HERE,
    is_live=False,
    paused=True,
    speed=inf,
    position_s=1234.5,
    duration_s=3600.0,
    dropped=17,
    recording="monitor-20261125-005021.log",
    recorded=1234,
    catching_up_s=1300.0,
    notes=("a note",),
)
EMPTY = Snapshot(t_us=0)
ODD = snapshot(
    axles=tuple(axle_view(axle) for axle in range(1, 13)),
    service=service(
        status=Status.STALE_INPUT,
        mu_max_std=inf,
        lambda_m_std=inf,
        creep_speed=1e6,
        doubt=Doubt.TIME,
        is_silent=True,
        rejected=None,
    ),
    messages=MESSAGES * 8,
    speed=12_345.6,
    remarks=("A remark of " + "many words " * 30 + ".", "short", "x" * 300),
    transport=RECORDING,
)
