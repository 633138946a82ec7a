"""Named causes in the quantities that a user knows: metres, newtons, milliseconds, percent."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import floor, isfinite, log10
from typing import NamedTuple

from adhesion_can.bus.roles import SignalChoice
from adhesion_can.config import Configuration
from adhesion_can.config.calibrated_radii import rim_axles
from adhesion_can.diagnosis.cause_result import Cause, ParameterValue
from adhesion_can.diagnosis.sentences import cause_sentence
from adhesion_can.physics.readings import Role

MOST_DIGITS = 2
"""Decimals of a percentage, at most."""
_VEHICLE, _ROLES = " under [vehicle]", " under [roles]"
LOAD_STEP = 1.1
"""Ratio of two axle loads for which the change of the adhesion is stated."""


class Meaning(NamedTuple):
    """A cause in the user's quantities.

    Attributes:
        text: What is wrong, a sentence.
        setting: Keys of the configuration that correct it, as TOML with their section; '' where
            none does.
        in_roles: Whether they are keys of [roles].

    """

    text: str
    setting: str = ""
    in_roles: bool = False


Values = Mapping[str, ParameterValue]
Describe = Callable[[Values, Configuration], Meaning]


def describe_cause(
    cause: Cause, configuration: Configuration, *, alone: bool, tables: bool
) -> Meaning:
    """A named cause in the user's quantities.

    Args:
        cause: Named cause.
        configuration: Vehicle and roles of the recordings.
        alone: Whether it is the only cause.
        tables: Whether the data are tables, to which no vehicle belongs.

    """
    values = {value.name: value for value in cause.parameters}
    describe = _BY_FORM.get((cause.effect, cause.form))
    at_bound = any(value.at_bound for value in cause.parameters)
    vehicle_is_known = not tables or (cause.effect, cause.form) not in _OF_VEHICLE
    if describe is not None and not at_bound and vehicle_is_known:
        meaning = describe(values, configuration)
        return Meaning(meaning.text) if tables else meaning
    return Meaning(cause_sentence(cause, alone=alone))


# ------------------------------------------------------------------- vehicle and instruments


def _wheel_radius(values: Values, configuration: Configuration) -> Meaning:
    error, axle = values["error"], round(values["axle"].value)
    radii = list(configuration.vehicle.wheel_radius)
    share = f"{_percent(error)} {'smaller' if error.value < 0 else 'larger'} than configured"
    if axle > len(radii):
        return Meaning(f"Axle {axle}'s wheel is {share}.")
    if axle in rim_axles(configuration):
        choices = _choices(configuration, Role.WHEEL_SPEED, axle)
        text = f"Axle {axle}'s wheel is {share}: its sender uses the wrong radius."
        return Meaning(text, _scaled_keys(choices, 1.0 + error.value), in_roles=True)
    before = radii[axle - 1]
    radii[axle - 1] = before * (1.0 + error.value)
    text = f"Axle {axle}'s wheel is {share}: {radii[axle - 1]:.4f} m, not {before:.4f}."
    return Meaning(text, f"wheel_radius_m = [{', '.join(f'{r:.4f}' for r in radii)}]{_VEHICLE}")


def _scaled(what: str, name: str, role: Role) -> Describe:
    """A reading that is high or low by a share, and the keys of its roles that correct it."""

    def describe(values: Values, configuration: Configuration) -> Meaning:
        axle = round(values["axle"].value) if "axle" in values else None
        error, choices = values[name], _choices(configuration, role, axle)
        text = f"{what.format(axle)} reads {_percent(error)} {_high(error)}."
        return Meaning(text, _scaled_keys(choices, 1.0 / (1.0 + error.value)), in_roles=True)

    return describe


def _scaled_keys(choices: Sequence[SignalChoice], ratio: float) -> str:
    """Keys of roles whose readings are multiplied by a ratio; an offset is subtracted last."""
    return _role_keys(
        [
            replace(choice, factor=choice.used_factor * ratio, offset=choice.offset * ratio)
            for choice in choices
        ]
    )


def _effort_bias(values: Values, configuration: Configuration) -> Meaning:
    bias = values["bias"]
    choices = _choices(configuration, Role.TRACTIVE_EFFORT)
    text = f"The tractive effort of each axle reads {abs(bias.value):.0f} N {_high(bias)}."
    keys = _role_keys([replace(choice, offset=choice.offset + bias.value) for choice in choices])
    return Meaning(text, keys, in_roles=True)


def _role_keys(choices: Sequence[SignalChoice]) -> str:
    """Entries of [roles] with their factors and offsets, as TOML; '' without any role."""
    entries = [f'"{choice.name}" = {{ {", ".join(_keys(choice))} }}' for choice in choices]
    return f"{' and '.join(entries)}{_ROLES}" if entries else ""


def _keys(choice: SignalChoice) -> Iterator[str]:
    """All keys of a role that are not the defaults: the entry takes the place of the user's."""
    yield f'signal = "{choice.message}.{choice.signal}"'
    texts = {"channel": choice.channel, "unit": choice.unit, "protection": choice.protection}
    for key, text in texts.items():
        if text is not None:
            yield f"{key} = {json.dumps(text, ensure_ascii=False)}"
    if choice.factor is not None:
        yield f"factor = {choice.factor:.5g}"
    if choice.sign != 1:
        yield f"sign = {choice.sign}"
    if choice.offset:
        yield f"offset = {choice.offset:.5g}"
    if choice.data_id is not None:
        yield f"data_id = {choice.data_id}"
    if choice.cycle_us is not None:
        yield f"cycle_ms = {choice.cycle_us / 1e3:g}"
    for key, kept in (("not_available", choice.not_available), ("stuck_check", choice.stuck_check)):
        if not kept:
            yield f"{key} = false"


def _wheelset_inertia(values: Values, configuration: Configuration) -> Meaning:
    before = configuration.vehicle.wheelset_inertia
    inertia = before + values["error"].value
    text = f"The wheelset's inertia is {inertia:.0f} kg·m², not {before:.0f}."
    return Meaning(text, f"wheelset_inertia_kgm2 = {inertia:.0f}{_VEHICLE}")


def _delay(what: str) -> Describe:
    def describe(values: Values, _: Configuration) -> Meaning:
        delay = values["delay"].value
        late = "late" if delay > 0 else "early"
        return Meaning(f"{what} {1e3 * abs(delay):.0f} ms {late}.")

    return describe


def _once_per_turn(values: Values, _: Configuration) -> Meaning:
    amplitude, axle = values["amplitude"], round(values["axle"].value)
    return Meaning(f"Axle {axle}'s wheel speed oscillates by {_percent(amplitude)} once per turn.")


# ------------------------------------------------------------------------------------ contact


def _per(name: str, sentence: str, factor: float = 1.0) -> Describe:
    """A sentence with a share as percent; of the adhesion with 'more' or 'less'."""

    def describe(values: Values, _: Configuration) -> Meaning:
        share, way = _percent(values[name], factor), "less" if values[name].value < 0 else "more"
        return Meaning(sentence.format(share, more=f"{share} {way}"))

    return describe


def _load_squared(values: Values, configuration: Configuration) -> Meaning:
    load = sum(configuration.vehicle.axle_load) / len(configuration.vehicle.axle_load)
    c5 = values["c5"].value
    lost, more = (c5 * (ratio * load) ** 2 for ratio in (1.0, LOAD_STEP))
    return _heavier((1.0 - more) / (1.0 - lost) - 1.0)


def _load_power(values: Values, _: Configuration) -> Meaning:
    return _heavier(LOAD_STEP ** -values["exponent"].value - 1.0)


def _heavier(change: float) -> Meaning:
    step = f"An axle with {100 * (LOAD_STEP - 1):.0f} % more load"
    way = "less" if change < 0 else "more"
    return Meaning(f"{step} has {100 * abs(change):.1f} % {way} adhesion.")


# -------------------------------------------------------------------------------------- words


def _percent(value: ParameterValue, factor: float = 1.0) -> str:
    """Magnitude of a share in percent, with the decimals that its standard deviation allows."""
    std = 100.0 * factor * value.std if value.std and isfinite(value.std) else 0.0
    digits = min(max(-floor(log10(std)), 0), MOST_DIGITS) if std else MOST_DIGITS
    return f"{abs(100.0 * factor * value.value):.{digits}f} %"


def _high(value: ParameterValue) -> str:
    return "low" if value.value < 0 else "high"


def _choices(
    configuration: Configuration, role: Role, axle: int | None = None
) -> list[SignalChoice]:
    """Signals of a role, of one axle or of all."""
    choices = (choice for choice in configuration.choices if choice.role is role)
    return [choice for choice in choices if axle is None or choice.axle == axle]


_BY_FORM: Mapping[tuple[str, str], Describe] = {
    ("wheel_radius", ""): _wheel_radius,
    ("speed_scale", ""): _scaled("The vehicle speed", "error", Role.VEHICLE_SPEED),
    ("effort_gain", "axle"): _scaled("The tractive effort of axle {}", "gain",
                                     Role.TRACTIVE_EFFORT),
    ("effort_gain", "all"): _scaled("The tractive effort of all axles", "gain",
                                    Role.TRACTIVE_EFFORT),
    ("effort_bias", ""): _effort_bias,
    ("wheelset_inertia", ""): _wheelset_inertia,
    ("effort_delay", ""): _delay("The tractive effort comes"),
    ("speed_delay", ""): _delay("The vehicle speed comes"),
    ("wheel_speed_delay", ""): _delay("The wheel speeds come"),
    ("wheel_once_per_turn", ""): _once_per_turn,
    ("load_transfer", "geometry"): _per("size", "The axle loads lack {} of the load transfer "
                                        "computed from effort and geometry."),
    ("brake_blending", "constant"): _per("share", "A friction brake takes {} of the braking force, "
                                         "in addition to the effort."),
    ("load_dependence", "burckhardt"): _load_squared,
    ("load_dependence", "power"): _load_power,
    ("rail_cleaning", ""): _per("gain", "Each axle has {more} adhesion than the axle ahead."),
    ("sanding", ""): _per("gain", "Under sand there is {more} adhesion."),
    ("rain", "level"): _per("gain", "With each level of rain there is {more} adhesion."),
    ("humidity", ""): _per("slope", "For each % of humidity there is {more} adhesion."),
    ("rail_temperature", ""): _per("slope", "For each degree of the rail there is {more} "
                                   "adhesion."),
    ("slow_drift", ""): _per("rate", "Every minute there is {more} adhesion.", 60.0),
    ("traction_braking_asymmetry", ""): _per("gain", "In braking there is {more} adhesion than in "
                                             "traction."),
}  # fmt: skip
"""Sentence for each effect and form; the others keep title and parameters."""
_OF_VEHICLE = {("wheel_radius", ""), ("wheelset_inertia", ""), ("load_dependence", "burckhardt")}
"""Effects whose sentence needs data of the configured vehicle."""
