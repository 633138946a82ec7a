"""Which drives a hunt makes, and what it is known by."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.worlds import (
    CONTACT_EFFECTS,
    CONTACTS,
    KINDS,
    LAWS,
    NULLS,
    OUTSIDE,
    PAIRS,
    POINTS,
    SINGLES,
)
from tests.worlds.outside.car import CARS
from tests.worlds.outside.kinds import (
    ASIDE,
    BESIDE,
    MECH,
    MEMORY,
    OPEN,
    OUTSIDE_KINDS,
    SECOND,
)

ROOT = Path(__file__).resolve().parents[2]
PAIRS_A_ROUND = 10
CONTACT_EFFECTS_A_ROUND = 6
BESIDE_A_ROUND = 8
FORMS_A_ROUND = 6
GROUPS = {
    "single": SINGLES,
    "law": LAWS,
    "pair": PAIRS,
    "null": NULLS,
    "out": OUTSIDE,
    "contact": CONTACTS,
    "contact+": CONTACT_EFFECTS,
    "points": POINTS,
    "outside": (*OPEN, *ASIDE),
    "outside:open": OPEN,
    "outside:aside": ASIDE,
    "outside:second": SECOND,
    "mech": MECH,
    "beside": BESIDE,
    "memory": MEMORY,
    "car": CARS,
}
FORM_KINDS = (*SINGLES, *OPEN, *MEMORY)
FORMS = ("short", "table", "drives")
"""Drives of 30 s, tables of samples, two drives of one world: `short:KIND` and so on."""
GROUPS |= {form: tuple(f"{form}:{kind}" for kind in FORM_KINDS) for form in FORMS}
BY_OTHERS = (
    "outside", "outside:open", "outside:aside", "outside:second", "mech", "beside", "memory", "car",
    *FORMS,
)  # fmt: skip
"""Groups that a hunt draws only where it is asked for them: half of the first is set aside, and the
second set, which is in no other group."""


@dataclass(frozen=True)
class Task:
    """A drive to make and to diagnose."""

    kind: str
    seed: int


def find_group(kind: str) -> str:
    """One of `GROUPS`; 'contact+' is a contact with an effect besides."""
    head = kind.partition(":")[0]
    if head == "contact" and "+" in kind:
        return "contact+"
    if head == "outside":
        named = {"outside:aside": ASIDE, "outside:second": SECOND}
        return next((group for group, own in named.items() if kind in own), "outside:open")
    if kind in MEMORY:
        return "memory"
    return head if head in GROUPS else "single"


def split_form(kind: str) -> tuple[str, str]:
    """Form ('' for a whole drive's log) and the kind of world that is given in it."""
    form, _, rest = kind.partition(":")
    return (form, rest) if form in FORMS else ("", kind)


def check_kinds(chosen: Sequence[str]) -> None:
    """Each one a kind or a group.

    Raises:
        ValueError: one is neither.

    """
    for name in chosen:
        known = (*KINDS, *OUTSIDE_KINDS, *CARS, *(k for form in FORMS for k in GROUPS[form]))
        if name not in known and name not in GROUPS:
            raise ValueError(f"no kind {name!r}: one of {', '.join(GROUPS)}, {', '.join(SINGLES)}")


def build_tasks(seed: int, rounds: int, only: Sequence[str]) -> list[Task]:
    """Every drive of a hunt, round by round.

    Args:
        seed: of the whole hunt; the first rounds are the same however many there are.
        rounds: each one has every single effect by both laws, null, outsider and contact once,
            ten pairs and six contacts with an effect besides; of the worlds by others, where `only`
            names them, every kind once, but eight effects beside a mechanism and six kinds in each
            form.
        only: kinds and groups; none: all but the worlds by others.

    """
    chosen = only or [name for name in GROUPS if name not in BY_OTHERS]
    tasks = []
    for number in range(rounds):
        rng = np.random.default_rng([seed, number])
        sampled = [PAIRS[k] for k in rng.choice(len(PAIRS), PAIRS_A_ROUND, replace=False)]
        contacts = rng.choice(len(CONTACT_EFFECTS), CONTACT_EFFECTS_A_ROUND, replace=False)
        everything = [*SINGLES, *LAWS, *sampled, *NULLS, *OUTSIDE, *CONTACTS]
        everything += [*(CONTACT_EFFECTS[k] for k in contacts), *POINTS]
        beside = rng.choice(len(BESIDE), BESIDE_A_ROUND, replace=False)
        everything += [*OPEN, *ASIDE, *SECOND, *MECH, *(BESIDE[k] for k in beside), *MEMORY, *CARS]
        for form in FORMS:
            drawn = rng.choice(len(FORM_KINDS), FORMS_A_ROUND, replace=False)
            everything += [GROUPS[form][k] for k in drawn]
        groups = [GROUPS[name] for name in chosen if name in GROUPS]
        kinds = [k for k in everything if k in chosen or any(k in group for group in groups)]
        kinds += [k for k in chosen if k not in GROUPS and k not in kinds]
        tasks += [Task(kind, seed + number) for kind in kinds]
    return tasks


def code_version() -> str:
    """Hash of all that a result depends on: the product, the worlds, the database."""
    digest = hashlib.sha256()
    files = [*ROOT.glob("adhesion_can/**/*.py"), *ROOT.glob("tests/worlds/**/*.py")]
    for path in sorted([*files, ROOT / "dbc" / "adhesion.dbc"]):
        digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.hexdigest()[:12]


class Results:
    """A JSON-lines file of what was found: a line a hunt that began and a line a drive."""

    def __init__(self, path: Path, version: str) -> None:
        self.path, self.version = path, version
        self._lines = _read(path) if path.exists() else []

    @property
    def seed(self) -> int | None:
        """Of the last hunt with this code."""
        seeds = [line["hunt"] for line in self._lines if "hunt" in line and self._ours(line)]
        return int(seeds[-1]) if seeds else None

    def records(self) -> list[dict[str, Any]]:
        """Drives that were diagnosed with this code, each one once."""
        found = {
            (line["kind"], line["seed"], line["holdout"], line.get("duration_s")): line
            for line in self._lines
            if "kind" in line and self._ours(line)
        }
        return list(found.values())

    def begin(self, seed: int) -> None:
        """Note the seed of a hunt, so that a killed one can go on."""
        if self.seed != seed:
            self.add({"hunt": seed})

    def add(self, line: dict[str, Any]) -> None:
        """Append a line at once: a killed hunt loses no more than what runs."""
        line = {"version": self.version, **line}
        self._lines.append(line)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a") as file:
            file.write(json.dumps(line) + "\n")

    def _ours(self, line: dict[str, Any]) -> bool:
        return bool(line.get("version") == self.version)


def _read(path: Path) -> list[dict[str, Any]]:
    """Lines of a results file; the last one may have been cut when the hunt was killed."""
    text = path.read_text()
    lines = text.splitlines()
    if text and not text.endswith("\n"):
        # Else the next line would be written on to it.
        path.write_text("".join(line + "\n" for line in lines[:-1]))
        lines = lines[:-1]
    return [json.loads(line) for line in lines]
