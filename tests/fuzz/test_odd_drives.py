"""Odd drives through the commands: a status of 0, 1 or 2, two lines at most, never a traceback.

The numbers are drawn by the state of the code, so that each change tries others; `tools/fuzz
--drives N` plays more.
"""

import hashlib
from pathlib import Path

import pytest

from tests.fuzz.mutants import DRIVES, mutant, play

PACKAGE = Path(__file__).resolve().parents[2] / "adhesion_can"
TRIED = {"drive.log": 40, "table.csv": 60}


def first_number():
    """A number that every change of the package's code makes another."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        digest.update(path.read_bytes())
    return int.from_bytes(digest.digest()[:4], "little")


@pytest.mark.costly
@pytest.mark.timeout(600)
@pytest.mark.parametrize("kind", DRIVES)
def test_odd_drives_are_used_or_refused(kind):
    first = first_number()
    statuses = set()
    for number in range(first, first + TRIED[kind]):
        try:
            statuses.add(play(kind, mutant(kind, number), number).status)
        except Exception as error:
            raise AssertionError(f"tools/fuzz --drives 1 --seed {number}") from error
    assert {0, 2} <= statuses
