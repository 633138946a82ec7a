"""A rail that is not Burckhardt's, from the doubt to the model that ends it."""

import json
from pathlib import Path

import numpy as np
import pytest

from adhesion_can import replay
from adhesion_can.cli.main import main
from tests.cli.played_bus import PlayedBus, run_on_recording

SETTLED_S = 20.0


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_rail_in_polachs_form_is_doubted_until_a_model_has_its_shape(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, model, answer = (tmp_path / name for name in ("drive.log", "model.toml", "answer.json"))
    truth = tmp_path / "truth.json"
    simulate = ["simulate", "--scenario", "polach-wet", "--duration", "50", "--seed", str(seed)]
    assert main([*simulate, "--log", str(log), "--truth", str(truth)]) == 0
    (rail,) = json.loads(truth.read_text())["surfaces"]

    # The service by itself: Burckhardt's curve is in doubt, and another family gives the peak.
    plain = run_on_recording(monkeypatch, log)
    assert np.mean(late(plain, "AdhesionQuality", "Doubt") == "shape of the curve") > 0.9
    # Over nine seeds 0.31, 0.61, 0.84 and six times more than 0.85 of the setpoints.
    assert np.mean(late(plain, "AdhesionSetpoint", "Status") == "TRACKING") > 0.2
    again = replay(log)
    sure = (again["time_s"] - again["time_s"][0] > SETTLED_S) & (again["status"] == "TRACKING")
    assert np.mean(again["family"][sure] == "polach") > 0.9
    assert_right(plain, rail)

    assert main(["diagnose", str(log), "--extended", str(model), "--json", str(answer)]) == 0
    named = [cause["effect"] for cause in json.loads(answer.read_text())["causes"]]
    assert named == ["curve_shape"]

    # With the model the doubt is gone, and the peak is known.
    extended = run_on_recording(monkeypatch, log, "--model", str(model), until_s=36.0)
    assert set(late(extended, "AdhesionQuality", "Doubt")) == {"none"}
    assert np.mean(late(extended, "AdhesionSetpoint", "Status") == "TRACKING") > 0.95
    assert_right(extended, rail)


def late(bus: PlayedBus, message: str, signal: str) -> np.ndarray:
    """Values of a signal that were sent after the first seconds."""
    return bus.texts(message, signal)[bus.time_s(message) > SETTLED_S]


def assert_right(bus: PlayedBus, rail: dict[str, float]) -> None:
    """Peaks sent while TRACKING within their standard deviations.

    A speed other than the truth's moves them little.
    """
    at, std_at = bus.time_s("AdhesionSetpoint"), bus.time_s("AdhesionQuality")
    rows = (at > SETTLED_S) & (bus.texts("AdhesionSetpoint", "Status") == "TRACKING")
    for value, std, truth, least in (
        ("MuMax", "MuMaxStd", rail["mu_max"], 0.03),
        ("LambdaM", "LambdaMStd", rail["lambda_m"], 0.15),
    ):
        error = np.abs(bus.numbers("AdhesionSetpoint", value)[rows] - truth)
        stds = np.interp(at[rows], std_at, bus.numbers("AdhesionQuality", std))
        assert (error < np.fmax(3.0 * stds, least * truth)).all()
