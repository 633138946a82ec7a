"""The page of a fleet: in a browser, its words, and its size for a large fleet."""

from dataclasses import replace

import pytest

from adhesion_can.fleet.overview import Failure, FleetOverview
from adhesion_can.fleet.page.build_page import fleet_page
from adhesion_can.fleet.page.words import left_out
from adhesion_can.fleet.pooled_diagnosis import diagnose_fleet
from adhesion_can.reporting.page import render, write_page
from tests.fleet.synthetic_overview import synthetic_overview
from tests.fleet.synthetic_units import Fleet
from tests.reporting.browser import require_drawn
from tests.reporting.test_page import nothing_is_loaded

MOST_BYTES = 6_000_000


@pytest.fixture(scope="module")
def overview():
    return synthetic_overview()


def cells(made, title):
    """Texts of all cells of a section's tables."""
    return [
        cell for part in made.sections[title] for row in getattr(part, "rows", ()) for cell in row
    ]


def test_the_page_is_drawn_wide_and_narrow_light_and_dark(browser, overview, tmp_path):
    made, path = fleet_page(overview, {"command": "none"}), tmp_path / "fleet.html"
    write_page(made, path)
    for width, dark in ((1280, False), (420, True)):
        browser.open(path, width, dark=dark)
        require_drawn(browser, made)
        assert browser.violations() == []


def test_the_worst_vehicles_come_first_with_their_causes(overview):
    made = fleet_page(overview, {})
    vehicles = [cell for cell in cells(made, "Vehicles")[::7] if cell]
    assert set(vehicles[:4]) == {"V03", "V11", "V20", "V21"}
    text = " ".join(cells(made, "Vehicles"))
    assert "wheel_radius axle 2" in text
    (worn,) = [f for f in overview.diagnosis.findings if f.where == "V20"]
    assert f"{100 * worn.pooled.value:.3f} ± {100 * worn.pooled.std:.3f} %" in text
    assert worn.pooled.std == pytest.approx(worn.std, rel=0.5)
    assert "4 of 30 vehicles differ from the others" in made.verdict[0]
    assert any("Line line1: speed_delay" in line for line in made.verdict)


def test_failed_recordings_are_listed_with_their_reasons(overview):
    made = fleet_page(overview, {})
    assert "holds no known frame" in " ".join(cells(made, "Failed recordings"))


def test_reasons_are_counted_without_the_names_of_files_and_with_the_kind_of_an_error(overview):
    bug = Failure("u", "V01", "KeyError: 'x' (core.py:12)")
    made = fleet_page(replace(overview, failures=(bug, *overview.failures), failed=3), {})
    said = made.sections["Failed recordings"][0].text
    assert "holds no known frame (check the database, or the bus of the recording): 2" in said
    assert "KeyError: 'x' (core.py:12): 1" in said


def test_a_fleet_without_positions_says_how_to_have_a_map():
    made = fleet_page(synthetic_overview(8, positions=False), {})
    assert "latitude_deg" in made.sections["Map"][0].text


def test_an_empty_fleet_has_a_page():
    assert "The comparison of vehicles finds nothing" in render(
        fleet_page(synthetic_overview(0), {})
    )


def test_nothing_is_loaded_from_elsewhere(overview):
    nothing_is_loaded(render(fleet_page(overview, {})))


@pytest.mark.slow
def test_a_page_of_ten_thousand_units_is_small(browser, tmp_path):
    made, path = fleet_page(synthetic_overview(5000), {}), tmp_path / "fleet.html"
    write_page(made, path)
    assert path.stat().st_size < MOST_BYTES
    browser.open(path)
    require_drawn(browser, made)


def test_causes_that_recordings_name_by_themselves_are_told_apart():
    units = [
        replace(one, causes=("load_dependence",) if one.vehicle == "V01" else ())
        for one in Fleet(vehicles=2, drives=2).draw(1)
    ]
    made = fleet_page(FleetOverview(diagnose_fleet(units)), {})
    assert any("V01: load_dependence, 2 of 2 recordings" in line for line in made.verdict)
    assert made.verdict[0] == "2 vehicles are too few to be compared with each other."
    assert cells(made, "Vehicles") == ["V01", "load_dependence", "-", "2 of 2"]
    assert "Nothing is named on the other vehicle." in render(made)


def test_one_of_a_thing_is_told_in_singular():
    units = Fleet(vehicles=1, drives=1).draw(1)
    made = fleet_page(FleetOverview(diagnose_fleet(units)), {})
    assert made.lead.startswith("1 recording of 1 vehicle, 1 with evidence")
    assert "The comparison of vehicles finds nothing." in render(made)
    assert "the other vehicle" not in render(made)
    assert made.verdict[0] == "1 vehicle is too few to be compared with each other."
    assert left_out(61, 60, "kind") == "1 further kind is not shown; all are in fleet.json."
    assert left_out(62, 60, "kind").startswith("2 further kinds are not shown")
    assert not left_out(60, 60, "kind")


def test_one_vehicle_differs_from_the_others():
    result = diagnose_fleet(Fleet(worn={20: -0.013}).draw(5))
    assert len(result.named) == 1
    verdict = fleet_page(FleetOverview(result), {}).verdict
    assert verdict[0] == "1 of 30 vehicles differs from the others: wheel_radius 1."
