"""Heat of slip work, sand at some axles, and rain: simulated, named alone, replayed.

The simulator has the formulas of the effects here: what is tested is the way from a drive to the
named cause and its size, and on to the service.
"""

import pytest

from adhesion_can.cli.main import main
from tests.diagnosis.diagnosis_helpers import diagnosed

DURATION_S = 240.0
SHARE, STD_DEVIATIONS = 0.2, 3.0
"""A size is right within a share of it, or within its own standard deviations."""
HIDDEN = {
    "contact_heating": {"loss": 1e-6, "time": 2.0},
    "contact_heating=4e-7,time=5": {"loss": 4e-7, "time": 5.0},
    "sanding:axles=0.15": {"gain": 0.15, "time": 2.0, "axle": 4},
    "sanding:axles=0.2,axle=1,time=5": {"gain": 0.2, "time": 5.0, "axle": 1},
    "rain=-0.1": {"gain": -0.1},
    "rain:steps=-0.15,ratio=1.2": {"gain": -0.15, "ratio": 1.2},
}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [11, 12])
@pytest.mark.parametrize("option", HIDDEN)
def test_it_is_named_alone_with_its_size(option, seed, tmp_path):
    log = tmp_path / "drive.log"
    drive = ["simulate", "--scenario", "sweep", "--duration", str(DURATION_S), "--seed", str(seed)]
    assert main([*drive, "--effect", option, "--log", str(log)]) == 0
    answer = diagnosed(tmp_path, log)
    assert answer.verdict == "named", answer.out
    (cause,) = answer.document["causes"]
    effect, _, form = option.partition("=")[0].partition(":")
    assert (cause["effect"], cause["rivals"]) == (effect, [])
    assert not form or cause["form"] == form
    for name, true in HIDDEN[option].items():
        found = cause["parameters"][name]
        std = found["std"] or 0.0
        off = abs(found["value"] - true)
        assert off <= max(SHARE * abs(true), STD_DEVIATIONS * std), (name, found)
