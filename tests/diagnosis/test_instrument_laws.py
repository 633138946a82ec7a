"""Errors of the instruments by laws: simulated with a size, named alone with that size.

The simulator adds the error by the definition that the diagnosis removes, so this shows that what
is defined is found and told from everything else, not that the mechanism is right.
"""

import pytest

from adhesion_can.cli.main import main
from tests.diagnosis.diagnosis_helpers import diagnosed

SEEDS = (1, 2)
KINDS = (
    ("load_transfer:geometry=1", {"size": 1.0}),
    ("effort_gain:axle=0.08,axle=4", {"gain": 0.08, "axle": 4.0}),
    ("effort_gain:heat=0.1", {"gain": 0.1, "time": 60.0}),
    ("effort_gain:time=5e-4", {"rate": 5e-4}),
    ("speed_error:step=0.01,time=100", {"error": 0.01, "time": 100.0}),
    ("speed_error:pitch=0.05", {"error": 0.05}),
    ("speed_error:offset=1.5", {"offset": 1.5}),
    ("speed_error:curvature=2", {"offset": 2.0}),
    ("speed_error:low_pass=0.35", {"time": 0.35}),
    ("speed_error:low_pass=0.5", {"time": 0.5}),
    ("curving_resistance=4", {"size": 4.0}),
    ("brake_blending:constant=0.2", {"share": 0.2}),
    ("brake_blending:fade=0.3", {"share": 0.3, "fade": 15.0}),
    ("brake_blending:fade=1.2,fade=12", {"share": 1.2, "fade": 12.0}),
    ("wheel_once_per_turn=0.006,phase=2,axle=3", {"amplitude": 0.006, "phase": 2.0, "axle": 3.0}),
)
ALIKE = ("brake_blending:constant", "effort_gain:time")
"""Effects that another one equals in all signals: the two are rivals."""


def answer_of(folder, effect, seed, duration_s=240):
    path = folder / "drive.log"
    options = ["--scenario", "sweep", "--duration", str(duration_s), "--seed", str(seed)]
    assert main(["simulate", *options, "--effect", effect, "--log", str(path)]) == 0
    return diagnosed(folder, path)


def check(answer, effect, wanted):
    name = effect.partition("=")[0].partition(":")[0]
    assert answer.verdict == "named", answer.out
    (cause,) = answer.document["causes"]
    if effect.startswith(ALIKE):
        assert name in {cause["effect"], *cause["rivals"]}, answer.out
    else:
        assert cause["effect"] == name, answer.out
        assert cause["rivals"] == [], answer.out
    for parameter, size in wanted.items() if cause["effect"] == name else ():
        found = cause["parameters"][parameter]
        within = max(0.2 * abs(size), 3.0 * (found["std"] or 0.0))
        assert found["value"] == pytest.approx(size, abs=within), (parameter, answer.out)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("effect", "wanted"), KINDS, ids=[kind for kind, _ in KINDS])
def test_a_law_is_named_alone_with_its_size(effect, wanted, seed, tmp_path):
    check(answer_of(tmp_path, effect, seed), effect, wanted)


@pytest.mark.slow
def test_loads_that_move_unseen_are_named(tmp_path):
    effect, wanted = KINDS[0]
    check(answer_of(tmp_path, effect, 3, duration_s=120), effect, wanted)


@pytest.mark.slow
def test_a_users_formula_in_an_instrument_is_named(tmp_path):
    path = tmp_path / "drive.log"
    options = ["--scenario", "sweep", "--duration", "240", "--effect", "speed_error:offset=1.5"]
    assert main(["simulate", *options, "--log", str(path)]) == 0
    text = "speed: 1 + a * curvature_per_m where a=1"
    model = tmp_path / "model.toml"
    answer = diagnosed(tmp_path, path, "--formula", text, "--extended", model)
    (cause,) = answer.document["causes"]
    assert {"formula", "speed_error"} == {cause["effect"], *cause["rivals"]}, answer.out
    if cause["effect"] == "formula":
        assert 'acts_on = "speed"' in model.read_text()
        assert cause["parameters"]["a"]["value"] == pytest.approx(1.5, rel=0.1)
