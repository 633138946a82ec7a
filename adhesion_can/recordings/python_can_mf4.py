"""python-can's reader of MF4, whose package is imported where a file of MF4 is read.

python-can imports asammdf, and pandas by it, whenever they are installed: half a second at every
start, for one of its readers. A command of ours puts that off; a program that imports this package
as a library finds python-can as it is.
"""

import sys
from collections.abc import Sequence
from importlib import reload
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

_READER = "can.io.mf4"
"""Module of python-can that reads MF4, and does without asammdf where it is not installed."""


class _Later:
    """Finds no asammdf while python-can's reader is imported; everybody else gets it.

    A finder by its method alone: `importlib.abc` takes longer to import than this module.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Nothing, or an error where python-can asks for asammdf."""
        del path, target
        reader = sys.modules.get(_READER)
        is_read = reader is not None and getattr(reader.__spec__, "_initializing", False)
        if fullname == "asammdf" and is_read:
            raise ModuleNotFoundError("asammdf is imported where a file of MF4 is read")
        return None


_LATER = _Later()


def put_off_asammdf() -> None:
    """Let python-can be imported without asammdf, in this process."""
    if _LATER not in sys.meta_path:
        sys.meta_path.insert(0, _LATER)


def mf4_reader(file: Any) -> Any:
    """python-can's reader of a file of MF4.

    Args:
        file: Path, or a file that is open for reading bytes.

    Raises:
        NotImplementedError: The package asammdf is not installed.

    """
    from can.io import mf4  # noqa: PLC0415  imported with python-can, and perhaps to be read anew

    if getattr(mf4, "asammdf", None) is None:
        if _LATER in sys.meta_path:
            sys.meta_path.remove(_LATER)
        reload(mf4)
    return mf4.MF4Reader(file)
