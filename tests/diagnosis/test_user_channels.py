"""Columns and texts that a user brings: causes on the same footing as the library's effects.

The tables are made here by formulas of the tests' own.
"""

import numpy as np
import pytest

from adhesion_can.api.identification import identify
from adhesion_can.config.model_file import read_model
from tests.diagnosis.diagnosis_helpers import burckhardt, diagnosed, write_table
from tests.seeds import first_quick

ROWS, SWEEPS = 2400, 24


def rig(seed, *, noise=0.012):
    """Slip sweeps of a rig in traction and braking, and its columns by name."""
    rng = np.random.default_rng(seed)
    own = np.linspace(0.0, 2.0 * np.pi, ROWS // SWEEPS, endpoint=False)
    slip = np.concatenate([0.12 * np.sin(own)] * SWEEPS)
    t_s = np.arange(ROWS) * 0.05 + np.repeat(np.arange(SWEEPS) * 5.0, ROWS // SWEEPS)
    sweep = np.repeat(np.arange(SWEEPS), ROWS // SWEEPS)
    white = noise * rng.standard_normal(ROWS)
    return rng, t_s, slip, sweep, burckhardt(slip), white


def table_of(t_s, slip, adhesion, **columns):
    return {"time_s": t_s, "slip": slip, "adhesion": adhesion, **columns}


def per_sweep(values, sweep):
    return np.asarray(values)[sweep]


def causes(answer):
    return {cause["effect"]: cause for cause in answer.document["causes"]}


@pytest.mark.costly
@pytest.mark.parametrize("seed", first_quick(range(5)))
def test_a_column_that_matters_is_named_with_its_size(tmp_path, seed):
    rng, t_s, slip, sweep, curve, white = rig(seed)
    x1 = per_sweep(rng.normal(size=SWEEPS), sweep)
    x2 = per_sweep(rng.normal(size=SWEEPS), sweep)
    adhesion = (1.0 + 0.06 * x1) * curve + white
    answer = diagnosed(
        tmp_path, write_table(tmp_path / "t.csv", table_of(t_s, slip, adhesion, x1=x1, x2=x2))
    )
    assert list(causes(answer)) == ["channel:x1"], answer.out
    slope = causes(answer)["channel:x1"]["parameters"]["slope"]
    # A slope about the mean of x1 is 0.06 over the factor there.
    truth = 0.06 / (1.0 + 0.06 * x1.mean())
    assert abs(slope["value"] - truth) < 4.0 * slope["std"] + 0.02 * abs(truth)
    assert slope["std"] < 0.01


@pytest.mark.slow
def test_columns_that_do_not_matter_are_seldom_named(tmp_path):
    """Twelve nulls with three columns each: a name in one at most (5 % are allowed)."""
    named = 0
    for seed in range(100, 112):
        rng, t_s, slip, sweep, curve, white = rig(seed)
        columns = {f"x{k}": per_sweep(rng.normal(size=SWEEPS), sweep) for k in range(3)}
        table = table_of(t_s, slip, curve + white, **columns)
        answer = diagnosed(tmp_path, write_table(tmp_path / "t.csv", table))
        named += bool(answer.document["causes"])
    assert named <= 1


def test_a_number_that_stands_for_a_surface_has_a_step_at_each_value(tmp_path):
    rng, t_s, slip, sweep, curve, white = rig(7)
    kind = per_sweep(rng.permutation(np.arange(SWEEPS) % 3 + 1), sweep)
    adhesion = np.where(kind == 2, 0.8, 1.0) * curve + white
    answer = diagnosed(
        tmp_path, write_table(tmp_path / "t.csv", table_of(t_s, slip, adhesion, surface=kind))
    )
    (cause,) = answer.document["causes"]
    assert (cause["effect"], cause["form"]) == ("channel:surface", "step")
    values = cause["parameters"]
    assert values["reference"]["value"] == 2.0
    assert abs(values["gain"]["value"] + 0.2) < 4.0 * values["gain"]["std"]
    assert "where surface is 2" in answer.out


def test_two_values_of_one_column_can_be_causes_together(tmp_path):
    rng, t_s, slip, sweep, curve, white = rig(8)
    kind = per_sweep(rng.permutation(np.arange(SWEEPS) % 4), sweep)
    adhesion = np.select([kind == 1, kind == 2], [0.75, 1.2], 1.0) * curve + white
    answer = diagnosed(
        tmp_path, write_table(tmp_path / "t.csv", table_of(t_s, slip, adhesion, surface=kind))
    )
    found = {c["parameters"]["reference"]["value"] for c in answer.document["causes"]}
    assert found == {1.0, 2.0}, answer.out


@pytest.mark.costly
def test_a_column_of_texts_groups_the_rows(tmp_path):
    rng, t_s, slip, sweep, curve, white = rig(9)
    wet = per_sweep(rng.permutation(np.arange(SWEEPS) % 2), sweep)
    rail = np.where(wet == 1, "wet", "dry")
    adhesion = np.where(wet == 1, 0.85, 1.0) * curve + white
    table = table_of(t_s, slip, adhesion, rail=rail.tolist())
    answer = diagnosed(tmp_path, write_table(tmp_path / "t.csv", table))
    (cause,) = answer.document["causes"]
    assert cause["effect"] == "channel:rail=wet"
    assert any(
        one.startswith("Adhesion changes where rail is wet (gain")
        for one in answer.document["wrong"]
    )
    assert cause["parameters"]["gain"]["value"] == pytest.approx(-0.15, abs=0.02)


@pytest.mark.costly
def test_a_measured_column_is_preferred_to_mere_time(tmp_path):
    """A column that runs with time explains as much as time does: the column is the cause."""
    rng, t_s, slip, _, curve, white = rig(10)
    temperature = 20.0 + 0.1 * t_s + 0.3 * rng.standard_normal(ROWS)
    adhesion = (1.0 - 0.01 * (temperature - 20.0)) * curve + white
    columns = {"oil_temperature": temperature}
    answer = diagnosed(
        tmp_path, write_table(tmp_path / "t.csv", table_of(t_s, slip, adhesion, **columns))
    )
    assert "channel:oil_temperature" in causes(answer), answer.out
    assert "slow_drift" not in causes(answer)


@pytest.mark.costly
@pytest.mark.parametrize("seed", first_quick([20, 21, 22]))
def test_a_column_in_steps_that_goes_with_time_is_named_with_time_as_its_rival(tmp_path, seed):
    """Three blocks of a test plan: what a smooth drift fits better may still be the column."""
    rng, t_s, slip, sweep, curve, white = rig(seed)
    angle = -2.4 * (sweep // 8) + 0.02 * rng.standard_normal(ROWS)
    adhesion = (1.0 + 0.01 * angle - 0.001 * t_s) * curve + white
    answer = diagnosed(
        tmp_path, write_table(tmp_path / "t.csv", table_of(t_s, slip, adhesion, angle=angle))
    )
    assert "slow_drift" not in causes(answer), answer.out
    assert "slow_drift" in causes(answer)["channel:angle"]["rivals"]


@pytest.mark.costly
def test_another_measurement_of_the_force_is_no_cause(tmp_path):
    rng, t_s, slip, sweep, curve, white = rig(11)
    adhesion = (1.0 + 0.05 * per_sweep(rng.normal(size=SWEEPS), sweep)) * curve + white
    table = table_of(t_s, slip, adhesion, torque=adhesion * 3.0 + 0.001 * rng.standard_normal(ROWS))
    answer = diagnosed(tmp_path, write_table(tmp_path / "t.csv", table))
    assert "channel:torque" not in causes(answer)
    why = {one["what"]: one["why"] for one in answer.document["untested"]}
    assert "another measurement of the same quantity is not a cause" in why["channel:torque"]


@pytest.mark.costly
def test_the_model_file_carries_a_channel_and_identify_removes_it(tmp_path):
    rng, t_s, slip, sweep, curve, white = rig(12)
    x1 = per_sweep(rng.normal(size=SWEEPS), sweep)
    path = write_table(
        tmp_path / "t.csv", table_of(t_s, slip, (1.0 + 0.1 * x1) * curve + white, x1=x1)
    )
    model = tmp_path / "m.toml"
    answer = diagnosed(tmp_path, path, "--extended", str(model))
    assert answer.status == 0, answer.err
    (active,) = read_model(model).effects
    assert active.effect.id == "channel:x1"
    plain, extended = (identify(path, model=one).whole.noise_std for one in (None, model))
    assert extended < 0.7 * plain
    assert extended == pytest.approx(0.012, rel=0.1)


@pytest.mark.costly
def test_a_channel_that_one_table_lacks_is_not_tested(tmp_path):
    paths = []
    for seed, columns in ((13, {"x1": 1}), (14, {})):
        rng, t_s, slip, sweep, curve, white = rig(seed)
        own = {name: per_sweep(rng.normal(size=SWEEPS), sweep) for name in columns}
        table = table_of(t_s, slip, curve + white, **own)
        paths.append(write_table(tmp_path / f"{seed}.csv", table))
    answer = diagnosed(tmp_path, *paths)
    why = {one["what"]: one["why"] for one in answer.document["untested"]}
    assert "14.csv does not have it" in why["channel:x1"]


@pytest.mark.costly
def test_the_terminal_says_what_is_left_and_with_what_it_goes(tmp_path):
    """Beside a named column another one acts in a way that no factor describes."""
    rng, t_s, slip, sweep, curve, white = rig(15)
    x1, x2 = (per_sweep(rng.uniform(-1.0, 1.0, SWEEPS), sweep) for _ in range(2))
    adhesion = (1.0 + 0.3 * x1) * (1.0 + 0.06 * np.cos(4.0 * x2)) * curve + white
    path = write_table(tmp_path / "t.csv", table_of(t_s, slip, adhesion, x1=x1, x2=x2))
    answer = diagnosed(tmp_path, path)
    assert "channel:x1" in causes(answer), answer.out
    assert "The residual depends on x2" in " ".join(answer.out.split())


@pytest.mark.costly
@pytest.mark.parametrize("seed", first_quick([21, 22]))
def test_a_column_is_named_beside_two_effects_of_the_library(tmp_path, seed):
    rng, t_s, slip, sweep, curve, white = rig(seed)
    x1, load = (per_sweep(rng.uniform(low, high, SWEEPS), sweep) for low, high in ((-1, 1), (2, 6)))
    factor = (load / 4.0) ** -0.4 * np.where(slip < 0.0, 0.8, 1.0) * (1.0 + 0.15 * x1)
    table = table_of(t_s, slip, factor * curve + white, normal_load_N=1e3 * load, x1=x1)
    found = causes(diagnosed(tmp_path, write_table(tmp_path / "t.csv", table)))
    # A friction brake that takes a share of the force is an asymmetry of the adhesion.
    (braking,) = set(found) - {"load_dependence", "channel:x1"}
    assert {"traction_braking_asymmetry", "brake_blending"} <= {braking, *found[braking]["rivals"]}
    slope = found["channel:x1"]["parameters"]["slope"]
    assert slope["value"] == pytest.approx(0.15 / (1.0 + 0.15 * x1.mean()), abs=0.03)


@pytest.mark.parametrize("seed", range(40, 45))
def test_the_levels_of_a_few_sweeps_are_no_drift(tmp_path, seed):
    """Six sweeps with pauses that happen to fall with time, as one in 720 orders does by chance."""
    rng, t_s, slip, sweep, curve, white = rig(seed)
    rows = sweep < 6
    level = 1.0 - 0.04 * sweep + 0.01 * per_sweep(rng.normal(size=SWEEPS), sweep)
    table = table_of(t_s[rows], slip[rows], (level * curve + white)[rows])
    answer = diagnosed(tmp_path, write_table(tmp_path / "t.csv", table))
    assert "slow_drift" not in causes(answer), answer.out
    assert "6 series with pauses between them" in answer.untested["slow_drift"]


@pytest.mark.parametrize("pause_s", [0.0, 5.0])
def test_a_drift_over_many_sweeps_or_without_a_pause_is_named(tmp_path, pause_s):
    _, _, slip, sweep, curve, white = rig(46)
    t_s = np.arange(ROWS) * 0.05 + pause_s * sweep
    adhesion = (1.0 - 0.15 * t_s / t_s[-1]) * curve + white
    answer = diagnosed(tmp_path, write_table(tmp_path / "t.csv", table_of(t_s, slip, adhesion)))
    assert list(causes(answer)) == ["slow_drift"], answer.out
