"""A configuration file from a database: guessed roles, and what is left to fill in."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from cantools.database.can import Signal

from adhesion_can.bus.database import CanDatabase, cycle_us, e2e_data_id
from adhesion_can.bus.role_candidates import RoleCandidate, candidates, unused_signals
from adhesion_can.bus.role_guess import CHOSEN, GuessedRoles, RoleGuess
from adhesion_can.bus.shared_signals import SHARED_ROLES, distribute, first_axle_of_each
from adhesion_can.bus.signal_signs import Signs, signs_of, stated_range
from adhesion_can.config.toml_text import quoted
from adhesion_can.config.vehicle_section import FILL_IN, VEHICLE_DATA, vehicle_example
from adhesion_can.estimation.doubt.settings import HEAVY_LOAD, InstrumentUncertainty
from adhesion_can.physics.readings import REQUIRED, SPEED_AIDS, Role
from adhesion_can.plurals import counted

_CHECKSUMS = ("crc", "checksum", "chksum", "pruefsumme")
_ONE_SIDED = "its values cannot be negative: if it has no sign, braking counts as traction"
_SIGN_OF_EFFORT = "positive in traction along the direction of travel; otherwise add sign = -1"


@dataclass(frozen=True)
class InitialConfiguration:
    """Content of a new configuration file.

    Attributes:
        database: Database of the messages.
        guessed: Roles of its signals.
        axles: Number of axles; None: not known.
        vehicle: Values of the vehicle by key of [vehicle]; keys that are missing are to be filled
            in.
        cycles: Cycle of messages, ms, by name, where the database has none.
        kept_axles: Numbers of the vehicle's axles that are mapped; empty where all are.

    """

    database: CanDatabase
    guessed: GuessedRoles
    axles: int | None
    vehicle: Mapping[str, float]
    cycles: Mapping[str, float] = field(default_factory=dict)
    kept_axles: tuple[int, ...] = ()

    @property
    def missing(self) -> list[str]:
        """Roles that adhesion needs and that are not clear."""
        taken = {guess.role for guess in self.guessed.taken}
        return [
            f"{role}.1, .." if role.per_axle else str(role)
            for role in Role
            if role in REQUIRED - taken
        ]

    @property
    def absent(self) -> list[Role]:
        """Roles that no signal was found for, neither a clear one nor one of several."""
        known = {guess.role for guess in self.guessed.guesses} | SPEED_AIDS
        return [role for role in Role if role not in known and role is not Role.CHANNEL]

    @property
    def unused(self) -> list[str]:
        """Signals without a role, as `Message.Signal`."""
        signals = unused_signals(self.database.db.messages, self.guessed)
        return [f"{message.name}.{signal.name}" for message, signal in signals]

    def candidates(self, role: Role) -> list[RoleCandidate]:
        """Signals that may have a role that was not found, best first."""
        return candidates(self.database.db.messages, self.guessed, role)

    @property
    def without_cycle(self) -> list[str]:
        """Messages of the roles, open ones included, that have no cycle in the database."""
        guessed = self.guessed
        guesses = (*guessed.taken, *guessed.shared, *guessed.unclear)
        messages = {guess.message.name: guess.message for guess in guesses}
        return [name for name, message in messages.items() if cycle_us(message) is None]

    @property
    def one_sided(self) -> list[str]:
        """Signals taken as an effort whose values cannot be negative, as `Message.Signal`."""
        return list(dict.fromkeys(g.place for g in self.guessed.taken if _is_one_sided(g)))

    @property
    def likely_axles(self) -> int | None:
        """Number of axles, or that by the wheel speeds that are still to be confirmed."""
        if self.axles is not None:
            return self.axles
        asked = [alike[0] for alike in self.guessed.rivals.values() if len(alike) == 1]
        others = {name: rivals for name, rivals in self.guessed.rivals.items() if len(rivals) > 1}
        return count_axles(
            replace(self.guessed, taken=(*self.guessed.taken, *asked), rivals=others)
        )

    @property
    def to_fill_in(self) -> list[str]:
        """Keys of [vehicle] without a value."""
        keys = [key for key in VEHICLE_DATA if key not in self.vehicle]
        return [*(["axles"] if self.axles is None else []), *keys]


def for_simulation(initial: InitialConfiguration) -> InitialConfiguration | None:
    """The configuration with the first axle of each motor; None where no axles share an effort.

    `simulate` moves every axle separately, so that two of them cannot have one effort.
    """
    guessed = initial.guessed
    kept = first_axle_of_each(guessed.taken)
    if not kept:
        return None
    whole = [guess for guess in guessed.taken if not guess.role.per_axle]
    rivals = {name: alike for name, alike in guessed.rivals.items() if not alike[0].role.per_axle}
    taken = (*whole, *(guess for guesses in kept.values() for guess in guesses))
    roles = GuessedRoles(taken, rivals)
    return replace(initial, guessed=roles, axles=len(kept), kept_axles=tuple(kept))


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
    parts = [head, bus, _vehicle(initial), _instruments(initial), _roles(initial), _unused(initial)]
    return "\n".join(parts)


def _vehicle(initial: InitialConfiguration) -> str:
    axles = f'"{FILL_IN}"' if initial.axles is None else str(initial.axles)
    which = "those with a wheel speed"
    if initial.kept_axles:
        which = (
            f"axles {' and '.join(map(str, initial.kept_axles))} of the vehicle: one of each motor"
        )
    lines = ["[vehicle]", f"axles = {axles}  # {which}"]
    for key, meaning in VEHICLE_DATA.items():
        value = initial.vehicle.get(key)
        if value is None:
            lines.append(f"{key} = {quoted(FILL_IN)}  # {meaning}, {vehicle_example(key)}")
        else:
            lines.append(f"{key} = {value:.12g}  # {meaning}")
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


def _instruments(initial: InitialConfiguration) -> str:
    """Section of what the instruments may be wrong by, with the values that hold without it."""
    load = initial.vehicle.get("axle_load_N")
    usual = InstrumentUncertainty().on_load(HEAVY_LOAD if load is None else load)
    bias = (
        "..  # N; without this line" if load is None else f"{usual.used_bias_std:.0f}  # N; this is"
    )
    return (
        "# Errors that all axles share; they count until the train has braked and coasted.\n"
        "# 'check' and 'calibrate' propose smaller ones that a recording bears out.\n"
        "[instruments]\n"
        f"speed_error_std = {usual.speed_error_std:g}  # scale of the vehicle speed, a share\n"
        f"# effort_bias_std = {bias} 0.41 % of the axle load\n"
    )


def _roles(initial: InitialConfiguration) -> str:
    lines = ["[roles]"]
    guessed, cycles = initial.guessed, initial.cycles
    if silent := [name for name in initial.without_cycle if name not in cycles]:
        lines += [
            f"# The database has no cycle of {', '.join(map(_comment, silent))}.",
            '# Write it at their roles: { signal = "MESSAGE.SIGNAL", cycle_ms = 20 } for 20 ms.',
        ]
    for guess in sorted(
        guessed.taken, key=lambda taken: (list(Role).index(taken.role), taken.axle)
    ):
        why = "chosen" if guess.reasons == CHOSEN else f"guessed from {_why(guess)}; check"
        lines.append(f"{_entry(guess, cycles)}  # {why}")
        lines += [f"#   {note}" for note in _notes(guess)]
    for name, rivals in guessed.rivals.items():
        lines.append(f"# {name}: unclear; uncomment the right line, if any:")
        lines += [f"# {_entry(rival, cycles)}  # {_why(rival)}" for rival in rivals]
    for role in SHARED_ROLES:
        lines += _shared(initial, role)
    if initial.absent:
        lines.append("# Not found; map those that the bus carries:")
    for role in initial.absent:
        needed = "needed for adhesion" if role in REQUIRED else "optional"
        name = f"{role}.1" if role.per_axle else str(role)
        lines.append(f'# {quoted(name)} = "MESSAGE.SIGNAL"  # {needed}')
        if suggestions := initial.candidates(role):
            lines.append(f"#   candidates: {', '.join(map(candidate_text, suggestions))}")
    return "\n".join(lines) + "\n"


def _entry(guess: RoleGuess, cycles: Mapping[str, float]) -> str:
    """Line of a role, with its factor and cycle where the database does not have them."""
    parts = [f"signal = {quoted(guess.place)}"]
    if guess.share != 1:
        parts.append(f"factor = {guess.share:.12g}")
    if guess.message.name in cycles:
        parts.append(f"cycle_ms = {cycles[guess.message.name]:.12g}")
    value = quoted(guess.place) if len(parts) == 1 else f"{{ {', '.join(parts)} }}"
    return f"{quoted(guess.name)} = {value}"


def signals_text(guesses: Sequence[RoleGuess]) -> str:
    """Signals with unit and stated range: `Message.Signal (kN, -60 to 60)`; what is alike once."""
    texts = [f"({guess.signal.unit or 'no unit'}{_range_text(guess.signal)})" for guess in guesses]
    if len(set(texts)) == 1:
        return _comment(f"{', '.join(guess.place for guess in guesses)} {texts[0]}")
    rows = zip(guesses, texts, strict=True)
    return _comment(", ".join(f"{guess.place} {text}" for guess, text in rows))


def _range_text(signal: Signal) -> str:
    ends = stated_range(signal)
    return "" if ends is None else f", {ends[0]:g} to {ends[1]:g}"


def candidate_text(candidate: RoleCandidate) -> str:
    """A candidate with its unit, and the roles for which it is taken."""
    uses = f", also {', '.join(candidate.uses)}" if candidate.uses else ""
    return _comment(f"{candidate.place} ({candidate.signal.unit or 'no unit'}{uses})")


def shared_sentence(shared: Sequence[RoleGuess], axles: int | None) -> str:
    """Why efforts or loads are not taken as those of axles 1, 2, .."""
    quantity = "load" if shared[0].role is Role.AXLE_LOAD else "effort"
    what = next((f"{guess.group} {quantity}" for guess in shared if guess.group), quantity)
    count = counted(len(shared), what)
    of = "an unknown number of axles" if axles is None else counted(axles, "axle")
    return f"{count} for {of}"


def _shared(initial: InitialConfiguration, role: Role) -> list[str]:
    """Efforts or loads of motors or bogies, commented out."""
    shared = initial.guessed.shared_of(role)
    if not shared:
        return []
    lines = [
        f"# {role}: {shared_sentence(shared, initial.likely_axles)}. The factor is the axle's",
        "# share: 0.5 where a motor or bogie has two axles.",
    ]
    proposed = distribute(shared, initial.likely_axles)
    if proposed:
        each = counted(round(1 / proposed[0].share), "axle")
        lines.append(f"# If each has {each}, in this order, uncomment:")
    else:
        lines.append("# Uncomment with the axle's number, and state its factor:")
    lines += [f"# {_entry(guess, initial.cycles)}  # {_why(guess)}" for guess in proposed or shared]
    if role is Role.TRACTIVE_EFFORT and proposed:
        lines += _one_of_each(initial, proposed)
    return lines


def _one_of_each(initial: InitialConfiguration, proposed: Sequence[RoleGuess]) -> list[str]:
    """Roles with the first axle of each motor, commented out: none where all have an effort."""
    kept = first_axle_of_each((*initial.guessed.taken, *proposed))
    kept_roles = [guess for guesses in kept.values() for guess in guesses]
    if not any(guess.role is Role.WHEEL_SPEED for guess in kept_roles):
        return []
    kept_roles.sort(key=lambda guess: (list(Role).index(guess.role), guess.axle))
    return [
        "# 'simulate' moves every axle separately. For it, copy this file, write the number of",
        f"# axles, {len(kept)}, and keep only these roles of axles {' and '.join(map(str, kept))}:",
        *(f"#   {_entry(guess, initial.cycles)}" for guess in kept_roles),
    ]


def _unused(initial: InitialConfiguration) -> str:
    """Signals without a role, a line for each message."""
    by_message: dict[str, list[str]] = {}
    for message, signal in unused_signals(initial.database.db.messages, initial.guessed):
        unit = f" ({signal.unit})" if signal.unit else ""
        by_message.setdefault(message.name, []).append(f"{signal.name}{unit}")
    if not by_message:
        return "# Every signal of the database has a role.\n"
    rows = (f"{name}: {', '.join(names)}" for name, names in by_message.items())
    lines = [f"#   {_comment(row)}" for row in rows]
    return "\n".join(["# Signals that are not used, by message:", *lines]) + "\n"


def _why(guess: RoleGuess) -> str:
    unit = f" {guess.signal.unit}" if guess.signal.unit and "unit" in guess.reasons else ""
    doubts = "".join(f"; {doubt}" for doubt in guess.doubts)
    return f"{' and '.join(guess.reasons)}{_comment(unit)}{doubts}"


def _is_one_sided(guess: RoleGuess) -> bool:
    return guess.role is Role.TRACTIVE_EFFORT and signs_of(guess.signal) is Signs.POSITIVE


def _notes(guess: RoleGuess) -> list[str]:
    """What to check about a guessed signal."""
    message, notes = guess.message, []
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
    if _is_one_sided(guess):
        notes.append(_ONE_SIDED)
    return notes


def _comment(text: str) -> str:
    """Text without line breaks and control characters, which no comment may have."""
    return "".join(c for c in text if c.isprintable())
