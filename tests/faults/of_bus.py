"""Faults of the bus: what comes is right, but late, twice, seldom or not at all."""

from collections.abc import Mapping

import numpy as np

from tests.faults.case import Case, Queues, Sents
from tests.faults.kinds import Kind
from tests.faults.wire import Sent

BOGIE = ("WheelSpeeds2", "TractiveEffort2")


def _on(one, case: Case):
    return case.active(one.t_us / 1e6)


def _silent(*names: str):
    """Messages whose sender is silent."""

    def change(sent: Sents, case: Case) -> Sents:
        return sent | {name: sent[name].rows(~_on(sent[name], case)) for name in names}

    return change


def _gap(sent: Sents, case: Case) -> Sents:
    """Nothing comes for the size, s; the counters go on."""
    return {
        name: one.rows(~(_on(one, case) & (one.t_us < (case.onset_s + case.size) * 1e6)))
        for name, one in sent.items()
    }


def _jitter(sent: Sents, case: Case) -> Sents:
    """Each frame is late by up to the size, s, in the order in which it was sent."""
    rng = case.rng
    found = {}
    for name, one in sent.items():
        late_us = np.where(_on(one, case), rng.uniform(0, case.size * 1e6, len(one.t_us)), 0.0)
        # No frame overtakes the one before it: a queue.
        found[name] = Sent(np.maximum.accumulate(one.t_us + late_us.astype(np.int64)), one.data)
    return found


def _twice(sent: Sents, case: Case) -> Sents:
    """A gateway sends each frame again after 0.15 ms."""
    found = {}
    for name, one in sent.items():
        copies = one.rows(_on(one, case))
        stamps = np.concatenate([one.t_us, copies.t_us + 150])
        order = np.argsort(stamps, kind="stable")
        found[name] = Sent(stamps[order], np.concatenate([one.data, copies.data])[order])
    return found


def _bursts(sent: Sents, case: Case) -> Sents:
    """A gateway holds the frames and lets them go together, one burst in each size, s."""
    period_us = case.size * 1e6
    found = {}
    for name, one in sent.items():
        held_us = np.ceil(one.t_us / period_us) * period_us
        place = np.arange(len(one.t_us))
        stamps = np.where(_on(one, case), held_us, one.t_us).astype(np.int64)
        # Frames follow each other by 0.2 ms on the bus.
        first = np.searchsorted(stamps, stamps)
        found[name] = Sent(np.maximum.accumulate(stamps + 200 * (place - first)), one.data)
    return found


def _seldom(queues: Queues, case: Case) -> Queues:
    """The senders leave out all but one in so many frames."""
    found = {}
    for name, one in queues.items():
        kept = np.arange(len(one.t_us)) % round(case.size) == 0
        found[name] = one.rows(kept | ~_on(one, case))
    return found


def _lost(sent: Sents, case: Case) -> Sents:
    """A share of all frames is lost; the counters tell."""
    rng = case.rng
    return {
        name: one.rows(~(_on(one, case) & (rng.uniform(size=len(one.t_us)) < case.size)))
        for name, one in sent.items()
    }


KINDS: Mapping[str, Kind] = {
    "bogie_wheels_silent": Kind(wire=_silent("WheelSpeeds2")),
    "bogie_silent": Kind(wire=_silent(*BOGIE)),
    "loads_silent": Kind(wire=_silent("AxleLoads1", "AxleLoads2")),
    "speed_silent": Kind(wire=_silent("VehicleSpeed")),
    "frames_jitter": Kind((0.005, 0.010), "s", wire=_jitter),
    "frames_twice": Kind(wire=_twice),
    "frames_in_bursts": Kind((0.1, 0.2), "s", wire=_bursts),
    "frames_gap": Kind((1.0, 2.0), "s", wire=_gap),
    "frames_seldom": Kind((2.0, 4.0), "cycles", queue=_seldom),
    "frames_lost": Kind((0.1, 0.2), "share", wire=_lost),
}
