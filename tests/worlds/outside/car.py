"""The multi-body car of others."""

CARS: tuple[str, ...] = ()
SAME_IN_CAR: dict[str, str] = {}
