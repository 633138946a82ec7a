"""What a service has learned, for `monitor --learned`: no message on the bus carries it."""

import time
import tomllib
from collections.abc import Callable
from pathlib import Path

from adhesion_can.errors import InputError

LOOK_S = 5.0
"""Time between two looks into the folder, s."""


class LearnedFolder:
    """Models that `run --learn` keeps in a folder, as sentences.

    Args:
        folder: Folder of `--learn-to`.
        clock: Monotonic clock, s.

    Raises:
        InputError: It is no folder.

    """

    def __init__(self, folder: Path, clock: Callable[[], float] = time.monotonic) -> None:
        if not folder.is_dir():
            reason = "is no folder" if folder.exists() else "does not exist"
            raise InputError(f"--learned {folder}", reason, "name the folder of run --learn-to")
        self._folder = folder
        self._clock = clock
        self._looked_s = -LOOK_S
        self._sentences: tuple[str, ...] = ()

    def sentences(self) -> tuple[str, ...]:
        """A sentence for each learned model; a folder that is not there any more has none."""
        now_s = self._clock()
        if now_s - self._looked_s >= LOOK_S:
            self._looked_s = now_s
            self._sentences = tuple(map(_describe, sorted(self._folder.glob("learned-*.toml"))))
        return self._sentences


def _describe(path: Path) -> str:
    """State and content of a learned model."""
    try:
        told = tomllib.loads(path.read_text(encoding="utf-8")).get("provenance", {})
        findings, state = told["found"], told["state"]
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, KeyError, AttributeError):
        return f"{path.name}: no learned model, or not readable."
    return f"Learned ({state}): {findings}; {path.name}."
