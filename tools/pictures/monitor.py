"""Picture of the monitor: its terminal program on a simulated drive, drawn by a browser."""

import asyncio
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from adhesion_can.cli.monitor_app import MonitorApp
from adhesion_can.cli.monitor_log import LogSource, survey
from adhesion_can.cli.monitor_session import MonitorSession
from adhesion_can.config import load_configuration
from adhesion_can.recordings.candump import format_frame
from adhesion_can.service.core import ServiceCore
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

DURATION_S, SHOWN_S = 20.0, 15.8
SIZE = (138, 46)
"""Columns and lines of the terminal."""
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--no-first-run", "--hide-scrollbars",
)  # fmt: skip
MARGIN = 4


def record(path, config):
    """A closed loop: what the locomotive and the service put on their bus."""
    settings = RunSettings(scenario_by_name("dry-wet-dry"), DURATION_S, obey=True)
    simulation = Simulation(settings, config.database)
    core = ServiceCore(config)
    with path.open("w") as file:
        for frames in simulation.run():
            for frame in frames:
                for answer in core.feed(frame):
                    simulation.receive(answer)
                    file.write(format_frame(answer, "can0"))
                file.write(format_frame(frame, "can0"))


def screenshot(log, config):
    """The program's screen as SVG."""
    source = LogSource([log], survey([log], config), None, clock=lambda: 0.0)
    session = MonitorSession(config, source)
    session.run_until(round(SHOWN_S * 1e6))
    app = MonitorApp(session)

    async def run():
        async with app.run_test(size=SIZE) as pilot:
            await pilot.pause()
            return app.export_screenshot(title="")

    return asyncio.run(run())


def rasterise(svg, target):
    """Draw an SVG by a browser; without the fonts that it names on the web."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        sys.exit("tools/picture: the monitor's picture needs chromium: install it")
    box = svg.split('viewBox="', 1)[1].split('"', 1)[0].split()
    width, height = (round(float(number)) for number in box[2:])
    scale = 1100 / width
    svg = svg.replace("Fira Code", "DejaVu Sans Mono")
    page = (
        "<!doctype html><style>body{margin:0;background:#fff}"
        f"svg{{width:{1100}px;height:{height * scale:.0f}px;display:block}}</style>{svg}"
    )
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "monitor.html"
        source.write_text(page, encoding="utf-8")
        subprocess.run(
            [
                browser,
                *FLAGS,
                f"--user-data-dir={folder}/profile",
                f"--window-size=1100,{height * scale + MARGIN:.0f}",
                f"--screenshot={target}",
                str(source),
            ],
            check=True,
            capture_output=True,
        )


def main(target):
    """Write the picture."""
    config = load_configuration()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "drive.log"
        record(log, config)
        svg = screenshot(log, config)
    rasterise(svg, Path(target).resolve())
    print(f"wrote {Path(target).name}")


if __name__ == "__main__":
    main(sys.argv[1])
