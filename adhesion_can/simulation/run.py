"""A simulated run: plant, drive, track and sensors stepped together, frames out."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import nan
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.bus.checked_message import CheckedMessage, SignalValues
from adhesion_can.bus.codec import MessagePlan, SignalPlan
from adhesion_can.bus.database import (
    DEMAND_MESSAGES,
    OUTPUT_MESSAGES,
    SAND_DEMAND,
    CanDatabase,
    database_with,
)
from adhesion_can.bus.frame import Frame, to_us
from adhesion_can.bus.rejection import Rejection
from adhesion_can.bus.roles import BoundMessage
from adhesion_can.errors import InputError
from adhesion_can.physics.burckhardt import Surface, peak
from adhesion_can.physics.curves import Conditions
from adhesion_can.physics.curves.same_peak import burckhardt_with_same_peak
from adhesion_can.physics.curves.surfaces import FamilySurface
from adhesion_can.physics.effects import ActiveEffect, build_instruments
from adhesion_can.physics.status import Status
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.drive import Drive, DriveSettings
from adhesion_can.simulation.plant import SLOWEST, Plant, Rails, Track
from adhesion_can.simulation.role_sensors import RoleSensors, packaged_messages
from adhesion_can.simulation.scenarios import Scenario
from adhesion_can.simulation.sensors import SLOT_US, PlantState, SensorNoiseSettings

STEP_US = 2000


@dataclass(frozen=True)
class RunSettings:
    """Settings of a run.

    Attributes:
        scenario: Surfaces, speed and surroundings.
        duration_s: Simulated time, s.
        seed: Seed of the sensors' noise.
        vehicle: Configured vehicle; effects may make the true one differ.
        effects: Mechanisms beyond the curve, and errors of sensors and data.
        noise: Standard deviations of the sensors' noise.
        drive: Gains and limits of the creep controller.
        obey: Whether the drive follows `AdhesionSetpoint`, or `EffortDemand` where that comes.
        load_transfer: Whether axle loads change under effort; in some scenarios they always do.
        along_track: Whether each axle finds a change of surface where the leading one found it, or
            all at the same time.
        start_speed: Speed at the start, m/s; None: that of the scenario.
        notes: Sentences on what was changed in the scenario for the vehicle.

    """

    scenario: Scenario
    duration_s: float
    seed: int = 1
    vehicle: Locomotive = field(default_factory=Locomotive)
    effects: tuple[ActiveEffect, ...] = ()
    noise: SensorNoiseSettings = field(default_factory=SensorNoiseSettings)
    drive: DriveSettings = field(default_factory=DriveSettings)
    obey: bool = False
    load_transfer: bool = False
    along_track: bool = False
    start_speed: float | None = None
    notes: tuple[str, ...] = ()


def _raw(signal: SignalPlan, payload: bytes) -> int:
    """Raw value of a signal in a payload, in the byte order of its database."""
    return signal.raw(int.from_bytes(payload, "big" if signal.big_endian else "little"))


class Simulation:
    """A run that makes its frames step by step and receives the service's answers.

    Args:
        settings: Settings of the run.
        database: Database; what it lacks of the message set of adhesion-can is the packaged one's.
        messages: Input messages with the roles of their signals; None: the packaged ones, looked
            up in the database by name.
        rails: Curves under the axles in place of the scenario's surfaces, and of their family.
        slot_us: Time from one message's first frame to that of the next, µs; 0: they are in phase.

    """

    def __init__(
        self,
        settings: RunSettings,
        database: CanDatabase,
        rails: Rails | None = None,
        messages: Sequence[BoundMessage] | None = None,
        slot_us: int = SLOT_US,
    ) -> None:
        self.settings = settings
        scenario, instruments = settings.scenario, build_instruments(settings.effects)
        vehicle = instruments.vehicle(settings.vehicle)
        if not vehicle.wheelset_inertia > 0:
            raise InputError(
                "vehicle",
                f"the wheelset's inertia would be {vehicle.wheelset_inertia:g} kg m^2",
                "it must be above 0",
            )
        self.plant = Plant(
            vehicle,
            scenario.speed if settings.start_speed is None else settings.start_speed,
            settings.effects,
            load_transfer=settings.load_transfer or scenario.load_transfer,
            load_shifts=instruments.load_shifts,
            gradient=scenario.profile,
            surroundings=scenario.surroundings,
            family=scenario.family,
        )
        self.sections = scenario.sections(settings.duration_s)
        behind = axles_behind(vehicle, along=settings.along_track)
        self._track: Rails = rails or Track(self.sections, behind)
        self._drive = Drive(vehicle.axles, settings.drive, scenario.pattern, settings.obey)
        rng = np.random.default_rng(settings.seed)
        sent = packaged_messages(database) if messages is None else messages
        self._sensors = RoleSensors(
            sent, settings.noise, rng, instruments, settings.vehicle, slot_us
        )
        answers = database_with(OUTPUT_MESSAGES, database)
        demands = database_with(DEMAND_MESSAGES, database)
        self._setpoint = MessagePlan(answers.message("AdhesionSetpoint"))
        self._demands = [CheckedMessage(demands.message(name)) for name in DEMAND_MESSAGES]
        self.is_answered = False
        """Whether a setpoint or a demand for the drive has come."""
        self._latest: PlantState | None = None
        """State at the end of the last step, which is that at the start of the next one."""
        self.now_us = 0

    def run(self) -> Iterator[list[Frame]]:
        """Steps of 2 ms until the duration is over: the frames that fall due in each."""
        end_us = to_us(self.settings.duration_s)
        while self.now_us < end_us:
            yield self.step()

    def step(self) -> list[Frame]:
        """One step; returns the frames due in it."""
        before, dt = self._latest or self._state(), STEP_US / 1e6
        plant, time_s = self.plant, self.now_us / 1e6
        creep = plant.radius * plant.wheel_speed - plant.speed
        effort = self._drive.step(time_s, plant.speed, creep, dt)
        plant.step(effort, self._track.under(time_s, plant.position), dt)
        start_us, self.now_us = self.now_us, self.now_us + STEP_US
        if not np.isfinite(plant.wheel_speed).all():
            effects = ", ".join(active.effect.id for active in self.settings.effects)
            raise InputError(
                f"effects ({effects})",
                f"the simulation has no finite value at {time_s:.3f} s",
                "correct the formula or the size, or remove the effect",
            )
        plant.time_s = self.now_us / 1e6  # steps added up would drift off the bus's clock
        self._latest = self._state()
        return self._sensors.due(self._latest, before, start_us, self.now_us)

    def first_frames(self) -> list[Frame]:
        """Frames that are due at the start, before the first step."""
        state = self._state()
        return self._sensors.due(state, state, 0, 0)

    def await_demands(self) -> None:
        """Give no effort until a controller demands some: the drive does not probe by itself."""
        self.demand_efforts({})

    def receive(self, frame: Frame) -> None:
        """Process a frame from the bus: setpoints and demands are for the drive, others ignored."""
        for message in self._demands:
            if message.is_carried_by(frame):
                self._follow(message.read(frame))
                return
        plan = self._setpoint
        same = frame.arbitration_id == plan.frame_id and frame.is_extended == plan.is_extended
        if not same or not frame.is_data:
            return
        self.is_answered = True
        payload = frame.data[: plan.size]
        creep, status = plan.signals["CreepSpeedSetpoint"], plan.signals["Status"]
        raw = _raw(creep, payload)
        self.take_setpoint(
            known=_raw(status, payload) == Status.TRACKING,
            creep_speed=None if raw == creep.not_available else creep.value(raw),
        )

    def take_setpoint(self, *, known: bool, creep_speed: float | None) -> None:
        """Give the drive a setpoint of the service; a drive that does not obey goes on probing.

        Args:
            known: Whether the service is in TRACKING.
            creep_speed: Creep speed setpoint, m/s; None: not available.

        """
        self._drive.update_command(self.now_us / 1e6, known=known, creep_speed=creep_speed)

    def demand_efforts(self, efforts: Mapping[int, float]) -> None:
        """Give the motors efforts in place of the drive's own control, from now on.

        Args:
            efforts: Efforts at the rim by axle number, N; NaN: none is demanded.

        """
        self._drive.demand_efforts(self.now_us / 1e6, efforts)

    def _follow(self, demand: SignalValues | Rejection) -> None:
        """Give a message's efforts to the drive; rejected frames are as if they had not come."""
        if isinstance(demand, Rejection) or not self.settings.obey:
            return
        self.is_answered = True
        efforts = {
            axle: nan if (value := demand[name]) is None else value
            for axle in range(1, self.settings.vehicle.axles + 1)
            if (name := f"EffortDemand_Ax{axle}") in demand
        }
        self.demand_efforts(efforts)
        if SAND_DEMAND in demand:
            # Without a demand it is as the surroundings have it.
            self.plant.sanding = True if demand[SAND_DEMAND] else None

    def find_peaks(self) -> tuple[Array, Array]:
        """Largest adhesion under each axle now and its slip ratio, shape (axles,) each.

        They are those of the curves, without effects in the contact.
        """
        plant = self.plant
        values = self._track.under(plant.time_s, plant.position)
        family = self.settings.scenario.family
        if family is None:
            c1, c2, c3 = values
            top = peak(c1, c2, c3)
            return np.asarray(top.mu_max), np.asarray(top.lambda_m)
        speed = max(plant.speed, SLOWEST)
        tops = [
            family.peak([float(x[axle]) for x in values], Conditions(speed, float(load)))
            for axle, load in enumerate(plant.load)
        ]
        places = [float(top.lambda_m) for top in tops]
        return np.array([float(top.mu_max) for top in tops]), np.array(places)

    @property
    def effort(self) -> Array:
        """Effort at the rim of each axle now, N, shape (axles,)."""
        return self._drive.effort

    def describe_drive(self) -> str:
        """Sentence about what the drive does, and why."""
        drive, time_s = self._drive, self.now_us / 1e6
        low, high = drive.settings.slip_low, drive.settings.slip_high
        probing = f"Probing: the drive sweeps the slip from {low:g} to {high:g}"
        if drive.holds(time_s):
            return "The drive holds the creep setpoint: the service knows the peak."
        if not drive.obey:
            return f"{probing} and ignores the service."
        if not drive.command.known:
            return f"{probing} to find the peak."
        rest_s = drive.settings.probe_s - (time_s - drive.command.since_s)
        return f"{probing} to find the peak. {max(rest_s, 0.0):.1f} s left."

    def notes(self) -> list[str]:
        """Sentences on what was changed for the vehicle, and on readings that were cut off."""
        return [*self.settings.notes, *self._sensors.saturation()]

    def adhesion_used(self) -> float:
        """Adhesion that the axles use now, Σ F / Σ N."""
        return float(self.plant.force.sum() / self.plant.load.sum())

    def _state(self) -> PlantState:
        plant = self.plant
        return PlantState(
            plant.wheel_speed,
            plant.speed,
            self._drive.effort,
            plant.load,
            plant.gradient,
            plant.conditions,
            plant.acceleration,
            plant.wheel_angle,
        )

    def truth(self) -> dict[str, Any]:
        """True surfaces, effects and noise of the run, as `--truth` writes them.

        The vehicle is the configured one, and the surfaces are without the effects; in what the
        real ones differ follows from the effects.
        """
        settings = self.settings
        ends = [section.from_s for section in self.sections[1:]] + [settings.duration_s]
        return {
            "scenario": settings.scenario.name,
            "seed": settings.seed,
            "vehicle": asdict(settings.vehicle),
            "surfaces": [
                {"from_s": section.from_s, "to_s": end, **self._surface_truth(section.surface)}
                for section, end in zip(self.sections, ends, strict=True)
            ],
            "effects": [
                {
                    "effect": active.effect.id,
                    "form": active.effect.form,
                    "parameters": {
                        p.name: value
                        for p, value in zip(active.effect.parameters, active.values, strict=True)
                    },
                }
                for active in settings.effects
            ],
            "noise": asdict(settings.noise),
            "surroundings": asdict(settings.scenario.surroundings),
            "notes": self.notes(),
        }

    def _surface_truth(self, surface: Surface | FamilySurface) -> dict[str, Any]:
        """Curve of a surface: for another family that at the scenario's speed and mean load.

        Its c1, c2, c3 are those of the nearest Burckhardt curve with the same peak.
        """
        if isinstance(surface, Surface):
            c1, c2, c3 = surface.theta
            peak = {"mu_max": surface.mu_max, "lambda_m": surface.lambda_m}
            return {"name": surface.name, "c1": c1, "c2": c2, "c3": c3, **peak}
        speed = self.settings.scenario.speed
        load = float(np.mean(self.settings.vehicle.axle_load))
        conditions = Conditions(speed, load)
        top = surface.family.peak(surface.values, conditions)
        c1, c2, c3 = burckhardt_with_same_peak(surface.family, surface.values, conditions)
        return {
            "name": surface.name,
            "c1": c1,
            "c2": c2,
            "c3": c3,
            "mu_max": float(top.mu_max),
            "lambda_m": float(top.lambda_m),
            "curve": surface.family.name,
            "parameters": surface.parameters,
            "at": {"speed_mps": speed, "load_N": load},
            "source": surface.source,
        }


def axles_behind(vehicle: Locomotive, *, along: bool) -> np.ndarray:
    """Distance of each axle behind the leading one, m; zeros where not asked for."""
    if not along or vehicle.geometry is None:
        return np.zeros(vehicle.axles)
    return vehicle.geometry.axle_places
