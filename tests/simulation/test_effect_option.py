"""`simulate --effect` from the command line: what it takes, what it writes, what it refuses."""

import json

import pytest

from adhesion_can.cli.main import main
from adhesion_can.errors import InputError
from adhesion_can.physics.effects import EFFECTS
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.effect_option import effects_help, parse_effects


def parsed(*texts, vehicle=None):
    actives = parse_effects(texts, vehicle or Locomotive())
    return [(a.effect.id, a.effect.form, a.values) for a in actives]


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: f"{e.id}:{e.form}")
def test_a_name_alone_takes_the_typical_size(effect):
    name = f"{effect.id}:{effect.form}" if effect.form else effect.id
    typical = tuple(p.typical for p in effect.parameters)
    assert parsed(name) == [(effect.id, effect.form, typical)]
    assert parsed(f"{name}=0") == [(effect.id, effect.form, (0.0, *typical[1:]))]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("load_dependence=3e-12", ("load_dependence", "burckhardt", (3e-12,))),
        ("load_dependence:power=0.3", ("load_dependence", "power", (0.3,))),
        ("falling_friction:polach=0.7", ("falling_friction", "polach", (0.7, 0.4))),
        ("falling_friction:polach=0.7,A=0.2", ("falling_friction", "polach", (0.7, 0.2))),
        ("adhesion_recovery=1e-6,time=5", ("adhesion_recovery", "", (1e-6, 5.0))),
        ("wheel_radius=-0.02", ("wheel_radius", "", (-0.02, 1.0))),
        ("wheel_radius=0.01,axle=4", ("wheel_radius", "", (0.01, 4.0))),
    ],
)
def test_sizes_forms_and_further_parameters(text, wanted):
    assert parsed(text) == [wanted]


def test_several_at_once_and_one_on_several_axles():
    texts = ("sanding", "wheel_radius=0.01", "wheel_radius=0.02,axle=2", "falling_friction",
             "falling_friction:polach")  # fmt: skip
    assert [name for name, _, _ in parsed(*texts)] == [text.split("=")[0].split(":")[0]
                                                       for text in texts]  # fmt: skip


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["magic"], "no effect 'magic'"),
        (["magic"], "known: wheelset_inertia, wheel_radius"),
        (["sanding:fine"], "no form 'fine'"),
        (["falling_friction:fine"], "known: burckhardt, polach"),
        (["sanding=much"], "'much' is not a number"),
        (["sanding="], "'' is not a number"),
        (["sanding=nan"], "gain out of range"),
        (["sanding=3"], "give -0.5 to 2"),
        (["adhesion_recovery=1e-6,time=99"], "time out of range"),
        (["adhesion_recovery=1e-6,time=99"], "give 0.3 to 30 s"),
        (["adhesion_recovery=1e-6,tim=9"], "no parameter 'tim'"),
        (["adhesion_recovery=1e-6,tim=9"], "known: time"),
        (["sanding=0.1,0.2"], "no parameter '0.2'"),
        (["sanding=0.1,gain=0.2"], "known: it has none except the size"),
        (["wheel_radius=0.01,axle=7"], "give 1 to 6"),
        (["wheel_radius=0.01,axle=1.5"], "1.5 is not an axle"),
        (["sanding", "sanding=0.1"], "given twice"),
        (["wheel_radius=0.01", "wheel_radius=0.02,axle=1"], "given twice"),
        (["load_dependence=1e-7"], "leaves no adhesion"),
    ],
)
def test_nonsense_is_refused_with_what_where_and_the_fix(texts, words):
    with pytest.raises(InputError) as caught:
        parsed(*texts)
    line = str(caught.value)
    assert words in line
    assert f"--effect {texts[-1]}" in line


def test_the_help_has_every_effect_and_parameter():
    text = effects_help()
    for effect in EFFECTS:
        line = next(
            x for x in text.splitlines()
            if x.split()[0] == (f"{effect.id}:{effect.form}" if effect.form else effect.id)
        )  # fmt: skip
        for parameter in effect.parameters:
            assert f"{parameter.name}: {parameter.meaning}" in line
            assert f"({parameter.typical:g})" in line


def simulate(tmp_path, name, *options):
    log, truth = tmp_path / f"{name}.log", tmp_path / f"{name}.json"
    arguments = ["simulate", "--scenario", "sweep", "--duration", "1", "--log", str(log)]
    status = main([*arguments, "--truth", str(truth), *options])
    return status, log, truth


def test_effects_stand_in_the_truth_and_in_the_log(tmp_path):
    status, log, truth = simulate(
        tmp_path, "a", "--effect", "falling_friction:polach=0.7,A=0.2",
        "--effect", "wheel_radius=0.01,axle=4",
    )  # fmt: skip
    assert status == 0
    assert json.loads(truth.read_text())["effects"] == [
        {"effect": "falling_friction", "form": "polach", "parameters": {"B": 0.7, "A": 0.2}},
        {"effect": "wheel_radius", "form": "", "parameters": {"error": 0.01, "axle": 4.0}},
    ]
    _, plain, _ = simulate(tmp_path, "b")
    assert log.read_bytes() != plain.read_bytes()
    assert len(log.read_text().splitlines()) == len(plain.read_text().splitlines())


@pytest.mark.parametrize(
    "options",
    [("--effect", "sanding=7"), ("--effect", "wheelset_inertia=-200"), ("--effect", "x=1")],
    ids=str,
)
def test_a_wrong_effect_is_one_line_and_leaves_nothing_behind(tmp_path, capsys, options):
    status, log, truth = simulate(tmp_path, "a", *options)
    error = capsys.readouterr().err.strip()
    assert status == 2
    assert len(error.splitlines()) == 1
    assert not log.exists()
    assert not truth.exists()
