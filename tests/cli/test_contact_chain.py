"""A rail that is not Burckhardt's, from the doubt to the model that ends it."""

import json
from pathlib import Path

import numpy as np
import pytest

from adhesion_can import replay
from adhesion_can.cli.main import main


@pytest.mark.parametrize(
    "seed", [1, pytest.param(2, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.slow)]
)
def test_a_rail_in_polachs_form_is_doubted_until_a_model_has_its_shape(
    seed: int, tmp_path: Path
) -> None:
    log, model, answer = (tmp_path / name for name in ("drive.log", "model.toml", "answer.json"))
    simulate = ["simulate", "--scenario", "polach-wet", "--duration", "60", "--seed", str(seed)]
    assert main([*simulate, "--log", str(log)]) == 0

    # The service by itself: it says that the curve has another shape, and claims no peak for it.
    plain = replay(log)
    late = plain["time_s"] - plain["time_s"][0] > 20.0
    assert np.mean(plain["doubt"][late] == "SHAPE") > 0.9
    assert np.mean(plain["status"][late] == "TRACKING") < 0.3

    assert main(["diagnose", str(log), "--extended", str(model), "--json", str(answer)]) == 0
    named = [cause["effect"] for cause in json.loads(answer.read_text())["causes"]]
    assert named == ["curve_shape"]

    # With the model the doubt is gone, and the peak is known.
    extended = replay(log, model=model)
    assert set(extended["doubt"][late]) == {"NONE"}
    assert np.mean(extended["status"][late] == "TRACKING") > 0.95
    std = extended["lambda_m_std"][late] / extended["lambda_m"][late]
    assert std.max() < 0.15
    assert abs(extended["lambda_m"][late][-1] / plain["lambda_m"][late][-1] - 1.0) > 0.2
