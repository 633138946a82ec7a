"""Picture of the report of a replay: a simulated drive, its page, and a browser's view of it."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from adhesion_can.cli.main import main as adhesion_can

WIDTH, HEIGHT = 1180, 1420
"""Part of the page that is shown, px: result and overview."""
COLOURS = 96
DRIVE = ("simulate", "--scenario", "dry-wet-greasy-dry", "--duration", "60", "--seed", "3")


def main(target):
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        sys.exit("report.py: needs Chromium: apt-get install chromium")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log, page, shot = folder / "drive.log", folder / "report.html", folder / "shot.png"
        adhesion_can([*DRIVE, "--log", str(log)])
        adhesion_can(["replay", str(log), "--html", str(page)])
        subprocess.run(
            [
                browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
                "--disable-background-networking", "--disable-component-update", "--disable-sync",
                "--no-first-run", f"--user-data-dir={folder / 'profile'}",
                "--virtual-time-budget=20000", f"--window-size={WIDTH},{HEIGHT}",
                f"--screenshot={shot}", page.as_uri(),
            ],
            check=True, capture_output=True, timeout=120,
        )  # fmt: skip
        with Image.open(shot) as image:
            image.convert("RGB").quantize(COLOURS).save(target, optimize=True)
    print(f"wrote {Path(target).name}")


if __name__ == "__main__":
    main(sys.argv[1])
