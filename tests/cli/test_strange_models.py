"""Model files with formulas and numbers that make no sense on the data: a count, or one line."""

import json
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.cli.main import main
from adhesion_can.physics.effects import known_effects
from adhesion_can.physics.effects.expression import ExpressionError
from adhesion_can.physics.effects.formula import formula_of
from tests.cli.test_commands import fails
from tests.cli.test_degenerate_drives import SETTINGS, play
from tests.diagnosis.bad_logs import readings, write

BASE = "[base]\nc1 = 0.4\nc2 = 60.0\nc3 = 0.3\n"
NOWHERE = ("1 + a*(1/(speed-speed))", "1 + a*log(-abs(speed))", "1 + a*exp(1e4*speed)",
           "1 + a*speed**1000", "1 + a*lag(1/(speed-speed), 1)")  # fmt: skip
"""Formulas of the adhesion without a finite value on any data."""


def formula(expression, a=0.1, acts_on="adhesion"):
    effect = f'[[effect]]\nid = "formula"\nexpression = "{expression}"\nacts_on = "{acts_on}"\n'
    return f"{BASE}{effect}[effect.parameters]\na = {a}\n"


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return write(
        tmp_path_factory.mktemp("strange") / "drive.log",
        readings(8.0),
        kept=lambda _, t_s: t_s < 4.0,
    )


@pytest.fixture
def model(tmp_path):
    def written(text):
        (tmp_path / "model.toml").write_text(text, encoding="utf-8")
        return str(tmp_path / "model.toml")

    return written


@pytest.mark.parametrize("expression", NOWHERE)
def test_replay_counts_the_samples_in_which_a_formula_has_no_value(expression, log, model, capsys):
    assert main(["replay", str(log), "--model", model(formula(expression))]) == 0
    out = capsys.readouterr().out
    assert re.search(r"dropped \d+ samples: the effects have no finite value", out)
    assert "TRACKING" not in out


@pytest.mark.parametrize("expression", NOWHERE)
def test_fits_refuse_a_formula_without_any_value_in_a_line(expression, log, model, capsys):
    path = model(formula(expression))
    assert "no finite value" in fails(capsys, "identify", str(log), "--model", path)
    assert "no finite value in any of" in fails(capsys, "evaluate", str(log), "--model", path)


def test_evaluate_counts_the_rows_in_which_a_formula_has_no_value(log, model, tmp_path, capsys):
    path = model(formula("1 + a*sqrt(speed - 8.5)", 0.01))
    out = str(tmp_path / "e.json")
    assert main(["evaluate", str(log), "--model", path, "--json", out]) == 0
    left_out = json.loads((tmp_path / "e.json").read_text())["left_out"]
    assert left_out > 0
    assert f"dropped {left_out} rows" in capsys.readouterr().out


@pytest.mark.parametrize("expression", NOWHERE[:4])
@pytest.mark.parametrize("acts_on", ["speed", "effort"])
def test_a_reading_whose_error_has_no_value_is_not_available(expression, acts_on, log, model):
    path = model(formula(expression, acts_on=acts_on))
    for command in ("replay", "identify", "evaluate"):
        status, lines = play(command, log, "--model", path)
        assert status in {0, 2}
        assert len(lines) <= 2


def test_a_simulated_contact_without_a_value_is_refused(model, tmp_path, capsys):
    words = ["--scenario", "dry", "--duration", "1", "--log", str(tmp_path / "s.log")]
    line = fails(capsys, "simulate", *words, "--model", model(formula(NOWHERE[0])))
    assert "no finite value at 0.000 s" in line


def test_a_simulated_reading_without_a_value_is_sent_as_not_available(model, tmp_path, capsys):
    words = ["--scenario", "dry", "--duration", "1", "--log", str(tmp_path / "s.log")]
    assert main(["simulate", *words, "--model", model(formula(NOWHERE[0], acts_on="speed"))]) == 0
    assert main(["check", str(tmp_path / "s.log")]) == 1
    assert "vehicle_speed: not available in 100.0 %" in capsys.readouterr().out


@pytest.mark.parametrize("time", ["-1", "0/0", "1/0", "-a", "a - 1", "1e10", "log(-a)"])
def test_a_lag_with_a_time_that_no_lag_has_is_refused(time, log, model, capsys):
    path = model(formula(f"1 + a*lag(speed, {time})"))
    line = fails(capsys, "replay", str(log), "--model", path)
    assert "the time constant of lag(speed, " in line
    with pytest.raises(ExpressionError, match="0 to 1e"):
        formula_of(f"1 + a*lag(speed, {time})", {"a": 0.1})


@pytest.mark.parametrize("time", ["0", "1e-12", "a", "2*a", "1e9"])
def test_a_lag_with_a_time_from_0_on_is_one(time, log, model):
    path = model(formula(f"1 + a*lag(speed, {time})", 0.01))
    assert main(["identify", str(log), "--model", path]) == 0


def test_a_lag_forgets_a_value_that_was_not_finite(log, model, tmp_path):
    """The square root is undefined for a part of the drive; its lag is not, all the rest of it."""
    path = model(formula("1 + a*lag(sqrt(speed - 8.5), 0.5)", 0.01))
    out = str(tmp_path / "i.json")
    assert main(["identify", str(log), "--model", path, "--json", out]) == 0
    found = json.loads((tmp_path / "i.json").read_text())
    assert 0 < found["left_out_by_model"]["the effects have no finite value"] < 1500


# ------------------------------------------------------------------------------------- mutations

ATOMS = st.sampled_from(
    ["speed", "slip", "creep_speed", "load", "a", "0", "1", "-1", "2", "1e308", "1e-308", "0.5",
     "speed-speed", "'speed'", "rain", "nothing"]
)  # fmt: skip


def larger(inner):
    binary = st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "**"]), inner)
    unary = st.tuples(st.sampled_from(["exp", "log", "sqrt", "tanh", "abs", "sin"]), inner)
    lag = st.tuples(inner, st.sampled_from(["1", "0", "a", "-1", "1e-9", "0/0", "speed"]))
    return st.one_of(
        binary.map(lambda x: f"({x[0]}{x[1]}{x[2]})"),
        unary.map(lambda x: f"{x[0]}({x[1]})"),
        lag.map(lambda x: f"lag({x[0]},{x[1]})"),
        st.tuples(st.sampled_from(["min", "max"]), inner, inner).map(
            lambda x: f"{x[0]}({x[1]},{x[2]})"
        ),
    )


EXPRESSIONS = st.recursive(ATOMS, larger, max_leaves=8).map(lambda text: f"1 + a*{text}")
SIZES = st.sampled_from(["0.1", "-0.5", "0.0", "-0.0", "1e300", "-1e300", "1e-300", "1"])


@pytest.mark.costly
@settings(max_examples=25, **SETTINGS)
@given(
    expression=EXPRESSIONS,
    size=SIZES,
    acts_on=st.sampled_from(["adhesion", "speed", "effort"]),
    command=st.sampled_from(["replay", "identify", "evaluate"]),
)
def test_any_formula_ends_in_an_answer_or_a_line(expression, size, acts_on, command, log, model):
    status, lines = play(command, log, "--model", model(formula(expression, size, acts_on)))
    assert status in {0, 2}
    assert len(lines) <= 2
    assert (status == 2) is bool(lines)


def ends(parameter):
    found = [parameter.typical, parameter.lower, parameter.upper]
    found += [2.0 * parameter.upper + 1.0, -1e308, 1e308, float("nan")]
    return [x for x in found if abs(x) < float("inf") or x != x]


EFFECTS = st.sampled_from(known_effects()).flatmap(
    lambda effect: st.tuples(
        st.just(effect), st.tuples(*(st.sampled_from(ends(p)) for p in effect.parameters))
    )
)


@pytest.mark.costly
@settings(max_examples=25, **SETTINGS)
@given(given_effect=EFFECTS, command=st.sampled_from(["replay", "identify", "evaluate"]))
def test_any_number_of_an_effect_ends_in_an_answer_or_a_line(given_effect, command, log, model):
    effect, values = given_effect
    text = f'{BASE}[[effect]]\nid = "{effect.id}"\n'
    text += f'form = "{effect.form}"\n' if effect.form else ""
    text += "[effect.parameters]\n"
    for parameter, value in zip(effect.parameters, values, strict=True):
        text += f"{parameter.name} = {value!r}\n"
    status, lines = play(command, log, "--model", model(text))
    assert status in {0, 2}
    assert len(lines) <= 2


@settings(max_examples=30, **SETTINGS)
@given(
    place=st.integers(0, 400),
    piece=st.sampled_from(["", "[", "]", "=", '"', "9", "e", "\n", "(", "'\\d'"]),
)
def test_a_model_with_any_letter_wrong_ends_in_an_answer_or_a_line(place, piece, log, model):
    text = formula("1 + a*max(tanh(speed - 8), 0)*lag(slip, 2)")
    text = text[: place % len(text)] + piece + text[place % len(text) + 1 :]
    status, lines = play("identify", log, "--model", model(text))
    assert status in {0, 2}
    assert len(lines) <= 2
