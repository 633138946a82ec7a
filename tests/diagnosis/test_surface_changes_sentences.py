"""Times of surface changes, and sentences without gaps."""

from itertools import permutations

import numpy as np
import pytest

from adhesion_can.config import load_configuration
from adhesion_can.diagnosis.cause_result import Cause, ParameterValue
from adhesion_can.diagnosis.drive.from_traces import build_drive_data_from_traces
from adhesion_can.diagnosis.inference.candidates import build_candidates
from adhesion_can.diagnosis.inference.judge_surface_changes import merge_surfaces
from adhesion_can.diagnosis.regression.find_surface_changes import (
    EXCLUDED_AROUND_S,
    build_regression_data,
    find_surface_changes,
)
from adhesion_can.diagnosis.regression.model import EXCLUDED
from adhesion_can.diagnosis.sentences import cause_sentence, separation_sentence
from adhesion_can.offline.load_traces import load_traces
from adhesion_can.physics.effects import EFFECTS
from adhesion_can.physics.effects.shape_factor import CURVE_SHAPE
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.recordings.recording import Recording
from tests.diagnosis.bad_logs import write
from tests.diagnosis.diagnosis_helpers import SLIP_MAX, V_MIN, SyntheticDrive
from tests.worlds.plant import drive as run_drive
from tests.worlds.world import World

IDS = list(dict.fromkeys(effect.id for effect in EFFECTS))


def build_drive_of_world(kind, seed, folder, duration_s, names=()):
    """Drive data of a world, and the times at which its surface changes."""
    world = World(kind, seed, 0, duration_s)
    hidden = (*world.shape, *world._sized(names, (0.1, 0.6))[0])
    readings = run_drive(world.profile, world.vehicle, world.rail, hidden, world.noise)
    path = write(folder / "a.log", readings)
    config = load_configuration(None)
    loaded = load_traces(Recording(path).blocks(), config, "a.log")
    made = build_drive_data_from_traces("a.log", loaded.traces(), config.vehicle, V_MIN, SLIP_MAX)
    return made, list(world.rail.begins_s[1:])


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_surface_changes_are_found_where_they_are(seed, tmp_path):
    drive, true = build_drive_of_world("null:surfaces", seed, tmp_path, 120.0)
    found = find_surface_changes(drive, build_candidates([drive])[0])
    # Where nothing is pulled nothing is seen: a change may be found a coasting phase late.
    for time in true:
        assert min(abs(time - t) for t in found) < 8.0
    assert len(found) <= len(true) + 1


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("null:1", ()),
        pytest.param("null:0", (), marks=pytest.mark.slow),
        pytest.param("null:5", (), marks=pytest.mark.slow),
        pytest.param("humidity", ("humidity",), marks=pytest.mark.slow),
        pytest.param("sanding", ("sanding",), marks=pytest.mark.slow),
        pytest.param("slow_drift", ("slow_drift",), marks=pytest.mark.slow),
    ],
)
def test_a_surface_that_stays_the_same_has_no_changes(kind, names, tmp_path):
    drive, _ = build_drive_of_world(kind, 4, tmp_path, 120.0, names)
    assert find_surface_changes(drive, build_candidates([drive])[0]) == []


@pytest.mark.costly
def test_another_contact_is_no_surface_that_changes(tmp_path):
    """Of 24 drives on contacts that are not Burckhardt's two have a change, of these three none.

    The best Burckhardt curve depends on what was driven: without splines two of the three had some.
    """
    changes = []
    for seed in (5, 6, 7):
        drive, _ = build_drive_of_world("contact:extended", seed, tmp_path, 240.0)
        changes.append(find_surface_changes(drive, build_candidates([drive])[0]))
    assert sum(bool(times) for times in changes) <= 1


def test_one_surface_takes_the_place_of_several():
    """Rows beside a change stay left out, and each drive keeps a surface of its own."""
    drives = tuple(
        build_drive_data_from_traces(
            name, SyntheticDrive(20.0).traces(), Locomotive(), V_MIN, SLIP_MAX
        )
        for name in ("a", "b")
    )
    data = build_regression_data(drives, [[8.0], [5.0, 12.0]])
    merged = merge_surfaces(data)
    assert data.surfaces == 5
    assert merged.surfaces == 2
    assert np.array_equal(merged.surface == EXCLUDED, data.surface == EXCLUDED)
    first = merged.surface[: len(drives[0])]
    assert set(first[first != EXCLUDED].tolist()) == {0}
    assert set(merged.surface[len(drives[0]) :].tolist()) == {EXCLUDED, 1}


def test_rows_beside_a_change_belong_to_no_surface():
    drive = SyntheticDrive(30.0, axles=2).build_drive_data()
    data = build_regression_data((drive, drive), [[10.0, 18.0], []])
    assert data.surfaces == 4
    first, second = np.split(data.surface, 2)
    t = drive.t_s
    assert (second == 3).all()
    near = np.minimum(np.abs(t - 10.0), np.abs(t - 18.0)) < EXCLUDED_AROUND_S
    assert (first[near] == EXCLUDED).all()
    assert (first[~near] == np.searchsorted([10.0, 18.0], t[~near])).all()


@pytest.mark.parametrize("effect", IDS)
def test_for_every_rival_there_is_something_to_do(effect):
    sentences = {rival: separation_sentence(effect, [rival]) for rival in IDS if rival != effect}
    for rival, words in sentences.items():
        sentence = words.removeprefix(f"to distinguish {effect} from {rival}, record ")
        assert words != sentence
        assert len(sentence) > 25
        assert "None" not in sentence


def test_no_two_are_to_vary_independently_of_themselves():
    for one, other in permutations(IDS, 2):
        sentence = separation_sentence(one, [other]).split(", record ", 1)[1]
        if "independently" in sentence:
            what = sentence.removeprefix("a drive in which ").split(" vary independently")[0]
            words = what.split(" and ")
            halves = (" and ".join(words[:k]) for k in range(1, len(words)))
            assert not any(what == f"{half} and {half}" for half in halves), (one, other)


def test_of_several_rivals_none_is_forgotten():
    """Words are known for a pair of them: the others need some as well."""
    sentence = separation_sentence("effort_delay", ["creep_relaxation", "speed_delay"])
    assert "third" in sentence
    assert len(sentence) > len(separation_sentence("effort_delay", ["creep_relaxation"])) + 20


@pytest.mark.parametrize("alone", [True, False])
def test_the_peak_of_a_shape_beside_effects_is_said_to_be_without_them(alone):
    """Beside a load dependence a tyre's curve peaked at half of what was measured."""
    names = ("mu_max_before", "mu_max_after", "lambda_m_before", "lambda_m_after")
    peak = tuple(ParameterValue(name, 0.3, 0.01, "1", name) for name in names)
    shape = Cause(CURVE_SHAPE, "polach", "the contact is another one", "", peak, 0.001, ())
    assert ("of the curve alone" in cause_sentence(shape, alone=alone)) is not alone
