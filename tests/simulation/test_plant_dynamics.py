"""The plant against SciPy's integrator with equations written anew, and against conservation."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from adhesion_can.physics.burckhardt import RAIL, Surface, peak
from adhesion_can.physics.effects import ActiveEffect, effect_by_id
from adhesion_can.physics.vehicle import Geometry, Locomotive
from adhesion_can.simulation.plant import (
    Plant,
    Track,
    TrackSection,
    running_resistance,
)

FIXED = settings(derandomize=True, deadline=None, max_examples=20)
DT = 0.002
G = 9.80665
VEHICLE = Locomotive(
    wheel_radius=(0.625, 0.62, 0.63, 0.61, 0.615, 0.625),
    axle_load=(245e3, 243e3, 244e3, 241e3, 242e3, 240e3),
    wheelset_inertia=210.0,
    train_mass=9.0e5,
)
DRY, WET, GREASY = (surface.theta for surface in RAIL)


def rail(theta, axles=6):
    return tuple(np.full(axles, c) for c in theta)


def mu_of(slip, c1, c2, c3):
    size = abs(slip)
    return math.copysign(c1 * (1 - math.exp(-c2 * size)) - c3 * size, slip)


def davis(v, mass):
    """1.5 + 0.00025 V² N/kN with V in km/h."""
    return (1.5 + 0.00025 * (3.6 * v) ** 2) / 1000 * mass * G if v > 0 else 0.0


def unchanged(_slip, _v, _load):
    return 1.0


def reference(vehicle, v0, effort_of, theta, end, gradient=0.0, factor=unchanged):
    """Slip, wheel speeds and speed at steps of DT, by SciPy's stiff integrator."""
    r, loads = np.array(vehicle.wheel_radius), np.array(vehicle.axle_load)

    def right_hand_side(t, state):
        omega, v = state[:-1], state[-1]
        effort = effort_of(t)
        force = np.empty(len(r))
        for i in range(len(r)):
            slip = (r[i] * omega[i] - v) / v
            force[i] = mu_of(slip, *theta) * loads[i] * factor(slip, v, loads[i])
        pull = force.sum() - davis(v, vehicle.train_mass) - vehicle.train_mass * G * gradient
        accel = r * (effort - force) / vehicle.wheelset_inertia
        return [*accel, pull / vehicle.train_mass]

    times = np.arange(0, end + DT / 2, DT)
    out = solve_ivp(
        right_hand_side,
        (0, times[-1]),
        [*(v0 / r), v0],
        method="LSODA",
        t_eval=times,
        rtol=1e-9,
        atol=1e-10,
        max_step=0.01,
    )
    assert out.success
    return times, out.y[:-1].T, out.y[-1]


def stepped(plant, effort_of, theta, end):
    """The same from the plant; the effort of a step is that of its middle."""
    omegas, speeds, forces = [plant.wheel_speed], [plant.speed], []
    for k in range(round(end / DT)):
        plant.step(effort_of((k + 0.5) * DT), rail(theta, plant.vehicle.axles), DT)
        omegas.append(plant.wheel_speed)
        speeds.append(plant.speed)
        forces.append(plant.force)
    return np.array(omegas), np.array(speeds), np.array(forces)


def ramp(sign=1.0, theta=DRY):
    """Effort that passes what the rail gives after about 4 s, differently fast for each axle."""
    top = float(peak(*theta).mu_max) * 242e3
    pace = np.array([1.0, 1.02, 0.97, 1.01, 0.99, 1.03])
    return lambda t: sign * top / 4.0 * t * pace


@pytest.mark.parametrize(
    ("v0", "sign"), [(3.0, 1.0), (10.0, 1.0), (30.0, 1.0), (10.0, -1.0), (30.0, -1.0)]
)
@pytest.mark.parametrize("theta", [DRY, GREASY], ids=["dry", "greasy"])
def test_a_torque_ramp_beyond_the_peak_is_that_of_an_exact_integration(v0, sign, theta):
    effort = ramp(sign, theta)
    end = 5.0
    times, omega_ref, v_ref = reference(VEHICLE, v0, effort, theta, end)
    omega, v, _ = stepped(Plant(VEHICLE, v0), effort, theta, end)
    r, place = np.array(VEHICLE.wheel_radius), float(peak(*theta).lambda_m)
    # Until the first wheel has run away to three times λ_m.
    away = (np.abs(r * omega_ref / v_ref[:, None] - 1) > 3 * place).any(axis=1)
    last = int(away.argmax()) if away.any() else len(times)
    assert last > 1000
    times, omega, v, omega_ref, v_ref = (x[:last] for x in (times, omega, v, omega_ref, v_ref))
    slip, slip_ref = r * omega / v[:, None] - 1, r * omega_ref / v_ref[:, None] - 1
    assert v == pytest.approx(v_ref, abs=2e-3)
    stable = np.abs(slip_ref) < 0.8 * place
    assert np.abs(slip - slip_ref)[stable].max() < 5e-4
    # On the falling side any error grows: there the moment of the run-away is what counts.
    passed = np.abs(slip_ref).max(axis=0) > 1.5 * place
    assert passed.any()
    for axle in np.flatnonzero(passed):
        at, at_ref = (times[np.argmax(np.abs(s[:, axle]) > place)] for s in (slip, slip_ref))
        assert at == pytest.approx(at_ref, abs=0.02)


def test_a_gradient_and_effects_are_in_the_balance_too():
    c4, c5, gradient = 0.1, 2e-12, 0.01
    effects = (
        ActiveEffect(effect_by_id("falling_friction"), (c4,)),
        ActiveEffect(effect_by_id("load_dependence"), (c5,)),
    )
    effort = ramp()

    def factor(slip, v, load):
        return math.exp(-c4 * abs(slip * v)) * (1 - c5 * load**2)

    _, omega_ref, v_ref = reference(VEHICLE, 12.0, effort, DRY, 2.5, gradient, factor)
    plant = Plant(VEHICLE, 12.0, effects, gradient=gradient)
    omega, v, _ = stepped(plant, effort, DRY, 2.5)
    assert omega == pytest.approx(omega_ref, rel=1e-4)
    assert v == pytest.approx(v_ref, abs=2e-4)


def test_steps_half_as_long_come_closer():
    # First order at least: the error must shrink with the step, so the scheme is consistent.
    effort = ramp()
    _, omega_ref, _ = reference(VEHICLE, 10.0, effort, DRY, 3.0)
    errors = []
    for parts in (1, 4):
        plant = Plant(VEHICLE, 10.0)
        for k in range(round(3.0 / DT) * parts):
            plant.step(effort((k + 0.5) * DT / parts), rail(DRY), DT / parts)
        errors.append(np.abs(plant.wheel_speed - omega_ref[-1]).max())
    assert errors[1] < errors[0] / 2


@FIXED
@given(
    st.floats(2.0, 40.0),
    st.floats(-0.02, 0.02),
    st.integers(0, 10**6),
    st.sampled_from([DRY, WET, GREASY]),
)
def test_momentum_is_conserved(v0, gradient, seed, theta):
    # Angular: J Δω = r Σ (T − F) dt for each wheelset; linear: M Δv = Σ (ΣF − R − G) dt.
    rng = np.random.default_rng(seed)
    plant = Plant(VEHICLE, v0, gradient=gradient)
    torque, rail_force, drag = np.zeros(6), np.zeros(6), 0.0
    omega0 = plant.wheel_speed.copy()
    effort, most = np.zeros(6), 0.8 * float(peak(*theta).mu_max) * 240e3
    for _ in range(300):
        effort = np.clip(effort + 3e3 * rng.standard_normal(6), -most, most)
        drag += DT * (davis(plant.speed, 9e5) + 9e5 * G * gradient)
        plant.step(effort, rail(theta), DT)
        torque += DT * effort
        rail_force += DT * plant.force
    r = np.array(VEHICLE.wheel_radius)
    assert 210.0 * (plant.wheel_speed - omega0) == pytest.approx(
        r * (torque - rail_force), abs=1e-6 * max(1.0, np.abs(torque).max())
    )
    if plant.speed > 0:
        assert 9e5 * (plant.speed - v0) == pytest.approx(rail_force.sum() - drag, abs=1.0)


def test_energy_put_in_is_found_again():
    # ∫ T ω r dt = ΔE_wheels + ΔE_train + resistance + slip losses, to the order of the step.
    vehicle = VEHICLE
    plant, effort = Plant(vehicle, 10.0), ramp()
    r = np.array(vehicle.wheel_radius)

    def energy():
        return 105.0 * (plant.wheel_speed**2).sum() + 0.5 * 9e5 * plant.speed**2

    begin, work, lost = energy(), 0.0, 0.0
    for k in range(1900):
        omega, v = plant.wheel_speed, plant.speed
        e = effort((k + 0.5) * DT)
        plant.step(e, rail(DRY), DT)
        mid_omega, mid_v = (omega + plant.wheel_speed) / 2, (v + plant.speed) / 2
        work += DT * float((e * r * mid_omega).sum())
        lost += DT * float((plant.force * (r * mid_omega - mid_v)).sum())
        lost += DT * davis(mid_v, 9e5) * mid_v
    assert energy() - begin == pytest.approx(work - lost, rel=1e-6)
    assert lost > 0


def test_force_on_the_rail_is_what_the_curve_gives_at_the_slip():
    plant, effort = Plant(VEHICLE, 15.0), ramp()
    for k in range(1700):
        plant.step(effort(k * DT), rail(DRY), DT)
        wanted = [mu_of(s, *DRY) * n for s, n in zip(plant.slip, plant.load, strict=True)]
        if k > 5:
            assert plant.force == pytest.approx(wanted, abs=0.003 * 245e3)


# ------------------------------------------------------------------------ locked and spinning


def locked(v0=20.0, seconds=3.0, theta=DRY):
    plant = Plant(VEHICLE, v0)
    for _ in range(round(seconds / DT)):
        plant.step(np.full(6, -120e3), rail(theta), DT)
    return plant


def test_a_locked_wheel_stays_at_zero_while_the_brake_holds_it():
    plant = locked()
    assert np.array_equal(plant.wheel_speed, np.zeros(6))
    assert plant.speed > 1
    assert plant.slip == pytest.approx([-1.0] * 6)


def test_a_locked_wheel_gives_the_rail_no_more_than_adhesion():
    # μ(−1) = −0.1 on the dry rail: a sliding wheel brakes with 24 kN, whatever the brake wants.
    plant = locked()
    for force, load in zip(plant.force, plant.load, strict=True):
        assert force == pytest.approx(mu_of(-1.0, *DRY) * load, rel=0.02)


@pytest.mark.parametrize("theta", [DRY, WET, GREASY], ids=["dry", "wet", "greasy"])
def test_no_braking_force_on_the_rail_is_ever_beyond_the_peak(theta):
    plant = Plant(VEHICLE, 20.0)
    top = float(peak(*theta).mu_max)
    for k in range(3000):  # locks in every second half
        plant.step(np.full(6, -120e3 * (k * DT % 1.0 > 0.5)), rail(theta), DT)
        assert (np.abs(plant.force) <= top * plant.load * 1.01).all(), k * DT


def test_a_released_wheel_spins_up_again():
    plant = locked(seconds=2.0)
    assert plant.speed > 1
    for _ in range(1500):
        plant.step(np.zeros(6), rail(DRY), DT)
    r = np.array(VEHICLE.wheel_radius)
    assert r * plant.wheel_speed == pytest.approx([plant.speed] * 6, rel=1e-3)


@pytest.mark.parametrize(("theta", "v0"), [(DRY, 0.0), (DRY, 15.0), (GREASY, 5.0)], ids=str)
def test_a_spinning_wheel_is_never_driven_by_the_rail(theta, v0):
    # Burckhardt's straight −c3 λ has no floor: far beyond the valid slip it must not turn round.
    plant = Plant(VEHICLE, v0)
    for k in range(2500):
        plant.step(np.full(6, 120e3), rail(theta), DT)
        assert (plant.force >= -1e-6 * plant.load).all(), (k * DT, plant.slip, plant.force)
    assert np.isfinite(plant.wheel_speed).all()
    assert np.isfinite(plant.speed)


# ------------------------------------------------------------------------- starting, standing


@pytest.mark.parametrize("theta", [DRY, WET, GREASY], ids=["dry", "wet", "greasy"])
def test_a_standing_train_starts(theta):
    plant = Plant(VEHICLE, 0.0)
    for _ in range(5000):
        plant.step(np.full(6, 2e4), rail(theta), DT)
    # 120 kN less some 13 kN of resistance on 900 t for 10 s.
    assert plant.speed == pytest.approx((120e3 - 1.6e-3 * 9e5 * G) / 9e5 * 10, rel=0.03)
    needed = -math.log(1 - 2e4 / 240e3 / theta[0]) / theta[1]  # c3 λ is small beside it
    assert np.abs(plant.slip).max() < 1.2 * needed
    assert plant.position == pytest.approx(plant.speed * 5, rel=0.02)


def test_a_standing_train_without_effort_stays():
    plant = Plant(VEHICLE, 0.0)
    for _ in range(1000):
        plant.step(np.zeros(6), rail(DRY), DT)
    assert plant.speed == 0.0
    assert plant.position == 0.0
    assert np.array_equal(plant.wheel_speed, np.zeros(6))


def test_a_train_braked_to_a_stand_stands():
    plant = Plant(VEHICLE, 3.0)
    for _ in range(10_000):
        plant.step(np.full(6, -3e4), rail(DRY), DT)
        assert plant.speed >= 0
        assert (plant.wheel_speed >= 0).all()
    assert plant.speed == 0.0
    assert plant.wheel_speed == pytest.approx([0.0] * 6, abs=1e-3)


def test_coasting_slows_by_the_resistance():
    plant = Plant(VEHICLE, 25.0)
    for _ in range(5000):
        plant.step(np.zeros(6), rail(DRY), DT)
    # Wheels turn with the train: their inertia, as mass at the rim, coasts too.
    mass = 9e5 + sum(210.0 / r**2 for r in VEHICLE.wheel_radius)
    drop = davis(24.9, 9e5) / mass * 10
    assert 25.0 - plant.speed == pytest.approx(drop, rel=0.01)


@pytest.mark.parametrize(("kmh", "per_kn"), [(0, 1.5), (100, 4.0), (80, 3.1)])
def test_running_resistance_by_hand(kmh, per_kn):
    assert running_resistance(kmh / 3.6, 1e6) == pytest.approx(per_kn * 1e-3 * 1e6 * G)


def test_load_transfer_moves_the_loads_only_where_asked_for():
    effort = np.full(6, 5e4)
    plain, moving = Plant(VEHICLE, 10.0), Plant(VEHICLE, 10.0, load_transfer=True)
    for plant in (plain, moving):
        plant.step(effort, rail(DRY), DT)
    assert np.array_equal(plain.load, VEHICLE.axle_load)
    wanted = np.array(VEHICLE.axle_load) + Geometry().load_transfer(effort)
    assert moving.load == pytest.approx(wanted)


# ------------------------------------------------------------------------------------- track


STRETCHES = (
    TrackSection(0.0, Surface("a", 0.4, 60.0, 0.3, "")),
    TrackSection(5.0, Surface("b", 0.3, 50.0, 0.2, "")),
    TrackSection(6.0, Surface("c", 0.2, 40.0, 0.1, "")),
)


def test_all_axles_change_together_where_none_is_behind():
    track = Track(STRETCHES, np.zeros(6))
    for k in range(1, 1000):
        t = k * 0.01
        c1 = track.under(t, 10.0 * t)[0]
        assert c1.tolist() == [0.4 if t < 5 else 0.3 if t < 6 else 0.2] * 6


def test_each_axle_finds_a_change_where_the_leading_one_found_it():
    # 10 m/s: an axle 12 m behind comes there 1.2 s later, when the next change has begun.
    behind = np.array([0.0, 2.0, 12.0])
    track = Track(STRETCHES, behind)
    for k in range(1000):
        t = k * 0.01
        c1, c2, c3 = track.under(t, 10.0 * t)
        for axle, distance in enumerate(behind):
            local = t - distance / 10.0
            if min(abs(local - 5), abs(local - 6)) < 0.015:
                continue
            index = 0 if local < 5 else 1 if local < 6 else 2
            wanted = STRETCHES[index].surface.theta
            assert (c1[axle], c2[axle], c3[axle]) == wanted, (t, axle)


def test_a_standing_train_keeps_its_rear_axles_on_the_old_rail():
    track = Track(STRETCHES[:2], np.array([0.0, 5.0]))
    track.under(0.0, 100.0)
    assert track.under(60.0, 100.0)[0].tolist() == [0.3, 0.4]
    assert track.under(90.0, 104.9)[0].tolist() == [0.3, 0.4]
    assert track.under(91.0, 105.0)[0].tolist() == [0.3, 0.3]
