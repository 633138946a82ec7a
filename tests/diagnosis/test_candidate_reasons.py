"""Why effects cannot be tested on some data, and the candidates of the others."""

from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.diagnosis.drive.turn_swing import NO_SWING, TurnSwing
from adhesion_can.diagnosis.inference.candidates import build_candidates
from adhesion_can.diagnosis.inference.search_starts import find_step_time
from tests.diagnosis.diagnosis_helpers import burckhardt

ROWS = 1200
COVARIATES = (
    *("relative_humidity_percent", "rail_temperature_degC", "sanding_active", "rain"),
    "curvature_per_m",
)


class Drive:
    """A recording of two axles with everything that an effect may need; `changes` take it away."""

    def __init__(self, name="a", *, step_s=0.02, cycle_s=None, speed=12.0, **changes):
        rng, n = np.random.default_rng(1), ROWS // 2
        self.name, self.table, self.independent, self.derived_force = name, False, False, False
        self.has_speed = self.has_load = True
        self.t_s = np.tile(np.arange(n) * step_s, 2)
        self.axle = np.repeat([1, 2], n)
        self.slip = 0.1 * np.sin(2 * np.pi * self.t_s / 3.0 + self.axle)
        self.adhesion = burckhardt(self.slip)
        self.load = rng.uniform(1.9e5, 2.1e5, ROWS)
        self.speed = np.full(ROWS, speed)
        self.covariates = {name: rng.uniform(0.0, 2.0, ROWS) for name in COVARIATES}
        self.lost, self.user_channels = {}, ()
        self.radius, self.inertia = np.array([0.5, 0.7]), 150.0
        self.swings = {1: NO_SWING, 2: NO_SWING}
        self.kinematics = SimpleNamespace(
            efforts=np.zeros((ROWS, 2)),
            cycle_s=step_s if cycle_s is None else cycle_s,
            once_per_turn=lambda axle: self.swings[axle],
        )
        for key, value in changes.items():
            setattr(self, key, value)

    @property
    def time_s(self):
        return self.t_s

    def __len__(self):
        return len(self.t_s)

    def observe(self, *_):
        return SimpleNamespace(
            slip=self.slip, adhesion=self.adhesion, load=self.load, speed=self.speed
        )


def answers(*drives):
    """Candidates by id, and reasons by what is not tested."""
    candidates, untested = build_candidates(drives)
    found = {}
    for one in candidates:
        found.setdefault(one.effect.id, []).append(one)
    return found, {one.what: one.why for one in untested}


def test_with_everything_there_all_is_tested_but_what_shows_no_start():
    found, reasons = answers(Drive())
    assert list(reasons) == ["wheel_once_per_turn"]
    assert "too short" in reasons["wheel_once_per_turn"]
    assert [one.axle for one in found["wheel_radius"]] == [1, 2]
    assert {one.axle for one in found["humidity"]} == {0}
    lags = {name for name, ones in found.items() if any(one.is_lag for one in ones)}
    assert {"speed_delay", "effort_delay", "wheel_speed_delay", "creep_relaxation"} <= lags
    assert "adhesion_recovery" not in lags


def test_plausible_sizes_are_those_of_the_vehicle_or_a_tenth_beyond_the_range():
    found, _ = answers(Drive())
    mean_load = float(np.mean(Drive().load))
    (inertia,) = found["wheelset_inertia"]
    assert inertia.plausible == pytest.approx((-150.0, 0.4 * mean_load / 9.80665 * 0.36 - 150.0))
    (bias,) = found["effort_bias"]
    assert bias.plausible == pytest.approx((-0.1 * mean_load, 0.1 * mean_load))
    (scale,) = found["speed_scale"]
    assert scale.plausible == pytest.approx((-0.055, 0.055))
    (delay,) = found["speed_delay"]
    assert delay.plausible == (-np.inf, np.inf)
    assert {one.plausible for one in found["wheel_radius"]} == {(-np.inf, np.inf)}


@pytest.mark.parametrize(
    ("changes", "names", "words"),
    [
        ({"has_speed": False}, ("speed_dependence", "speed_delay", "falling_friction"),
         "no column speed_mps"),
        ({"has_load": False}, ("load_dependence",), "loads are not measured"),
        ({"table": True}, ("wheelset_inertia", "speed_error low_pass"), "not the wheel speed"),
        ({"derived_force": True}, ("speed_delay", "effort_delay", "wheel_speed_delay"),
         "force of a is computed"),
        ({"axle": np.ones(ROWS, dtype=int)}, ("rail_cleaning", "wheel_radius", "load_transfer"),
         "one axle"),
        ({"adhesion": np.abs(burckhardt(Drive().slip))}, ("brake_blending",), "hardly any braking"),
        ({"covariates": {}}, ("humidity", "rain", "sanding", "curve_creep"), "no signal gives"),
        ({"covariates": dict.fromkeys(COVARIATES, np.ones(ROWS))}, ("humidity", "sanding"),
         "does not change in these data"),
        ({"covariates": {}, "lost": {"channel rain": 7}}, ("rain",),
         "rain is not available in 7 of its readings in a"),
    ],
)  # fmt: skip
def test_what_lacks_something_is_not_tested_and_the_reason_is_given(changes, names, words):
    found, reasons = answers(Drive(**changes))
    for name in names:
        assert words in reasons[name], (name, reasons.get(name))
        assert name.split()[0] not in found or " " in name
    # One drive that lacks it is enough.
    _, reasons = answers(Drive(), Drive("b", **changes))
    if not {"axle", "adhesion", "lost"} & set(changes) and "change" not in words:
        assert all(name in reasons for name in names)


def test_efforts_of_all_axles_and_one_recording():
    drive = Drive()
    drive.kinematics.efforts = None
    _, reasons = answers(drive)
    assert reasons["load_transfer"] == "the efforts of all axles are not known"
    assert reasons["speed_error pitch"] == "the efforts of all axles are not known"
    _, reasons = answers(Drive(), Drive("b"))
    assert "diagnose each recording separately" in reasons["speed_error step"]
    assert "diagnose each recording separately" in reasons["wheel_once_per_turn"]


@pytest.mark.parametrize(("share", "enough"), [(0.019, False), (0.021, True)])
def test_braking_in_a_fiftieth_of_the_rows_is_enough(share, enough):
    adhesion = np.full(ROWS, 0.1)
    adhesion[: round(share * ROWS)] = -0.006
    adhesion[-100:] = -0.004  # coasting
    _, reasons = answers(Drive(adhesion=adhesion))
    assert ("brake_blending" not in reasons) == enough


def test_rows_too_far_apart_show_no_short_delay_and_no_short_length():
    """At most twice the typical value: 0.1 s of the effort's delay, 1 m of the relaxation."""
    _, reasons = answers(Drive(step_s=0.099, speed=10.0))
    assert "effort_delay" not in reasons
    assert "creep_relaxation" not in reasons
    _, reasons = answers(Drive(step_s=0.101, speed=10.0))
    assert "0.1 s apart, too far for a delay of about 0.05 s" in reasons["effort_delay"]
    assert "1 m apart, too far for a length of about 0.5 m" in reasons["creep_relaxation"]
    assert "speed_delay" not in reasons
    _, reasons = answers(Drive(step_s=0.41))
    assert "speed_delay" in reasons


def test_rows_further_apart_than_a_pause_forget():
    for step_s in (0.99, 1.0):
        _, reasons = answers(Drive(step_s=step_s, speed=0.1))
        assert "adhesion_recovery" not in reasons
    _, reasons = answers(Drive(step_s=1.2, speed=0.1))
    assert "an effect with a memory starts again" in reasons["adhesion_recovery"]
    assert "an effect with a memory starts again" in reasons["contact_heating"]


def test_independent_points_have_no_order_and_one_sign_no_instrument_errors():
    points = Drive(table=True, independent=True)
    found, reasons = answers(points)
    assert "without an order" in reasons["creep_relaxation"]
    assert "speed_scale" in found
    one_sided = Drive(table=True, independent=True, slip=np.abs(points.slip))
    _, reasons = answers(one_sided)
    assert "all slips have one sign" in reasons["speed_scale"]
    assert "all slips have one sign" in reasons["effort_bias"]
    # A time series of traction alone has other ways.
    assert "speed_scale" not in answers(Drive(slip=np.abs(points.slip)))[1]


def series(count, *, lasts_s=10.0, apart_s=100.0):
    """A table of so many series with pauses between them."""
    n = ROWS // count
    t_s = np.concatenate([k * apart_s + np.linspace(0.0, lasts_s, n) for k in range(count)])
    rows = len(t_s)
    drive = Drive(table=True, t_s=t_s, axle=np.ones(rows, dtype=int))
    for name in ("slip", "adhesion", "load", "speed"):
        setattr(drive, name, getattr(drive, name)[:rows])
    drive.covariates = {name: column[:rows] for name, column in drive.covariates.items()}
    return drive


@pytest.mark.parametrize(
    ("drive", "few"),
    [
        (series(19), True),
        (series(20), False),
        (series(5), True),
        # A tenth of the variance of time within them: three of 95 s, 100 s apart.
        (series(3, lasts_s=97.0), False),
        (series(3, lasts_s=90.0), True),
    ],
)
def test_a_few_series_with_pauses_show_no_drift(drive, few):
    _, reasons = answers(drive)
    assert ("at least 20 are needed" in reasons.get("slow_drift", "")) == few


def swing(amplitude, std, phase=0.5):
    return TurnSwing(amplitude, phase, std)


def test_a_wheel_that_swings_once_a_turn_is_tested_at_its_axle_with_its_phase():
    drive = Drive()
    drive.swings = {1: swing(2.9e-4, 1e-6), 2: swing(4e-3, 1e-4, 1.25)}
    found, reasons = answers(drive)
    (candidate,) = found["wheel_once_per_turn"]
    assert (candidate.axle, candidate.starts) == (2, ((1.25,),))
    assert reasons == {}
    # Five standard deviations, and 0.03 %, are the least.
    drive.swings = {1: swing(4.9e-4, 1e-4), 2: swing(5.1e-4, 1e-4)}
    assert [one.axle for one in answers(drive)[0]["wheel_once_per_turn"]] == [2]
    drive.swings = {1: swing(2.9e-4, 1e-6), 2: swing(1e-4, 1e-6)}
    assert "by more than 0.029 %" in answers(drive)[1]["wheel_once_per_turn"]


@pytest.mark.parametrize("step_s", [2.0, 6.0, 10.0])
def test_a_step_of_the_speed_is_sought_where_small_slips_of_all_axles_step(step_s):
    rng = np.random.default_rng(5)
    drive = Drive()
    drive.slip = drive.slip + np.where(drive.t_s >= step_s, 0.01, 0.0)
    drive.slip = drive.slip + 0.002 * rng.standard_normal(ROWS)
    assert find_step_time(drive) == pytest.approx(step_s, abs=0.6)
    (candidate,) = [one for one in answers(drive)[0]["speed_error"] if one.effect.form == "step"]
    assert candidate.starts == ((find_step_time(drive),),)


def test_with_few_small_slips_the_step_is_sought_in_the_middle():
    drive = Drive(adhesion=np.where(np.arange(ROWS) < 49, 0.0, 0.3))
    assert find_step_time(drive) == pytest.approx(np.mean(drive.t_s))
