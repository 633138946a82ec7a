"""Writes the pages of docs/reference, or says which are not up to date (--check)."""

import argparse
import sys
from pathlib import Path

from reference_pages import PAGES

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "reference"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing; status 1 if stale")
    check = parser.parse_args().check
    made = {FOLDER / name: make() for name, make in PAGES.items()}
    stale = [path for path, text in made.items() if not path.exists() or path.read_text() != text]
    for path in stale:
        if check:
            print(f"docs/reference/{path.name} is not up to date: run tools/references")
        else:
            path.write_text(made[path])
    return 1 if check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
