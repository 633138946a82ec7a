"""Figures of the documents beside what the commands that they name print today."""

import os
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parent.parent
CLAIMS = ROOT / "tools" / "claims.toml"
MOST_COMMITS = 50
"""Most commits of the code that a claim depends on before it is to be measured again."""


@dataclass(frozen=True)
class Figure:
    """A figure that a command prints.

    Attributes:
        printed: Regular expression with one group: the number in what the command prints.
        value: The number in the document.
        within: Largest difference, in the unit of the number.

    """

    printed: str
    value: float
    within: float


@dataclass(frozen=True)
class Claim:
    """Figures of a document, and where they come from.

    Attributes:
        document: Path of the document.
        text: Words of the document with the figures.
        command: Command that prints them, for a shell in an empty folder; $ROOT is this repository,
            $DATA the folder of measured data.
        commit: Commit at which they were measured.
        date: Day of that, ISO 8601.
        code: Paths of the code that they depend on.
        figures: What a command of less than a minute prints; empty for a longer one.

    """

    document: str
    text: str
    command: str
    commit: str
    date: str
    code: tuple[str, ...]
    figures: tuple[Figure, ...] = ()

    @property
    def is_stated(self) -> bool:
        """Whether the document has the words, whatever its line breaks."""
        return _flat(self.text) in _flat((ROOT / self.document).read_text())

    def count_commits(self) -> int | None:
        """Number of commits of the code since; None where the history is not at hand."""
        words = ["git", "rev-list", "--count", f"{self.commit}..HEAD", "--", *self.code]
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
        return int(done.stdout) if done.returncode == 0 else None


def read_claims(path: Path = CLAIMS) -> list[Claim]:
    """All claims, in the order of the file."""
    common = tomllib.loads(path.read_text())
    claims = []
    for one in common["claim"]:
        figures = tuple(Figure(**figure) for figure in one.pop("figures", ()))
        one["code"] = tuple(part for name in one.pop("code") for part in common["code"][name])
        claims.append(Claim(**one, figures=figures))
    return claims


def run(claim: Claim) -> str:
    """What the command prints, both streams."""
    data = Path(os.environ.get("ADHESION_CAN_REALDATA", ROOT.parent / "shared" / "realdata"))
    environment = {**os.environ, "ROOT": str(ROOT), "DATA": str(data)}
    with TemporaryDirectory() as folder:
        words = ["bash", "-euo", "pipefail", "-c", claim.command]
        done = subprocess.run(
            words, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
    return done.stdout + done.stderr


def compare(claim: Claim, printed: str) -> list[str]:
    """A line for each figure that the command prints otherwise, or no longer."""
    wrong = []
    for figure in claim.figures:
        found = re.search(figure.printed, printed)
        if found is None:
            wrong.append(f"prints nothing like {figure.printed!r}")
        elif abs(float(found[1]) - figure.value) > figure.within:
            wrong.append(f"prints {found[1]}, the document says {figure.value:g}")
    return wrong


def check(claim: Claim) -> tuple[str, str]:
    """Verdict on a claim ('ok', 'OLD' or 'WRONG'), and what there is to say of it."""
    if not claim.is_stated:
        return "WRONG", f"{claim.document} does not say this any more"
    if claim.figures:
        wrong = compare(claim, run(claim))
        return ("WRONG", "; ".join(wrong)) if wrong else ("ok", "as printed")
    age = claim.count_commits()
    if age is None:
        return "ok", f"measured {claim.date}"
    verdict = "OLD" if age > MOST_COMMITS else "ok"
    return verdict, f"measured {claim.date}, {age} commits of its code ago"


def main() -> int:
    """Run the command; 1 where a figure is wrong or too old, 2 where no claim is meant."""
    wanted = " ".join(sys.argv[1:])
    claims = [c for c in read_claims() if wanted in f"{c.document} {c.text} {c.command}"]
    if not claims:
        print(f"no claim has {wanted!r} in its document, text or command")
        return 2
    failed = 0
    for claim in claims:
        verdict, words = check(claim)
        print(f"{verdict:5} {claim.document}: {claim.text}")
        print(f"      {claim.command}: {words}", flush=True)
        failed += verdict != "ok"
    print(f"{failed} wrong, or more than {MOST_COMMITS} commits old")
    return 1 if failed else 0


def _flat(text: str) -> str:
    """A text without line breaks and runs of spaces."""
    return " ".join(text.split())


if __name__ == "__main__":
    sys.exit(main())
