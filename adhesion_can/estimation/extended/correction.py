"""Removal of an extended model's effects from samples, and the model's requirements on the data.

An extended model is μ = factor · curve(slip'): effects in the contact change the slip and multiply
the adhesion. Inverted, a sample (λ, μ) becomes the point (slip', μ/factor) of the base curve, which
any estimator can then identify. Errors of the instruments are removed before that, where samples
are computed from readings.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.errors import ConfigError, InputError
from adhesion_can.estimation.extended.current_curve import (
    LatestConditions,
    Scale,
    SteadyLagStates,
    usual_factor,
)
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.estimation.extended.slip_lags import SlipLags
from adhesion_can.physics.channels import CHANNEL_BY_NAME
from adhesion_can.physics.effects import ActiveEffect, Change, Contact, LagStates, compute_change
from adhesion_can.physics.effects.empirical import Empirical
from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.equations import TRAVEL_DIRECTION

USABLE = 0.2
"""Least factor of a usable sample, as a share of the usual one: divided by a smaller one, it would
be mostly noise."""

# ----------------------------------------------------------- requirements of a model on the data


def require_channels(model: ExtendedModel, available: Iterable[str], source: str, fix: str) -> None:
    """ConfigError where an effect depends on a channel that is not available.

    Args:
        model: Extended model.
        available: Names of the available channels.
        source: Source that lacks the channel, for the error.
        fix: Way to fix it, for the error.

    """
    present = set(available)
    for active in model.actives:
        lacking = active.effect.requires.lacks(present)
        if lacking:
            what = f"{active.effect.id} needs {lacking}, which {source} does not give"
            raise ConfigError(model.where, what, fix)


def require_axles(model: ExtendedModel, axles: int) -> None:
    """ConfigError where a model names an axle that the vehicle does not have."""
    for active in model.effects:
        for parameter, value in zip(active.effect.parameters, active.values, strict=True):
            if parameter.axle and value > axles:
                raise ConfigError(
                    f"{model.where}: {active.effect.id}",
                    f"axle {value:g} of a vehicle with {axles}",
                    "correct the axle, or the vehicle's axles",
                )


def channels_used(active: ActiveEffect) -> set[str]:
    """Channels among speed, load and place on which an effect with its values depends."""
    if isinstance(active.effect, Empirical):
        known = {"speed": "speed", "creep_speed": "speed", "load": "load", "axle": "place"}
        return {known[active.effect.channel]} if active.effect.channel in known else set()
    rows = np.ones(2)
    covariates = dict.fromkeys(active.effect.requires.covariates, rows)
    plain = Contact(
        slip=np.array([0.02, 0.03]),
        creep_speed=np.array([0.2, 0.3]),
        speed=10 * rows,
        load=1e5 * rows,
        time_s=np.array([0.0, 0.02]),
        axle=rows,
        place=rows,
        adhesion=0.2 * rows,
        covariates=covariates,
    )
    other = {
        "speed": replace(plain, speed=20 * rows, creep_speed=2 * plain.creep_speed),
        "load": replace(plain, load=2e5 * rows),
        "place": replace(plain, place=2 * rows, axle=2 * rows),
    }

    def outcome(contact: Contact) -> Array:
        change = compute_change([active], contact, LagStates())
        return np.concatenate([change.slip, np.broadcast_to(change.factor, (2,))])

    base = outcome(plain)
    return {name for name, contact in other.items() if not np.array_equal(outcome(contact), base)}


_COLUMN = {
    "speed": CHANNEL_BY_NAME["speed"].column,
    "load": CHANNEL_BY_NAME["axle_load"].column,
    "place": CHANNEL_BY_NAME["axle"].column,
}
"""Column of a sample table that carries an attribute of `Contact`."""


def require_columns(model: ExtendedModel, samples: Samples, where: str) -> None:
    """InputError where a sample table lacks a column on which an effect of the model depends.

    Args:
        model: Extended model.
        samples: Samples of the table; a speed or a load of 1 means a missing column.
        where: Name of the table, for the error.

    """
    fix = "add the column, or give the recording"
    require_channels(model, samples.covariates, where, fix)
    lacking = {
        "speed": bool((samples.speed == 1.0).all()),
        "load": bool((samples.load == 1.0).all()),
        "place": bool((samples.axle == 0).all()),
    }
    for active in model.in_contact:
        for channel in sorted(channels_used(active)):
            if lacking[channel]:
                what = f"no column {_COLUMN[channel]!r}, which {active.effect.id} needs"
                raise InputError(where, what, fix)


# -------------------------------------------------------------------- samples without the effects


class CorrectedSamples(NamedTuple):
    """Samples without the effects in the contact.

    Attributes:
        samples: Samples of the base curve.
        kept: Whether each original sample is kept, shape (n,).
        left_out: Number of samples that are left out, by reason.
        contact: Contacts of all samples to which the effects apply, also of those that they leave
            too little of; None: no such sample.

    """

    samples: Samples
    kept: NDArray[np.bool_]
    left_out: Counter[str]
    contact: Contact | None = None


def correct_samples(samples: Samples, model: ExtendedModel, axles: int) -> CorrectedSamples:
    """Samples of a whole drive without the effects in the contact.

    Args:
        samples: Samples in the order of their stamps.
        model: Extended model.
        axles: Number of axles of the vehicle.

    """
    actives = model.in_contact
    if not actives or not len(samples):
        return CorrectedSamples(samples, np.ones(len(samples), dtype=np.bool_), Counter())
    origin_us = int(samples.t_us[0])
    usual = find_usual_factor(samples, actives, origin_us, axles)
    return remove_effects(samples, actives, origin_us, axles, SlipLags(), usual or 1.0)


def mean_factor(before: Samples, after: Samples) -> float:
    """Factor of the adhesion by effects that were removed, mean of samples; 1 without any.

    Args:
        before: Samples as measured.
        after: The same samples without the effects.

    """
    base = float(np.abs(after.adhesion).sum())
    return float(np.abs(before.adhesion).sum()) / base if base > 0.0 else 1.0


def find_usual_factor(
    samples: Samples, actives: tuple[ActiveEffect, ...], origin_us: int, axles: int
) -> float | None:
    """Usual factor of the effects in the conditions of samples; None where none has all channels.

    Args:
        samples: Samples in the order of their stamps, at least one.
        actives: Effects in the contact with their values.
        origin_us: Stamp of the start of the drive, µs.
        axles: Number of axles of the vehicle.

    """
    known = have_channels(samples, actives, Counter())
    if not known.any():
        return None
    contact = build_contact(samples.select(known), origin_us, axles)
    return usual_factor(actives, LatestConditions.update(contact, None))


def scale_to_usual(
    samples: Samples, actives: tuple[ActiveEffect, ...], origin_us: int, axles: int
) -> tuple[ActiveEffect, ...] | None:
    """Effects with a constant factor by which the usual one is 1; None where no channel is there.

    A level beyond any rail's is none for an estimator.

    Args:
        samples: Samples in the order of their stamps, at least one.
        actives: Effects in the contact with their values.
        origin_us: Stamp of the start of the drive, µs.
        axles: Number of axles of the vehicle.

    """
    usual = find_usual_factor(samples, actives, origin_us, axles)
    if usual is None:
        return None
    return actives if usual == 1.0 else (*actives, ActiveEffect(Scale(1.0 / usual), ()))


def remove_effects(
    samples: Samples,
    actives: tuple[ActiveEffect, ...],
    origin_us: int,
    axles: int,
    lags: LagStates,
    usual: float = 1.0,
) -> CorrectedSamples:
    """Samples without effects in the contact, for a whole drive or a step of it.

    Variances are scaled with the adhesion, so that its noise then differs from sample to sample.
    The excess over a sample whose factor is 1 is added to the sample's own variance,
    `transient_var`.

    Args:
        samples: Samples in the order of their stamps.
        actives: Effects in the contact with their values.
        origin_us: Stamp of the start of the drive, µs.
        axles: Number of axles of the vehicle.
        lags: Lag states of the effects, continued from step to step. Variances follow those lags of
            the slip that `SlipLags` knows.
        usual: Usual factor of the effects.

    """
    left_out: Counter[str] = Counter()
    kept = have_channels(samples, actives, left_out)
    if not kept.all():
        samples = samples.select(kept)
    if not len(samples):
        return CorrectedSamples(samples, kept, left_out)
    contact = build_contact(samples, origin_us, axles)
    if isinstance(lags, SlipLags):
        lags.watch(contact.slip)
    change = compute_change(actives, contact, lags)
    samples = _with_slip_errors(samples, actives, contact, lags, change)
    factor = np.broadcast_to(change.factor, change.slip.shape)
    finite = np.isfinite(change.slip + factor + samples.slip_total_var + samples.transient_var)
    good = finite & (factor >= USABLE * usual)
    if not good.all():
        if not finite.all():
            left_out["the effects have no finite value"] += int((~finite).sum())
        small = int((finite & ~good).sum())
        if small:
            left_out[f"the effects remove all but {USABLE:g} of the adhesion"] += small
        samples = samples.select(good)
        kept[kept] = good
        change, factor = replace(change, slip=change.slip[good]), factor[good]
    square = 1.0 / (factor * factor)
    corrected = replace(
        samples,
        slip=change.slip,
        adhesion=samples.adhesion / factor,
        adhesion_var=samples.adhesion_var * square,
        transient_var=samples.transient_var * square
        + samples.adhesion_var * np.maximum(square - 1.0, 0.0),
    )
    return CorrectedSamples(corrected, kept, left_out, contact)


def _with_slip_errors(
    samples: Samples,
    actives: tuple[ActiveEffect, ...],
    contact: Contact,
    lags: LagStates,
    change: Change,
) -> Samples:
    """Samples with the errors that their slips have behind the effects.

    An error of the slip moves the factor too, where the factor depends on the slip: a sample of
    little slip in a curve has an adhesion that is shared by a slip of which little is known.

    Args:
        samples: Samples as measured, in the order of the contacts.
        actives: Effects in the contact with their values.
        contact: Contacts of the samples.
        lags: Lag states after the change.
        change: Change of the contacts by the effects.

    """
    if isinstance(lags, SlipLags):
        samples = lags.smooth_errors(samples, contact.time_s)
    std = np.sqrt(samples.slip_total_var)
    if not std.any():
        return samples

    def moved(by: Array) -> Contact:
        speed = contact.creep_speed + by * contact.speed
        return replace(contact, slip=contact.slip + by, creep_speed=speed)

    further = moved(std)
    above = compute_change(actives, further, SteadyLagStates({}))
    if above.slip is further.slip and np.array_equal(above.factor, change.factor):
        return samples
    below = compute_change(actives, moved(-std), SteadyLagStates({}))
    # Central differences over two standard deviations; a lag has followed both sides.
    by_factor = (above.factor - below.factor) / (above.factor + below.factor) * samples.adhesion
    by_slip = np.divide(above.slip - below.slip, 2.0 * std, out=np.ones_like(std), where=std > 0.0)
    square = by_slip * by_slip
    return replace(
        samples,
        slip_var=samples.slip_var * square,
        slip_common_var=samples.slip_common_var * square,
        transient_var=samples.transient_var + by_factor * by_factor,
    )


def have_channels(
    samples: Samples, actives: tuple[ActiveEffect, ...], left_out: Counter[str]
) -> NDArray[np.bool_]:
    """Whether a sample has all channels on which the effects depend, shape (n,)."""
    kept = np.isfinite(samples.speed + samples.load)
    if not kept.all():
        left_out["speed or load not finite"] += int((~kept).sum())
    for active in actives:
        requires = active.effect.requires
        needs = requires.covariates
        if not needs:
            continue
        none = np.zeros(len(samples), dtype=np.bool_)
        columns = [
            np.isfinite(samples.covariates[name]) if name in samples.covariates else none
            for name in needs
        ]
        known = (np.all if requires.each_covariate else np.any)(columns, axis=0)
        missing = int((kept & ~known).sum())
        if missing:
            word = " and " if requires.each_covariate else " or "
            left_out[f"{word.join(needs)} not available"] += missing
            kept &= known
    return kept


def build_contact(samples: Samples, origin_us: int, axles: int) -> Contact:
    """Contacts of the samples; travel is forwards where its direction is not known."""
    axle = samples.axle.astype(np.float64)
    travel = samples.covariates.get(TRAVEL_DIRECTION)
    reverse = None if travel is None else travel < 0
    place = axle if reverse is None else np.where(reverse, axles + 1 - axle, axle)
    return Contact(
        slip=samples.slip,
        creep_speed=samples.creep_speed,
        speed=samples.speed,
        load=samples.load,
        time_s=np.asarray((samples.t_us - origin_us) * 1e-6, dtype=np.float64),
        axle=axle,
        place=place,
        adhesion=samples.adhesion,
        covariates=samples.covariates,
    )
