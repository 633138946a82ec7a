"""The line that installs an extra of this package, as it can be typed where it is printed."""

import os
import shlex
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from adhesion_can.errors import InputError


@contextmanager
def needing_extra(name: str, where: str, what: str, note: str = "") -> Iterator[None]:
    """Imports of packages that come with an extra.

    Args:
        name: Extra of pyproject.toml.
        where: Option or file that asks for it.
        what: What needs which packages.
        note: What is said behind the missing module.

    Raises:
        InputError: The extra is not installed.

    """
    try:
        yield
    except ImportError as error:
        missing = f"{what} (no module {error.name!r}){note}"
        raise InputError(where, missing, install_extra(name)) from error


def install_extra(name: str) -> str:
    """Command that installs an extra.

    In a clone it names the clone, for the extra's packages are those of its pyproject.toml. In an
    installed package it names the distribution, which pip finds installed: it adds the packages
    of the extra and leaves the version as it is.

    Args:
        name: Extra of pyproject.toml, as 'report'.

    """
    clone = _clone()
    if clone is None:
        return install_package(f"adhesion-can[{name}]")
    place = "." if clone == Path.cwd() else _from_here(clone)
    return f"{_pip()} install -e {shlex.quote(f'{place}[{name}]')}"


def install_package(requirement: str) -> str:
    """Command that installs a package into the environment of this process."""
    return f"{_pip()} install {shlex.quote(requirement)}"


def _clone() -> Path | None:
    """Folder of the clone that this package is imported from; None: it is installed."""
    folder = Path(__file__).resolve().parents[1]
    try:
        text = (folder / "pyproject.toml").read_text(encoding="utf-8")
    except OSError:
        return None
    return folder if 'name = "adhesion-can"' in text else None


def _pip() -> str:
    """The pip of this environment: by its name where that finds it, else by its path."""
    folder = Path(sys.executable).parent
    pip_on_path = shutil.which("pip")
    if pip_on_path is not None and Path(pip_on_path).parent == folder:
        return "pip"
    if os.access(folder / "pip", os.X_OK):
        return shlex.quote(_from_here(folder / "pip"))
    python = shlex.quote(_from_here(Path(sys.executable)))
    return f"{python} -m pip"


def _from_here(path: Path) -> str:
    """A path below the current folder without that folder, any other one whole."""
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)
