"""What follows from the findings, one rule at a time: models and channels are given."""

from types import SimpleNamespace

import pytest

from adhesion_can.diagnosis.inference.findings import Findings

A, B, C = "a", "b", "c"


def model(rmse=1.0, candidates=()):
    return SimpleNamespace(rmse=rmse, candidates=tuple(candidates))


def channel(name="speed", *, p_value=0.001, gain=0.1):
    return SimpleNamespace(channel=SimpleNamespace(name=name), p_value=p_value, gain=gain)


def rule(name, **given):
    """The value of a property of findings of which everything else is given."""
    prop = vars(Findings)[name]
    known = {"oscillates": False, "saturated": False, "channel_alpha": 0.025, "alpha": 0.01}
    return getattr(prop, "func", getattr(prop, "fget", None))(SimpleNamespace(**(known | given)))


def explains(plain, best, channels=(), **given):
    selection = SimpleNamespace(best=model(best))
    return rule(
        "explains", selection=selection, baseline=model(plain),
        significant_channels_of_best=channels, **given,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({}, True),
        ({"oscillates": True}, False),
        ({"saturated": True}, False),
        ({"plain": 1e-12, "best": 1e-13}, False),
    ],
)
def test_a_model_explains_but_not_where_the_drive_train_swings_or_nothing_is_left(given, wanted):
    assert explains(**({"plain": 0.02, "best": 0.01} | given)) is wanted


@pytest.mark.parametrize(("gain", "wanted"), [(0.05, True), (0.4, False)])
def test_the_strongest_channel_must_not_explain_more_than_the_model(gain, wanted):
    """The model takes 0.19 off the square, the channel 0.08 or 0.52."""
    strongest, weaker = channel(gain=gain), channel(gain=0.001)
    assert explains(0.01, 0.009, (strongest, weaker)) is wanted


@pytest.mark.parametrize(
    ("p_values", "is_explained", "named"),
    [
        ({A: 0.01, B: 0.001}, True, (A, B)),
        ({A: 0.011, B: 0.001}, True, ()),
        ({A: 0.001, B: 0.001}, False, ()),
        ({}, True, ()),
    ],
)
def test_effects_are_named_together_or_not_at_all(p_values, is_explained, named):
    selection = SimpleNamespace(best=model(candidates=p_values))
    found = rule("named", selection=selection, p_value=p_values.get, explains=is_explained)
    assert found == named


def test_channels_count_from_their_level_on():
    channels = (channel(p_value=0.025), channel(p_value=0.026), channel(p_value=0.0))
    found = rule("significant_channels_of_best", channels_of_best=channels)
    assert found == (channels[0], channels[2])


@pytest.mark.parametrize(
    ("channels", "given", "place"),
    [
        ((channel(), channel("load")), {}, 0),
        ((channel(gain=0.029), channel("load", gain=0.03)), {}, 1),
        ((channel(p_value=0.026), channel("load", p_value=0.025)), {}, 1),
        ((channel(), channel("tractive_effort")), {"saturated": True}, 1),
        ((channel(),), {"saturated": True}, None),
        ((channel(),), {"plain": model(1e-12)}, None),
        ((), {}, None),
    ],
)
def test_the_channel_that_is_not_explained_is_the_first_that_matters(channels, given, place):
    selection = SimpleNamespace(plain=given.pop("plain", model(0.02)))
    found = rule("unexplained_channel", selection=selection, channels_of_plain=channels, **given)
    assert found is (None if place is None else channels[place])


def test_a_fitted_model_is_found_by_its_effects():
    plain, single, smaller = model(), model(candidates=[A]), model(candidates=[A, B])
    selection = SimpleNamespace(plain=plain, singles=(single,), smaller=(smaller,))
    findings = SimpleNamespace(selection=selection)
    for wanted in (plain, single, smaller):
        assert Findings.fitted_with(findings, wanted.candidates) is wanted
    assert Findings.fitted_with(findings, (B, A)) is None
    assert Findings.fitted_with(findings, (C,)) is None


@pytest.mark.parametrize(
    ("size", "swings"), [(None, False), (0.0029, False), (0.0031, True), (0.02, True)]
)
def test_an_oscillation_matters_from_three_tenths_of_the_noise_on(size, swings):
    oscillation = None if size is None else SimpleNamespace(adhesion=size)
    assert rule("oscillates", oscillation=oscillation, noise_floor=0.01) is swings


def share(plain, best, left, *, leaves_more=True):
    """Share of the excess at two RMSE and a ratio of what is left and the sensors' noise."""
    found = SimpleNamespace(
        selection=SimpleNamespace(best=SimpleNamespace(rmse=best)),
        baseline=SimpleNamespace(rmse=plain),
        noise=SimpleNamespace(left=left, leaves_more=leaves_more),
    )
    return vars(Findings)["share_of_excess"].func(found)


@pytest.mark.parametrize(
    ("plain", "best", "left", "wanted"),
    [
        (2.0, 1.5, 1.5, 1.75 / 3.0),  # noise of variance 1, 1.25 left, 1.75 explained
        (1.0, 1.0, 2.0, 0.0),
        (1.0, 1.1, 2.0, 0.0),
        (10.0, 0.1, 2.0, 1.0),
    ],
)
def test_share_of_what_the_sensors_do_not_explain(plain, best, left, wanted):
    assert share(plain, best, left) == pytest.approx(wanted, abs=1e-3)


def test_where_nothing_exceeds_the_noise_any_gain_is_all():
    assert share(1.0, 0.999, 1.1, leaves_more=False) == 1.0
