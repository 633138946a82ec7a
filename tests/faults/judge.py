"""Independent judge of a drive: the setpoints that were sent, and the truth.

TRACKING is a promise: the numbers are right within their standard deviations. A setpoint breaks it
where it says TRACKING and its largest adhesion lies more than three of its standard deviations and
more than 2 % from the true one, or its slip ratio more than three and 5 %. While a change of the
rail passes along the axles, any value between those of the two rails is right.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.faults.locomotive import Truth
from tests.faults.rail import Floats
from tests.faults.wire import Frame
from tests.worlds.encoding import database

SETPOINT, QUALITY = 0x201, 0x203
TRACKING, FAULT = 1, 5
DEVIATIONS, MU_SHARE, SLIP_SHARE = 3.0, 0.02, 0.05
ALLOWED_S = 0.5
"""Time for which a setpoint may be wrong after the error has become big, s."""
BEFORE_S = 5.0
"""Span before the onset in which TRACKING is looked at, s."""
NOT_AVAILABLE = 0xFFFF


@dataclass(frozen=True, eq=False)
class Setpoints:
    """What was sent, decoded; a row a setpoint. NaN: not available.

    Attributes:
        t: Due time, s, (n,).
        status: Number of the status, (n,).
        mu: Largest adhesion, (n,).
        mu_std: Its standard deviation as last sent, (n,).
        slip: Optimal slip ratio, (n,).
        slip_std: Its standard deviation as last sent, (n,).

    """

    t: Floats
    status: NDArray[np.int64]
    mu: Floats
    mu_std: Floats
    slip: Floats
    slip_std: Floats


def decode(sent: Sequence[Frame]) -> Setpoints:
    """Setpoints of the frames that a service sent, by cantools."""
    names = {SETPOINT: ("MuMax", "LambdaM"), QUALITY: ("MuMaxStd", "LambdaMStd")}
    rows = []
    quality = (np.nan, np.nan)
    messages = {number: database().get_message_by_frame_id(number) for number in names}
    # Quality is due with the setpoint of its time, which stands before it.
    for frame in sorted(
        (f for f in sent if f.arbitration_id in names),
        key=lambda f: (f.t_us, -f.arbitration_id),
    ):
        number = frame.arbitration_id
        signals = messages[number].decode(frame.data, decode_choices=False, scaling=False)
        factors = {s.name: s.scale for s in messages[number].signals}
        values = tuple(
            np.nan if signals[name] == NOT_AVAILABLE else float(signals[name]) * factors[name]
            for name in names[number]
        )
        if number == QUALITY:
            quality = values
        else:
            rows.append((frame.t_us / 1e6, signals["Status"], *values, *quality))
    table = np.array(rows, dtype=float).reshape(-1, 6)
    return Setpoints(
        t=table[:, 0],
        status=table[:, 1].astype(np.int64),
        mu=table[:, 2],
        slip=table[:, 3],
        mu_std=table[:, 4],
        slip_std=table[:, 5],
    )


@dataclass(frozen=True)
class Verdict:
    """What a drive's setpoints were like.

    Attributes:
        before: Share of TRACKING in the 5 s before the onset.
        wrong: Share of the time from the error on that was TRACKING and wrong.
        wrong_late: The same beyond the 0.5 s that are allowed after the error, and after a change
            of the rail has passed the last axle, and further than that from what is wrong without
            the fault as well.
        longest_s: Longest stretch of that, s.
        leaves_s: Time from the error until TRACKING was left for the first time, s; None: never.
        tracking: Share of TRACKING from the error on.
        faults: Share of FAULT from the error on.
        back_s: Time from the end of the fault until TRACKING came back, s; None: never, NaN: the
            fault stays.
        worst_mu: Largest relative error of a wrong largest adhesion.
        worst_slip: Largest relative error of a wrong slip ratio.

    """

    before: float
    wrong: float
    wrong_late: float
    longest_s: float
    leaves_s: float | None
    tracking: float
    faults: float
    back_s: float | None
    worst_mu: float
    worst_slip: float


def _outside(value: Floats, limits: Floats) -> Floats:
    """How far a value lies outside of its limits, with its sign."""
    return np.where(value > limits[1], value - limits[1], np.minimum(value - limits[0], 0.0))


def errors(sent: Setpoints, truth: Truth) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Relative errors of the two numbers, and whether a setpoint is TRACKING and wrong."""
    rows = np.clip(np.searchsorted(truth.t, sent.t, side="right") - 1, 0, len(truth.t) - 1)
    peaks, slips = truth.peaks[:, rows], truth.slips[:, rows]
    off_mu, off_slip = _outside(sent.mu, peaks), _outside(sent.slip, slips)
    share_mu, share_slip = off_mu / peaks[0], off_slip / slips[0]
    wrong_mu = (np.abs(off_mu) > DEVIATIONS * sent.mu_std) & (np.abs(share_mu) > MU_SHARE)
    wrong_slip = (np.abs(off_slip) > DEVIATIONS * sent.slip_std) & (np.abs(share_slip) > SLIP_SHARE)
    tracking = sent.status == TRACKING
    return (
        np.where(wrong_mu, share_mu, 0.0),
        np.where(wrong_slip, share_slip, 0.0),
        tracking & (wrong_mu | wrong_slip),
    )


def judge(
    sent: Setpoints,
    truth: Truth,
    onset_s: float,
    error_s: float,
    end_s: float | None,
    twin: Setpoints | None = None,
) -> Verdict:
    """Verdict on a drive.

    Args:
        sent: Setpoints.
        truth: Truth of the drive.
        onset_s: Time at which the fault begins, s.
        error_s: Time at which its error is big enough to matter, s.
        end_s: Time at which the fault ends, s; None: it stays.
        twin: Setpoints of the same drive without the fault; None: there is no such drive.

    """
    share_mu, share_slip, wrong = errors(sent, truth)
    tracking = sent.status == TRACKING
    earlier = (sent.t >= onset_s - BEFORE_S) & (sent.t < onset_s)
    later = sent.t >= error_s
    late = (sent.t >= error_s + ALLOWED_S) & ~_changing(sent.t, truth)
    if twin is not None:
        late &= ~_near(sent.t, twin.t[errors(twin, truth)[2]])
    left = np.flatnonzero(later & ~tracking)
    step_s = 0.02
    return Verdict(
        before=_share(tracking, earlier),
        wrong=_share(wrong, later),
        wrong_late=_share(wrong, late),
        longest_s=step_s * _longest(wrong & late),
        leaves_s=float(sent.t[left[0]] - error_s) if len(left) else None,
        tracking=_share(tracking, later),
        faults=_share(sent.status == FAULT, later),
        back_s=_back(sent, tracking, end_s),
        worst_mu=_largest(share_mu[wrong & later]),
        worst_slip=_largest(share_slip[wrong & later]),
    )


def _changing(t: Floats, truth: Truth) -> NDArray[np.bool_]:
    """Whether a change of the rail passes along the axles, or has just done so."""
    ends = np.append(0.0, truth.t[~truth.settled])
    last = ends[np.searchsorted(ends, t, side="right") - 1]
    return t - last < ALLOWED_S


def _near(t: Floats, times: Floats) -> NDArray[np.bool_]:
    """Whether a time lies within `ALLOWED_S` of one of some others, which ascend."""
    first = np.searchsorted(times, t - ALLOWED_S)
    return np.searchsorted(times, t + ALLOWED_S, side="right") > first


def _back(sent: Setpoints, tracking: NDArray[np.bool_], end_s: float | None) -> float | None:
    if end_s is None:
        return float("nan")
    again = np.flatnonzero((sent.t >= end_s) & tracking)
    return float(sent.t[again[0]] - end_s) if len(again) else None


def _share(which: NDArray[np.bool_], among: NDArray[np.bool_]) -> float:
    count = int(among.sum())
    return float((which & among).sum() / count) if count else 0.0


def _largest(values: Floats) -> float:
    return float(values[np.abs(values).argmax()]) if len(values) else 0.0


def _longest(which: NDArray[np.bool_]) -> int:
    """Length of the longest run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], which.astype(int), [0]])))
    return int((edges[1::2] - edges[::2]).max()) if len(edges) else 0
