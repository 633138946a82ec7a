"""Efforts of motors or bogies that drive several axles, and their distribution over these axles."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from adhesion_can.bus.role_guess import RoleGuess
from adhesion_can.physics.readings import Role


def find_shared_efforts(taken: Iterable[RoleGuess], rivals: Iterable[str]) -> tuple[RoleGuess, ...]:
    """Guessed efforts of which nobody can say that they are those of axles 1, 2, ..

    They are fewer than the axles with a wheel speed and their numbers do not follow a word for an
    axle; or they are of motors or bogies, and no wheel speed says how many axles there are.

    Args:
        taken: Clear guesses.
        rivals: Names of the roles that are not clear.

    Returns:
        These efforts by their number; none where each axle has an effort of its own.

    """
    guesses = list(taken)
    efforts = sorted(
        (guess for guess in guesses if guess.role is Role.TRACTIVE_EFFORT and not guess.of_axle),
        key=lambda guess: guess.axle,
    )
    axles = {guess.axle for guess in guesses if guess.role is Role.WHEEL_SPEED}
    axles |= {int(name.partition(".")[2]) for name in rivals if name.startswith("wheel_speed.")}
    with_effort = {guess.axle for guess in guesses if guess.role is Role.TRACTIVE_EFFORT}
    fewer = with_effort < axles
    unknown = not axles and any(guess.group for guess in efforts)
    return tuple(efforts) if fewer or unknown else ()


def distribute(shared: Sequence[RoleGuess], axles: int | None) -> tuple[RoleGuess, ...]:
    """Efforts of the axles, where each motor or bogie drives the same number of them in a row.

    Args:
        shared: Efforts of the motors or bogies.
        axles: Number of axles; None: not known.

    Returns:
        A guess for each axle with its share; none where the axles cannot be divided evenly.

    """
    count = len(shared)
    if not count or axles is None or axles <= count or axles % count:
        return ()
    if [guess.axle for guess in shared] != list(range(1, count + 1)):
        return ()
    each = axles // count
    return tuple(
        replace(shared[(axle - 1) // each], axle=axle, share=1 / each)
        for axle in range(1, axles + 1)
    )
