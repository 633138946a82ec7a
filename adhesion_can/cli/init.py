"""`init`: a commented configuration from a database, its roles guessed by name and unit."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from adhesion_can.bus.database import load_database
from adhesion_can.bus.guess_roles import guess_roles
from adhesion_can.bus.role_guess import GuessedRoles, RoleGuess
from adhesion_can.bus.shared_efforts import distribute
from adhesion_can.cli.common import (
    add_lenient,
    require_outputs,
    require_positive,
    tell_left_out,
)
from adhesion_can.config.initial_file import (
    REQUIRED,
    InitialConfiguration,
    count_axles,
    initial_text,
    shared_sentence,
)
from adhesion_can.config.vehicle_section import VEHICLE_DATA, vehicle_example
from adhesion_can.errors import InputError
from adhesion_can.files import whole_file
from adhesion_can.plurals import counted
from adhesion_can.printable import say

_OPTIONS = {
    "wheel_radius_m": ("--wheel-radius", "M", "metres"),
    "axle_load_N": ("--axle-load", "N", "newtons"),
    "wheelset_inertia_kgm2": ("--inertia", "KGM2", "kg m^2"),
    "train_mass_kg": ("--train-mass", "KG", "kilograms"),
}
"""Option of each value of the vehicle, the sign of its unit, and the unit in words."""

SHOWN = 6
"""Number of signals that a line on the terminal names."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Writes a commented configuration for --config. Roles are guessed from names, units and "
        "value tables; where two signals fit a role about equally well, and where motors or bogies "
        "drive several axles, you are asked. What stays open is commented out, or says 'fill in'."
    )
    parser.add_argument("--dbc", type=Path, required=True, metavar="F", help="CAN database")
    parser.add_argument(
        "--out", type=Path, metavar="CONFIG.toml", help="file to write (default: stdout)"
    )
    parser.add_argument(
        "--overwrite",
        action="store_true",
        help="replace the file of --out, with edits in it",
    )
    parser.add_argument("--yes", action="store_true", help="take the clear guesses and ask nothing")
    for key, (option, unit, _) in _OPTIONS.items():
        parser.add_argument(option, dest=key, type=float, metavar=unit, help=_meaning(key))
    add_lenient(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    given = {key: value for key in _OPTIONS if (value := getattr(options, key)) is not None}
    for key, value in given.items():
        require_positive(value, _OPTIONS[key][0], _OPTIONS[key][2])
    require_outputs(options, {"--out": options.out})
    if options.out is not None and options.out.is_file() and not options.overwrite:
        raise InputError(
            f"--out {options.out}",
            "exists, and may have your edits",
            "choose another name, or pass --overwrite",
        )
    database = load_database(options.dbc, lenient=options.lenient)
    tell_left_out(database)
    guessed = guess_roles(database.db.messages)
    initial = InitialConfiguration(database, guessed, count_axles(guessed), given)
    if not options.yes:
        if not sys.stdin.isatty():
            raise InputError(str(options.dbc), _summary(initial), "pass --yes to take the guesses")
        initial = _ask(initial)
    text = initial_text(initial, options.out)
    if options.out is None:
        sys.stdout.write(text)
    else:
        with whole_file(options.out) as file:
            file.write(text)
    where = "" if options.out is None else f"{options.out}: "
    say(f"{where}{_summary(initial)}")
    for line in _left_over(initial):
        say(line)
    return 0


def _meaning(key: str) -> str:
    """Meaning of a value of the vehicle as one number, with usual values."""
    return f"{VEHICLE_DATA[key].partition(':')[0]}, {vehicle_example(key)}"


def _summary(initial: InitialConfiguration) -> str:
    """What was guessed and what is open, as one line."""
    unclear = list(initial.guessed.rivals)
    parts = [f"{len(initial.guessed.taken)} roles guessed"]
    if unclear:
        parts.append(f"unclear {', '.join(unclear)}")
    if shared := initial.guessed.shared:
        parts.append(f"not assigned: {shared_sentence(shared, initial.axles)}")
    if initial.missing:
        parts.append(f"missing {', '.join(initial.missing)}")
    if initial.to_fill_in:
        parts.append(f"to fill in {', '.join(initial.to_fill_in)}")
    return "; ".join(parts)


def _left_over(initial: InitialConfiguration) -> list[str]:
    """Lines on the candidates for roles that are needed, and on the signals that are not used."""
    lines = []
    for role in initial.absent:
        if role in REQUIRED:
            found = _some(initial.candidates(role)) or "no signal has a unit that fits"
            lines.append(f"{role} not found; candidates: {found}")
    if unused := initial.unused:
        count = counted(len(unused), "signal")
        lines.append(f"{count} not used: {_some(unused)}")
    return lines


def _some(names: Sequence[str]) -> str:
    """The first names of a list, which the file has whole."""
    more = f", and {len(names) - SHOWN} more (the file lists all)" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


def _ask(initial: InitialConfiguration) -> InitialConfiguration:
    """The configuration with the answers of a person; an empty answer leaves a thing open."""
    taken, open_roles = list(initial.guessed.taken), dict(initial.guessed.rivals)
    for name, rivals in initial.guessed.rivals.items():
        used = {guess.place for guess in taken}
        free = [rival for rival in rivals if rival.place not in used]
        chosen = _ask_rival(name, free)
        if chosen is not None:
            taken.append(chosen)
            del open_roles[name]
    guessed = GuessedRoles(tuple(taken), open_roles, initial.guessed.shared)
    vehicle = dict(initial.vehicle)
    axles = count_axles(guessed)
    if axles is None:
        axles = _ask_count("axles: number of the axles, such as 4")
    guessed = _ask_shared(guessed, axles)
    for key in VEHICLE_DATA:
        if key not in vehicle and (number := _ask_number(f"{key}: {_meaning(key)}")) is not None:
            vehicle[key] = number
    return replace(initial, guessed=guessed, axles=axles, vehicle=vehicle)


def _ask_shared(guessed: GuessedRoles, axles: int | None) -> GuessedRoles:
    """The guesses with the efforts of motors or bogies distributed, where the answer is yes."""
    proposed = distribute(guessed.shared, axles)
    if not proposed:
        return guessed
    each = round(1 / proposed[0].share)
    places = ", ".join(guess.place for guess in guessed.shared)
    say(f"{shared_sentence(guessed.shared, axles)}: {places}")
    answer = _answer(
        f"does each drive {each} axles, in this order, with equal shares? y, or Enter for later: "
    )
    if answer.lower() not in ("y", "yes"):
        return guessed
    return replace(guessed, taken=(*guessed.taken, *proposed), shared=())


def _ask_rival(name: str, rivals: list[RoleGuess]) -> RoleGuess | None:
    if not rivals:
        return None
    say(f"{name} may be")
    for number, rival in enumerate(rivals, start=1):
        unit = rival.signal.unit or "no unit"
        say(f"  {number}  {rival.place} ({unit})")
    while answer := _answer("number, or Enter for none: "):
        if answer.isdecimal() and 1 <= int(answer) <= len(rivals):
            return rivals[int(answer) - 1]
    return None


def _ask_number(question: str) -> float | None:
    while answer := _answer(f"{question} (Enter: later): "):
        try:
            number = float(answer)
        except ValueError:
            number = 0.0
        if 0.0 < number < float("inf"):
            return number
        say("one number above 0, please; a list goes into the file later")
    return None


def _ask_count(question: str) -> int | None:
    while answer := _answer(f"{question} (Enter: later): "):
        if answer.isdecimal() and int(answer) > 0:
            return int(answer)
    return None


def _answer(question: str) -> str:
    """Answer of a person; '' at the end of the input."""
    say(question, end="")
    return sys.stdin.readline().strip()
