"""The line with which a command ends: a finding in the user's quantities, and what can be typed."""

import re
import shlex
from dataclasses import replace
from math import inf
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from adhesion_can.api.configuration import load_configuration
from adhesion_can.calibration.fit import AxleRadius, CalibratedQuantity
from adhesion_can.cli.main import build_parser
from adhesion_can.diagnosis.cause_result import Cause, ParameterValue
from adhesion_can.diagnosis.next_drive.result import NextDrive
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.driving_plan import DrivingPlan, PlanStep
from adhesion_can.physics.effects import forms_of_effect, known_effects
from adhesion_can.physics.effects.formula import parse_formula
from adhesion_can.physics.objection import NEEDS_RELIEF, WORDINGS, Objection
from adhesion_can.reporting.next_steps.after_diagnosis import after_diagnosis
from adhesion_can.reporting.next_steps.after_recording import (
    after_calibration,
    after_evaluation,
    after_replay,
)
from adhesion_can.reporting.next_steps.next_step import NextStep, Typed
from adhesion_can.reporting.next_steps.quantities import describe_cause
from adhesion_can.reporting.objections import ObjectionLog
from tests.reporting.test_diagnosis_report import estimate, named, nothing, unexplained

CONFIGURATION = load_configuration()
LOG = Typed(inputs=(Path("drive one.log"),), configuration=("--config", "tram.toml"))
TABLE = Typed(inputs=(Path("rig.csv"),), tables=True, columns=("--column", "slip=kappa"))
PLANNED = NextDrive(("a", "b"), DrivingPlan((PlanStep(1.0, "coast"),), 10.0), "Drive 1 s.")
NO_PLAN = NextDrive(("a", "b"), None, "No plan: no manoeuvre is within the limits.")


def cause(effect, form, *values, rivals=()):
    """A cause with values and standard deviations of its free parameters, then its axle."""
    known = next(one for one in forms_of_effect(effect) if one.form == form)
    parameters = tuple(
        ParameterValue(p.name, value, std, p.unit, p.meaning)
        for p, (value, std) in zip(known.parameters, values, strict=True)
    )
    return Cause(effect, form, known.title, "", parameters, 0.001, rivals)


def of(*causes, **changes):
    return replace(named(), causes=causes, next_drive=None, **changes)


def line(found, typed=LOG):
    return after_diagnosis(found, typed, CONFIGURATION).line


def entry(role, signal, key):
    """An entry of [roles] as TOML."""
    return f'"{role}" = {{ signal = "{signal}", {key} }}'


def effort(axle, key):
    message = f"TractiveEffort{1 if axle <= 3 else 2}"
    return entry(f"tractive_effort.{axle}", f"{message}.TractiveEffort_Ax{axle}", key)


ROLES = " under [roles]"
WHEEL = cause("wheel_radius", "", (-0.01, 2e-5), (3.0, None))


@pytest.mark.parametrize(
    ("one", "text", "setting"),
    [
        (WHEEL, "Axle 3's wheel is 1.00 % smaller than configured: 0.6188 m, not 0.6250.",
         "wheel_radius_m = [0.6250, 0.6250, 0.6188, 0.6250, 0.6250, 0.6250] under [vehicle]"),
        (cause("speed_scale", "", (0.02, 1e-4)), "The vehicle speed reads 2.00 % high.",
         entry("vehicle_speed", "VehicleSpeed.VehicleSpeed", "factor = 0.98039") + ROLES),
        (cause("effort_bias", "", (-1500.0, 90.0)),
         "The tractive effort of each axle reads 1500 N low.",
         " and ".join(effort(axle, "offset = -1500") for axle in range(1, 7)) + ROLES),
        (cause("effort_gain", "axle", (0.05, 0.004), (2.0, None)),
         "The tractive effort of axle 2 reads 5.0 % high.",
         effort(2, "factor = 0.95238") + ROLES),
        (cause("wheelset_inertia", "", (400.0, 20.0)),
         "The wheelset's inertia is 600 kg·m², not 200.",
         "wheelset_inertia_kgm2 = 600 under [vehicle]"),
        (cause("effort_delay", "", (-0.028, 0.0003)), "The tractive effort comes 28 ms early.", ""),
        (cause("slow_drift", "", (-0.0005, 1e-5)),
         "Every minute there is 3.00 % less adhesion.", ""),
        (cause("load_dependence", "power", (0.5, 0.01)),
         "An axle with 10 % more load has 4.7 % less adhesion.", ""),
        (cause("sanding", "", (0.2, 0.03)), "Under sand there is 20 % more adhesion.", ""),
    ],
)  # fmt: skip
def test_a_cause_is_in_the_users_quantities(one, text, setting):
    meaning = describe_cause(one, CONFIGURATION, alone=True, tables=False)
    assert (meaning.text, meaning.setting) == (text, setting)


@pytest.mark.parametrize("effect", known_effects(), ids=lambda one: f"{one.id} {one.form}")
def test_every_effect_has_a_sentence(effect):
    values = [(p.typical, None if p.axle else abs(p.typical) / 50) for p in effect.parameters]
    one = cause(effect.id, effect.form, *values)
    meaning = describe_cause(one, CONFIGURATION, alone=True, tables=False)
    assert meaning.text[0].isupper()
    assert meaning.text.endswith(".")


def test_a_size_at_its_bound_is_not_stated_as_known():
    (size, axle) = WHEEL.parameters
    at_bound = replace(WHEEL, parameters=(replace(size, std=None, at_bound=True), axle))
    meaning = describe_cause(at_bound, CONFIGURATION, alone=True, tables=False)
    assert "at its bound" in meaning.text
    assert not meaning.setting


OWN_KEYS = {
    "channel": "can1",
    "sign": -1,
    "protection": "e2e-p01",
    "data_id": 7,
    "cycle_us": 20_000,
    "not_available": False,
    "stuck_check": False,
}
"""Keys that the user's entry may have, and that the new one must keep."""


@pytest.mark.parametrize(
    ("one", "axle", "reads", "true"),
    [
        (cause("speed_scale", "", (0.25, 1e-4)), 0, 10.0, 8.0),
        (cause("effort_gain", "axle", (0.25, 0.004), (2.0, None)), 2, 1000.0, 800.0),
        (cause("effort_gain", "all", (0.25, 0.004)), 5, 1000.0, 800.0),
        (cause("effort_bias", "", (200.0, 90.0)), 3, 1000.0, 800.0),
    ],
)
def test_the_entries_of_roles_can_be_loaded_and_correct_what_reads_high(
    tmp_path, one, axle, reads, true
):
    """Each reading holds a factor and an offset of its own, which stay in force."""
    own = tuple(
        replace(choice, factor=0.5, offset=100.0, **OWN_KEYS) if choice.axle == axle else choice
        for choice in CONFIGURATION.choices
    )
    known = replace(CONFIGURATION, choices=own)
    setting = describe_cause(one, known, alone=True, tables=False).setting
    entries, _, section = setting.partition(" under ")
    path = tmp_path / "own.toml"
    path.write_text("\n".join([section, *entries.split(" and "), ""]))
    (choice,) = [c for c in load_configuration(path).choices if c.axle == axle]
    assert {key: getattr(choice, key) for key in OWN_KEYS} == OWN_KEYS
    raw = (reads + 100.0) / 0.5
    assert raw * choice.used_factor - choice.offset == pytest.approx(true, rel=1e-4)


def test_a_role_is_corrected_only_in_a_file_that_has_all_roles():
    """One role in a file replaces all the defaults."""
    speed = of(cause("speed_scale", "", (0.02, 1e-4)))
    assert "--extended model.toml --config tram.toml, then confirm it" in line(speed)
    owned = replace(CONFIGURATION, choices=CONFIGURATION.choices[:-1])
    said = after_diagnosis(speed, LOG, owned).line
    assert 'Next: write "vehicle_speed" = { signal = ' in said
    assert "under [roles] in the configuration, then adhesion-can diagnose" in said


def test_a_delay_has_no_key_and_is_corrected_by_the_model():
    said = line(of(DELAY))
    assert said.endswith(
        "adhesion-can diagnose 'drive one.log' --extended model.toml --config tram.toml, then "
        "confirm it on another drive: adhesion-can evaluate OTHER.log --model model.toml --config "
        "tram.toml (no key of the configuration corrects a delay)"
    )


def test_the_commands_of_a_plan_can_be_typed():
    said = line(replace(of(RIVALLED), next_drive=PLANNED))
    for typed in re.findall("adhesion-can ((?:control|simulate|diagnose) [^(),]*)", said):
        build_parser().parse_args(shlex.split(typed.replace("INTERFACE", "virtual")))
    assert "simulate --scenario sweep --closed-loop --plan plan.toml --log NEW.log" in said


def test_a_wheel_is_calibrated_or_written():
    assert line(of(WHEEL)) == (
        "Axle 3's wheel is 1.00 % smaller than configured: 0.6188 m, not 0.6250. Next: "
        "adhesion-can calibrate 'drive one.log' --out calibrated.toml --config tram.toml, or "
        "write wheel_radius_m = [0.6250, 0.6250, 0.6188, 0.6250, 0.6250, 0.6250] under "
        "[vehicle] in the configuration"
    )
    # To a table belongs no vehicle that could be corrected.
    assert "calibrate" not in line(of(WHEEL), TABLE)


DELAY = cause("effort_delay", "", (0.028, 0.0003))
RIVALLED = replace(DELAY, rivals=("wheel_speed_delay",))


@pytest.mark.parametrize(
    ("found", "typed", "wanted"),
    [
        (replace(named(), gain=None), LOG, "then adhesion-can diagnose NEW.log --config tram.toml"),
        (of(DELAY), LOG, "adhesion-can diagnose 'drive one.log' --extended model.toml --config"),
        (of(DELAY), replace(LOG, outputs={"--extended": Path("m.toml")}),
         "adhesion-can evaluate OTHER.log --model m.toml --config tram.toml"),
        (of(DELAY),
         replace(LOG, outputs={"--extended": Path("m.toml")}, holdout=(Path("b.log"),)),
         "adhesion-can replay b.log --model m.toml --config tram.toml"),
        (of(DELAY), replace(TABLE, outputs={"--extended": Path("m.toml")}),
         "adhesion-can evaluate OTHER.csv --model m.toml --column slip=kappa"),
        (of(DELAY), TABLE,
         "adhesion-can diagnose rig.csv --extended model.toml --column slip=kappa"),
        (of(RIVALLED), LOG,
         "from wheel_speed_delay. Next: adhesion-can diagnose 'drive one.log' --next-drive plan"),
        (of(RIVALLED, needed=None), TABLE, "record a longer drive under other conditions, then"),
        (of(RIVALLED, needed="to distinguish a from b, record coasting"), TABLE,
         "to distinguish a from b, record coasting; then adhesion-can diagnose rig.csv NEW.csv"),
        (replace(of(RIVALLED), next_drive=PLANNED),
         replace(LOG, outputs={"--next-drive": Path("p.toml")}),
         "Next: drive the plan with adhesion-can control --plan p.toml -i INTERFACE -c CHANNEL"),
        (replace(of(RIVALLED, needed=None), next_drive=NO_PLAN), LOG,
         "No plan: no manoeuvre is within the limits. Next: record"),
        (replace(nothing(), evidence=()), LOG, "Next: adhesion-can run -i INTERFACE -c CHANNEL"),
        (unexplained(), LOG, "Next: adhesion-can diagnose 'drive one.log' --next-drive plan.toml"),
        (replace(unexplained(), oscillates=True), LOG,
         "Next: find what makes the wheels oscillate, record again, then adhesion-can "),
        (replace(unexplained(), closest=named().closest), LOG, "--next-drive plan.toml"),
        (replace(unexplained(), saturated=True), LOG, "widen the range of the clipped"),
    ],
)  # fmt: skip
def test_what_follows_a_diagnosis_is_what_was_not_done_yet(found, typed, wanted):
    said = line(found, typed)
    assert wanted in said
    assert "\n" not in said
    assert said.count("Next: ") == 1


@pytest.mark.parametrize(
    ("channel", "known", "law"),
    [
        ("speed", "speed", "1 + a * speed where a=0.005"),
        ("axle_load", "speed", "1 + a * load where a=0.01"),
        ("rain", "rain", "1 + a * rain where a=0.005"),
        ("oil film", "speed", '1 + a * "oil film" where a=0.01'),
        ("a", "speed", '1 + a * "a" where a=0.01'),
        ("lambda", "speed", '1 + a * "lambda" where a=0.01'),
        ("exp", "speed", '1 + a * "exp" where a=0.01'),
    ],
)
def test_what_is_unexplained_names_a_law_that_can_be_typed(channel, known, law):
    profile = replace(unexplained().profile, channel=known, at=np.array([1.0, 20.0]))
    found = replace(unexplained(), channel=channel, profile=profile)
    said = after_diagnosis(found, LOG, CONFIGURATION).action
    (formula,) = shlex.split(said[said.index("adhesion-can") :])[4:5]
    assert formula == law
    assert parse_formula(formula).channels == (law.split(" where")[0].split("* ")[1].strip('"'),)


@pytest.mark.parametrize("channel", ["tractive_effort", "slip_rate", "position", "time", "axle"])
def test_a_channel_that_no_formula_has_leads_to_a_plan_and_then_to_a_drive(channel):
    found = replace(unexplained(), channel=channel)
    assert "--formula" not in line(found)
    assert "--next-drive plan.toml" in line(found)
    assert "as a signal under [channels], then" in line(replace(found, next_drive=NO_PLAN))
    assert line(found, TABLE).endswith(
        "as a column, then adhesion-can diagnose NEW.csv --column slip=kappa"
    )


def test_the_next_line_differs_from_the_command_that_was_typed():
    found = replace(unexplained(), channel="speed")
    first = line(found)
    (formula,) = re.findall("--formula '([^']*)'", first)
    typed = replace(LOG, formulas=(formula,))
    assert "--next-drive plan.toml" in line(found, typed)
    planned = replace(found, next_drive=NO_PLAN)
    assert "diagnose NEW.log" in line(planned, typed)


def test_what_is_rerun_keeps_formulas_and_held_out_data():
    typed = replace(LOG, formulas=("1 + a * wind where a=0.1",), holdout=(Path("-b.log"),))
    assert typed.on_inputs("diagnose") == (
        "adhesion-can diagnose 'drive one.log' --holdout ./-b.log "
        "--formula '1 + a * wind where a=0.1' --config tram.toml"
    )
    assert replace(LOG, inputs=(Path("a.log.gz"),)).new_file("NEW") == "NEW.log"


def test_the_json_of_a_diagnosis_has_the_line():
    assert replace(named(), next_step="Next: coast").to_dict()["next"] == "Next: coast"
    assert NextStep("", "coast").line == "Next: coast"


class Calibrated:
    """What `after_calibration` asks of a calibration."""

    def __init__(self, *ratios, std=1e-5):
        self.systematic_percent = 0.09
        self.axles = [
            AxleRadius(axle, 0.625, CalibratedQuantity(0.625 * ratio, std, (0.0, 1.0)), 60.0, 9)
            for axle, ratio in enumerate(ratios, start=1)
        ]


def test_radii_agree_or_are_written():
    agree, worn = Calibrated(1.0005, 0.9995), Calibrated(1.0, 0.99)
    assert "agree" in after_calibration(Calibrated(0.99, std=0.01), LOG, ()).finding
    assert after_calibration(agree, LOG, ()).line == (
        "The radii agree with the configuration. Next: adhesion-can diagnose 'drive one.log' "
        "--config tram.toml"
    )
    assert after_calibration(worn, LOG, ()).line == (
        "Axle 2's wheel is 1.00 % smaller than configured: 0.6188 m, not 0.6250. Next: "
        "adhesion-can calibrate 'drive one.log' --out calibrated.toml --config tram.toml"
    )
    written = replace(LOG, outputs={"--out": Path("new.toml")})
    assert after_calibration(worn, written, ()).action == (
        "adhesion-can diagnose 'drive one.log' --config new.toml"
    )


@pytest.mark.parametrize(
    ("doubts", "objections", "last", "wanted"),
    [
        ([Doubt.NONE], {}, estimate(), "Next: adhesion-can run -i INTERFACE -c"),
        ([Doubt.NONE, Doubt.AXLE], {}, estimate(), "differ. Next: adhesion-can diagnose"),
        ([Doubt.NONE], {Objection.EFFORTS_JUMP: 0.9}, estimate(), "Next: adhesion-can run -i"),
        ([Doubt.AXLE], {Objection.LOADS_JUMP: 0.9}, estimate(), "check the axle-load sensors"),
        ([Doubt.NONE], {Objection.NO_RELIEF: 0.9}, estimate(), "record a drive with more reliefs"),
        ([Doubt.NONE], {}, estimate(identifiable=False), "Next: adhesion-can identify"),
        ([Doubt.NONE], {}, None, "The service found no curve. Next: adhesion-can check"),
    ],
)  # fmt: skip
def test_what_follows_a_replay(doubts, objections, last, wanted):
    assert wanted in after_replay(last, doubts, objected(objections), LOG).line


def test_a_doubt_that_stays_with_a_model_does_not_lead_back_to_its_diagnosis():
    typed = replace(LOG, model=Path("m.toml"))
    step = after_replay(estimate(), [Doubt.AXLE], ObjectionLog(), typed)
    assert step.finding.startswith("With the model too: The service doubts its curve")
    assert step.action == (
        "test it on another drive: adhesion-can evaluate OTHER.log --model m.toml --config "
        "tram.toml"
    )


def test_a_useful_model_of_a_table_is_run_and_not_identified_and_evaluated_again():
    gain = SimpleNamespace(percent=12.0, interval=(8.0, 15.0))
    found = SimpleNamespace(total=SimpleNamespace(refitted=gain))
    typed = replace(TABLE, model=Path("m.toml"))
    assert after_evaluation(found, typed).action == (
        "adhesion-can run -i INTERFACE -c CHANNEL --model m.toml"
    )


def objected(seconds):
    """The objections of a drive of 10 s that starts with them."""
    out = ObjectionLog()
    names = [objection for objection, s in seconds.items() for _ in range(round(50 * s))]
    for cycle in range(500):
        out.add(20_000 * cycle, names[cycle] if cycle < len(names) else Objection.NONE)
    return out


@pytest.mark.parametrize("objection", WORDINGS)
def test_a_lasting_objection_names_what_to_check_and_not_the_check_that_led_to_it(objection):
    step = after_replay(estimate(), [Doubt.NONE], objected({objection: 5.0}), LOG)
    assert "objects to the readings, longest at 0.0 .. 5.0 s: " in step.finding
    record = "record a drive with more reliefs (relieve "
    assert step.action.startswith(record if objection in NEEDS_RELIEF else "check ")
    assert "adhesion-can check" not in step.action
    assert re.search(r"then adhesion-can replay ('drive one.log'|NEW.log) --config", step.action)


@pytest.mark.parametrize(
    ("percent", "interval", "finding", "action"),
    [
        (12.0, (8.0, 15.0), "are of practical use on these data: gain 12.0 %", "replay"),
        (0.1, (0.05, 0.15), "hardly act on these data: gain 0.10 %", "record a drive in which"),
        (3.0, (-1.0, 6.0), "It is not certain that the model's effects help", "diagnose"),
        (-9.0, (-12.0, -3.0), "make the prediction worse on these data: gain -9.0 %", "diagnose"),
        (3.0, (-inf, inf), "It is not known whether the model's effects help", "record a longer"),
    ],
)
def test_what_follows_an_evaluation_is_what_the_gain_is_worth(percent, interval, finding, action):
    gain = SimpleNamespace(percent=percent, interval=interval)
    found = SimpleNamespace(total=SimpleNamespace(refitted=gain))
    step = after_evaluation(found, LOG)
    assert finding in step.finding
    assert action in step.action
