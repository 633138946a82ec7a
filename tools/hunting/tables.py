"""The confusion and the targets as Markdown, which reads well enough on a terminal too."""

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
from judge import JudgedRecord
from outside_tables import outside_outcomes, outside_targets
from shares import Target, at_most, bounds, markdown_table, share
from work import NO_WORLD

__all__ = ["bounds", "confusion", "share", "target_table", "targets"]

from tests.worlds import CONTACTS, LAWS, NULLS, OUTSIDE, POINTS, SINGLES


def targets(rows: Sequence[JudgedRecord]) -> list[Target]:
    """Every target of the hunt."""
    singles = [r for r in rows if r.group == "single"]
    pairs = [r for r in rows if r.group == "pair"]
    outside = [r for r in rows if r.group == "out"]
    named = [r for r in rows if r.found]
    seconds = [r.seconds for r in rows]
    memory = [r.rss_mb for r in rows if r.rss_mb is not None]
    ratios = [r.floor_ratio for r in singles if r.found and r.floor_ratio is not None]
    result = [share("single effects named, or with their rivals", (r.found for r in singles), 0.95)]
    for effect in SINGLES:
        own = [r.found for r in singles if r.kind == effect]
        if own:
            result.append(share(f"- {effect}", own, 0.85))
    if laws := [r.found for r in rows if r.group == "law"]:
        result.append(share("single effects by another law named, or with rivals", laws, 0.92))
    result += [
        share("pairs: both named", (r.outcome == "both" for r in pairs), 0.75),
        share("pairs: at least one named", (r.outcome in ("both", "one") for r in pairs), 0.95),
    ]
    for kind in NULLS:
        own = [r.outcome == "nothing" for r in rows if r.kind == kind]
        if own:
            result.append(share(f"{kind}: nothing found", own, 0.95))
    result.append(
        share("outside: unexplained, channel right", (r.outcome == "unexplained" for r in outside),
              0.85)
    )  # fmt: skip
    for kind in OUTSIDE:
        own = [r.outcome == "unexplained" for r in outside if r.kind == kind]
        if own:
            result.append(share(f"- {kind}", own, 0.85))
    result += contact_targets(rows)
    result += outside_targets(rows)
    covered = [r.covered for r in named if r.covered is not None]
    median = float(np.median(seconds)) if seconds else None
    longest = f", longest {max(seconds):.1f} s" if seconds else ""
    result += [
        share("gain: interval holds the true one (all hidden was named)", covered, 0.85, 0.97),
        share("RMSE after extension at most 1.10 of the noise floor (singles named)",
              (ratio <= 1.10 for ratio in ratios), 0.95),
        share("parameters in their 95 % interval (named by name)",
              (hit for r in rows for hit in r.inside), 0.85),
        at_most("time, median", median, 10.0, "s", longest),
        at_most("memory, peak", max(memory) if memory else None, 2048.0, "MiB"),
    ]  # fmt: skip
    return result


def contact_targets(rows: Sequence[JudgedRecord]) -> list[Target]:
    """Targets of contacts that are not Burckhardt's; none where there are no such drives."""
    contacts = [r for r in rows if r.group == "contact"]
    # A drive that could not be made says nothing of the diagnosis.
    beside = [r for r in rows if r.group == "contact+" and r.answer != (NO_WORLD,)]
    points = [r for r in rows if r.group == "points"]
    if not (contacts or beside or points):
        return []
    result = []
    for title, own in (("contacts", contacts), ("points", points)):
        right = (r.outcome in ("named", "nothing below noise") for r in own)
        peaks = [r.peak for r in own if r.peak is not None]
        slips = [p.lambda_m for p in peaks if p.lambda_m is not None]
        result += [
            share(f"{title}: shape or falling friction named, or too small", right, 0.95),
            share(f"{title}: no sensor or vehicle error blamed",
                  (not r.blames_instrument for r in own), 0.97),
            share(f"{title}: μ_max after extension within 1 %",
                  (abs(p.mu_max) <= 0.01 for p in peaks), 0.95),
            share(f"{title}: λ_m after extension within 8 %",
                  (abs(slip) <= 0.08 for slip in slips), 0.95),
            share(f"{title}: peak in its 95 % interval",
                  (hit for p in peaks for hit in p.covered), 0.90),
        ]  # fmt: skip
    result.append(
        share("contact and effect: effect named", (r.outcome in ("both", "one") for r in beside),
              0.90)
    )  # fmt: skip
    result.append(
        share("contact and effect: no sensor or vehicle error blamed",
              (not r.blames_instrument for r in beside), 0.97)
    )  # fmt: skip
    return result


def target_table(found: Sequence[Target], figure: str = "figure (one-sided 95 % bounds)") -> str:
    """Targets as Markdown; `figure` is the heading of the figures."""
    head = ("target", "wanted", figure, "verdict")
    return markdown_table(head, [(t.what, t.wanted, t.figure, t.verdict) for t in found])


def confusion(rows: Sequence[JudgedRecord]) -> str:
    """Every kind and what was answered, as Markdown."""
    parts = [
        _outcomes(
            rows,
            "single effect",
            SINGLES,
            ("named", "rival", "wrong", "unexplained", "nothing", "failed"),
        ),
        _outcomes(
            rows,
            "single effect by another law",
            LAWS,
            ("named", "rival", "wrong", "unexplained", "nothing", "failed"),
        ),
        _pairs(rows),
        _outcomes(rows, "no effect", NULLS, ("nothing", "wrong", "unexplained", "failed")),
        _outcomes(
            rows,
            "outside the library",
            OUTSIDE,
            ("unexplained", "wrong channel", "wrong", "nothing", "failed"),
        ),
    ]
    shapes = ("named", "nothing below noise", "wrong", "unexplained", "nothing", "failed")
    parts.append(_outcomes(rows, "contact", CONTACTS, shapes))
    besides = sorted({r.kind for r in rows if r.group == "contact+"})
    columns = ("both", "one", "shape", "wrong", "unexplained", "nothing", "failed")
    parts.append(_outcomes(rows, "contact and effect", besides, columns))
    parts.append(_outcomes(rows, "points of a contact", POINTS, shapes))
    parts += outside_outcomes(rows)
    return "\n\n".join(part for part in parts if part)


def _outcomes(
    rows: Sequence[JudgedRecord], title: str, kinds: Sequence[str], columns: Sequence[str]
) -> str:
    lines = []
    for kind in kinds:
        own = [r for r in rows if r.kind == kind]
        if own:
            counts = Counter(r.outcome for r in own)
            # A null that is called unexplained went wrong, whatever channel is blamed.
            answers = Counter(" + ".join(r.answer) for r in own if not r.found and r.answer)
            # Right answers are not listed.
            if kind in OUTSIDE:
                answers = Counter(
                    " + ".join(r.answer) for r in own if r.outcome != "unexplained" and r.answer
                )
            instead = ", ".join(f"{name} {n}" for name, n in answers.most_common())
            lines.append((kind, str(len(own)), *(_count(counts[c]) for c in columns), instead))
    return markdown_table((title, "drives", *columns, "instead"), lines) if lines else ""


def _pairs(rows: Sequence[JudgedRecord]) -> str:
    """Pairs by the effects that are in them."""
    pairs = [r for r in rows if r.group == "pair"]
    columns = ("both", "one", "wrong", "unexplained", "nothing", "failed")

    def line(name: str, has: Callable[[JudgedRecord], bool]) -> tuple[str, ...]:
        own = [r for r in pairs if has(r)]
        counts = Counter(r.outcome for r in own)
        return (name, str(len(own)), *(_count(counts[c]) for c in columns))

    if not pairs:
        return ""
    lines = [line("all", lambda _: True)]
    for effect in SINGLES:
        row = line(effect, lambda r, e=effect: e in _members(r.kind))  # type: ignore[misc]
        if row[1] != "0":
            lines.append(row)
    return markdown_table(("pairs with", "drives", *columns), lines)


def _members(kind: str) -> list[str]:
    return kind.removeprefix("pair:").split("+")


def _count(n: int) -> str:
    return str(n) if n else "."
