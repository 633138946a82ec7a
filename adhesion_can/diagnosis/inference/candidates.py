"""Effects that the data can identify, and the reasons for those that they cannot."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData, observed_column
from adhesion_can.diagnosis.drive.kinematics import median_step
from adhesion_can.diagnosis.evidence import Untested
from adhesion_can.diagnosis.formatting import effect_name
from adhesion_can.diagnosis.inference.channel_candidates import build_channel_candidates
from adhesion_can.diagnosis.inference.search_starts import with_starts
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.physics.channels import CHANNEL_BY_NAME
from adhesion_can.physics.effects import (
    ActiveEffect,
    Contact,
    Effect,
    LagStates,
    acts_in_contact,
    build_instruments,
    known_effects,
)
from adhesion_can.physics.effects.base import Requirements
from adhesion_can.physics.instrument_laws import Need
from adhesion_can.physics.lag_states import PAUSE_S
from adhesion_can.physics.parameter import SearchStart, Wheelset

UNTESTABLE_SHARE = 0.995
"""Share of a signature that the curve's parameters imitate, from which it is not testable."""
COARSE = 2.0
"""Distance of the rows, in typical delays or lengths, beyond which these do not show."""
BEYOND = 1.1
"""Largest size of an effect that is named, relative to the end of its range."""
COASTING = 0.005
"""|μ| of an axle that coasts."""
LEAST_BRAKING = 0.02
"""Share of the rows with braking below which nothing is said about it."""
LEAST_SERIES, WITHIN = 20, 0.1
"""Least number of a table's series, the rows between two pauses, that show a drift by their levels
alone; and the share of the variance of time within them from which the rows of each show it."""


def build_candidates(drives: Sequence[DriveData]) -> tuple[tuple[Candidate, ...], list[Untested]]:
    """Effects that the recordings can be tested for, and the others with the reason."""
    candidates_found: list[Candidate] = []
    untested: dict[tuple[str, str], str] = {}
    wheelset = Wheelset(
        load=float(np.mean(observed_column(drives, "load"))),
        radius=float(np.mean(np.concatenate([drive.radius for drive in drives]))),
        inertia=float(np.mean([drive.inertia for drive in drives])),
    )
    axles = sorted(set.union(*(set(np.unique(c.axle).tolist()) for c in drives)))
    for effect in known_effects():
        why = _missing(effect, drives)
        candidates: list[Candidate] = []
        if not why:
            effect_axles = axles if any(p.axle for p in effect.parameters) else [0]
            plausible = (-inf, inf) if effect_axles != [0] else _plausible(effect, wheelset)
            plain = Candidate(effect, is_lag=_is_lag(effect), plausible=plausible)
            candidates, why = with_starts(plain, effect_axles, drives)
        candidates_found += candidates
        if why:
            untested[effect.id, effect.form] = why
    channels, without = build_channel_candidates(drives)
    return (*candidates_found, *channels), [
        *_describe_untested(untested, candidates_found),
        *without,
    ]


def _describe_untested(
    untested: Mapping[tuple[str, str], str], candidates: Sequence[Candidate]
) -> list[Untested]:
    """Effects that are not tested: by id, and by form where another form is tested."""
    tested = {candidate.effect.id for candidate in candidates}
    reasons = {
        effect_name(effect, form if effect in tested else ""): why
        for (effect, form), why in untested.items()
    }
    return [Untested(what, why) for what, why in reasons.items()]


def _plausible(effect: Effect, wheelset: Wheelset) -> tuple[float, float]:
    """Smallest and largest size of an effect that a vehicle may have.

    A delay beyond its range is reported before anything is fitted.
    """
    size = effect.parameters[0]
    if size.plausible is not None:
        return size.plausible(wheelset)
    if size.unit == "s":
        return -inf, inf
    return BEYOND * size.lower, BEYOND * size.upper


def _missing(effect: Effect, drives: Sequence[DriveData]) -> str:
    """Why an effect cannot be tested; '' where it can."""
    requires = effect.requires
    if requires.covariates and (why := _missing_signal(requires.covariates, drives)):
        return why
    if effect.observability.drift and (why := _few_series(drives)):
        return why
    return (
        _missing_sequence(effect, drives)
        or _derived_force(effect, drives)
        or _missing_rows(effect, drives)
    )


def _derived_force(effect: Effect, drives: Sequence[DriveData]) -> str:
    """Why a delay between the signals cannot be tested; '' where it can.

    Where the force is dv/dt, a shift of v by τ changes the slip by τ dv/dt/v, the adhesion itself:
    it bends the curve, and fits whatever the signals' delays are.
    """
    if acts_in_contact(effect) or effect.parameters[0].unit != "s":
        return ""
    for drive in drives:
        if drive.derived_force:
            return (
                f"the force of {drive.name} is computed from the rate of change of the vehicle "
                "speed, so it shows no delay relative to it"
            )
    return ""


def _join_overlapping(series: NDArray[np.int64], time_s: Array) -> NDArray[np.int64]:
    """Numbers of series, those at the same time joined: axles of one test are one level of time."""
    count = int(series.max()) + 1
    first, last = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(first, series, time_s)
    np.maximum.at(last, series, time_s)
    order = np.argsort(first, kind="stable")
    behind = first[order][1:] > np.maximum.accumulate(last[order])[:-1]
    joined = np.empty(count, dtype=np.int64)
    joined[order] = np.concatenate([[0], np.cumsum(behind)])
    return joined[series]


def _few_series(drives: Sequence[DriveData]) -> str:
    """Why the series of a table cannot show a drift; '' where they can.

    Series that were measured with pauses differ by more than their time: a few levels go with time
    by chance, however many rows each of them has.
    """
    number, total, within = 0, 0.0, 0.0
    for drive in drives:
        if not drive.table or not len(drive):
            return ""
        new = np.abs(np.diff(drive.t_s, prepend=drive.t_s[:1])) > PAUSE_S
        series = np.cumsum(new | (np.diff(drive.axle, prepend=drive.axle[:1]) != 0))
        series = _join_overlapping(series, drive.time_s)
        rows, time_s = np.bincount(series), drive.time_s
        mean = np.bincount(series, time_s) / np.maximum(rows, 1)
        total += len(drive) * float(np.var(time_s))
        within += float(np.sum((time_s - mean[series]) ** 2))
        number += len(rows)
    if number >= LEAST_SERIES or within >= WITHIN * total:
        return ""
    return (
        f"the rows are {number} series with pauses between them; a trend over so few series may "
        f"be chance, and at least {LEAST_SERIES} are needed"
    )


def _missing_sequence(effect: Effect, drives: Sequence[DriveData]) -> str:
    """Why independent points cannot show an effect; '' where they can, or are a time series."""
    if not any(drive.independent for drive in drives):
        return _too_coarse(effect, drives) if depends_on_sequence(effect) else ""
    if depends_on_sequence(effect):
        return "the rows are independent points without an order in time"
    if not acts_in_contact(effect) and _is_one_sided(drives):
        return "all slips have one sign, so instrument errors cannot be separated from the curve"
    return ""


def _too_coarse(effect: Effect, drives: Sequence[DriveData]) -> str:
    """Why rows are too far apart to show a delay or a lag; '' where they are not."""
    for parameter in effect.parameters:
        if parameter.unit not in {"s", "m"}:
            continue
        limit = COARSE * parameter.typical
        for drive in drives:
            speed = drive.observe().speed[1:] if parameter.unit == "m" else 1.0
            step = median_step(drive.time_s, drive.axle, speed)
            if step > limit:
                return (
                    f"the rows of {drive.name} are {step:.2g} {parameter.unit} apart, too far "
                    f"for a {parameter.name} of about {parameter.typical:g} {parameter.unit}"
                )
    return _forgets(effect, drives)


def _forgets(effect: Effect, drives: Sequence[DriveData]) -> str:
    """Why rows do not follow each other closely enough for a memory; '' where they do."""
    if not any(p.unit == "s" and p.search is SearchStart.SCALES for p in effect.parameters[1:]):
        return ""
    for drive in drives:
        # The time of the regression, in which rows that do not follow each other stand apart.
        step = median_step(drive.t_s, drive.axle)
        if step > PAUSE_S:
            return (
                f"the rows of {drive.name} are {step:.2g} s apart, so an effect with a memory "
                "starts again"
            )
    return ""


def _is_lag(effect: Effect) -> bool:
    """Whether the size of an effect is a time or a length by which something lags."""
    if not acts_in_contact(effect) and not _is_delay(effect):
        return False
    return effect.parameters[0].unit in {"s", "m"} and depends_on_sequence(effect)


def _is_delay(effect: Effect) -> bool:
    """Whether an effect is a delay of a signal."""
    instruments = build_instruments([ActiveEffect(effect, _typical_values(effect))])
    return bool(instruments.speed_lag or instruments.effort_lag)


def _typical_values(effect: Effect) -> tuple[float, ...]:
    return tuple(p.typical for p in effect.parameters)


def _missing_rows(effect: Effect, drives: Sequence[DriveData]) -> str:
    """Why the rows of these drives cannot show an effect; '' where they can."""
    requires = effect.requires
    if requires.wheel_speed and any(drive.table for drive in drives):
        return "a table contains slip and adhesion, not the wheel speed that they come from"
    axles = max(len(np.unique(drive.axle)) for drive in drives)
    if requires.several_axles and axles < 2:
        return "all rows belong to one axle"
    if requires.speed and not all(drive.has_speed for drive in drives):
        return f"the table has no column {CHANNEL_BY_NAME['speed'].column}"
    if requires.load and not all(drive.has_load for drive in drives):
        return "the loads are not measured"
    return _missing_drives(requires, drives)


def _missing_drives(requires: Requirements, drives: Sequence[DriveData]) -> str:
    """Why drives of this kind cannot show an effect; '' where they can."""
    if requires.all_efforts and any(drive.kinematics.efforts is None for drive in drives):
        return "the efforts of all axles are not known"
    if (
        requires.braking
        and np.mean(observed_column(drives, "adhesion") < -COASTING) < LEAST_BRAKING
    ):
        return "there is hardly any braking"
    if requires.one_recording and len(drives) > 1:
        return "its values belong to one recording: diagnose each recording separately"
    return ""


def _is_one_sided(drives: Sequence[DriveData]) -> bool:
    """Whether the rows are of traction alone, or of braking alone."""
    slip = observed_column(drives, "slip")
    return bool((slip >= 0.0).all() or (slip <= 0.0).all())


def depends_on_sequence(effect: Effect) -> bool:
    """Whether an effect depends on when a row was measured, or on the rows before it."""
    values = _typical_values(effect)
    if not acts_in_contact(effect):
        instruments = build_instruments([ActiveEffect(effect, values)])
        return _is_delay(effect) or instruments.needs(Need.SEQUENCE)
    rows = np.ones(3)
    contact = Contact(
        slip=np.array([0.02, 0.04, 0.03]),
        creep_speed=np.array([0.2, 0.4, 0.3]),
        speed=10.0 * rows,
        load=1e5 * rows,
        time_s=np.array([0.0, 0.02, 0.04]),
        axle=rows,
        place=rows,
        adhesion=0.2 * rows,
        covariates=dict.fromkeys(effect.requires.covariates, rows),
    )
    later = replace(contact, time_s=np.array([100.0, 150.0, 300.0]))
    changes = [effect.change(state, values, LagStates()) for state in (contact, later)]
    early, late = (np.concatenate([c.slip, np.broadcast_to(c.factor, (3,))]) for c in changes)
    return not np.array_equal(early, late)


def _missing_signal(covariates: Sequence[str], drives: Sequence[DriveData]) -> str:
    """Why an effect that requires one of some covariates cannot be tested; '' where it can."""
    known = set.intersection(*(set(drive.covariates) for drive in drives))
    needed = sorted(known.intersection(covariates))
    if not needed:
        return _no_signal(covariates, drives)
    still = all(_is_constant(drives, name) for name in needed)
    return f"{' and '.join(needed)} does not change in these data" if still else ""


def _no_signal(covariates: Sequence[str], drives: Sequence[DriveData]) -> str:
    """Why a channel is not known: no signal gives it, or its readings are not available."""
    for drive in drives:
        for name in covariates:
            count = drive.lost.get(f"channel {name}", 0)
            if count:
                return f"{name} is not available in {count} of its readings in {drive.name}"
    return f"no signal gives {' or '.join(covariates)}"


def _is_constant(drives: Sequence[DriveData], name: str) -> bool:
    values = np.concatenate([drive.covariates[name] for drive in drives])
    return not len(values) or float(np.ptp(values)) == 0.0
