"""What one test decides about an effect is the same in every sentence, table and figure."""

from dataclasses import replace
from math import nan
from types import SimpleNamespace

import pytest

from adhesion_can import diagnose, simulate
from adhesion_can.config.plan_file import read_plan, write_plan
from adhesion_can.diagnosis import build_evidence
from adhesion_can.diagnosis.evidence import Decision, EffectEvidence
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.model_comparison import LEVEL
from adhesion_can.diagnosis.inference.model_selection import ModelSelection
from adhesion_can.diagnosis.next_drive.apply_remaining import apply_remaining
from adhesion_can.diagnosis.next_drive.remaining import RemainingExplanations
from adhesion_can.reporting.diagnosis import terminal
from adhesion_can.reporting.diagnosis_figures import environment_figure
from adhesion_can.reporting.diagnosis_tables import DECISIONS, evidence_rows
from tests.diagnosis.test_model_comparison import BLOCKS, scored

LAW, RIVAL = "load_dependence", "load_transfer"


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """Diagnosis of a drive with a rival, and of it together with the drive that was planned."""
    folder = tmp_path_factory.mktemp("two")
    first = simulate("sweep", 120.0, 3, effects=[LAW]).write(folder / "first.log")
    before = diagnose(first, next_drive=True)
    write_plan(before.next_drive.plan, folder / "plan.toml")
    plan = read_plan(folder / "plan.toml")
    second = simulate("dry", None, 2, effects=[LAW], plan=plan).write(folder / "second.log")
    return before, diagnose([first, second])


@pytest.mark.slow
def test_what_a_further_drive_refutes_is_refuted_in_the_evidence_too(two):
    before, after = two
    assert before.causes[0].rivals == (RIVAL,)
    assert after.causes[0].rivals == ()
    (refuted,) = after.remaining.refuted
    assert refuted.name.startswith(RIVAL)
    assert "(limit: 1.6)" in refuted.reason
    own = [one for one in after.evidence if one.effect == RIVAL]
    assert {one.decision for one in own} == {Decision.REFUTED}
    assert all(one.worse_p_value == after.remaining.p_value < LEVEL for one in own)
    cells = {row[0]: row[-1] for row in evidence_rows(after.evidence)}
    assert cells["load_transfer geometry"].startswith("refuted, p ")
    text = " ".join(part for part in terminal(after) if isinstance(part, str))
    assert DECISIONS[Decision.REFUTED].meaning in text


@pytest.mark.slow
def test_a_size_is_the_same_in_all_data_wherever_it_is_shown(two):
    for found in two:
        value = found.causes[0].parameters[0].value
        assert {one.size for one in found.environments} == {value}
        figure = environment_figure(found.environments)
        assert figure.layout["shapes"][0]["x0"] == pytest.approx(value * 1e12)
        assert figure.layout["xaxis"]["title"]["text"] == "c5, × 10⁻¹² 1/N²"
        assert f"{value:.4g} 1/N²" in figure.caption


def effect(name, axle=0):
    return SimpleNamespace(effect=SimpleNamespace(id=name), axle=axle)


@pytest.mark.parametrize(
    ("refuted", "left"), [({}, 2), ({("b", 0): 0.01}, 1), ({("b", 2): nan}, 2)]
)
def test_a_refuted_rival_is_no_rival(refuted, left):
    best, b, c = (scored([1.0] * BLOCKS, 1.0, (effect(name),)) for name in "abc")
    selection = ModelSelection(best, best, (b, c), (), None, known_rivals={"a": ("b", "c")})
    found = Findings(None, None, selection, None, None, (), [], 1.0, 0.01, 0.025)
    remaining = RemainingExplanations(("1",), ("2",), ("a", "c"), (), refuted_effects=refuted)
    applied, _ = apply_remaining(found, None, found, remaining)
    assert len(applied.selection.indistinguishable) == left
    assert ("b" in applied.selection.known_rivals["a"]) == (left == 2)
    assert apply_remaining(found, None, found, None)[0] is found


def evidence(decision, effect="b"):
    return EffectEvidence(effect, "", 0, 3.0, 0.001, 0.1, ("a", 0.5), 3.0, decision)


def test_a_further_drive_overrules_what_is_open_and_no_name():
    given = [evidence(Decision.WORSE), evidence(Decision.NAMED), evidence(Decision.RIVAL, "c")]
    first, named, other = build_evidence._mark_refuted(given, {("b", 0): 0.002})
    assert (first.decision, first.worse_p_value) == (Decision.REFUTED, 0.002)
    assert named.decision is Decision.NAMED
    assert other.decision is Decision.RIVAL


def test_worse_is_what_the_test_of_rivals_calls_worse():
    drives = SimpleNamespace(drives=(None,))
    found = SimpleNamespace(regression=SimpleNamespace(data=drives))
    best = scored([1.0] * BLOCKS, 1.0)
    sure = scored([1.2, 1.1] * (BLOCKS // 2), 1.1)
    unsure = scored([2.0, 0.2] * (BLOCKS // 2), 1.1)
    assert build_evidence._compare(found, best, sure)[0] is Decision.WORSE
    decision, p_value = build_evidence._compare(found, best, unsure)
    assert decision is Decision.NOT_BETTER
    assert p_value >= LEVEL


def unnamed(fit, **found):
    plain = scored([1.0] * BLOCKS, 1.0)
    selection = SimpleNamespace(plain=plain, test=SimpleNamespace(independent=5.0))
    given = {"oscillates": False, "saturated": (), "explains": True, **found}
    return build_evidence._why_not_named(SimpleNamespace(selection=selection, **given), fit)


def test_an_effect_without_a_name_says_which_test_it_failed():
    clear = scored([0.5, 0.4] * (BLOCKS // 2), 0.7)
    unsure = scored([0.1, 1.5] * (BLOCKS // 2), 0.7)
    assert unnamed(scored([0.9] * BLOCKS, 0.995)) == "gain < 1 %"
    assert unnamed(scored([0.998] * BLOCKS, 0.9)) == "block gain < 0.5 %"
    assert unnamed(unsure).startswith("gain p = ")
    assert unnamed(clear, oscillates=True) == "oscillation"
    assert unnamed(clear, saturated=(1,)) == "cut-off efforts"
    assert unnamed(clear, explains=False) == "more is left"
    assert unnamed(clear) == "unconfirmed"


def test_the_reason_is_in_the_row_and_ends_with_another_decision():
    one = replace(evidence(Decision.NOT_NAMED), why="gain < 1 %")
    ((*_, cell),) = evidence_rows([one])
    assert cell == "not named: gain < 1 %"
    (refuted,) = build_evidence._mark_refuted([one], {("b", 0): 0.002})
    assert evidence_rows([refuted])[0][-1] == "refuted, p = 0.002"
    cause = SimpleNamespace(rivals=("b",))
    (rival,) = build_evidence._mark_rivals([one], [cause])
    assert evidence_rows([rival])[0][-1] == "rival"


def test_every_decision_has_a_name_and_a_meaning_with_its_limit():
    assert set(DECISIONS) == set(Decision)
    assert len({one.name for one in DECISIONS.values()}) == len(Decision)
    for one in (Decision.WORSE, Decision.NOT_BETTER, Decision.NOT_NAMED, Decision.NOT_SIGNIFICANT):
        assert "limit p = 0.0" in DECISIONS[one].meaning
