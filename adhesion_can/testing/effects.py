"""What holds of every effect, as a class of tests."""

from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from math import isfinite
from typing import ClassVar

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.channels import CHANNEL_BY_NAME, COVARIATES
from adhesion_can.physics.effects import (
    Change,
    Contact,
    ContactEffect,
    Effect,
    InstrumentEffect,
    LagStates,
    acts_in_contact,
    effect_by_id,
)
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.testing.require import require

RANGES: Mapping[Role, tuple[float, float]] = {
    Role.HUMIDITY: (20.0, 100.0),
    Role.RAIL_TEMPERATURE: (-10.0, 40.0),
    Role.AMBIENT_TEMPERATURE: (-10.0, 40.0),
    Role.CURVATURE: (-1 / 300, 1 / 300),
    Role.GRADIENT: (-0.03, 0.03),
}
"""Ends of the covariates that vary continuously, in their units; of others 0 and 1."""
STATES = 3
"""Number of states 0, 1, .. of the covariates that have steps."""
LEAST_CHANGE = 1e-3
"""Least change of slip or factor that counts as visible."""


def draw_contact(seed: int = 3, n: int = 180, dt: float = 0.01, axles: int = 6) -> Contact:
    """A drive with all channels at random, running backwards.

    Args:
        seed: Seed of the draw.
        n: Number of samples.
        dt: Time between the samples of an axle, s.
        axles: Number of axles, sampled in turn.

    """
    rng = np.random.default_rng(seed)
    slip, speed = 0.1 * np.cumsum(rng.uniform(-0.1, 0.1, n)), rng.uniform(3.0, 40.0, n)
    rows = np.arange(n, dtype=np.float64)
    axle: Array = np.mod(rows, axles) + 1.0
    return Contact(
        slip=slip,
        creep_speed=slip * speed,
        speed=speed,
        load=rng.uniform(1.5e5, 2.6e5, n),
        time_s=4.0 + dt * np.floor(rows / axles),
        axle=axle,
        place=axles + 1.0 - axle,
        adhesion=rng.uniform(-0.4, 0.4, n),
        covariates={
            name: rng.integers(0, STATES, n).astype(np.float64)
            if CHANNEL_BY_NAME[name].steps
            else rng.uniform(*RANGES.get(role, (0.0, 1.0)), n)
            for role, name in COVARIATES.items()
        },
    )


def typical_values(effect: Effect, size: float | None = None) -> tuple[float, ...]:
    """Typical values of an effect's parameters; the first one replaced by `size` if given."""
    values = [parameter.typical for parameter in effect.parameters]
    return tuple(values if size is None else [size, *values[1:]])


class EffectSuite:
    """Tests that every effect passes.

    Attributes:
        effect: The effect.
        covariates: Lowest and highest value of each covariate of the effect that is no channel of
            this package, by its name.

    """

    effect: Effect
    covariates: ClassVar[Mapping[str, tuple[float, float]]] = {}

    def draw(self, n: int = 180) -> Contact:
        """A drive of `n` samples with all channels, and the covariates of the effect."""
        contact, rng = draw_contact(n=n), np.random.default_rng(5)
        covariates = {name: rng.uniform(*ends, n) for name, ends in self.covariates.items()}
        return replace(contact, covariates={**contact.covariates, **covariates})

    def test_the_definition_is_complete(self) -> None:
        """Texts are there, parameters have a range with 0 for the size, and names differ."""
        effect = self.effect
        kinds = isinstance(effect, ContactEffect), isinstance(effect, InstrumentEffect)
        require(sum(kinds) == 1, "an effect has either `change` or `amend`")
        require(acts_in_contact(effect) == kinds[0], "it acts in the contact if it has `change`")
        texts = {"id": effect.id, "title": effect.title, "literature": effect.literature}
        for parameter in effect.parameters:
            for name in ("name", "unit", "meaning"):
                texts[f"{name} of a parameter"] = getattr(parameter, name)
                require(texts[f"{name} of a parameter"].strip(), f"{parameter}: no {name}")
            ends = f"{parameter.name}: lower {parameter.lower}, upper {parameter.upper}"
            require(isfinite(parameter.lower) and isfinite(parameter.upper), f"{ends}: not finite")
            require(parameter.lower < parameter.upper, f"{ends}: no range")
            typical = parameter.typical
            require(parameter.lower <= typical <= parameter.upper, f"{ends}: {typical} outside")
            require(typical != 0.0, f"{parameter.name}: typical is 0, with which nothing changes")
        for name, text in texts.items():
            require(text.strip(), f"no {name}")
        require(effect.title[0].islower(), "the title is a clause that follows 'because'")
        require(effect.parameters, "no parameter: the first one is the size")
        names = [parameter.name for parameter in effect.parameters]
        require(len(set(names)) == len(names), f"two parameters have one name: {names}")
        size = effect.parameters[0]
        require(size.lower <= 0.0 <= size.upper, f"{size.name}: the range of a size has 0 in it")

    def test_it_states_how_it_shows(self) -> None:
        """The channel of its residuals exists, and its rivals are effects."""
        shows, needs = self.effect.observability, self.effect.requires.covariates
        known = {*CHANNEL_BY_NAME, *self.covariates}
        require(shows.channel in known, f"no channel {shows.channel!r}: it is no channel, and not "
                "in `covariates` of the suite")  # fmt: skip
        require(shows.excitation.strip(), "no excitation: what must vary for the effect to show")
        if set(needs) & known:
            require(shows.channel in needs, f"it shows over {shows.channel}, and requires {needs}")
        for separation in shows.separations:
            require(separation.rival != self.effect.id, "an effect is no rival of itself")
            effect_by_id(separation.rival)  # KeyError with the effects that exist
            require(separation.manoeuvre.strip(), f"no manoeuvre against {separation.rival}")

    def test_size_0_changes_nothing(self) -> None:
        """Neither the contact nor the instruments."""
        for n in (1, 6, 180):
            if isinstance(self.effect, ContactEffect):
                contact = self.draw(n)
                change = self._change(contact, typical_values(self.effect, 0.0))
                is_same = np.allclose(change.slip, contact.slip, rtol=0.0, atol=1e-15)
                require(is_same, "size 0 changes the slip")
                require(np.allclose(change.factor, 1.0, rtol=0.0, atol=1e-15), "factor not 1")
            else:
                amended = self._amend(typical_values(self.effect, 0.0))
                require(amended.vehicle(Locomotive()) == Locomotive(), "another vehicle")
                require(amended.radius_factor(6).tolist() == [1.0] * 6, "another radius")
                for field in fields(Instruments):
                    value = getattr(amended, field.name)
                    is_none = value == () if field.name == "laws" else not np.any(value)
                    require(field.name == "radius_error" or is_none, f"size 0: {field.name}")

    def test_the_typical_size_is_seen_and_leaves_its_inputs_alone(self) -> None:
        """A contact changes by a thousandth at least, instruments in one of their errors."""
        if isinstance(self.effect, ContactEffect):
            contact = self.draw()
            contact = replace(contact, series_s=contact.time_s.copy())
            copies = [array.copy() for array in _arrays(contact)]
            change = self._change(contact, typical_values(self.effect))
            moved = np.abs(change.slip - contact.slip).max(), np.abs(change.factor - 1.0).max()
            require(sum(moved) > LEAST_CHANGE, f"slip and factor move by {moved}: not visible")
            kept = zip(_arrays(contact), copies, strict=True)
            require(all(map(np.array_equal, *zip(*kept, strict=True))), "it writes to its inputs")
        else:
            amended = self._amend(typical_values(self.effect))
            names = [field.name for field in fields(Instruments)]
            moved_names = [n for n in names if getattr(amended, n) != getattr(PERFECT, n)]
            require(len(moved_names) == 1, f"errors of the instruments: {moved_names}, not one")
            again = self._amend(typical_values(self.effect))
            require(amended == again, "the same values give other instruments")

    def test_the_ends_of_its_ranges_give_numbers(self) -> None:
        """Slip and factor stay finite there."""
        if not isinstance(self.effect, ContactEffect):
            return
        for end in ("lower", "upper"):
            values = tuple(getattr(parameter, end) for parameter in self.effect.parameters)
            change = self._change(self.draw(), values)
            require(np.isfinite(change.slip).all(), f"{end} ends {values}: slip not finite")
            require(np.isfinite(change.factor).all(), f"{end} ends {values}: factor not finite")

    def _change(self, contact: Contact, values: tuple[float, ...]) -> Change:
        if not isinstance(self.effect, ContactEffect):
            raise TypeError(f"{self.effect.id} has no `change`")
        return self.effect.change(contact, values, LagStates())

    def _amend(self, values: tuple[float, ...]) -> Instruments:
        if not isinstance(self.effect, InstrumentEffect):
            raise TypeError(f"{self.effect.id} has no `amend`")
        return self.effect.amend(PERFECT, values)


def _arrays(contact: Contact) -> Iterable[Array]:
    """All arrays of a contact."""
    values = (getattr(contact, field.name) for field in fields(Contact))
    return [
        *(value for value in values if isinstance(value, np.ndarray)),
        *contact.covariates.values(),
    ]
