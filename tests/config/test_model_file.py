"""The file of an extended model: nothing is lost in it, and nothing wrong is read from it."""

import hashlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.config.model_file import model_text, read_model, write_model
from adhesion_can.errors import ConfigError, InputError
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.effects import EFFECTS, ActiveEffect, effect_by_id
from adhesion_can.physics.effects.empirical import Empirical
from adhesion_can.physics.effects.formula import formula_of

FIXED = settings(derandomize=True, deadline=None, max_examples=40)

TEXT = """
[base]
c1 = 0.4
c2 = 60
c3 = 0.3
covariance = [[1e-6, 0, 0], [0, 4.0, 0.001], [0, 0.001, 1e-4]]

[[effect]]
id = "wheel_radius"
covariance = [[1e-8, 0], [0, 0]]
[effect.parameters]
error = 0.01
axle = 2

[[effect]]
id = "falling_friction"
form = "polach"
[effect.parameters]
B = 0.3
A = 0.4

[[spline]]
channel = "pressure_kPa"
kind = "factor"
knots = [0, 0, 0, 0, 5, 10, 10, 10, 10]
coefficients = [0, 0.1, -0.1, 0.2, 0]

[provenance]
version = "0.3"
verdict = "named"
"""


def finite(low, high):
    return st.floats(low, high, allow_nan=False)


def covariance_of(draw, size):
    """A root of any scale, so that the matrix is one; made even, since products are not."""
    root = np.array(draw(st.lists(finite(-1, 1), min_size=size * size, max_size=size * size)))
    scale = 10.0 ** np.array(draw(st.lists(finite(-9, 3), min_size=size, max_size=size)))
    root = root.reshape(size, size) * scale[:, None]
    matrix = root @ root.T
    return tuple(map(tuple, ((matrix + matrix.T) / 2).tolist()))


@st.composite
def models(draw):
    chosen = draw(st.lists(st.sampled_from(EFFECTS), max_size=4, unique_by=lambda e: e.id))
    effects = []
    for effect in chosen:
        values = [
            float(draw(st.integers(1, 9))) if p.axle else draw(finite(p.lower, p.upper))
            for p in effect.parameters
        ]
        effects.append(ActiveEffect(effect, tuple(values)))
    covariances = [
        draw(st.none()) if draw(st.booleans()) else covariance_of(draw, len(a.values))
        for a in effects
    ]
    splines = []
    for _ in range(draw(st.integers(0, 2))):
        inner = sorted(draw(st.lists(finite(-1e3, 1e3), max_size=4)))
        knots = (-1e4,) * 4 + tuple(inner) + (1e4,) * 4
        coefficients = draw(
            st.lists(finite(-2, 2), min_size=len(knots) - 4, max_size=len(knots) - 4)
        )
        channel = draw(st.text(min_size=1, max_size=8).filter(is_utf8))
        splines.append(Empirical(channel, "factor", knots, tuple(coefficients)))
    words = st.text(max_size=12).filter(is_utf8)
    return ExtendedModel(
        base=(draw(finite(0.01, 5)), draw(finite(10, 400)), draw(finite(0, 0.09))),
        base_covariance=covariance_of(draw, 3) if draw(st.booleans()) else None,
        effects=tuple(effects),
        covariances=tuple(covariances),
        splines=tuple(splines),
        provenance=draw(st.dictionaries(words, words, max_size=4)),
    )


def is_utf8(text):
    return not any("\ud800" <= c <= "\udfff" for c in text)


@pytest.mark.costly
@FIXED
@given(model=models())
def test_what_is_written_is_read_back_to_the_last_bit(tmp_path_factory, model):
    path = tmp_path_factory.getbasetemp() / "model.toml"
    write_model(model, path)
    again = read_model(path)
    assert again == model
    assert model_text(again) == model_text(model)
    assert again.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert again.where == str(path)


def test_a_file_written_by_hand_is_read(tmp_path):
    (tmp_path / "m.toml").write_text(TEXT)
    model = read_model(tmp_path / "m.toml")
    assert model.base == (0.4, 60.0, 0.3)
    assert model.base_covariance[1] == (0.0, 4.0, 0.001)
    assert [a.effect for a in model.effects] == [
        effect_by_id("wheel_radius"),
        effect_by_id("falling_friction", "polach"),
    ]
    assert [a.values for a in model.effects] == [(0.01, 2.0), (0.3, 0.4)]
    assert model.covariances == (((1e-8, 0.0), (0.0, 0.0)), None)
    assert model.splines[0].coefficients == (0.0, 0.1, -0.1, 0.2, 0.0)
    assert model.provenance == {"version": "0.3", "verdict": "named"}
    assert model.instruments.radius_error == {2: 0.01}


WRONG = {
    "no base": ("[base]", "[basis]", "no [base]"),
    "unknown key": ("[provenance]", "[origin]", "origin: unknown key"),
    "unknown key of the base": ("c3 = 0.3", "c3 = 0.3\nc4 = 1", "base.c4: unknown key"),
    "missing number": ("c2 = 60\n", "", "base.c2: missing"),
    "text for a number": ("c2 = 60", 'c2 = "60"', "base.c2"),
    "boolean for a number": ("c2 = 60", "c2 = true", "base.c2"),
    "not finite": ("c2 = 60", "c2 = inf", "base.c2"),
    "no contact": ("c2 = 60", "c2 = 1e300", "c1, c2 and c3 are limited to"),
    "falling from the start": ("c2 = 60", "c2 = 0.5", "c3 not negative and below c1 c2"),
    "covariance of the base": ("[[1e-6, 0, 0], ", "[", "3 rows of 3"),
    "negative variance": ("[[1e-6, 0, 0]", "[[-1e-6, 0, 0]", "not negative"),
    "uneven covariance": ("[0, 4.0, 0.001]", "[0, 4.0, 0.002]", "not symmetric"),
    "impossible correlation": ("[0, 0.001, 1e-4]", "[0, 0.001, 1e-9]", "negative direction"),
    "unknown effect": ('"wheel_radius"', '"wheel_diameter"', "no effect 'wheel_diameter'; known:"),
    "unknown form": ('"polach"', '"carter"', "falling_friction has no form 'carter'; known:"),
    "missing form": ('form = "polach"\n', "", "no form ''; known: 'burckhardt'"),
    "unknown parameter": ("B = 0.3", "B = 0.3\nC = 1", "effect[2].parameters.C: unknown key"),
    "missing parameter": ("axle = 2\n", "", "effect[1].parameters.axle: missing"),
    "out of bounds": ("error = 0.01", "error = 0.3", "parameters.error: error = 0.3 is not within"),
    "no number of an axle": ("axle = 2", "axle = 2.5", "not the number of an axle"),
    "covariance of an effect": ("[[1e-8, 0], [0, 0]]", "[[1e-8]]", "effect[1].covariance"),
    "unknown key of an effect": ('form = "polach"', 'shape = "polach"', "effect[2].shape"),
    "effect twice": (
        "[[spline]]",
        '[[effect]]\nid = "falling_friction"\nform = "burckhardt"\nparameters.c4 = 0.1\n[[spline]]',
        "falling_friction is given twice",
    ),
    "unknown list": ("[[spline]]", "[[splines]]", "splines: unknown key"),
    "not a list": ("[[spline]]", "[spline]", "spline: not a list of tables"),
    "other kind": ('kind = "factor"', 'kind = "shift"', "spline[1]: kind 'shift'"),
    "missing list": ("coefficients = [0, 0.1, -0.1, 0.2, 0]\n", "", "coefficients: missing"),
    "too few coefficients": ("0.2, 0]", "0.2]", "4 coefficients"),
    "descending knots": ("0, 5, 10", "0, -5, 10", "must not descend"),
    "free ends": ("[0, 0, 0, 0, 5", "[-1, 0, 0, 0, 5", "first four"),
    "provenance not text": ('version = "0.3"', "version = 3", "provenance.version"),
    "not TOML": ("c2 = 60", "c2 = ", "not TOML"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named_with_its_file_and_key(tmp_path, case):
    good, bad, said = WRONG[case]
    assert good in TEXT
    path = tmp_path / "m.toml"
    path.write_text(TEXT.replace(good, bad))
    with pytest.raises(ConfigError) as caught:
        read_model(path)
    message = str(caught.value)
    assert said in message
    assert "m.toml" in message
    assert "\n" not in message


def test_a_file_that_is_not_there_and_a_folder_that_is_not(tmp_path):
    with pytest.raises(ConfigError, match="No such file"):
        read_model(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match="not TOML"):
        read_model(tmp_path / "bytes.toml")
    with pytest.raises(InputError, match="No such file"):
        write_model(ExtendedModel((0.4, 60.0, 0.3)), tmp_path / "none" / "m.toml")


def test_the_file_explains_its_numbers():
    active = ActiveEffect(effect_by_id("speed_dependence"), (1.25,))
    text = model_text(ExtendedModel((0.4, 60.0, 0.3), effects=(active,)))
    assert "adhesion at the same slip falls with vehicle speed" in text
    assert "share = 1.25  # 1; fall with speed" in text


def test_a_model_made_in_the_program_is_checked_alike():
    effect = effect_by_id("humidity")
    for values in ((0.5,), (float("nan"),), ()):
        with pytest.raises(ValueError, match="humidity"):
            ExtendedModel((0.4, 60.0, 0.3), effects=(ActiveEffect(effect, values),))
    with pytest.raises(ValueError, match="covariances"):
        ExtendedModel((0.4, 60.0, 0.3), covariances=(None,))


@pytest.mark.parametrize(
    "text", ["1 + a * (wind\n)", "1 + a *\fwind", "1 + a * '\x01\x7f'", "1 + ä * 'α'"]
)
def test_a_formula_of_any_characters_is_read_back(tmp_path, text):
    """Its text stands in a comment too, which a line break would end."""
    constant = "ä" if "ä" in text else "a"
    model = ExtendedModel(
        (0.4, 60.0, 0.3), effects=(ActiveEffect(formula_of(text, {constant: 0.1}), (0.1,)),)
    )
    write_model(model, tmp_path / "m.toml")
    assert read_model(tmp_path / "m.toml") == model


@pytest.mark.parametrize("acts_on", ["adhesion", "speed", "effort"])
def test_a_formula_says_what_it_acts_on(tmp_path, acts_on):
    formula = formula_of("1 + a * wind", {"a": 0.1}, acts_on)
    model = ExtendedModel((0.4, 60.0, 0.3), effects=(ActiveEffect(formula, (0.1,)),))
    write_model(model, tmp_path / "m.toml")
    text = (tmp_path / "m.toml").read_text()
    assert (f'acts_on = "{acts_on}"' in text) == (acts_on != "adhesion")
    again = read_model(tmp_path / "m.toml")
    assert again == model
    assert bool(again.instruments.laws) == (acts_on != "adhesion")
    (tmp_path / "m.toml").write_text(text.replace('"speed"', '"weather"'))
    if acts_on == "speed":
        with pytest.raises(ConfigError, match="acts_on"):
            read_model(tmp_path / "m.toml")
