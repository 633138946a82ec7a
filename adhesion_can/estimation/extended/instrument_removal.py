"""Removal of the instruments' errors from finished samples, as far as one row alone allows it.

Where samples are formed from readings, the errors are removed from the readings instead
(`adhesion_can/sampling`).
"""

from dataclasses import replace

import numpy as np

from adhesion_can.errors import InputError
from adhesion_can.physics.effects import LagStates
from adhesion_can.physics.instrument_laws import Need, Situation, remove_errors
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.samples import Samples


def remove_instrument_errors(samples: Samples, instruments: Instruments, where: str) -> Samples:
    """Samples of a table with the errors of its instruments removed.

    Raises:
        InputError: An error can only be removed from readings, not from a table.

    """
    if instruments == PERFECT:
        return samples
    late = instruments.speed_lag or instruments.effort_lag
    needs = frozenset().union(*(law.needs for law in instruments.laws))
    impossible = [
        name
        for name, possible in (
            ("a delay", not late),
            ("the wheelset's inertia", not instruments.inertia_error),
            ("a radius", not instruments.radius_error or bool((samples.axle > 0).all())),
            ("an effort's bias", not instruments.effort_bias or bool((samples.load > 1.0).all())),
            ("an error that depends on other rows", not needs - {Need.AXLE}),
            ("an axle's error", Need.AXLE not in needs or bool((samples.axle > 0).all())),
        )
        if not possible
    ]
    if impossible:
        raise InputError(
            where,
            f"the model's effect {impossible[0]} cannot be removed from its rows",
            "give the recording instead of the table",
        )
    radius = np.array([1.0 + instruments.radius_error.get(int(i), 0.0) for i in samples.axle])
    slip = (1.0 + samples.slip) * radius * (1.0 + instruments.speed_error) - 1.0
    speed = samples.speed / (1.0 + instruments.speed_error)
    adhesion = samples.adhesion - instruments.effort_bias / samples.load
    plain = replace(samples, slip=slip, speed=speed, creep_speed=slip * speed, adhesion=adhesion)
    return _without_laws(plain, instruments) if instruments.laws else plain


def _without_laws(samples: Samples, instruments: Instruments) -> Samples:
    """Samples without the errors of instruments that depend on a row alone."""
    read = Situation(
        time_s=np.asarray((samples.t_us - samples.t_us[0]) * 1e-6, dtype=np.float64),
        axle=samples.axle.astype(np.float64),
        wheel_speed=(1.0 + samples.slip) * samples.speed,
        wheel_accel=np.zeros(len(samples)),
        speed=samples.speed,
        effort=samples.adhesion * samples.load,
        load=samples.load,
        covariates=samples.covariates,
    )
    true = remove_errors(instruments.laws, read, LagStates()).values
    slip = true.wheel_speed / true.speed - 1.0
    return replace(
        samples,
        slip=slip,
        speed=true.speed,
        creep_speed=slip * true.speed,
        adhesion=true.effort / true.load,
    )
