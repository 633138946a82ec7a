"""`init`: a commented configuration from a database, its roles guessed by name and unit."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from adhesion_can.bus.database import load_database
from adhesion_can.bus.guess_roles import guess_roles
from adhesion_can.bus.role_candidates import torques
from adhesion_can.bus.role_specs import known_units
from adhesion_can.bus.shared_signals import SHARED_ROLES
from adhesion_can.cli.common import (
    add_lenient,
    require_database,
    require_positive,
    tell_left_out,
)
from adhesion_can.cli.init_numbers import meaning, require_usual
from adhesion_can.cli.init_questions import ask, ask_second_file
from adhesion_can.cli.outputs import add_file, require_outputs
from adhesion_can.config.initial_file import (
    InitialConfiguration,
    candidate_text,
    count_axles,
    for_simulation,
    initial_text,
    shared_sentence,
)
from adhesion_can.errors import InputError
from adhesion_can.files import whole_file
from adhesion_can.physics.readings import REQUIRED, Role
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
        "ranges and value tables; where two signals fit a role about equally well, where motors or "
        "bogies have several axles, and where a needed role has no clear signal, you are asked. "
        "What stays open is commented out, or says 'fill in'. Where axles share a motor, a second "
        "file with one axle of each is offered for 'simulate', beside --out."
    )
    parser.add_argument("--dbc", type=Path, required=True, metavar="F", help="CAN database")
    add_file(parser, "--out", "CONFIG.toml", "file to write (default: stdout)")
    parser.add_argument(
        "--overwrite",
        action="store_true",
        help="replace the file of --out, with edits in it",
    )
    parser.add_argument("--yes", action="store_true", help="take the clear guesses and ask nothing")
    for key, (option, unit, _) in _OPTIONS.items():
        parser.add_argument(option, dest=key, type=float, metavar=unit, help=meaning(key))
    add_lenient(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    given = {key: value for key in _OPTIONS if (value := getattr(options, key)) is not None}
    for key, value in given.items():
        require_positive(value, _OPTIONS[key][0], _OPTIONS[key][2])
    require_outputs(options)
    if options.out is not None and options.out.is_file() and not options.overwrite:
        raise InputError(
            f"--out {options.out}",
            "exists, and may have your edits",
            "choose another name, or pass --overwrite",
        )
    require_database(options.dbc)
    database = load_database(options.dbc, lenient=options.lenient)
    tell_left_out(database)
    guessed = guess_roles(database.db.messages)
    axles = count_axles(guessed)
    require_usual(given, {key: option for key, (option, *_) in _OPTIONS.items()})
    initial = InitialConfiguration(database, guessed, axles, given)
    if not options.yes:
        if not sys.stdin.isatty():
            raise InputError(str(options.dbc), _summary(initial), "pass --yes to take the guesses")
        initial = ask(initial)
    _write(initial, options.out)
    second = None if options.yes else _second_file(initial, options)
    where = "" if options.out is None else f"{options.out}: "
    say(f"{where}{_summary(initial)}")
    for line in _left_over(initial):
        say(line)
    if second is not None:
        say(f"{second}: for 'simulate', one axle of each motor")
    return 0


def _write(initial: InitialConfiguration, path: Path | None) -> None:
    """Write the file; None: to stdout."""
    text = initial_text(initial, path)
    if path is None:
        sys.stdout.write(text)
    else:
        with whole_file(path) as file:
            file.write(text)


def _second_file(initial: InitialConfiguration, options: argparse.Namespace) -> Path | None:
    """Path of the file for `simulate`, which is written after a yes; None: there is none."""
    simulated = for_simulation(initial)
    if simulated is None or options.out is None:
        return None
    path: Path = options.out.with_name(f"{options.out.stem}_simulate{options.out.suffix}")
    if path.exists() and not options.overwrite:
        say(f"{path}: exists, and may have your edits; with --overwrite it is written again")
        return None
    if not ask_second_file(path):
        return None
    _write(simulated, path)
    return path


def _summary(initial: InitialConfiguration) -> str:
    """What was guessed and what is open, as one line."""
    unclear = list(initial.guessed.rivals)
    parts = [f"{counted(len(initial.guessed.taken), 'role')} guessed"]
    if unclear:
        parts.append(f"unclear {', '.join(unclear)}")
    parts.extend(
        f"not assigned: {shared_sentence(shared, initial.likely_axles)}"
        for role in SHARED_ROLES
        if (shared := initial.guessed.shared_of(role))
    )
    if initial.missing:
        parts.append(f"missing {', '.join(initial.missing)}")
    if initial.to_fill_in:
        parts.append(f"to fill in {', '.join(initial.to_fill_in)}")
    if silent := [name for name in initial.without_cycle if name not in initial.cycles]:
        parts.append(f"no cycle of {', '.join(silent)}")
    return "; ".join(parts)


def _left_over(initial: InitialConfiguration) -> list[str]:
    """Lines on the candidates for roles that are needed, and on the signals that are not used."""
    lines = []
    for role in initial.absent:
        if role in REQUIRED:
            candidates = [candidate_text(candidate) for candidate in initial.candidates(role)]
            listed = _some(candidates) or f"no signal has a unit that fits ({known_units(role)})"
            lines.append(f"{role} not found; candidates: {listed}")
            if role is Role.TRACTIVE_EFFORT and (ours := torques(initial.database.db.messages)):
                lines.append(
                    f'{_some(ours)}: a torque gives an effort with unit = "N" and factor = gear '
                    "ratio * efficiency / wheel radius (1/m)"
                )
    if one_sided := initial.one_sided:
        lines.append(f"{_some(one_sided)}: cannot be negative; check the sign in braking")
    if unused := initial.unused:
        count = counted(len(unused), "signal")
        lines.append(f"{count} not used: {_some(unused)}")
    return lines


def _some(names: Sequence[str]) -> str:
    """The first names of a list, which the file has whole."""
    more = f", and {len(names) - SHOWN} more (the file lists all)" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
