"""The rules between selection and confirmation: their order, their reasons, and the docs."""

import re
from pathlib import Path

from adhesion_can.diagnosis.rules import RULES, Rule, apply_rules

ARCHITECTURE = Path(__file__).resolve().parents[2] / "docs" / "architecture.md"


def test_each_rule_starts_from_what_the_one_before_has_left(monkeypatch):
    rules = tuple(Rule(lambda found, k=k: [*found, k], "a reason") for k in range(3))
    monkeypatch.setattr("adhesion_can.diagnosis.rules.RULES", rules)
    assert apply_rules(["selected"]) == ["selected", 0, 1, 2]


def test_each_rule_has_a_reason_of_one_sentence():
    for rule in RULES:
        assert re.fullmatch(r"[A-Z][^.]+\.", rule.reason), rule.reason


def test_the_architecture_lists_them_in_their_order():
    listed = re.findall(r"^\| rule `(\w+)`", ARCHITECTURE.read_text(encoding="utf-8"), re.MULTILINE)
    assert listed == [rule.apply.__name__ for rule in RULES]
