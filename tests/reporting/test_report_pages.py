"""Every report in a browser: drawn, silent, readable by all, small, and made of what was asked."""

import gzip
import re
import webbrowser
from base64 import b64decode
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from plotly.offline import get_plotlyjs

from adhesion_can.calibration.coasting import CalibrationSettings, CoastingDrive
from adhesion_can.calibration.fit import calibrate
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.status import Status
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.reporting import calibration_page, experiment
from adhesion_can.reporting.drive.page import DriveTexts
from adhesion_can.reporting.drive.page import page as drive_page
from adhesion_can.reporting.drive.recorder import DriveRecorder
from adhesion_can.reporting.page import Page, render, write_page
from adhesion_can.reporting.pictures import write_pictures
from adhesion_can.sampling.traces import Trace
from adhesion_can.service.outputs import Outputs, Setpoint
from tests.reporting.browser import require_drawn
from tests.reporting.test_experiment_report import NAMES, made_of
from tests.reporting.test_page import Elements, nothing_is_loaded

EPOCH_US = 1_790_000_000_000_000
MOST_BYTES = 4_000_000
"""Of an hour of drive; docs/reports.md says so. At most 6 MB are asked for."""


def outputs(t_us, rng):
    """A setpoint of a drive whose surface changes every 20 s."""
    since_s = t_us / 1e6 % 20.0
    mu_max = (0.4, 0.25, 0.12)[int(t_us / 20e6) % 3] * (1 + 0.01 * rng.standard_normal())
    return Outputs(
        status=Status.SURFACE_CHANGE if since_s < 0.5 else Status.TRACKING,
        setpoint=Setpoint(mu_max, 0.06, 0.6),
        theta=(1.1 * mu_max, 40.0, 0.2),
        mu_max_std=0.02 / (1 + since_s),
        lambda_m_std=np.inf if since_s < 1 else 0.004,
        surface_age_s=since_s,
        doubt=Doubt.SPEED if int(t_us / 20e6) % 7 == 5 else Doubt.NONE,
        speed=15.0 + 5 * np.sin(t_us / 60e6),
    )


def recorded(seconds):
    """Record of a synthetic drive with the rates of a real one, its times since 1970."""
    rng = np.random.default_rng(1)
    recorder = DriveRecorder(0.25)
    for t_us in range(0, round(seconds * 1e6), 20_000):
        recorder.add(EPOCH_US + t_us, outputs(t_us, rng))
        if t_us % 1_000_000 == 0:
            at = EPOCH_US + t_us + np.arange(600) * 1600
            slip = rng.normal(0, 0.05, 600)
            mu = np.sign(slip) * 0.3 * (1 - np.exp(-40 * np.abs(slip)))
            recorder.add_samples(Samples.curve(slip, mu + 0.01 * rng.standard_normal(600), at))
    return recorder.result()


CONFIG = load_configuration()
TEXTS = DriveTexts(title="Replay of a drive", lead="A drive.", provenance={"command": "none"})


@pytest.fixture(scope="module")
def hour():
    return drive_page(recorded(3600.0), TEXTS, CONFIG)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A simulated drive of 12 s over two rails, with a frame that fails its check."""
    path = tmp_path_factory.mktemp("drive") / "drive.log"
    command = ["simulate", "--scenario", "dry-wet-dry", "--duration", "12", "--seed", "1"]
    assert main([*command, "--log", str(path)]) == 0
    lines = path.read_text().splitlines(keepends=True)
    place = next(k for k in range(2000, len(lines)) if " 101#" in lines[k])
    lines[place] = re.sub(r"#..", "#" + ("00" if "#00" not in lines[place] else "11"), lines[place])
    path.write_text("".join(lines))
    return path


@pytest.fixture(scope="module")
def replayed(log):
    path = log.with_name("replay.html")
    assert (
        main(["replay", str(log), "--html", str(path), "--svg", str(log.with_name("r.svg"))]) == 0
    )
    return path


def calibration_of_synthetic_coasting():
    vehicle, settings = Locomotive(), CalibrationSettings()
    rng = np.random.default_rng(3)
    t_us = EPOCH_US + np.arange(0, 60_000_000, 20_000)
    speed = 15.0 + 3.0 * np.sin((t_us - EPOCH_US) / 20e6)
    wheels, efforts = {}, {}
    for axle in range(1, 7):
        radius = vehicle.wheel_radius[axle - 1] * (1 + 0.002 * axle)
        wheels[axle] = Trace.from_readings(t_us, speed / radius)
        efforts[axle] = Trace.from_readings(t_us, np.where((t_us - EPOCH_US) % 9e6 < 5e6, 0, 3e4))
    noisy = Trace.from_readings(t_us, speed + 0.01 * rng.standard_normal(len(t_us)))
    drive = CoastingDrive(noisy, wheels, efforts)
    result = calibrate([drive], vehicle, settings)
    plots = calibration_page.plot_drives([drive], ["d.log"], vehicle, settings, result)
    return calibration_page.page(result, plots, (), ["A note."], {"command": "none"})


MADE = {
    "calibration": calibration_of_synthetic_coasting,
    "experiment": lambda: experiment.page([made_of(2, NAMES)], {"command": "none"}),
}


WIDE, NARROW = (1280, False), (420, True)


def first_section(made):
    return dict(islice(made.sections.items(), 1))


def look(browser, path, made, audits=(NARROW,), ways=(WIDE, NARROW)):
    """Open a page wide and light, and narrow and dark; each is drawn whole and without a word."""
    for width, dark in ways:
        browser.open(path, width, dark=dark)
        require_drawn(browser, made)
        paper = browser.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (paper == "rgb(255, 255, 255)") is not dark
        if (width, dark) in audits:
            assert browser.violations() == []


@pytest.mark.parametrize("kind", MADE)
def test_a_page_is_drawn_wide_and_narrow_light_and_dark(kind, browser, tmp_path):
    made = MADE[kind]()
    write_page(made, tmp_path / "page.html")
    look(browser, tmp_path / "page.html", made)


class FiguresOfAFile:
    """The figures of a page that a command wrote, as `require_drawn` counts them."""

    def __init__(self, path):
        self.elements = nothing_is_loaded(path.read_text())
        self.figures = [type("", (), {"data": f["data"]}) for f in self.elements.figures()]


@pytest.mark.costly
def test_a_replay_is_drawn_with_its_faults_and_the_command_that_repeats_it(browser, replayed, log):
    made = FiguresOfAFile(replayed)
    look(browser, replayed, made, audits=(WIDE, NARROW))
    flat = " ".join(made.elements.text.values())
    assert "rejected, 1 missing" in flat or "1 of " in flat
    assert f"adhesion-can replay {log} --html {replayed} --svg" in flat
    headings = made.elements.texts("h2")
    assert headings[1:] == [
        "Overview",
        "Surfaces",
        "Status, doubt and objections",
        "Data quality",
        "Provenance",
    ]


@pytest.mark.costly
def test_a_check_is_drawn_and_shows_the_faulty_frame(browser, log):
    path = log.with_name("check.html")
    assert main(["check", str(log), "--html", str(path)]) == 1
    made = FiguresOfAFile(path)
    look(browser, path, made)
    rejected = next(t for t in made.figures[0].data if t["name"] == "rejected")
    assert sum(rejected["y"]) == 1.0  # per second, in spans of a second


@pytest.mark.costly
def test_an_hour_of_drive_is_a_small_page(browser, hour, tmp_path):
    path = tmp_path / "hour.html"
    write_page(hour, path)
    assert path.stat().st_size < MOST_BYTES
    look(browser, path, hour, audits=(), ways=(WIDE,))
    # Time begins at 0, with date and time said once in the heading.
    overview = Elements(path.read_text()).figures()[0]
    times = [v for trace in overview["data"] for v in trace["x"] if v is not None]
    assert min(times) == 0.0
    assert max(times) == pytest.approx(3600.0, abs=0.1)
    titles = [
        a["title"]["text"] for k, a in overview["layout"].items() if "title" in a and k[0] == "x"
    ]
    assert titles == ["time, s"]
    flat = " ".join(Elements(path.read_text()).text.values())
    assert flat.count("2026-09-21 14:13:20 UTC") == 1


@pytest.mark.costly
def test_the_figures_of_an_hour_hold_its_extremes(hour):
    over_time, over_distance = hour.figures[:2]
    for figure in (over_time, over_distance):
        estimate = next(t for t in figure.data if t["name"] == "estimate")
        y = np.asarray(estimate["y"], dtype=float)
        assert np.nanmax(y) > 0.4 * 1.03  # of 60 000 setpoints with 1 % of noise
        assert np.nanmin(y) < 0.12 * 0.97


def test_a_page_is_printed_light_and_within_its_paper(browser, hour, tmp_path):
    path = tmp_path / "page.html"
    write_page(replace(hour, sections=first_section(hour)), path)
    browser.open(path, 1280, dark=True)
    browser.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    widths = browser.evaluate(
        "[...document.querySelectorAll('.main-svg')].map((s) => s.getBoundingClientRect().width)"
    )
    assert max(widths) <= 680
    fills = browser.evaluate(
        "[...document.querySelectorAll('.main-svg')].map((s) => s.style.background)"
    )
    assert {fill for fill in fills if fill} == {"rgb(255, 255, 255)"}
    browser.evaluate("window.dispatchEvent(new Event('afterprint'))")
    assert len(browser.pdf()) > 10_000


@pytest.mark.costly
def test_pictures_are_written_one_a_figure_and_twice_the_same(replayed, hour, tmp_path):
    written = sorted(replayed.parent.glob("r*.svg"))
    assert len(written) == len(FiguresOfAFile(replayed).figures)
    few = Page("t", "l", [], first_section(hour), {})
    for form, begin in (("svg", b"<?xml"), ("png", b"\x89PNG")):
        first = write_pictures(few, tmp_path / f"a.{form}")
        assert [path.name for path in first] == [f"a.{form}", f"a-2.{form}"]
        once = [path.read_bytes() for path in first]
        assert all(text.startswith(begin) for text in once)
        again = [path.read_bytes() for path in write_pictures(few, tmp_path / f"a.{form}")]
        assert once == again


@pytest.mark.parametrize("kind", MADE)
def test_all_figures_of_a_page_can_be_pictures(kind, tmp_path):
    made = MADE[kind]()
    assert len(write_pictures(made, tmp_path / "p.svg")) == len(made.figures)


def test_open_without_html_opens_a_temporary_file_and_says_where(log, monkeypatch, capsys):
    opened = []
    monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url) or True)
    assert main(["check", str(log), "--open"]) == 1
    out = capsys.readouterr().out
    path = re.search(r"written: (\S+)", out).group(1)
    assert opened == [f"file://{path}"]


@pytest.mark.parametrize(
    ("words", "said"),
    [(["--png", "p.svg"], "does not end in .png"), (["--html", "no/such/p.html"], "folder")],
)
def test_a_report_that_cannot_be_written_is_an_error_before_the_work(words, said, log, capsys):
    assert main(["replay", str(log), *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_plotly_in_the_page_is_plotly():
    elements = Elements(render(MADE["experiment"]()))
    packed = elements.texts("script", id="plotly")[0]
    assert gzip.decompress(b64decode(packed)).decode() == get_plotlyjs()


@pytest.mark.parametrize("count", [0, 1, 3])
def test_a_drive_of_few_setpoints_without_an_estimate_is_a_page_too(count, tmp_path):
    recorder = DriveRecorder(0.25)
    for number in range(count):
        recorder.add(number * 20_000, Outputs(speed=3.0))
    made = drive_page(recorder.result(), TEXTS, CONFIG)
    assert "Data quality" in render(made)
    assert len(write_pictures(made, tmp_path / "p.svg")) == min(count, 2)
