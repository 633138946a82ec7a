"""Named runs: the surfaces, the speed, the surroundings and the pattern of the drive."""

from dataclasses import dataclass, field, replace

from adhesion_can.physics.burckhardt import RAIL, Surface
from adhesion_can.physics.curves import CurveFamily
from adhesion_can.physics.curves.surfaces import POLACH_RAIL, FamilySurface
from adhesion_can.simulation.drive import Pattern
from adhesion_can.simulation.plant import GradientProfile, TrackSection
from adhesion_can.simulation.surroundings import Surroundings, TrackCurve, Wave

_BY_NAME: dict[str, Surface | FamilySurface] = {
    **{surface.name: surface for surface in RAIL},
    **{surface.name: surface for surface in POLACH_RAIL},
}

SPEED_PERIOD_S = 170.0
"""Period of the swing of the speed, s; the other periods of `sweep` share no multiple with it."""

STEEPEST = 0.035
"""Gradient of the steepest track, m/m."""
RISE, SWINGING_RISE = 0.005, 0.02
"""Gradient per m/s above the speed of the level track, m/m, where that is constant or swings."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """A run.

    Attributes:
        name: Name for `--scenario`.
        surfaces: Names of `RAIL` surfaces or of `POLACH_RAIL` ones, each for an even share of the
            duration.
        speed: Speed at the start, m/s; the track's profile keeps the train near it.
        pattern: Pattern of the sweeps of a drive that is left alone.
        meaning: Description in one line.
        speed_swing: Relative amplitude with which the profile lets the speed swing.
        load_transfer: Whether axle loads always change under effort.
        gradient: Constant gradient of the track, m/m; None: a profile keeps the train near `speed`.
        surroundings: Air, rail, sand and curves along the run.
        pace: Factor by which the speeds of the run were multiplied, in `speed` already.
        help: Force of a second vehicle that keeps the speed where the track alone cannot, over what
            a track of `STEEPEST` gives; 0: there is none.

    """

    name: str
    surfaces: tuple[str, ...]
    speed: float = 10.0
    pattern: Pattern = Pattern.STAGGERED
    meaning: str = ""
    speed_swing: float = 0.0
    load_transfer: bool = False
    gradient: float | None = None
    surroundings: Surroundings = field(default_factory=Surroundings)
    pace: float = 1.0
    help: float = 0.0

    @property
    def family(self) -> CurveFamily | None:
        """Curve family of the surfaces; None for Burckhardt's curve."""
        first = surface_by_name(self.surfaces[0])
        return first.family if isinstance(first, FamilySurface) else None

    @property
    def profile(self) -> GradientProfile | float:
        """Gradient profile of the track: the climb for full effort on dry rail comes at 6 m/s more.

        Where the speed is to change, the track is as steep as it must be for the train to follow.
        """
        if self.gradient is not None:
            return self.gradient
        return GradientProfile(
            self.speed,
            rise=self._rise / self.pace,
            steepest=STEEPEST,
            amplitude=self.speed_swing,
            period_s=SPEED_PERIOD_S,
            help_rise=self.help * RISE / self.pace,
            help_most=self.help * STEEPEST,
        )

    @property
    def top_speed(self) -> float:
        """Speed at which track and second vehicle brake with all their force, m/s."""
        return self.speed * (1.0 + self.speed_swing) + self.pace * STEEPEST / self._rise

    @property
    def _rise(self) -> float:
        # A light train follows a softer hold; a stiff one would turn its acceleration over at once.
        return SWINGING_RISE if self.speed_swing and not self.help else RISE

    def at_pace(self, factor: float) -> "Scenario":
        """The run with all its speeds multiplied by a factor above 0."""
        return replace(self, speed=factor * self.speed, pace=factor * self.pace)

    def sections(self, duration_s: float) -> list[TrackSection]:
        """Surfaces with the times at which they start."""
        share = duration_s / len(self.surfaces)
        return [
            TrackSection(round(i * share, 6), surface_by_name(name))
            for i, name in enumerate(self.surfaces)
        ]


def surface_by_name(name: str) -> Surface | FamilySurface:
    """Rail surface of that name."""
    return _BY_NAME[name]


_SWEEP = Scenario(
    "sweep",
    ("dry",),
    speed=13.5,
    pattern=Pattern.SWEEP,
    meaning="creep from 0 to beyond the peak in traction and braking, with coasting; "
    "speed, curves, air, rain and sand vary",
    speed_swing=0.6,
    load_transfer=True,
    surroundings=Surroundings(
        humidity=Wave(60.0, 20.0, 97.0),
        rail_temperature=Wave(20.0, 9.0, 131.0),
        sanding_period_s=47.0,
        sanding_s=15.0,
        rain_period_s=71.0,
        shower_s=40.0,
        curves=(
            TrackCurve(260.0, 300.0, 220.0),
            TrackCurve(200.0, -600.0, 160.0),
            TrackCurve(240.0, 420.0, 280.0),
            TrackCurve(180.0, -1200.0, 130.0),
        ),
    ),
)

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
        "polach-dry", ("polach-dry",), meaning="dry rail in Polach's form, axles swept in turn"
    ),
    Scenario(
        "polach-wet", ("polach-wet",), meaning="wet rail in Polach's form, axles swept in turn"
    ),
    Scenario(
        "polach-low",
        ("polach-low",),
        meaning="rail of low adhesion in Polach's form, axles swept in turn",
    ),
    replace(
        _SWEEP,
        name="polach-sweep",
        surfaces=("polach-dry",),
        meaning="as 'sweep', on dry rail in Polach's form",
    ),
    _SWEEP,
)


def scenario_by_name(name: str) -> Scenario:
    """Scenario of that name; KeyError with the names that exist."""
    for scenario in SCENARIOS:
        if scenario.name == name:
            return scenario
    raise KeyError(f"no scenario {name!r}; known: {', '.join(s.name for s in SCENARIOS)}")
