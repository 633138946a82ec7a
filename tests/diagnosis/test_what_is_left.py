"""What is left judges the names: beside a large error of another origin a small gain has none."""

from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can import diagnose, simulate
from adhesion_can.diagnosis.inference import confirm_on_hold_out
from adhesion_can.diagnosis.inference.model_selection import ModelSelection
from adhesion_can.diagnosis.inference.sensor_noise import NoiseComparison
from adhesion_can.diagnosis.refutation import environments, refute


@pytest.fixture(scope="module")
def worn(tmp_path_factory):
    """A drive with a larger wheel at axle 2."""
    path = tmp_path_factory.mktemp("worn") / "worn.log"
    return simulate("sweep", 120.0, 1, effects=["wheel_radius=0.01,axle=2"]).write(path)


@pytest.mark.slow
def test_a_cause_is_named_where_noise_is_left(worn):
    assert [cause.effect for cause in diagnose(worn).causes] == ["wheel_radius"]


@pytest.mark.costly
@pytest.mark.slow
@pytest.mark.parametrize(("p_value", "is_named"), [(0.005, True), (0.02, False)])
def test_a_cause_is_named_at_the_one_percent_level(worn, monkeypatch, p_value, is_named):
    monkeypatch.setattr(ModelSelection, "p_value", lambda *_: p_value)
    assert [cause.effect for cause in diagnose(worn).causes] == ["wheel_radius"] * is_named


@pytest.mark.slow
def test_a_cause_with_too_small_a_share_is_the_closest(worn, monkeypatch):
    monkeypatch.setattr(refute, "LEAST_OF_EXCESS", 2.0)
    found = diagnose(worn)
    assert found.causes == ()
    (closest,) = (one for one in found.closest if one.effect == "wheel_radius")
    assert "of the residual beyond the sensor noise" in closest.refuted_by
    assert found.verdict.value == "unexplained"


@pytest.mark.costly
@pytest.mark.slow
def test_a_cause_that_gains_too_little_elsewhere_has_no_name(worn, monkeypatch):
    monkeypatch.setattr(confirm_on_hold_out, "LEAST_GAIN", 1.0)
    found = diagnose(worn)
    assert found.causes == ()
    (why,) = (one.why for one in found.untested if one.what == "wheel_radius" and one.rejected)
    assert "too small to be named" in why


@pytest.mark.slow
def test_a_shape_has_no_name_beside_more_than_noise(tmp_path, monkeypatch):
    """Where it is noise the shape is named: tests/cli/test_contact_chain.py."""
    log = simulate("polach-wet", 60.0, 1).write(tmp_path / "a.log")
    monkeypatch.setattr(NoiseComparison, "is_exceeded", property(lambda _self: True))
    found = diagnose(log)
    assert "curve_shape" not in [cause.effect for cause in found.causes]
    assert "another curve can fit any residual" in " ".join(one.refuted_by for one in found.closest)


def test_the_rate_of_the_slip_is_that_of_each_axle():
    t_s = np.tile(np.arange(0.0, 10.0, 0.1), 2)
    axle = np.repeat([1, 2], 100)
    slip = np.where(axle == 1, 0.02, -0.05) * t_s
    rate = environments._compute_rate(SimpleNamespace(axle=axle, t_s=t_s), slip)
    assert rate == pytest.approx(np.where(axle == 1, 0.02, 0.05))


def test_a_row_without_another_one_near_changes_by_nothing():
    drive = SimpleNamespace(axle=np.ones(3), t_s=np.array([0.0, 5.0, 10.0]))
    assert environments._compute_rate(drive, np.array([0.0, 0.1, 0.0])).tolist() == [0.0] * 3


class Named:
    """Findings with effects of which each gains so much beside the others, with its interval."""

    def __init__(self, gains):
        self.named = tuple(gains)
        candidates = tuple(SimpleNamespace(effect=SimpleNamespace(id=name)) for name in gains)
        model = SimpleNamespace(candidates=candidates, gains=gains)
        self.selection = SimpleNamespace(best=SimpleNamespace(model=model))
        self.regression = None

    def without_effect(self, place):
        gains = self.selection.best.model.gains
        return Named({name: gains[name] for k, name in enumerate(gains) if k != place})


@pytest.mark.parametrize(
    ("gains", "left"),
    [
        ({"a": (5.0, 9.0), "b": (1.0, 3.0)}, {"a", "b"}),
        ({"a": (5.0, 9.0), "b": (-1.0, 30.0)}, {"a"}),
        ({"a": (-4.0, 9.0), "b": (-1.0, 3.0), "c": (2.0, 3.0)}, {"c"}),
        ({"a": (-4.0, 9.0)}, {"a"}),  # alone it is judged with the plain curve
        ({}, set()),
    ],
)
def test_each_of_several_causes_gains_beside_the_others(gains, left, monkeypatch):
    def gain_of(_found, without, _best):
        return SimpleNamespace(interval=without, percent=sum(without) / 2)

    def remove(model, place):
        return (model.gains[model.candidates[place].effect.id],)

    monkeypatch.setattr(confirm_on_hold_out, "_compute_gain", gain_of)
    monkeypatch.setattr(confirm_on_hold_out, "remove_effect", remove)
    fit = SimpleNamespace
    monkeypatch.setattr(confirm_on_hold_out, "fit_model", lambda _rows, one: fit(model=one))
    monkeypatch.setattr(confirm_on_hold_out, "is_significant", lambda one: one.interval[0] > 0.0)
    kept, rejected = confirm_on_hold_out.drop_uncertain(Named(gains))
    assert set(kept.named) == left
    assert {one.what for one in rejected} == set(gains) - left
    assert all(one.rejected and "in addition to the other causes" in one.why for one in rejected)
