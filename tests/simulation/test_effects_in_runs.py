"""Every effect through the simulator: its formula, written out here, is found in truth and frames.

The contact's effects show in the force between wheel and rail, those of the instruments in the
frames, beside a run without them: the drive uses the true state, so both runs are the same drive.
"""

import math
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from adhesion_can.bus.block import Block
from adhesion_can.bus.codec import MessagePlan
from adhesion_can.bus.database import INPUT_MESSAGES, load_database
from adhesion_can.config import load_configuration
from adhesion_can.errors import InputError
from adhesion_can.offline.extract_samples import extract_samples
from adhesion_can.physics.effects import EFFECTS, ActiveEffect, acts_in_contact, effect_by_id
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.plant import Plant
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name
from adhesion_can.simulation.sensors import SensorNoiseSettings
from adhesion_can.simulation.surroundings import Surroundings, TrackCurve, Wave

DATABASE = load_database()
SILENT = SensorNoiseSettings(0.0, 0.0, 0.0, 0.0)
DRY = (0.40, 60.0, 0.30)
DT = 0.002
# All that changes in minutes changes in seconds here.
QUICK = Surroundings(
    humidity=Wave(60.0, 30.0, 1.9),
    rail_temperature=Wave(20.0, 15.0, 1.3),
    sanding_period_s=0.7,
    sanding_s=0.3,
    rain_period_s=0.9,
    shower_s=0.6,
    curves=(TrackCurve(90.0, 300.0, 5.0),),
)
SWEEP = replace(scenario_by_name("sweep"), surroundings=QUICK)


def mu0(slip):
    size = np.abs(slip)
    return np.copysign(DRY[0] * (1 - np.exp(-DRY[1] * size)) - DRY[2] * size, slip)


def active(name, *values, form=""):
    return ActiveEffect(effect_by_id(name, form), values)


def simulation_of(*effects, scenario=SWEEP, duration=3.0, **changes):
    settings = RunSettings(scenario, duration, effects=effects, **changes)
    return Simulation(settings, DATABASE)


class Record:
    """The plant at each step: what its force answered to, and what came of it."""

    def __init__(self, simulation, seconds=3.0, from_s=0.0):
        simulation._sensors.due = lambda *_: []
        simulation.now_us, simulation.plant.time_s = round(from_s * 1e6), from_s
        plant, rows = simulation.plant, []
        for _ in range(round(seconds / DT)):
            conditions = plant.conditions
            time = plant.time_s
            before = plant.slip
            speed = plant.speed
            simulation.step()
            rows.append(
                (time, before, plant.slip, speed, plant.load, plant.force,
                 simulation._drive.effort, plant.wheel_speed, conditions)
            )  # fmt: skip
        columns = list(zip(*rows, strict=True))
        self.time, self.before, self.slip, self.speed = map(np.array, columns[:4])
        self.load, self.force, self.effort, self.wheel_speed = map(np.array, columns[4:8])
        self.conditions = columns[8]
        self.mu = self.force / self.load
        self.v = self.speed[:, None]

    def channel(self, name):
        return np.array([getattr(c, name) for c in self.conditions])[:, None]


def agrees(record, wanted, tolerance=0.003, skip=50):
    assert np.abs(record.slip).max() > 0.1
    assert record.mu[skip:] == pytest.approx(wanted[skip:], abs=tolerance)


def curtius(v):
    return 7.5 / (3.6 * v + 44) + 0.161


FACTORS = [
    (active("speed_dependence", 0.8), lambda r: 1 + 0.8 * (curtius(r.v) / curtius(0.0) - 1)),
    (active("load_dependence", 4e-12), lambda r: 1 - 4e-12 * r.load**2),
    (active("load_dependence", 0.5, form="power"), lambda r: np.sqrt(1e5 / r.load)),
    (active("falling_friction", 0.2), lambda r: np.exp(-0.2 * np.abs(r.slip * r.v))),
    (
        active("falling_friction", 0.5, 0.3, form="polach"),
        lambda r: 0.7 * np.exp(-0.5 * np.abs(r.slip * r.v)) + 0.3,
    ),
    (active("rail_cleaning", 0.03), lambda _: np.array([1, 1.03, 1.06, 1.09, 1.12, 1.15])),
    (active("humidity", -0.004), lambda r: 1 - 0.004 * (r.channel("humidity") - 60)),
    (
        active("rail_temperature", 0.006),
        lambda r: 1 + 0.006 * (r.channel("rail_temperature") - 20),
    ),
    (active("sanding", 0.15), lambda r: 1 + 0.15 * r.channel("sanding")),
    (active("rain", -0.1), lambda r: 1 - 0.1 * r.channel("rain")),
    (
        active("rain", -0.1, 1.5, form="steps"),
        lambda r: np.choose(r.channel("rain").astype(int), (1.0, 0.9, 0.85)),
    ),
    (active("slow_drift", -0.05), lambda r: 1 - 0.05 * r.time[:, None]),
]


@pytest.mark.parametrize(
    ("effect", "factor"), FACTORS, ids=[f"{a.effect.id}:{a.effect.form}" for a, _ in FACTORS]
)
def test_a_factor_of_adhesion_is_in_the_force(effect, factor):
    record = Record(simulation_of(effect))
    wanted = factor(record)
    agrees(record, wanted * mu0(record.slip))
    assert np.abs(wanted - 1).max() > 0.05


@pytest.mark.parametrize("from_s", [0.0, 10.0], ids=["traction", "braking"])
def test_asymmetry_is_in_the_force_of_braking(from_s):
    record = Record(simulation_of(active("traction_braking_asymmetry", -0.2)), from_s=from_s)
    assert (record.slip[100:] < 0).all() == (from_s > 0)
    agrees(record, mu0(record.slip) * (0.8 if from_s else 1.0))


def test_lateral_creep_in_curves_is_in_the_force():
    record = Record(simulation_of(active("curve_creep", 8.0)))
    lateral = 8.0 * record.channel("curvature")
    assert lateral.max() > 0.02
    whole = np.hypot(record.slip, lateral)
    agrees(record, mu0(whole) * record.slip / whole)


def test_a_relaxation_length_is_in_the_force():
    # λ' integrated here: (σ/v) dλ'/dt + λ' = λ, by the mean slip of each step.
    length = 0.6
    record = Record(simulation_of(active("creep_relaxation", length)))
    lagging, wanted = np.zeros(6), []
    for before, after, v in zip(record.before, record.slip, record.speed, strict=True):
        lagging = lagging + (1 - math.exp(-v * DT / length)) * ((before + after) / 2 - lagging)
        wanted.append(mu0(lagging))
    agrees(record, np.array(wanted), tolerance=0.004)
    # And it is seen: the force is not what the slip alone gives.
    assert np.abs(record.mu - mu0(record.slip))[50:].max() > 0.02


@pytest.mark.parametrize(("speed", "length"), [(4.0, 0.3), (10.0, 0.3), (10.0, 1.5), (25.0, 0.05)])
def test_a_relaxing_contact_swings_as_an_exact_integration_says(speed, length):
    # An effort that rises within 0.1 s stirs it up: J dω/dt = r (T − μ(λ') N) and λ' behind λ.
    r, inertia, load, last = 0.625, 200.0, 245e3, 0.6

    def effort(t):
        return 3e4 * min(t / 0.1, 1.0)

    def right_hand_side(t, state):
        omega, lagging = state
        slip = (r * omega - speed) / speed
        accel = r * (effort(t) - float(mu0(lagging)) * load) / inertia
        return [accel, speed / length * (slip - lagging)]

    times = np.arange(0, last, DT)
    out = solve_ivp(
        right_hand_side, (0, last), [speed / r, 0.0], t_eval=times, rtol=1e-9, atol=1e-11,
        max_step=1e-3,
    )  # fmt: skip
    vehicle = replace(Locomotive(), train_mass=1e12)
    plant = Plant(vehicle, speed, [active("creep_relaxation", length)])
    slips = []
    for t in times:
        slips.append(plant.slip[0])
        plant.step(np.full(6, effort(t + DT / 2)), tuple(np.full(6, c) for c in DRY), DT)
    wanted = r * out.y[0] / speed - 1
    # The step damps what swings within few steps, so it is compared to the size of the swing.
    assert np.abs(np.array(slips) - wanted).max() < 0.2 * np.abs(wanted).max()
    assert slips[-1] == pytest.approx(wanted[-1], abs=0.1 * np.abs(wanted).max())


def test_slip_work_is_in_the_force():
    gain, time = 4e-7, 2.0
    record = Record(simulation_of(active("adhesion_recovery", gain, time)))
    work, wanted = np.zeros(6), []
    for slip, v, force in zip(record.slip, record.speed, record.force, strict=True):
        wanted.append((1 + gain * work) * mu0(slip))
        work = work + DT * (np.abs(force * slip * v) - work / time)
    agrees(record, np.array(wanted))
    assert gain * work.max() > 0.05


def test_heat_of_slip_work_is_in_the_force():
    loss, time = 1e-6, 1.5
    record = Record(simulation_of(active("contact_heating", loss, time)))
    heat, wanted = np.zeros(6), []
    for slip, v, force in zip(record.slip, record.speed, record.force, strict=True):
        wanted.append(mu0(slip) / (1 + loss * heat))
        heat = heat + DT * (np.abs(force * slip * v) - heat / time)
    agrees(record, np.array(wanted))
    assert loss * heat.max() > 0.05


def test_sand_at_axles_1_and_4_is_in_the_force_and_fades():
    gain, time = 0.3, 0.5
    record = Record(simulation_of(active("sanding", gain, time, 4.0, form="axles")))
    sand, wanted = 0.0, []
    for strewn in record.channel("sanding")[:, 0]:
        rate = 20.0 if strewn else 1.0 / time
        sand += (strewn - sand) * (1.0 - math.exp(-rate * DT))
        wanted.append(sand)
    wanted = np.array(wanted)[:, None] * np.array([1, 0, 0, 1, 0, 0])
    agrees(record, (1 + gain * wanted) * mu0(record.slip), tolerance=0.006)
    assert wanted[:, 0][record.channel("sanding")[:, 0] == 0].max() > 0.3


def test_effects_together_multiply_in_the_force():
    record = Record(simulation_of(active("sanding", 0.15), active("rail_cleaning", 0.03)))
    factor = (1 + 0.15 * record.channel("sanding")) * np.array([1, 1.03, 1.06, 1.09, 1.12, 1.15])
    agrees(record, factor * mu0(record.slip))


# --------------------------------------------------------------------------------- stability


@pytest.mark.costly
@pytest.mark.parametrize("speed", [1.5, 12.0])
@pytest.mark.parametrize(
    "effect",
    [
        *(active("creep_relaxation", length) for length in (1e-4, 0.003, 0.01, 0.03, 0.1, 0.4)),
        active("curve_creep", 30.0),
        active("load_dependence", -3.0, form="power"),
        active("sanding", 2.0),
        active("falling_friction", 2.0),
    ],
    ids=lambda a: f"{a.effect.id} {a.values[0]:g}" if isinstance(a, ActiveEffect) else str(a),
)
def test_a_steady_effort_below_the_peak_comes_to_rest(effect, speed):
    # No drive to hold it: whatever the step itself stirs up would be seen. A train so heavy keeps
    # its speed; the contact's own swinging dies away within some relaxation lengths.
    bend = Surroundings(sanding_s=60.0, curves=(TrackCurve(1e6, 300.0, 1.0),))
    vehicle = replace(Locomotive(), train_mass=1e12)
    plant = Plant(vehicle, speed, [effect], surroundings=bend)
    plant.position = 5e3
    theta = tuple(np.full(6, c) for c in DRY)
    slips = []
    for _ in range(2000):
        plant.step(np.full(6, 0.05 * 245e3), theta, DT)
        slips.append(plant.slip)
    settled = np.array(slips[-100:])
    assert np.isfinite(settled).all()
    assert np.ptp(settled, axis=0).max() < 1e-3 * max(1.0, np.abs(settled).max())


# ------------------------------------------------------------------------------------- frames


DURATION = 4.0
PLANS = {p.frame_id: p for p in (MessagePlan(DATABASE.message(n)) for n in INPUT_MESSAGES)}


def signals(*effects, duration=DURATION, **changes):
    """Values by signal over their stamps (µs), without noise, and the frames."""
    simulation = simulation_of(*effects, duration=duration, noise=SILENT, **changes)
    frames = [frame for step in simulation.run() for frame in step]
    values = defaultdict(dict)
    for frame in frames:
        word = int.from_bytes(frame.data, "little")
        for name, signal in PLANS[frame.arbitration_id].signals.items():
            values[name][frame.t_us] = signal.value(signal.raw(word))
    return values, frames


@pytest.fixture(scope="module")
def plain():
    return signals()


def column(values, name):
    return np.array(list(values[name].values()))


def others_are_equal(frames, plain_frames, changed_ids):
    pairs = list(zip(frames, plain_frames, strict=True))
    assert all(a == b for a, b in pairs if a.arbitration_id not in changed_ids)
    assert any(a != b for a, b in pairs)


def test_speed_scale_is_a_ratio_of_measured_and_true_speed(plain):
    values, frames = signals(active("speed_scale", 0.02))
    measured, true = column(values, "VehicleSpeed"), column(plain[0], "VehicleSpeed")
    assert measured == pytest.approx(1.02 * true, abs=0.0021)
    others_are_equal(frames, plain[1], {0x111})


def test_effort_bias_is_a_difference_at_every_axle(plain):
    values, frames = signals(active("effort_bias", -4000.0))
    for axle in range(1, 7):
        name = f"TractiveEffort_Ax{axle}"
        assert column(values, name) == pytest.approx(column(plain[0], name) - 4000.0, abs=10.1)
    others_are_equal(frames, plain[1], {0x121, 0x122})


@pytest.mark.parametrize(
    ("name", "delay_ms", "cycle_ms", "signal", "ids"),
    [
        ("speed_delay", 200, 20, "VehicleSpeed", {0x111}),
        ("speed_delay", 1000, 20, "VehicleSpeed", {0x111}),
        ("effort_delay", 50, 10, "TractiveEffort_Ax2", {0x121, 0x122}),
        ("effort_delay", 500, 10, "TractiveEffort_Ax5", {0x121, 0x122}),
    ],
)
def test_a_delay_of_whole_cycles_is_a_shift(plain, name, delay_ms, cycle_ms, signal, ids):
    values, frames = signals(active(name, delay_ms / 1e3))
    late, true = column(values, signal), column(plain[0], signal)
    shift = delay_ms // cycle_ms
    assert late[shift:].tolist() == true[:-shift].tolist()
    # What was before the run began is as it was then.
    assert np.ptp(late[:shift]) <= abs(late[shift] - late[0])
    others_are_equal(frames, plain[1], ids)


def test_a_delay_between_cycles_is_between_values(plain):
    values, _ = signals(active("effort_delay", 0.0137))
    true = plain[0]["TractiveEffort_Ax1"]
    stamps, efforts = np.array(list(true)), np.array(list(true.values()))
    late = values["TractiveEffort_Ax1"]
    wanted = np.interp(np.array(list(late)) - 13_700, stamps, efforts)
    moving = slice(10, None)
    step = np.abs(np.diff(efforts)).max()
    error = np.abs(np.array(list(late.values())) - wanted)[moving]
    # Straight lines between frames are not the plant, but nearer than a tenth of a cycle's change.
    assert error.max() < 0.15 * step
    assert np.median(error) < 12.0


def test_speed_errors_and_delays_work_together(plain):
    values, _ = signals(active("speed_scale", -0.03), active("speed_delay", 0.1))
    late, true = column(values, "VehicleSpeed"), column(plain[0], "VehicleSpeed")
    assert late[5:] == pytest.approx(0.97 * true[:-5], abs=0.0021)


def test_a_true_radius_is_the_ratio_of_speed_and_wheel_speed_in_coasting():
    # The last two seconds of each half of a sweep coast: wheels roll, r ω = v.
    values, _ = signals(
        active("wheel_radius", 0.02, 3.0), active("wheel_radius", -0.01, 5.0), duration=10.0
    )

    def at(name):
        return np.mean([x for t, x in values[name].items() if t > 9_000_000])

    radii = [at("VehicleSpeed") / at(f"WheelSpeed_Ax{axle}") for axle in range(1, 7)]
    wanted = [0.625, 0.625, 0.6375, 0.625, 0.61875, 0.625]
    assert radii == pytest.approx(wanted, rel=5e-4)


def test_a_true_inertia_takes_the_effort_that_does_not_reach_the_rail():
    record = Record(simulation_of(active("wheelset_inertia", 700.0)))
    omega = np.vstack([np.full((1, 6), np.nan), record.wheel_speed])
    taken = 900.0 * np.diff(omega, axis=0) / DT / 0.625
    assert (record.effort - record.force)[1:] == pytest.approx(taken[1:], abs=1e-3)
    assert np.abs(taken[1:]).max() > 1e3
    agrees(record, mu0(record.slip))


@pytest.mark.parametrize("name", ["speed_scale", "speed_delay", "effort_delay", "effort_bias"])
def test_errors_of_sensors_never_touch_the_true_rail(name):
    effect = effect_by_id(name)
    plain, wrong = (
        Record(simulation_of(*effects), 1.0)
        for effects in ((), (ActiveEffect(effect, (effect.parameters[0].upper,)),))
    )
    assert np.array_equal(plain.force, wrong.force)
    assert np.array_equal(plain.wheel_speed, wrong.wheel_speed)


# ----------------------------------------------------------------- what a receiver makes of them


@pytest.mark.parametrize(
    ("effect", "factor"),
    [
        (
            active("humidity", -0.005),
            lambda s: 1 - 0.005 * (s.covariates["relative_humidity_percent"] - 60),
        ),
        (active("sanding", 0.15), lambda s: 1 + 0.15 * s.covariates["sanding_active"]),
        (
            active("rail_temperature", 0.008),
            lambda s: 1 + 0.008 * (s.covariates["rail_temperature_degC"] - 20),
        ),
        (active("falling_friction", 0.2), lambda s: np.exp(-0.2 * np.abs(s.creep_speed))),
    ],
    ids=["humidity", "sanding", "rail_temperature", "falling_friction"],
)
def test_samples_of_a_run_lie_on_the_formula_with_what_the_frames_say(effect, factor):
    # Slow enough for a message of each second; without transfer, since loads come at 5 Hz.
    around = Surroundings(
        humidity=Wave(85.0, 5.0, 40.0),
        rail_temperature=Wave(32.0, 4.0, 40.0),
        sanding_period_s=4.0,
        sanding_s=2.0,
    )
    scenario = replace(SWEEP, surroundings=around, load_transfer=False)
    simulation = simulation_of(effect, scenario=scenario, duration=6.4, noise=SILENT)
    frames = [frame for step in simulation.run() for frame in step]
    samples, _ = extract_samples([Block.from_frames(frames)], load_configuration(), "simulated")
    away = np.abs(samples.slip) > 0.02  # where quantised speeds matter little
    wanted = (factor(samples) * mu0(samples.slip))[away]
    assert np.median(np.abs(samples.adhesion[away] - wanted)) < 1.5e-3
    assert np.quantile(np.abs(samples.adhesion - mu0(samples.slip))[away], 0.9) > 0.02


# ---------------------------------------------------------------------------- nothing, nonsense


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: f"{e.id}:{e.form}" if e.form else e.id)
def test_an_effect_changes_the_run_and_one_of_size_zero_does_not(effect):
    others = [p.typical for p in effect.parameters[1:]]

    def run(*effects):
        record = Record(simulation_of(*effects), 0.5)
        return record.force, record.wheel_speed

    base = run()
    nothing = run(ActiveEffect(effect, (0.0, *others)))
    for a, b in zip(base, nothing, strict=True):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-6)
    if acts_in_contact(effect) and effect.id != "traction_braking_asymmetry":
        something = run(ActiveEffect(effect, (effect.parameters[0].typical, *others)))
        assert np.abs(base[0] - something[0]).max() > 10.0


def test_a_wheelset_without_inertia_is_refused():
    with pytest.raises(InputError, match="inertia"):
        simulation_of(active("wheelset_inertia", -200.0))
