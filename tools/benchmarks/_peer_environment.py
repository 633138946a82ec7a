"""Environments of peers that are compared with, made under build/ when they are first needed."""

import subprocess
import sys
from pathlib import Path

from _report import aside

BUILD = Path(__file__).resolve().parents[2] / "build"


def peer_python(name, packages, report):
    """Python of an environment with some packages; None, which is reported, without one."""
    folder = BUILD / name
    python, stamp = folder / "bin" / "python", folder / "installed"
    if not stamp.exists():
        aside(f"installing {', '.join(packages)} into {folder} (once)")
        pip = [str(python), "-m", "pip", "install", "-q", "--disable-pip-version-check", *packages]
        for words in ([sys.executable, "-m", "venv", "--clear", str(folder)], pip):
            done = subprocess.run(words, capture_output=True, text=True, check=False)
            if done.returncode:
                reason = (done.stderr or done.stdout).strip().splitlines()[-1:]
                report.write(f"no peers: {' '.join(words)} failed: {' '.join(reason)}")
                return None
        stamp.touch()
    return python
