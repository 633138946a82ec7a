"""Efforts and loads of motors or bogies with several axles, and their distribution over these."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from adhesion_can.bus.role_guess import RoleGuess
from adhesion_can.physics.readings import Role

SHARED_ROLES = (Role.TRACTIVE_EFFORT, Role.AXLE_LOAD)
"""Roles of which several axles may share a signal."""


def find_shared(taken: Iterable[RoleGuess], rivals: Iterable[str]) -> tuple[RoleGuess, ...]:
    """Guessed efforts and loads that need not be those of axles 1, 2, ..

    They are fewer than the axles with a wheel speed and their numbers do not follow a word for an
    axle; or they are of motors or bogies, and no wheel speed says how many axles there are. A load
    that names a bogie is always that of several axles, and so is an effort without a number.

    Args:
        taken: Clear guesses.
        rivals: Names of the roles that are not clear.

    Returns:
        These signals by role and number; none where each axle has a signal of its own.

    """
    guesses = list(taken)
    axles = {guess.axle for guess in guesses if guess.role is Role.WHEEL_SPEED}
    axles |= {int(name.partition(".")[2]) for name in rivals if name.startswith("wheel_speed.")}
    return tuple(shared for role in SHARED_ROLES for shared in _of_role(role, guesses, axles))


def _of_role(role: Role, guesses: Sequence[RoleGuess], axles: set[int]) -> list[RoleGuess]:
    role_guesses = [guess for guess in guesses if guess.role is role]
    open_ = sorted(
        (guess for guess in role_guesses if not guess.of_axle), key=lambda guess: guess.axle
    )
    of_bogies = role is Role.AXLE_LOAD and any(guess.group for guess in open_)
    fewer = {guess.axle for guess in role_guesses} < axles
    unknown = not axles and any(guess.group for guess in open_)
    unnumbered = any(not guess.numbered for guess in open_)
    return open_ if of_bogies or fewer or unknown or unnumbered else []


def distribute(shared: Sequence[RoleGuess], axles: int | None) -> tuple[RoleGuess, ...]:
    """Efforts or loads of the axles, where each motor or bogie has as many of them in a row.

    Args:
        shared: Efforts or loads of the motors or bogies.
        axles: Number of axles; None: not known.

    Returns:
        A guess for each axle with its share; none where the axles cannot be divided evenly.

    """
    count = len(shared)
    if not count or axles is None or axles < count or axles % count:
        return ()
    if [guess.axle for guess in shared] != list(range(1, count + 1)):
        return ()
    each = axles // count
    return tuple(
        replace(shared[(axle - 1) // each], axle=axle, share=1 / each, doubts=())
        for axle in range(1, axles + 1)
    )


def first_axle_of_each(taken: Iterable[RoleGuess]) -> dict[int, tuple[RoleGuess, ...]]:
    """Roles of the first axle of each effort, where several axles share one.

    Args:
        taken: Roles of all axles.

    Returns:
        Roles of each axle that is kept, by its number among all axles: its efforts, speeds and
        loads, numbered from 1 again; empty where every axle has an effort of its own.

    """
    guesses = sorted(taken, key=lambda guess: guess.axle)
    efforts = [guess for guess in guesses if guess.role is Role.TRACTIVE_EFFORT]
    first: dict[str, int] = {}
    for guess in efforts:
        first.setdefault(guess.place, guess.axle)
    if len(first) == len(efforts):
        return {}
    return {
        axle: tuple(
            replace(guess, axle=number)
            for guess in guesses
            if guess.role.per_axle and guess.axle == axle
        )
        for number, axle in enumerate(sorted(first.values()), start=1)
    }
