"""Adhesion changes with a channel that the user brought: a column of a table, or a signal.

It is no member of `EFFECTS`: there is one for every such channel, and its id names the channel. A
column of few values has a step at each of them, as a number that means a kind of surface has
no order.
"""

from dataclasses import dataclass
from math import inf

import numpy as np

from adhesion_can.physics.channels import channel_label, channel_unit
from adhesion_can.physics.effects.base import Change, Contact, Observability, Requirements
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

PREFIX = "channel:"
"""Start of the id of all channel effects."""
LINEAR, STEP = "", "step"
"""Forms: a factor that is linear in the channel, and one at a single value of it."""
TYPICAL = 0.1
"""Typical change of the adhesion over a standard deviation of the channel, or by a step."""
LEAST_FACTOR, MOST_GAIN = 0.05, 5.0
"""Least factor within the range of the data, and largest share gained by a step."""


@dataclass(frozen=True, slots=True)
class ChannelFactor:
    """Factor 1 + slope (x − reference), or 1 + gain where x has one value.

    Attributes:
        channel: Name of x.
        unit: Unit of x; '' where none is stated.
        label: Name of x in sentences; '' for `channel`.
        form: `LINEAR` or `STEP`.
        reference: Value of x at which nothing changes, or that of the step.
        spread: Standard deviation of x in the data.
        reach: Largest distance of x from the reference in the data; inf: any slope is possible.

    """

    channel: str
    unit: str = ""
    label: str = ""
    form: str = LINEAR
    reference: float = 0.0
    spread: float = 1.0
    reach: float = 0.0

    @property
    def id(self) -> str:
        """Id with the name of the channel."""
        return PREFIX + self.channel

    @property
    def title(self) -> str:
        """What happens, a clause."""
        label = self.label or channel_label(self.channel)
        group, equals, text = self.channel.partition("=")
        if self.form == STEP and equals and not self.label and self.reference == 1.0:
            # A column of texts has one of 0 and 1 for each text.
            return f"adhesion changes where {group} is {text}"
        if self.form == STEP:
            return f"adhesion changes where {label} is {self.reference:g}"
        return f"adhesion changes with {label}"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Slope or gain, and the reference, which is given."""
        unit = self.unit or channel_unit(self.channel) or self.channel
        if self.form == STEP:
            size = Parameter(
                "gain", "1", TYPICAL, LEAST_FACTOR - 1.0, MOST_GAIN, "share of adhesion gained"
            )
            what = "value at which it is gained"
        else:
            most = (1.0 - LEAST_FACTOR) / self.reach if self.reach > 0.0 else inf
            meaning = f"share of adhesion per unit of {self.channel}"
            typical = TYPICAL / self.spread
            size = Parameter("slope", f"1/{unit}", typical, -most, most, meaning)
            what = "value at which nothing changes"
        given = Parameter("reference", unit, self.reference, -inf, inf, what, given=True)
        return size, given

    @property
    def literature(self) -> str:
        """Reference."""
        return "the user's data"

    @property
    def requires(self) -> Requirements:
        """The channel."""
        return Requirements(covariates=(self.channel,))

    @property
    def observability(self) -> Observability:
        """Residuals over the channel."""
        return Observability(self.channel, channel_label(self.channel))

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        size, reference = values
        x = contact.covariates[self.channel]
        part = x == reference if self.form == STEP else x - reference
        return Change(contact.slip, np.maximum(1.0 + size * part, LEAST_FACTOR))
