"""Slip work of the last seconds, on which effects with a memory depend."""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.effects.base import Contact
from adhesion_can.physics.lag_states import LagStates


def follow_slip_work(name: str, contact: Contact, time: float, lags: LagStates) -> Array:
    """Slip work W with dW/dt = |F v_s| − W/T, J, shape (n,); 0 at the start.

    Args:
        name: Name of the lag in the lag states.
        contact: State of the contacts; rows of one axle in the order of time.
        time: Memory T, s.
        lags: Lagging states, carried from call to call.

    """
    power = np.abs(contact.adhesion * contact.load * contact.creep_speed)
    return lags.follow(name, contact.axle, contact.lag_time_s, power * time, 1.0 / time, 0.0)
