"""A dialogue with `init`: the numbers of a tram as options, and lines typed at a terminal."""

from io import StringIO

VEHICLE = [
    "--wheel-radius",
    "0.33",
    "--axle-load",
    "90e3",
    "--inertia",
    "60",
    "--train-mass",
    "4e4",
]


class Terminal(StringIO):
    """Typed lines."""

    def isatty(self):
        return True
