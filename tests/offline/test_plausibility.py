"""Signs, units, stuck and repeated rows, found before anything is fitted."""

import numpy as np
import pytest

from adhesion_can.cli.main import main
from adhesion_can.offline.plausibility import inspect_points, longest_run
from adhesion_can.offline.points import MeasuredPoints
from tests.seeds import first_quick

N = 600


def points(seed=1, *, table=True, **changes):
    """A sound drive of one axle: creep in traction and braking."""
    rng = np.random.default_rng(seed)
    t = np.arange(N) * 0.05
    slip = 0.08 * np.sin(2 * np.pi * t / 7.0)
    size = np.abs(slip)
    adhesion = np.sign(slip) * (0.35 * (1 - np.exp(-40 * size)) - 0.4 * size)
    given = {
        "slip": slip + 0.0005 * rng.standard_normal(N),
        "adhesion": adhesion + 0.01 * rng.standard_normal(N),
        "t_us": np.round(t * 1e6).astype(np.int64),
        "speed": 12.0 + np.sin(t / 9.0),
        "load": np.full(N, 245e3),
    }
    given |= {name: change(given[name]) for name, change in changes.items()}
    return MeasuredPoints(**given, table=table)


def stuck(values):
    values = values.copy()
    values[200:300] = values[200]
    return values


FATAL = {
    "slip reversed": ({"slip": np.negative}, "opposite signs"),
    "force reversed": ({"adhesion": np.negative}, "opposite signs"),
    "slip in percent": ({"slip": lambda x: 100 * x}, "the slip reaches"),
    "slip in permille": ({"slip": lambda x: 1000 * x}, "the slip reaches"),
    "load in kN": ({"adhesion": lambda x: 1000 * x, "load": lambda x: x / 1000}, "unit=kN"),
    "load in t": ({"adhesion": lambda x: 9807 * x, "load": lambda x: x / 9807}, "unit=t"),
    "load in kg": ({"adhesion": lambda x: 9.81 * x, "load": lambda x: x / 9.81}, "unit=kg"),
    "force in kN": ({"adhesion": lambda x: x / 1000}, "if the force is in kN"),
    "speed far off": ({"speed": lambda x: 20 * x}, "km/h"),
}
TOLD = {
    "both in kN": ({"load": lambda x: x / 1e4}, "the load is about"),
    "speed in km/h": ({"speed": lambda x: 3.6 * x + 10.0}, "unit=km/h"),
    "stamps repeated": (
        {"t_us": lambda t: t // 200_000 * 200_000},
        "the same stamp as the previous row",
    ),
    "slip stuck": ({"slip": stuck}, "the slip stays at"),
    "adhesion stuck": ({"adhesion": stuck}, "the adhesion stays at"),
}


@pytest.mark.parametrize("seed", range(20))
def test_sound_data_have_no_findings(seed):
    assert inspect_points(points(seed)) == []
    assert inspect_points(points(seed, table=False)) == []


@pytest.mark.parametrize("kind", [*FATAL, *TOLD])
@pytest.mark.parametrize("seed", range(3))
def test_a_fault_is_one_sentence_with_its_fix(kind, seed):
    changes, says = (FATAL | TOLD)[kind]
    (finding,) = inspect_points(points(seed, **changes))
    assert says in finding.sentence
    assert finding.fatal is (kind in FATAL)
    assert "\n" not in finding.sentence
    assert finding.fix


@pytest.mark.parametrize("seed", range(5))
def test_slips_in_percent_are_seen_where_none_exceeds_one(seed):
    """A vehicle that never uses much adhesion: its percents look like ratios, but are linear."""
    rng = np.random.default_rng(seed)
    slip = 0.004 * rng.standard_normal(N)
    adhesion = 15.0 * slip + 0.01 * rng.standard_normal(N)
    measured = slip + 0.001 * rng.standard_normal(N)
    assert inspect_points(MeasuredPoints(measured, adhesion)) == []
    (finding,) = inspect_points(MeasuredPoints(100.0 * measured, adhesion))
    assert "slip=slip,unit=percent" in finding.fix
    assert finding.fatal


@pytest.mark.parametrize("seed", range(5))
def test_large_slips_of_a_real_contact_are_no_percent(seed):
    """A model car with slips to 0.9, and a locked wheel on ice."""
    rng = np.random.default_rng(seed)
    slip = rng.uniform(-0.9, 0.9, N)
    for peak, steepness in ((0.8, 15.0), (0.05, 300.0), (0.03, 50.0)):
        size = np.abs(slip)
        adhesion = np.sign(slip) * peak * (1.0 - np.exp(-steepness * size))
        adhesion += 0.005 * rng.standard_normal(N)
        assert inspect_points(MeasuredPoints(slip, adhesion)) == []


def test_a_load_that_may_be_of_two_units_is_told_with_both():
    (finding,) = inspect_points(points(adhesion=lambda x: 1000 * x / 2, load=lambda x: x / 1000))
    assert "unit=kN" in finding.fix
    (finding,) = inspect_points(points(adhesion=lambda x: 7000 * x, load=lambda x: x / 7000))
    assert "unit=kN; if it is in t, unit=t" in finding.fix


@pytest.mark.parametrize("kind", FATAL)
def test_of_a_recording_no_columns_are_named(kind):
    changes, _ = FATAL[kind]
    (finding,) = inspect_points(points(table=False, **changes))
    assert "--column" not in finding.sentence


@pytest.mark.parametrize("seed", range(5))
def test_slips_of_a_wheel_that_spins_are_no_percent(seed):
    """A car on ice: its wheels turn up to six times as fast as it moves."""
    rng = np.random.default_rng(seed)
    slip = np.exp(rng.uniform(np.log(0.02), np.log(6.0), N))
    adhesion = 0.2 * (1.0 - np.exp(-40.0 * slip)) + 0.01 * rng.standard_normal(N)
    (finding,) = inspect_points(MeasuredPoints(slip, adhesion))
    assert "the wheel spins" in finding.what
    assert not finding.fatal
    # The same numbers as percent: at a tenth of a percent there is no adhesion yet.
    adhesion = 0.2 * (1.0 - np.exp(-0.4 * slip)) + 0.01 * rng.standard_normal(N)
    (finding,) = inspect_points(MeasuredPoints(slip, adhesion))
    assert "unit=percent" in finding.fix
    assert finding.fatal


def test_a_racing_tyre_is_named_beside_the_unit_that_would_fit_too():
    tyre = points(adhesion=lambda x: 12 * x, load=lambda x: x / 50)
    (finding,) = inspect_points(tyre)
    assert "which only a racing tyre reaches" in finding.what
    assert "unit=kg" in finding.fix
    assert "unit=kN" not in finding.fix  # 5 MN
    assert finding.fatal


def late(seed, rows, step_s=0.05):
    """A drive whose slip swings by changing amounts, and is late by some rows."""
    rng = np.random.default_rng(seed)
    t = np.arange(2 * N) * step_s
    knots = np.arange(0.0, t[-1] + 5.0, 1.0)
    slip = np.interp(t, knots, 0.03 * rng.choice([-1.0, 1.0]) * (-1.0) ** np.arange(len(knots)))
    slip *= np.interp(t, knots, rng.uniform(0.6, 1.4, len(knots)))
    adhesion = np.sign(slip) * 0.3 * (1 - np.exp(-40 * np.abs(slip)))
    adhesion += 0.01 * rng.standard_normal(len(t))
    seen = np.interp(t - rows * step_s, t, slip) + 0.0005 * rng.standard_normal(len(t))
    return seen, adhesion, np.round(t * 1e6).astype(np.int64)


@pytest.mark.parametrize("seed", range(5))
def test_a_slip_late_by_half_a_swing_is_not_called_reversed(seed):
    slip, adhesion, t_us = late(seed, 20)
    (finding,) = inspect_points(MeasuredPoints(slip, adhesion, t_us))
    assert "opposite signs" in finding.what
    assert "the slip may lag the force by 1 s" in finding.what
    assert finding.fix.startswith("shift the late one")
    assert "sign=-1" not in finding.fix
    # Turned and in step: its sign explains all, and nothing is late.
    slip, adhesion, t_us = late(seed, 0)
    (finding,) = inspect_points(MeasuredPoints(-slip, adhesion, t_us))
    assert "sign=-1" in finding.fix
    assert "late" not in finding.sentence


@pytest.mark.parametrize("seed", range(10))
def test_a_border_of_two_surfaces_is_no_late_force(seed):
    """Slips that grow as the rail changes fit best at a shift; two rails explain them better."""
    rng = np.random.default_rng(seed)
    t = np.arange(N) * 0.05
    slip = 0.01 + 0.05 / (1 + np.exp(-(t - 14.0) / 0.5)) * rng.uniform(0.8, 1.2)
    slip += 0.004 * np.sin(2 * np.pi * t / 3.0)
    level = np.where(t < 15.2, 0.1, 0.35)
    adhesion = level * (1 - np.exp(-60 * slip)) + 0.005 * rng.standard_normal(N)
    slip = slip + 0.0005 * rng.standard_normal(N)
    t_us = np.round(t * 1e6).astype(np.int64)
    found = inspect_points(MeasuredPoints(slip, adhesion, t_us))
    assert not [one for one in found if one.fatal]


def test_coasting_and_small_slips_have_no_sign():
    """Noise around zero is of either sign, and says nothing."""
    rng = np.random.default_rng(4)
    idle = MeasuredPoints(0.0005 * rng.standard_normal(N), 0.01 * rng.standard_normal(N))
    assert inspect_points(idle) == []


def test_a_few_rows_are_not_judged():
    assert inspect_points(MeasuredPoints(np.full(5, 7.0), np.full(5, 50.0))) == []


def test_the_longest_run_is_one_in_which_the_other_column_moves():
    values = np.array([1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 3.0])
    still = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0])
    assert longest_run(values, still) == (2, 2.0)
    assert longest_run(values, np.arange(7.0)) == (4, 1.0)
    assert longest_run(np.arange(3.0), np.zeros(3)) is None


@pytest.mark.costly
@pytest.mark.parametrize(
    ("radius_m", "status"), first_quick([(0.33, 1), (0.625, 0), (0.57, 1), (0.605, 0)], 2)
)
def test_a_radius_that_a_rolling_wheel_contradicts_is_told(tmp_path, capsys, radius_m, status):
    """Whatever it is: 0.33 for 0.625 m is no known mistake."""
    log, config = tmp_path / "d.log", tmp_path / "c.toml"
    words = [
        "simulate",
        "--scenario",
        "sweep",
        "--duration",
        "40",
        "--seed",
        "1",
        "--log",
        str(log),
    ]
    assert main(words) == 0
    config.write_text(f"[vehicle]\nwheel_radius_m = {radius_m}\n")
    capsys.readouterr()
    assert main(["check", str(log), "--config", str(config)]) == status
    said = "".join(capsys.readouterr())
    told = f"while coasting, the rim speed is {radius_m / 0.625:.3f}"
    assert (told[:-1] in said) == (radius_m != 0.625)
    assert ("calibrate" in said) == (radius_m != 0.625)
