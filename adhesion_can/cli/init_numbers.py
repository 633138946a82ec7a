"""Numbers that `init` asks for: those of the vehicle, and cycles that the database lacks."""

import re
from collections.abc import Callable, Mapping

from adhesion_can.cli.init_answers import ask_until
from adhesion_can.config.initial_file import InitialConfiguration
from adhesion_can.config.vehicle_ranges import VEHICLE_RANGES, find_light, find_unlikely, short
from adhesion_can.config.vehicle_section import VEHICLE_DATA, VEHICLE_EXAMPLES, vehicle_example
from adhesion_can.errors import InputError
from adhesion_can.physics.vehicle import GRAVITY
from adhesion_can.recordings.tables.cells import is_float

SHORTEST_CYCLE_MS, LONGEST_CYCLE_MS = 0.1, 100e3
"""Cycles that a role may state, ms."""
_WITH_UNIT = re.compile(r"(?P<number>\d+(?:[.,]\d+)?) ?(?P<unit>[a-zA-Z]+)")


def meaning(key: str) -> str:
    """Meaning of a value of the vehicle as one number, with usual values."""
    return f"{VEHICLE_DATA[key].partition(':')[0]}, {vehicle_example(key)}"


def ask_vehicle(given: Mapping[str, float], axles: int | None) -> dict[str, float]:
    """Numbers of the vehicle by key of [vehicle]: those given, and those that a person typed.

    Args:
        given: Numbers that are not asked for.
        axles: Number of axles; None: not known.

    """
    vehicle = dict(given)
    for key in VEHICLE_DATA:
        if key not in vehicle:
            load = vehicle.get("axle_load_N")
            carried_kg = None if load is None or axles is None else load * axles / GRAVITY
            parse = _number(key, carried_kg)
            number = ask_until(f"{key}: {meaning(key)} (Enter: later): ", parse)
            if number is not None:
                vehicle[key] = number
    return vehicle


def require_usual(given: Mapping[str, float], options: Mapping[str, str]) -> None:
    """Raise an InputError where an option gives a number that no vehicle has.

    Args:
        given: Numbers by key of [vehicle].
        options: Name of each option by key.

    """
    for key, value in given.items():
        unlikely = find_unlikely(key, value)
        if unlikely is not None:
            raise InputError(
                options[key],
                unlikely.what,
                f"pass {unlikely.fix}; if it is right, write it into the file that 'init' makes",
            )


def ask_cycles(initial: InitialConfiguration) -> dict[str, float]:
    """Cycles, ms, that a person typed, by message with a role and without a cycle."""
    cycles = {}
    for name in initial.without_cycle:
        question = (
            f"{name}: cycle of this message in ms, which the database lacks, such as 20 "
            "(Enter: later): "
        )
        number = ask_until(question, _cycle)
        if number is not None:
            cycles[name] = number
    return cycles


def _number(key: str, carried_kg: float | None) -> Callable[[str], float]:
    """Parser of a number of the vehicle: an unusual one has to be typed twice."""
    unusual: set[float] = set()

    def parse(answer: str) -> float:
        number = _positive(answer, key)
        unlikely = find_unlikely(key, number)
        if unlikely is None and key == "train_mass_kg" and carried_kg is not None:
            unlikely = find_light(number, carried_kg)
        if unlikely is not None and number not in unusual:
            unusual.add(number)
            raise ValueError(f"{unlikely.what}; type {unlikely.fix}, or {answer} again to keep it")
        return number

    return parse


def _positive(answer: str, key: str) -> float:
    example = VEHICLE_EXAMPLES[key][0]
    unit = VEHICLE_DATA[key].partition(":")[0].rpartition(", ")[2]
    try:
        number = float(answer)
    except ValueError:
        raise ValueError(
            _in_its_unit(answer, key) or _not_a_number(answer, unit, example)
        ) from None
    if not 0.0 < number < float("inf"):
        raise ValueError(f"not above 0; type for example {example}")
    return number


def _in_its_unit(answer: str, key: str) -> str:
    """What to type in place of an answer with another unit, such as '92 kN'; '' for any other."""
    match = _WITH_UNIT.fullmatch(answer)
    others = VEHICLE_RANGES[key].others
    if match is None or match["unit"] not in others:
        return ""
    number = float(match["number"].replace(",", ".")) * others[match["unit"]]
    return f"type it in {VEHICLE_RANGES[key].unit}: {short(number)}"


def _cycle(answer: str) -> float:
    """Cycle in ms; ValueError where it is none."""
    try:
        number = float(answer)
    except ValueError:
        raise ValueError(_not_a_number(answer, "ms", "20")) from None
    if not SHORTEST_CYCLE_MS <= number <= LONGEST_CYCLE_MS:
        raise ValueError(
            f"not from {SHORTEST_CYCLE_MS:g} to {LONGEST_CYCLE_MS:.0f} ms; type for example 20"
        )
    return number


def _not_a_number(answer: str, unit: str, example: str) -> str:
    """What is wrong with an answer that is no number, and an example."""
    first = answer.split(maxsplit=1)[0]
    if is_float(answer.replace(",", ".")):
        return f"has a decimal comma; type {answer.replace(',', '.')}"
    if len(answer.replace(",", " ").split()) > 1 and all(
        map(is_float, answer.replace(",", " ").split())
    ):
        return (
            f"several numbers; type one for all axles, for example {example}; the file takes a list"
        )
    if is_float(first):
        return f"has more than a number; type it in {unit} without the unit, for example {example}"
    return f"not a number; type one in {unit}, for example {example}"
