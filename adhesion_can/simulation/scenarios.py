"""Named runs: which rail comes when, how fast the train is and what the drive does."""

from dataclasses import dataclass

from adhesion_can.physics.burckhardt import RAIL, Surface
from adhesion_can.simulation.drive import Pattern
from adhesion_can.simulation.plant import Profile, Stretch

_BY_NAME = {surface.name: surface for surface in RAIL}


@dataclass(frozen=True, slots=True)
class Scenario:
    """A run.

    Attributes:
        name: as `--scenario` takes it.
        surfaces: names of `RAIL` surfaces, each for an even share of the duration.
        speed: at the start, m/s; the track's profile keeps the train near it.
        pattern: of a drive that is left alone.
        meaning: one line.

    """

    name: str
    surfaces: tuple[str, ...]
    speed: float = 10.0
    pattern: Pattern = Pattern.STAGGERED
    meaning: str = ""

    @property
    def profile(self) -> Profile:
        """Of the track: the climb that takes up full effort on dry rail comes 6 m/s faster."""
        return Profile(self.speed, rise=0.005)

    def stretches(self, duration_s: float) -> list[Stretch]:
        """Surfaces with the times at which they begin."""
        share = duration_s / len(self.surfaces)
        return [
            Stretch(round(i * share, 6), surface_by_name(name))
            for i, name in enumerate(self.surfaces)
        ]


def surface_by_name(name: str) -> Surface:
    """Rail surface of that name."""
    return _BY_NAME[name]


SCENARIOS: tuple[Scenario, ...] = (
    Scenario("dry", ("dry",), meaning="dry rail, axles swept in turn"),
    Scenario("wet", ("wet",), meaning="wet rail, axles swept in turn"),
    Scenario("greasy", ("greasy",), meaning="greasy rail, axles swept in turn"),
    Scenario("dry-wet-dry", ("dry", "wet", "dry"), meaning="rain in the middle"),
    Scenario(
        "dry-wet-greasy-dry",
        ("dry", "wet", "greasy", "dry"),
        meaning="rain, then leaves, then a clean rail",
    ),
    Scenario(
        "sweep",
        ("dry",),
        speed=15.0,
        pattern=Pattern.SWEEP,
        meaning="creep from 0 to beyond the peak in traction and braking, with coasting",
    ),
)


def scenario_by_name(name: str) -> Scenario:
    """Scenario of that name; KeyError with the names that exist."""
    for scenario in SCENARIOS:
        if scenario.name == name:
            return scenario
    raise KeyError(f"no scenario {name!r}; known: {', '.join(s.name for s in SCENARIOS)}")
