"""Scored models: sizes, plausibility, which effects stand beside each other, and shortfalls."""

from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.diagnosis.inference import curve_shape
from adhesion_can.diagnosis.inference.curve_shape import (
    FREE,
    _find_rivals,
    _has_fewer_causes,
    _is_of_no_contact,
    _leaves_slip,
    _shows_in_adhesion,
    choose_families,
    drop_doubtful_effects,
)
from adhesion_can.diagnosis.inference.model_comparison import (
    ScoredModel,
    find_shortfall,
    is_improvement,
    is_worse,
    score_model,
)
from adhesion_can.diagnosis.inference.select_effects import MOST_EFFECTS
from adhesion_can.diagnosis.inference.shape_finding import ScoredFamily
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.gram_matrices import BlockGramMatrices
from adhesion_can.diagnosis.regression.model import Model
from adhesion_can.diagnosis.regression.segment_curves import SegmentCurves
from adhesion_can.diagnosis.regression.whitened_regression import FittedModel
from adhesion_can.physics.curves import FAMILIES
from adhesion_can.physics.effects import effect_by_id
from adhesion_can.physics.effects.channel_factor import STEP, ChannelFactor

BLOCKS = 30
CURVES = SegmentCurves(np.array([[0.35, 4.0, 0.4]]))
HUMIDITY, SANDING = Candidate(effect_by_id("humidity")), Candidate(effect_by_id("sanding"))
MAGIC, POLACH = FAMILIES["magic_formula"], FAMILIES["polach"]


def effect(name, form="", axle=0, **how):
    return Candidate(effect_by_id(name, form), axle, **how)


def scored(level=10.0, rmse=1.0, candidates=(), *, with_speed=None, flips=None, family=None):
    """A model whose blocks have about these squares, 30 of them, the same scatter in each model."""
    squares = level + 0.01 * np.sin(np.arange(BLOCKS) * 1.7) * level
    curves = SimpleNamespace(family=family or FAMILIES["burckhardt"])
    fitted = SimpleNamespace(
        model=SimpleNamespace(candidates=tuple(candidates), curves=curves),
        cross_validated_squares=squares,
        cross_validated_square=float(squares.sum()),
        grams=SimpleNamespace(rows=np.full(BLOCKS, 12.0)),
    )
    return ScoredModel(fitted, rmse, rmse if with_speed is None else with_speed, flips or {})


# ------------------------------------------------------------------- sizes and plausibility


def fitted_with(sizes, candidates, step=None):
    """A fitted model with effects of given sizes, and what a further step would add to each."""
    model = Model(CURVES)
    for candidate, size in zip(candidates, sizes, strict=True):
        model = model.with_effect(candidate, (size, *candidate.null_values[1:]))
    p = len(model.parameter_vector)
    gram = np.eye(p + 1)
    for place, further in (step or {}).items():
        first = model.first_parameter(place)
        gram[first, -1] = gram[-1, first] = further
    grams = BlockGramMatrices(gram[None], np.array([100.0]))
    return ScoredModel(FittedModel(model, grams, np.eye(p), np.ones(p, dtype=bool)), 1.0, 1.0)


def test_a_size_at_the_end_of_its_range_is_what_it_would_be_without_it():
    upper = HUMIDITY.free_parameters[0].upper
    inside = fitted_with([0.005, 0.3], [HUMIDITY, SANDING], {0: 0.004, 1: 0.2})
    assert inside.free_sizes == (0.005, 0.3)
    at_end = fitted_with([upper, 0.3], [HUMIDITY, SANDING], {0: 0.004, 1: 0.2})
    assert at_end.free_sizes == pytest.approx((upper + 0.004, 0.3))


@pytest.mark.parametrize(
    ("size", "further", "plausible"),
    [(0.005, 0.0, True), (0.01, 0.0, True), (0.01, 0.0009, True), (0.01, 0.0011, False),
     (-0.01, -0.0009, True), (-0.01, -0.0011, False), (-0.004, -9.0, True)],
)  # fmt: skip
def test_sizes_must_be_those_that_a_vehicle_may_have(size, further, plausible):
    candidate = effect("humidity", plausible=(-0.011, 0.011))
    beside = effect("sanding", plausible=(-0.5, 0.5))
    model = fitted_with([0.2, size], [beside, candidate], {1: further})
    assert model.is_plausible is plausible
    assert not fitted_with([0.6, size], [beside, candidate]).is_plausible


# ---------------------------------------------------------- which effects stand beside others


@pytest.mark.parametrize(
    ("present", "candidate", "admitted"),
    [
        ([], effect("humidity"), True),
        ([effect("humidity")], effect("humidity"), False),
        ([effect("humidity")], effect("sanding"), True),
        ([effect("wheel_radius", axle=1)], effect("wheel_radius", axle=2), True),
        ([effect("wheel_radius", axle=1)], effect("wheel_radius", axle=1), False),
        ([effect("effort_gain", "axle", 1)], effect("effort_gain", "axle", 3), True),
        ([effect("effort_gain", "axle", 1)], effect("effort_gain", "time"), False),
        ([effect("effort_gain", "time")], effect("effort_gain", "heat"), False),
        ([effect("load_dependence", "power")], effect("load_dependence", "burckhardt"), False),
    ],
)
def test_forms_of_a_mechanism_exclude_each_other_and_axles_do_not(present, candidate, admitted):
    assert scored(candidates=present).admits(candidate) is admitted


def test_values_of_a_channel_stand_beside_each_other_and_its_slope_does_not():
    one, two = (Candidate(ChannelFactor("shop", form=STEP, reference=k)) for k in (1.0, 2.0))
    slope = Candidate(ChannelFactor("shop"))
    assert scored(candidates=[one]).admits(two)
    assert not scored(candidates=[one]).admits(one)
    assert not scored(candidates=[one]).admits(slope)
    assert not scored(candidates=[slope]).admits(one)


def test_what_a_larger_model_adds():
    small, large = scored(candidates=[HUMIDITY]), scored(candidates=[SANDING, HUMIDITY])
    assert small.candidates_missing_from(large) == (SANDING,)
    assert large.candidates_missing_from(small) == ()
    assert small.ids == {"humidity"}
    assert not small.drifts
    assert scored(candidates=[effect("slow_drift")]).drifts
    assert small.held_out_rmse == pytest.approx((10.0 / 12.0) ** 0.5, rel=0.01)


# -------------------------------------------------------------------------------- comparisons


@pytest.mark.parametrize(
    ("large", "words"),
    [
        (scored(9.0, 0.989), ""),
        (scored(9.0, 0.991), "gain < 1 %"),
        (scored(9.0, 0.999, with_speed=0.98), ""),
        (scored(9.94, 0.9), ""),
        (scored(9.96, 0.9), "block gain < 0.5 %"),
    ],
)
def test_a_gain_must_be_worth_it_in_the_adhesion_and_in_the_blocks(large, words):
    assert find_shortfall(scored(), large, 1.0) == words
    assert is_improvement(scored(), large, 1.0) is (words == "")


def test_beside_another_effect_the_gain_must_be_three_percent():
    small = scored(candidates=[HUMIDITY])
    assert find_shortfall(small, scored(9.0, 0.971, [HUMIDITY, SANDING]), 1.0) == "gain < 3 %"
    assert find_shortfall(small, scored(9.0, 0.969, [HUMIDITY, SANDING]), 1.0) == ""


def mixed(level, rmse, flips=None, family=None):
    """A model whose gain over 10 scatters so much that blocks show nothing."""
    found = scored(level, rmse, flips=flips, family=family)
    found.fitted.cross_validated_squares = level + 3.0 * np.cos(np.arange(BLOCKS) * 2.1)
    return found


@pytest.mark.parametrize(
    ("flips", "words"),
    [
        ({}, "gain p = "),
        ({frozenset(): 0.02}, ""),
        ({frozenset(): 0.026}, "gain p = 0.052"),
        ({frozenset({HUMIDITY}): 0.001}, "gain p = "),  # of another comparison
    ],
)
def test_sign_flips_count_where_they_tested_the_same_addition(flips, words):
    found = find_shortfall(scored(), mixed(9.9, 0.9, flips), 1.0)
    assert found.startswith(words)
    assert bool(found) == bool(words)
    other = mixed(9.9, 0.9, {frozenset(): 0.001}, family=MAGIC)
    assert find_shortfall(scored(), other, 1.0).startswith("gain p = ")


def test_a_model_is_worse_by_more_than_a_five_hundredth_and_surely_so():
    assert not is_worse(scored(10.0), scored(10.019))
    assert is_worse(scored(10.0), scored(10.021))
    assert not is_worse(scored(10.0), scored(9.0))
    assert not is_worse(scored(10.0), mixed(10.5, 1.0))


def test_the_error_is_that_of_the_rows_that_decide_without_what_axles_share():
    residual = np.array([3.0, 4.0, 100.0])
    regression = SimpleNamespace(
        residual=lambda _: residual,
        without_speed_errors=lambda all_of_it: all_of_it / 2.0,
        used=np.array([True, True, False]),
    )
    found = score_model(regression, SimpleNamespace(model=None))
    assert found.rmse_with_speed_errors == pytest.approx((12.5) ** 0.5)
    assert found.rmse == pytest.approx((12.5) ** 0.5 / 2.0)
    assert found.sign_flips == {}


# ------------------------------------------------------------------------ the choice of a family


def family(curves, alone, extended=None, rmse=0.8, extended_rmse=0.8):
    """A family with its squares alone, and with the effects of Burckhardt's model."""
    own = scored(alone, rmse, family=curves)
    more = own if extended is None else scored(extended, extended_rmse, family=curves)
    return ScoredFamily(curves, own, more)


def chosen(fits, plain=None, best=None):
    """Families that are chosen, by name, with the number of effects that may stand beside them."""
    plain = plain or scored()
    selection = SimpleNamespace(plain=plain, best=best or plain)
    findings = SimpleNamespace(selection=selection)
    burckhardt = ScoredFamily(FAMILIES["burckhardt"], plain, selection.best)
    found = choose_families(findings, [burckhardt, *fits])
    return [(one.curves.family.name, one.most_effects) for one in found]


def test_a_formula_is_preferred_to_the_free_curve_within_two_percent_of_the_rmse():
    assert [name for name, _ in chosen([family(FREE, 8.0), family(MAGIC, 8.3)])] == [
        *("magic_formula", "free")
    ]
    assert [name for name, _ in chosen([family(FREE, 8.0), family(MAGIC, 8.4)])] == ["free"]
    assert [name for name, _ in chosen([family(FREE, 8.2), family(MAGIC, 8.0)])] == [
        "magic_formula"
    ]
    assert chosen([family(MAGIC, 8.0)]) == [("magic_formula", MOST_EFFECTS)]


def test_of_two_formulas_the_one_that_is_better_alone_counts():
    """With the effects both are as good; one of them does without."""
    best = scored(8.5, 0.8, [HUMIDITY])
    fits = [family(MAGIC, 9.5, 7.0, 0.9, 0.7), family(POLACH, 7.05, 7.1, 0.7, 0.7)]
    found = chosen(fits, best=best)
    assert [name for name, _ in found] == ["polach", "magic_formula"]


def test_a_family_that_improves_nothing_is_not_chosen():
    assert chosen([family(MAGIC, 10.0, rmse=1.0), family(FREE, 9.97, rmse=0.995)]) == []


@pytest.mark.parametrize(
    ("effects", "rmse", "most"),
    [
        ([HUMIDITY], 0.88, 0),  # within a tenth of the RMSE: it may stand in its place
        ([HUMIDITY], 0.89, None),
        ([HUMIDITY, SANDING], 0.95, 1),
        ([HUMIDITY, SANDING], 0.992, None),  # not worth it
    ],
)
def test_a_family_that_is_no_better_with_the_effects_may_replace_some_of_them(effects, rmse, most):
    best = scored(8.0, 0.8, effects)
    found = chosen([family(MAGIC, 9.0, 8.0, rmse, 0.8)], best=best)
    assert found == ([] if most is None else [("magic_formula", most)])


def test_a_family_that_is_better_with_the_effects_may_have_as_many():
    best = scored(9.0, 0.9, [HUMIDITY])
    found = chosen([family(MAGIC, 9.5, 8.0, 0.95, 0.8)], best=best)
    assert found == [("magic_formula", MOST_EFFECTS)]


SCALE = effect("speed_scale")


@pytest.mark.parametrize(
    ("before", "beside", "fewer"),
    [
        ([HUMIDITY, SANDING], [], True),
        ([HUMIDITY], [], False),  # the shape is a cause as well
        ([SCALE], [], True),  # of an error of the instruments less
        ([SCALE, HUMIDITY], [SCALE], False),
        ([SCALE, HUMIDITY], [HUMIDITY], True),
        ([HUMIDITY, SANDING], [SCALE], False),
        ([SCALE], [HUMIDITY], False),
    ],
)
def test_a_shape_has_fewer_causes_by_one_cause_or_one_error_of_the_instruments(
    before, beside, fewer
):
    effects = scored(candidates=before)
    assert _has_fewer_causes(effects, scored(candidates=beside)) is fewer
    # As good as the effects it must be, in the adhesion and in the blocks.
    assert _has_fewer_causes(effects, scored(rmse=1.019, candidates=beside)) is fewer
    assert not _has_fewer_causes(effects, scored(rmse=1.021, candidates=beside))
    assert not _has_fewer_causes(effects, scored(10.1, candidates=beside))


# ------------------------------------------------------------------- effects beside a shape


class Shaped:
    """Findings with a shape and effects of given p-values."""

    alpha = 0.01

    def __init__(self, plain, best, p_values):
        self.selection = SimpleNamespace(plain=plain, best=best)
        self.p_value = dict(zip(best.candidates, p_values, strict=True)).get

    def with_best(self, best):
        return ("dropped", best)


@pytest.mark.parametrize(
    ("level", "rmse", "p_values", "kept"),
    [
        (9.4, 0.96, (0.001, 0.01), True),
        (9.4, 0.98, (0.001, 0.001), False),  # less than 3 % of the RMSE
        (9.6, 0.96, (0.001, 0.001), False),  # less than 5 % of the squares
        (9.4, 0.96, (0.001, 0.011), False),
    ],
)
def test_effects_beside_a_shape_must_be_worth_it_and_significant_each(level, rmse, p_values, kept):
    plain, best = scored(), scored(level, rmse, [HUMIDITY, SANDING])
    shaped = Shaped(plain, best, p_values)
    found = drop_doubtful_effects(shaped)
    assert (found is shaped) == kept
    if not kept:
        assert found == ("dropped", plain)


# ---------------------------------------------------------------------- what speaks against a shape


def shown(after, *, noisy_share=0.0, speed_error=0.0):
    """Whether a shape shows that leaves so much of a residual of 1 in two halves of the rows.

    The slips of the first half have noise: a share of the residual's variance by the wheel speed,
    and an error by the vehicle speed, in standard deviations of the rest.
    """
    first = np.arange(40) < 20
    regression = SimpleNamespace(
        slip_variance_share=np.where(first, noisy_share, 0.1),
        speed_error_design=np.where(first, 0.02 * speed_error, 0.001)[:, None],
        scale=np.full(40, 50.0),
        used=np.arange(40) % 2 == 0,
        residual=lambda residual: residual,
    )
    left = np.where(first, *after)
    left[1::2] = 9.0  # these rows are held out
    models = [SimpleNamespace(model=one * (-1.0) ** np.arange(40)) for one in (np.ones(40), left)]
    return _shows_in_adhesion(regression, *models)


@pytest.mark.parametrize("noisy", [{"noisy_share": 0.8}, {"speed_error": 2.0}])
def test_a_shape_shows_in_rows_whose_error_is_the_adhesions(noisy, monkeypatch):
    monkeypatch.setattr(curve_shape, "compare_where_effort_is_noisy", lambda *_: None)
    assert shown((1.0, 0.98), **noisy)
    assert not shown((0.1, 1.0), **noisy)
    assert not shown((0.1, 0.995), **noisy)
    # Where both halves are as exact, both count.
    assert shown((0.1, 1.0))


def test_a_shape_that_shows_in_no_exact_row_does_not_show(monkeypatch):
    monkeypatch.setattr(curve_shape, "compare_where_effort_is_noisy", lambda *_: None)
    regression = SimpleNamespace(
        slip_variance_share=np.full(9, 0.9), speed_error_design=np.zeros((9, 1)), scale=np.ones(9),
        used=np.ones(9, dtype=bool),
    )  # fmt: skip
    any_model = SimpleNamespace(model=None)
    assert not _shows_in_adhesion(regression, any_model, any_model)


@pytest.mark.parametrize(
    ("left", "still_left", "shows"),
    [(1.2, 1.0, True), (1.2, 1.19, False), (1.05, 0.9, False), (3.0, 2.9, True)],
)
def test_what_the_efforts_noise_explains_is_no_shape(left, still_left, shows, monkeypatch):
    monkeypatch.setattr(curve_shape, "compare_where_effort_is_noisy", lambda _, model: model)
    small, large = SimpleNamespace(model=left), SimpleNamespace(model=still_left)
    assert _shows_in_adhesion(None, small, large) is shows


@pytest.mark.parametrize(("measured", "is_none"), [(-0.2, True), (0.2, False)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_peak_behind_which_the_force_is_against_the_slip_is_of_no_contact(
    measured, is_none, side, monkeypatch
):
    """The measured force counts, beyond the peak alone, and rows that were held out do not."""
    slip = side * np.linspace(0.001, 0.1, 400)
    beyond = np.abs(slip) > 0.05
    adhesion = side * np.where(beyond, measured, 0.2)
    adhesion[1::2] = -side * 0.4
    predicted = side * np.full(400, 0.25)
    at = SimpleNamespace(
        slip=slip, predicted=predicted, residual=adhesion - predicted, conditions=None
    )
    monkeypatch.setattr(curve_shape, "evaluate_model", lambda *_: at)
    curves = SimpleNamespace(slope=lambda *_: np.where(beyond, -1.0, 1.0))
    model = SimpleNamespace(curves=curves, active_effects=())
    regression = SimpleNamespace(
        data=SimpleNamespace(surface=np.zeros(400)), used=np.arange(400) % 2 == 0
    )
    assert _is_of_no_contact(regression, SimpleNamespace(model=model)) is is_none


def dependence(square, name="slip", gain=0.1):
    """A dependence of a residual of any RMSE that takes so much off its square."""
    return SimpleNamespace(
        channel=SimpleNamespace(name=name), gain=gain, explained_square=lambda _: square
    )


@pytest.mark.parametrize(
    ("before", "left", "rmse", "leaves"),
    [
        (2.3, [dependence(1.0)], 1.5, True),
        (2.3, [dependence(0.5)], 1.5, False),
        (2.3, [], 1.5, False),
        (2.3, [dependence(1.0, "speed")], 1.5, False),
        (2.3, [dependence(1.0, gain=0.02)], 1.5, False),
        # It explains more than any curve over the slip could: 4.0 - 1.21 of 2.3.
        (2.3, [dependence(1.0)], 1.1, False),
        (0.0, [dependence(0.1)], 2.0, True),
    ],
)
def test_a_shape_that_leaves_a_dependence_on_the_slip_is_not_the_shape(before, left, rmse, leaves):
    def with_rmse(value):
        return SimpleNamespace(rmse=value)

    findings = SimpleNamespace(
        selection=SimpleNamespace(plain=with_rmse(2.0)),
        channels_of_plain=[dependence(9.0, "speed"), dependence(before)],
    )
    shaped = SimpleNamespace(
        selection=SimpleNamespace(best=with_rmse(rmse)), significant_channels_of_best=left
    )
    assert _leaves_slip(findings, shaped) is leaves


@pytest.mark.parametrize(
    ("effects", "level", "one_speed", "rivals"),
    [
        ([HUMIDITY], 10.0, False, ("humidity",)),
        ([HUMIDITY], 11.0, False, ()),
        ([HUMIDITY, SANDING], 9.0, True, ("falling_friction", "humidity")),
        ([], 10.0, False, ()),
        ([], 10.0, True, ("falling_friction",)),
    ],
)
def test_rivals_of_a_shape_are_effects_that_explain_as_much(
    effects, level, one_speed, rivals, monkeypatch
):
    """Not those that stand beside it; at one speed a fall of friction is the same as a shape."""
    monkeypatch.setattr(curve_shape, "is_at_one_speed", lambda _: one_speed)
    shaped = SimpleNamespace(regression=SimpleNamespace(data=SimpleNamespace(drives=())))
    best = scored(10.0, candidates=[SANDING] if SANDING in effects else [])
    assert _find_rivals(shaped, scored(level, candidates=effects), best) == rivals
