"""Effects against formulas written out here, and the registry against the contract."""

import ast
import math
import pickle
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import adhesion_can
from adhesion_can.physics.effects import (
    EFFECTS,
    MIN_FACTOR,
    ActiveEffect,
    ContactEffect,
    LagStates,
    build_instruments,
    compute_change,
    effect_by_id,
)
from adhesion_can.physics.instruments import PERFECT
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.testing.effects import EffectSuite, draw_contact

CONTRACT_IDS = {
    *("speed_dependence", "load_dependence", "falling_friction", "wheelset_inertia"),
    *("wheel_radius", "speed_scale", "speed_delay", "effort_delay", "effort_bias"),
    "wheel_speed_delay",
    *("creep_relaxation", "curve_creep", "rail_cleaning", "adhesion_recovery", "humidity"),
    *("contact_heating", "rain"),
    *("rail_temperature", "sanding", "slow_drift", "traction_braking_asymmetry"),
    *("load_transfer", "effort_gain", "speed_error", "curving_resistance", "brake_blending"),
    "wheel_once_per_turn",
}
IN_CONTACT = [effect for effect in EFFECTS if isinstance(effect, ContactEffect)]
RH, RAIL_T, SAND, CURVE, RAIN = (
    *("relative_humidity_percent", "rail_temperature_degC", "sanding_active", "curvature_per_m"),
    "rain",
)


def named(effect):
    return f"{effect.id}:{effect.form}" if effect.form else effect.id


def contact(**changes):
    """A drive, all channels at random, with some of them given."""
    sizes = {name: changes.pop(name) for name in ("n", "dt") if name in changes}
    return replace(draw_contact(**sizes), **changes)


def changed(name, at, *values, form=""):
    return effect_by_id(name, form).change(at, values, LagStates())


def factor_of(name, at, *values, form=""):
    change = changed(name, at, *values, form=form)
    assert np.array_equal(change.slip, at.slip)
    return np.broadcast_to(change.factor, at.slip.shape)


# --------------------------------------------------------------------------------- the registry


def test_every_effect_of_the_contract_is_there_and_forms_are_told_apart():
    assert {effect.id for effect in EFFECTS} == CONTRACT_IDS
    assert len({(effect.id, effect.form) for effect in EFFECTS}) == len(EFFECTS)
    for effect in EFFECTS:
        assert effect_by_id(effect.id, effect.form) is effect
        first = next(e for e in EFFECTS if e.id == effect.id)
        assert effect_by_id(effect.id) is first
    for twin in ("load_dependence", "falling_friction"):
        forms = [effect.form for effect in EFFECTS if effect.id == twin]
        assert len(forms) == 2
        assert all(forms)


@pytest.mark.parametrize(
    ("name", "form"), [("phlogiston", ""), ("sanding", "fine"), ("falling_friction", "Polach")]
)
def test_unknown_id_or_form_names_the_known_ones(name, form):
    with pytest.raises(KeyError, match="falling_friction"):
        effect_by_id(name, form)


class TestEach(EffectSuite):
    """Each effect of the registry, and each of its forms."""

    @pytest.fixture(autouse=True, params=EFFECTS, ids=named)
    def choose(self, request):
        self.effect = request.param


@pytest.mark.parametrize("effect", EFFECTS, ids=named)
def test_an_effect_goes_to_other_processes(effect):
    assert pickle.loads(pickle.dumps(effect)) == effect  # noqa: S301  our own bytes


@pytest.mark.parametrize("effect", EFFECTS, ids=named)
def test_a_copy_with_other_bounds_leaves_the_effect_as_it_is(effect):
    """So a fit asks for a size that no vehicle has (`refute.without_bounds`)."""
    size, *others = effect.parameters
    free = (replace(size, lower=-np.inf, upper=np.inf), *others)
    freed = copy(effect)
    object.__setattr__(freed, "parameters", free)
    assert effect_by_id(effect.id, effect.form).parameters == (size, *others)
    assert pickle.loads(pickle.dumps(freed)).parameters == free  # noqa: S301  our own bytes


def test_forms_of_a_mechanism_agree_on_what_they_require_and_how_they_show():
    for effect in IN_CONTACT:
        first = effect_by_id(effect.id)
        assert (effect.title, effect.requires, effect.observability) == (
            *(first.title, first.requires, first.observability),
        )


def test_no_pair_of_effects_is_separated_in_two_ways():
    pairs = [
        frozenset({effect_id, separation.rival})
        for effect_id in CONTRACT_IDS
        for separation in effect_by_id(effect_id).observability.separations
    ]
    assert len(pairs) == len(set(pairs))


@pytest.mark.costly
def test_what_is_particular_to_an_effect_stands_in_its_definition_alone():
    """No module knows an effect by its id. Roles, labels, words of databases are called so too."""
    package = Path(adhesion_can.__file__).parent
    exempt = {
        *(package / "physics" / "readings.py", package / "physics" / "channels.py"),
        package / "config" / "vehicle_section.py",
        package / "bus" / "role_specs.py",
        # An effect in the user's own quantities, with the setting that corrects it: presentation.
        *(package / "reporting" / "next_steps").glob("*.py"),
        package / "learning" / "sentences.py",
        # A parameter of its runs is called so too.
        package / "fmu" / "locomotive.py",
        # A direction in which an effect would move the residual is called as the effect.
        package / "estimation" / "doubt" / "directions.py",
    }
    found = [
        f"{path.relative_to(package)}:{node.lineno}: {node.value}"
        for path in sorted(package.rglob("*.py"))
        if path not in exempt and path.parent != package / "physics" / "effects"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and node.value in CONTRACT_IDS
    ]
    assert found == []


def test_errors_of_single_axles():
    single = {"wheel_radius", "sanding", "effort_gain", "wheel_once_per_turn"}
    assert {e.id for e in EFFECTS for p in e.parameters if p.axle} == single


# --------------------------------------------------------------------------- formulas, by hand


def test_speed_dependence_is_curtius_and_kniffler_relative_to_standstill():
    at = contact(speed=np.linspace(0.0, 40.0, 180))

    def curtius(kmh):
        return 7.5 / (kmh + 44) + 0.161

    whole = [curtius(3.6 * v) / curtius(0) for v in at.speed]
    assert factor_of("speed_dependence", at, 1.0) == pytest.approx(whole, rel=1e-12)
    half = [1 + 0.5 * (f - 1) for f in whole]
    assert factor_of("speed_dependence", at, 0.5) == pytest.approx(half, rel=1e-12)
    # The published values: 0.331 at standstill, 0.213 at 100 km/h.
    assert factor_of("speed_dependence", contact(speed=np.full(180, 100 / 3.6)), 1.0)[0] == (
        pytest.approx(0.2131 / 0.3315, rel=1e-3)
    )


def test_load_dependence_is_the_c5_factor_of_eq_4():
    at = contact()
    wanted = [1 - 3e-12 * n**2 for n in at.load]
    assert factor_of("load_dependence", at, 3e-12) == pytest.approx(wanted, rel=1e-12)
    assert factor_of("load_dependence", at, 3e-12, form="burckhardt") == pytest.approx(wanted)


def test_load_power_takes_a_power_of_the_load_in_hundred_kilonewton():
    at = contact()
    wanted = [1 / math.pow(n / 1e5, 0.4) for n in at.load]
    assert factor_of("load_dependence", at, 0.4, form="power") == pytest.approx(wanted, rel=1e-12)
    assert factor_of("load_dependence", contact(load=np.full(180, 4e5)), 0.5, form="power")[
        0
    ] == pytest.approx(0.5)


def test_falling_friction_is_the_c4_factor_of_eq_4():
    at = contact()
    wanted = [math.exp(-0.17 * abs(s * v)) for s, v in zip(at.slip, at.speed, strict=True)]
    assert factor_of("falling_friction", at, 0.17) == pytest.approx(wanted, rel=1e-12)


def test_polachs_form_falls_to_a_share():
    at = contact()
    wanted = [(1 - 0.3) * math.exp(-0.8 * abs(c)) + 0.3 for c in at.creep_speed]
    assert factor_of("falling_friction", at, 0.8, 0.3, form="polach") == pytest.approx(wanted)
    fast = factor_of(
        "falling_friction", contact(creep_speed=np.full(180, 1e3)), 0.8, 0.3, form="polach"
    )
    assert fast == pytest.approx(np.full(180, 0.3))


def test_rail_cleaning_counts_from_the_leading_axle():
    at = contact()  # runs backwards: axle 6 leads
    wanted = [{6: 1.0, 5: 1.03, 4: 1.06, 3: 1.09, 2: 1.12, 1: 1.15}[int(a)] for a in at.axle]
    assert factor_of("rail_cleaning", at, 0.03) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "size", "channel", "reference"),
    [("humidity", -0.004, RH, 60.0), ("rail_temperature", 0.007, RAIL_T, 20.0),
     ("sanding", 0.25, SAND, 0.0), ("rain", -0.15, RAIN, 0.0)],
)  # fmt: skip
def test_a_channel_changes_adhesion_in_a_straight_line(name, size, channel, reference):
    at = contact()
    wanted = [1 + size * (x - reference) for x in at.covariates[channel]]
    assert factor_of(name, at, size) == pytest.approx(wanted, rel=1e-12)
    assert channel in effect_by_id(name).requires.covariates


def test_slow_drift_goes_by_the_time_since_the_recording_began():
    at = contact(time_s=np.linspace(0.0, 600.0, 180))
    wanted = [1 + 5e-4 * t for t in at.time_s]
    assert factor_of("slow_drift", at, 5e-4) == pytest.approx(wanted, rel=1e-12)


def test_asymmetry_is_a_factor_in_braking_alone():
    at = contact()
    assert {True, False} == set((at.slip < 0).tolist())
    wanted = [0.85 if s < 0 else 1.0 for s in at.slip]
    assert factor_of("traction_braking_asymmetry", at, -0.15).tolist() == wanted


def test_recovery_counts_slip_work_with_a_fading_memory():
    # Explicit Euler in steps a hundred times as fine, for each axle by itself.
    at = contact(n=600, dt=0.02)
    gain, time = 3e-6, 1.7
    factor = factor_of("adhesion_recovery", at, gain, time)
    power = np.abs(at.adhesion * at.load * at.creep_speed)
    for axle in range(1, 7):
        rows = np.flatnonzero(at.axle == axle)
        work = 0.0
        assert factor[rows[0]] == 1.0
        for before, now in zip(rows, rows[1:], strict=False):
            for part in range(100):
                p = power[before] + (power[now] - power[before]) * (part + 0.5) / 100
                work += 0.02 / 100 * (p - work / time)
            assert factor[now] == pytest.approx(1 + gain * work, rel=2e-4)


def test_heating_takes_adhesion_by_the_slip_work_of_the_last_seconds():
    # Explicit Euler in steps a hundred times as fine, for each axle by itself.
    at = contact(n=600, dt=0.02)
    loss, time = 5e-6, 1.3
    factor = factor_of("contact_heating", at, loss, time)
    power = np.abs(at.adhesion * at.load * at.creep_speed)
    for axle in range(1, 7):
        rows = np.flatnonzero(at.axle == axle)
        heat = 0.0
        for before, now in zip(rows, rows[1:], strict=False):
            for part in range(100):
                p = power[before] + (power[now] - power[before]) * (part + 0.5) / 100
                heat += 0.02 / 100 * (p - heat / time)
            assert factor[now] == pytest.approx(1 / (1 + loss * heat), rel=2e-4)


def test_sand_at_two_axles_lasts_beyond_the_sanding():
    at = contact(n=1200, dt=0.01)
    seconds = at.time_s - at.time_s[0]
    strewn = ((seconds >= 0.5) & (seconds < 1.0)).astype(float)
    at = replace(at, covariates={SAND: strewn}, place=at.axle)
    factor = factor_of("sanding", at, 0.3, 0.4, 4.0, form="axles")
    sanded = np.isin(at.axle, (1.0, 4.0))
    assert (factor[~sanded] == 1.0).all()
    assert (factor[seconds < 0.5] == 1.0).all()
    under = sanded & (seconds > 0.8) & (seconds < 1.0)
    assert factor[under] == pytest.approx(np.full(under.sum(), 1.3), rel=2e-3)
    after = sanded & (seconds >= 1.02)
    wanted = 1 + 0.3 * np.exp(-(seconds[after] - 1.0) / 0.4)
    # Between the last reading and the next one sand fades along a straight line.
    assert factor[after] == pytest.approx(wanted, abs=0.005)
    # In reverse the last axle leads; 1 means the leading axle alone.
    back = factor_of("sanding", replace(at, place=7.0 - at.axle), 0.3, 0.4, 1.0, form="axles")
    assert set(at.axle[back > 1.1].tolist()) == {6.0}


def test_rain_by_steps_has_a_size_of_its_own_for_each_level():
    at = contact()
    wanted = [{0.0: 1.0, 1.0: 0.8, 2.0: 1 - 0.2 * 1.7}[x] for x in at.covariates[RAIN].tolist()]
    assert factor_of("rain", at, -0.2, 1.7, form="steps") == pytest.approx(wanted, rel=1e-12)


def test_creep_relaxation_follows_the_slip_over_a_way_in_either_direction():
    """A late or smoothed speed may come out backwards: exp grew beyond all numbers with it."""
    ways = [
        changed("creep_relaxation", contact(n=600, speed=sign * np.full(600, 6e4)), 0.8).slip
        for sign in (1.0, -1.0)
    ]
    assert ways[0].tolist() == ways[1].tolist()
    # Some hundred lengths go by in a step.
    assert ways[0] == pytest.approx(contact(n=600).slip, abs=1e-3)


def test_creep_relaxation_follows_the_slip_over_a_length():
    # (σ/v) dλ'/dt + λ' = λ, in steps a hundred times as fine.
    at = contact(n=600, dt=0.01, speed=np.repeat(np.linspace(3.0, 30.0, 100), 6))
    change = changed("creep_relaxation", at, 0.8)
    assert np.asarray(change.factor).tolist() == 1.0
    for axle in range(1, 7):
        rows = np.flatnonzero(at.axle == axle)
        lagging = at.slip[rows[0]]
        for before, now in zip(rows, rows[1:], strict=False):
            for part in range(100):
                slip = at.slip[before] + (at.slip[now] - at.slip[before]) * (part + 0.5) / 100
                lagging += 0.01 / 100 * at.speed[now] / 0.8 * (slip - lagging)
            assert change.slip[now] == pytest.approx(lagging, abs=1e-4)


def test_curve_creep_shares_adhesion_between_the_ways_of_creep():
    at = contact()
    change = changed("curve_creep", at, 4.0)
    for k in range(180):
        lateral = 4.0 * abs(at.covariates[CURVE][k])
        whole = math.sqrt(at.slip[k] ** 2 + lateral**2)
        assert abs(change.slip[k]) == pytest.approx(whole, rel=1e-12)
        assert math.copysign(1, change.slip[k]) == math.copysign(1, at.slip[k])
        assert change.factor[k] == pytest.approx(abs(at.slip[k]) / whole, rel=1e-12)


def test_curve_creep_of_a_table_goes_by_its_slip_angle():
    at = contact(covariates={"slip_angle_deg": np.linspace(-10.0, 10.0, 180)})
    change = changed("curve_creep", at, 1.0)
    wanted = [
        math.hypot(s, math.tan(math.radians(a)))
        for s, a in zip(at.slip, at.covariates["slip_angle_deg"], strict=True)
    ]
    assert np.abs(change.slip) == pytest.approx(wanted, rel=1e-12)


def test_a_wheel_that_rolls_straight_has_no_share_to_lose():
    at = contact(slip=np.zeros(180), covariates={CURVE: np.zeros(180)})
    change = changed("curve_creep", at, 4.0)
    assert change.slip.tolist() == [0.0] * 180
    assert np.isfinite(change.factor).all()


# ----------------------------------------------------------------------------- several together


def test_effects_follow_each_other_and_multiply():
    at = contact()
    actives = [
        ActiveEffect(effect_by_id("creep_relaxation"), (0.8,)),
        ActiveEffect(effect_by_id("speed_scale"), (0.01,)),  # nothing in the contact
        ActiveEffect(effect_by_id("curve_creep"), (4.0,)),
        ActiveEffect(effect_by_id("sanding"), (0.3,)),
        ActiveEffect(effect_by_id("traction_braking_asymmetry"), (-0.2,)),
    ]
    both = compute_change(actives, at, LagStates())
    lagging = changed("creep_relaxation", at, 0.8).slip
    for k in range(180):
        whole = math.hypot(lagging[k], 4.0 * at.covariates[CURVE][k])
        assert both.slip[k] == pytest.approx(math.copysign(whole, lagging[k]), rel=1e-12)
        share = abs(lagging[k]) / whole
        factor = share * (1 + 0.3 * at.covariates[SAND][k]) * (0.8 if lagging[k] < 0 else 1.0)
        assert both.factor[k] == pytest.approx(max(factor, MIN_FACTOR), rel=1e-9)


def test_without_effects_in_the_contact_nothing_changes():
    at = contact()
    for actives in ([], [ActiveEffect(effect_by_id("effort_bias"), (3e3,))]):
        change = compute_change(actives, at, LagStates())
        assert change.slip is at.slip
        assert change.factor == 1.0


def test_errors_of_the_instruments_add_up():
    given = [
        ActiveEffect(effect_by_id("wheel_radius"), (0.02, 3.0)),
        ActiveEffect(effect_by_id("wheel_radius"), (-0.01, 6.0)),
        ActiveEffect(effect_by_id("wheel_radius"), (0.01, 3.0)),
        ActiveEffect(effect_by_id("wheelset_inertia"), (150.0,)),
        ActiveEffect(effect_by_id("speed_scale"), (0.03,)),
        ActiveEffect(effect_by_id("speed_delay"), (0.1,)),
        ActiveEffect(effect_by_id("effort_delay"), (0.02,)),
        ActiveEffect(effect_by_id("effort_bias"), (-500.0,)),
        ActiveEffect(effect_by_id("sanding"), (0.3,)),  # nothing in the instruments
    ]
    found = build_instruments(given)
    assert dict(found.radius_error) == pytest.approx({3: 0.03, 6: -0.01})
    assert found.radius_factor(6) == pytest.approx([1, 1, 1.03, 1, 1, 0.99])
    assert (found.inertia_error, found.speed_error) == (150.0, 0.03)
    assert (found.speed_delay, found.effort_delay, found.effort_bias) == (0.1, 0.02, -500.0)
    assert build_instruments(given[4:5], found).speed_error == pytest.approx(0.06)
    real = found.vehicle(Locomotive())
    assert real.wheel_radius == pytest.approx((0.625, 0.625, 0.64375, 0.625, 0.625, 0.61875))
    assert real.wheelset_inertia == 350.0
    assert build_instruments([]) == PERFECT
