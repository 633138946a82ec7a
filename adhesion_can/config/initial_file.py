"""A configuration file from a database: guessed roles, and what is left to fill in."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from adhesion_can.bus.database import CanDatabase, cycle_us, e2e_data_id
from adhesion_can.bus.guess_roles import GuessedRoles, RoleGuess
from adhesion_can.config.toml_text import quoted
from adhesion_can.config.vehicle_section import FILL_IN, VEHICLE_DATA
from adhesion_can.physics.readings import Role

REQUIRED = (Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT)
"""Roles without which there is no adhesion coefficient."""
_CHECKSUMS = ("crc", "checksum", "chksum", "pruefsumme")
_SIGN_OF_EFFORT = "positive in traction along the direction of travel; otherwise add sign = -1"


@dataclass(frozen=True)
class InitialConfiguration:
    """What stands in a new configuration file.

    Attributes:
        database: Database of the messages.
        guessed: Roles of its signals.
        axles: Number of axles; None: not known.
        vehicle: Values of the vehicle by key of [vehicle]; keys that are missing are to be filled
            in.

    """

    database: CanDatabase
    guessed: GuessedRoles
    axles: int | None
    vehicle: Mapping[str, float]

    @property
    def missing(self) -> list[str]:
        """Roles that adhesion needs and that are not clear."""
        taken = {guess.role for guess in self.guessed.taken}
        return [
            f"{role}.1, .." if role.per_axle else str(role)
            for role in REQUIRED
            if role not in taken
        ]

    @property
    def to_fill_in(self) -> list[str]:
        """Keys of [vehicle] without a value."""
        keys = [key for key in VEHICLE_DATA if key not in self.vehicle]
        return [*(["axles"] if self.axles is None else []), *keys]


def count_axles(guessed: GuessedRoles) -> int | None:
    """Number of axles by the guessed wheel speeds; None where they are not 1, 2, .. to the last."""
    axles = sorted(g.axle for g in guessed.taken if g.role is Role.WHEEL_SPEED)
    unclear = any(name.startswith(f"{Role.WHEEL_SPEED}.") for name in guessed.rivals)
    return len(axles) if axles == list(range(1, len(axles) + 1)) and axles and not unclear else None


def initial_text(initial: InitialConfiguration, target: Path | None) -> str:
    """Text of the configuration file.

    Args:
        initial: Content.
        target: Path of the file, to which that of the database is relative; None: to here.

    """
    folder = Path.cwd() if target is None else target.resolve().parent
    path = os.path.relpath(initial.database.path.resolve(), folder)
    head = (
        "# Configuration of adhesion-can, guessed from a CAN database. Check every line marked\n"
        "# 'guessed', fill in what says so, then: adhesion-can check RECORDING --config THIS_FILE\n"
    )
    bus = f"[bus]\ndatabase = {quoted(path)}\n"
    parts = [head, bus, _vehicle(initial), _roles(initial)]
    return "\n".join(parts)


def _vehicle(initial: InitialConfiguration) -> str:
    axles = f'"{FILL_IN}"' if initial.axles is None else str(initial.axles)
    lines = ["[vehicle]", f"axles = {axles}  # those with a wheel speed"]
    for key, meaning in VEHICLE_DATA.items():
        value = initial.vehicle.get(key)
        lines.append(
            f"{key} = {f'{value:.12g}' if value is not None else quoted(FILL_IN)}  # {meaning}"
        )
    lines += [
        "",
        "# For load transfer under effort; without this section none is computed:",
        "# [vehicle.geometry]",
        "# axles_per_bogie = [2, 2]",
        "# pivot_distance_m = ..    # between the bogies' centres",
        "# axle_spacing_m = ..      # within a bogie",
        "# coupler_height_m = ..    # above the rail",
        "# traction_height_m = ..   # of the traction rods, above the rail",
    ]
    return "\n".join(lines) + "\n"


def _roles(initial: InitialConfiguration) -> str:
    lines = ["[roles]"]
    guessed = initial.guessed
    for guess in guessed.taken:
        lines.append(
            f"{quoted(guess.name)} = {quoted(guess.place)}  # guessed from {_why(guess)}; check"
        )
        lines += [f"#   {note}" for note in _notes(guess)]
    for name, rivals in guessed.rivals.items():
        lines.append(f"# {name}: unclear; uncomment the right line, if any:")
        lines += [f"# {quoted(name)} = {quoted(rival.place)}  # {_why(rival)}" for rival in rivals]
    known = {guess.role for guess in guessed.taken} | {
        rival.role for rivals in guessed.rivals.values() for rival in rivals
    }
    absent = [role for role in Role if role not in known and role is not Role.CHANNEL]
    if absent:
        lines.append("# Not found; map those that the bus carries:")
    for role in absent:
        needed = "needed for adhesion" if role in REQUIRED else "optional"
        name = f"{role}.1" if role.per_axle else str(role)
        lines.append(f'# {quoted(name)} = "MESSAGE.SIGNAL"  # {needed}')
    return "\n".join(lines) + "\n"


def _why(guess: RoleGuess) -> str:
    unit = f" {guess.signal.unit}" if guess.signal.unit and "unit" in guess.reasons else ""
    return f"{' and '.join(guess.reasons)}{_comment(unit)}"


def _notes(guess: RoleGuess) -> list[str]:
    """What the database does not say about a guessed signal, or what it cannot know."""
    message, notes = guess.message, []
    if cycle_us(message) is None:
        notes.append(
            "the database has no cycle of its message: write "
            f"{{ signal = {quoted(guess.place)}, cycle_ms = .. }}"
        )
    checksum = next(
        (s.name for s in message.signals if any(c in s.name.lower() for c in _CHECKSUMS)), None
    )
    if checksum and e2e_data_id(message) is None:
        notes.append(
            f"{_comment(checksum)} is not checked, because the database has no E2EDataId; for "
            "AUTOSAR E2E profile 1, write data_id"
        )
    if guess.role is Role.TRACTIVE_EFFORT and guess.axle == 1:
        notes.append(_SIGN_OF_EFFORT)
    return notes


def _comment(text: str) -> str:
    """Text without line breaks and control characters, which no comment may have."""
    return "".join(c for c in text if c.isprintable())
