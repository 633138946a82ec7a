"""Runs on surfaces in Polach's form: the truth, the frames, open and closed loop."""

import numpy as np
import pytest

import adhesion_can
from adhesion_can.bus.database import load_database
from adhesion_can.physics.burckhardt import adhesion, peak
from adhesion_can.physics.curves import FAMILIES, Conditions
from adhesion_can.physics.curves.same_peak import burckhardt_with_same_peak
from adhesion_can.physics.curves.surfaces import POLACH_RAIL
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import SCENARIOS, scenario_by_name

POLACH = [s for s in SCENARIOS if s.name.startswith("polach-")]


@pytest.mark.parametrize("surface", POLACH_RAIL, ids=lambda s: s.name)
def test_the_nearest_burckhardt_curve_has_the_same_peak_and_is_near_around_it(surface):
    conditions = Conditions(10.0, 245e3)
    top = surface.family.peak(surface.values, conditions)
    theta = burckhardt_with_same_peak(surface.family, surface.values, conditions)
    same = peak(*theta)
    assert float(same.mu_max) == pytest.approx(float(top.mu_max), rel=1e-6)
    assert float(same.lambda_m) == pytest.approx(float(top.lambda_m), rel=1e-6)
    slip = float(top.lambda_m) * np.linspace(0.5, 2.0, 20)
    curve = surface.family.adhesion(slip, surface.values, conditions)
    assert np.abs(adhesion(slip, *theta) - curve).max() < 0.03 * float(top.mu_max)


@pytest.mark.parametrize("scenario", POLACH, ids=lambda s: s.name)
def test_the_truth_has_the_family_its_parameters_and_its_peak(scenario):
    simulation = Simulation(RunSettings(scenario, 2.0), load_database())
    (surface,) = simulation.truth()["surfaces"]
    family = FAMILIES[surface["curve"]]
    values = [surface["parameters"][p.name] for p in family.parameters]
    slip = np.geomspace(1e-4, 1.0, 4001)
    at = surface["at"]
    curve = family.adhesion(slip, values, Conditions(at["speed_mps"], at["load_N"]))
    assert at["speed_mps"] == scenario.speed
    assert surface["mu_max"] == pytest.approx(curve.max(), rel=1e-5)
    assert surface["lambda_m"] == pytest.approx(slip[np.argmax(curve)], rel=0.01)
    top = peak(surface["c1"], surface["c2"], surface["c3"])
    assert float(top.mu_max) == pytest.approx(surface["mu_max"], rel=1e-6)
    assert "Polach" in surface["source"]


def test_the_wheels_are_on_the_curve():
    """The rail's force is the curve's at the slip and speed of the moment, whatever the load."""
    scenario = scenario_by_name("polach-dry")
    simulation = Simulation(RunSettings(scenario, 4.0, load_transfer=True), load_database())
    surface, plant = POLACH_RAIL[0], simulation.plant
    for i, _ in enumerate(simulation.run()):
        if i > 500 and i % 50 == 0:
            mu = surface.family.adhesion(
                plant.slip, surface.values, Conditions(plant.speed, plant.load)
            )
            np.testing.assert_allclose(plant.force / plant.load, mu, atol=0.012)
    assert np.ptp(plant.load) > 1e3


def test_a_closed_loop_holds_the_setpoint_on_such_a_contact():
    settings = RunSettings(scenario_by_name("polach-dry"), 6.0, obey=True)
    simulation = Simulation(settings, load_database())
    simulation._drive.update_command(0.0, known=True, creep_speed=0.25)
    for _ in simulation.run():
        pass
    creep = simulation.plant.slip * simulation.plant.speed
    np.testing.assert_allclose(creep, 0.25, rtol=0.05)


@pytest.mark.costly
def test_the_curve_is_identified_from_the_frames_of_such_a_run(tmp_path):
    """Burckhardt does not hold on it; the peak of Polach's form is the true one."""
    drive = adhesion_can.simulate("polach-dry", 8.0, seed=3)
    log = drive.write(tmp_path / "polach.log")
    names = ("burckhardt", "polach")
    results = {n: adhesion_can.identify(log, curve=n).curves[0] for n in names}
    rmse = {n: results[n].families[0].fit.rmse for n in names}
    assert rmse["polach"] < 0.9 * rmse["burckhardt"]
    assert results["polach"].families[0].log_density > (
        results["burckhardt"].families[0].log_density + 0.1
    )
    fit = results["polach"].families[0].fit
    surface = POLACH_RAIL[0]
    truth = surface.family.peak(surface.values, fit.conditions)
    assert fit.mu_max == pytest.approx(float(truth.mu_max), rel=0.01)
    assert fit.lambda_m == pytest.approx(float(truth.lambda_m), rel=0.05)
