"""Targets and tables of the worlds by others."""

from collections import Counter
from collections.abc import Sequence

from judge import JudgedRecord
from outside import MECHANISM_GROUPS, OUTSIDE_GROUPS
from shares import Target, markdown_table, share
from work import NO_WORLD

from tests.worlds import SINGLES

TITLES = {"short": "drives of 30 s", "table": "tables of samples", "drives": "two drives"}
LOUD = 0.10
FALSE = ("wrong", "kept with a false one")


def outside_targets(rows: Sequence[JudgedRecord]) -> list[Target]:
    """Targets of the worlds by others; none where there are no such drives."""
    by_group = {
        group: [r for r in rows if r.group == group and r.answer != (NO_WORLD,)]
        for group in OUTSIDE_GROUPS
    }
    result = []
    for group in MECHANISM_GROUPS:
        if own := by_group[group]:
            loud = [r for r in own if r.excess is not None and r.excess >= LOUD]
            title = f"{group}: not called noise where it raises the RMSE by 10 % and more"
            result += [
                _false(group, own, 0.03),
                share(title, (r.outcome != "nothing" for r in loud), 0.0),
            ]
    for kind in dict.fromkeys(r.kind for r in by_group["memory"]):
        result += [_false(kind, [r for r in by_group["memory"] if r.kind == kind], 0.02)]
    if own := by_group["car"]:
        spoken = (r.outcome != "nothing" for r in own)
        result += [
            _false("multi-body car", own, 0.03),
            share("multi-body car: never called noise", spoken, 1.0),
        ]
    if own := by_group["mech"]:
        right = (r.outcome == "named" for r in own)
        result += [
            share("families: named alone with the right size", right, 0.90),
            _false("families", own, 0.03),
        ]
    if own := by_group["beside"]:
        kept = (r.outcome in ("kept", "kept with a false one") for r in own)
        result += [
            share("a true cause beside an unlisted mechanism: kept", kept, 0.70),
            _false("a true cause beside an unlisted mechanism", own, 0.03),
        ]
    for form, title in TITLES.items():
        if own := [r for r in rows if r.group == form and r.answer != (NO_WORLD,)]:
            single = [r for r in own if r.kind.partition(":")[2] in SINGLES]
            result += [
                _false(title, own, 0.03),
                share(f"{title}: single effects named, or with their rivals",
                      (r.found for r in single), 0.0),
            ]  # fmt: skip
    return result


def outside_outcomes(rows: Sequence[JudgedRecord]) -> list[str]:
    """Every kind and what was answered, as Markdown; '' for a group without drives."""
    silent = ("unexplained", "nothing", "failed")
    family = ("named", "wrong size", "size unknown", "rival", "with others", "wrong", *silent)
    beside = ("kept", "kept with a false one", "lost", "wrong", "failed")
    return [
        *(outcome_table(rows, group, ("same", "wrong", *silent)) for group in MECHANISM_GROUPS),
        outcome_table(rows, "mech", family),
        outcome_table(rows, "beside", beside),
        outcome_table(rows, "memory", ("nothing", "unexplained", "wrong", "failed")),
        outcome_table(rows, "car", ("same", "wrong", *silent)),
        *(
            outcome_table(rows, form, ("named", "rival", "same", "wrong", *silent))
            for form in TITLES
        ),
    ]


def outcome_table(rows: Sequence[JudgedRecord], group: str, columns: Sequence[str]) -> str:
    """Kinds of a group with their outcomes, and all that was named."""
    lines = []
    for kind in dict.fromkeys(r.kind for r in rows if r.group == group):
        own = [r for r in rows if r.kind == kind]
        counts = Counter(r.outcome for r in own)
        answers = Counter(" + ".join(r.answer) for r in own if r.answer)
        cells = (str(counts[column] or ".") for column in columns)
        named = ", ".join(f"{name} {n}" for name, n in answers.most_common())
        lines.append((kind, str(len(own)), *cells, named))
    return markdown_table((group, "drives", *columns, "answers"), lines) if lines else ""


def _false(title: str, own: Sequence[JudgedRecord], most: float) -> Target:
    return share(f"{title}: false names", (r.outcome in FALSE for r in own), 0.0, most)
