"""What the documents say of keys, figures and files is true."""

import argparse
import importlib
import json
import re
import shlex
from pathlib import Path

import pytest

from adhesion_can.cli.main import COMMANDS
from adhesion_can.config.load import settings_sections
from adhesion_can.physics import burckhardt, kinematics
from adhesion_can.physics.readings import Role

ROOT = Path(__file__).resolve().parent.parent


def test_every_section_is_documented():
    text = (ROOT / "docs" / "configuration.md").read_text()
    for name in settings_sections():
        assert f"`[{name}]`" in text, name


def test_every_role_is_documented():
    text = (ROOT / "docs" / "configuration.md").read_text()
    for role in Role:
        assert f"`{role}" in text, role


PAGES = (
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "SECURITY.md",
    *(ROOT / "docs").rglob("*.md"),
)


def anchors_of(page):
    """Anchors of a page's headings, as git hosts make them."""
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_anchors_and_named_files_exist(page):
    text = page.read_text()
    for target, anchor in re.findall(r"\]\((?!http)([^)#\s]*)(?:#([^)\s]+))?\)", text):
        file = page.parent / target if target else page
        assert file.exists(), target
        if anchor:
            assert anchor in anchors_of(file), (target, anchor)
    for name in re.findall(r"`((?:adhesion_can/)?[a-z_]+/[\w/]+\.py)", text):
        if name.split("/")[0] not in ("docs", "tests", "tools"):
            assert (ROOT / "adhesion_can" / name.removeprefix("adhesion_can/")).exists(), name


def test_the_readme_is_short_and_leads_on():
    text = (ROOT / "README.md").read_text()
    assert len(text.splitlines()) <= 100
    assert max(map(len, text.splitlines())) <= 100
    assert "![" in text  # a picture of the monitor
    assert "docs/index.md" in text


def test_the_index_leads_to_every_page():
    """Each page is reached from docs/index.md by links, in a few steps."""
    start = ROOT / "docs" / "index.md"
    seen, waiting = {start}, [start]
    while waiting:
        page = waiting.pop()
        for target in re.findall(r"\]\((?!http)([^)#\s]+)", page.read_text()):
            file = (page.parent / target).resolve()
            found = sorted(file.glob("*.md")) if file.is_dir() else [file]
            new = [one for one in found if one.suffix == ".md" and one not in seen]
            seen.update(new)
            waiting += new
    missing = {page.relative_to(ROOT).as_posix() for page in PAGES if page not in seen}
    assert missing <= {"README.md"}


def test_decisions_are_short():
    for page in (ROOT / "docs" / "decisions").glob("*.md"):
        assert len(page.read_text().splitlines()) <= 30, page.name


DBC_OF_THE_EXAMPLE = """VERSION ""
NS_ :
BS_:
BU_: X
BO_ 256 Odometry: 8 X
 SG_ GroundSpeed : 0|16@1+ (0.01,0) [0|0] "" X
BO_ 257 Axle1: 8 X
 SG_ Speed : 0|16@1+ (0.1,0) [0|0] "" X
BO_ 258 Drive1: 8 X
 SG_ Force : 0|16@1- (0.1,0) [0|0] "" X
"""


def test_the_configuration_of_the_guide_works(tmp_path):
    from adhesion_can.config import load_configuration

    example = re.search(
        r"```toml\n(.*?)```", (ROOT / "docs/guides/own_database.md").read_text(), re.DOTALL
    )[1]
    (tmp_path / "mine.toml").write_text(example)
    (tmp_path / "mine.dbc").write_text(DBC_OF_THE_EXAMPLE)
    configuration = load_configuration(tmp_path / "mine.toml")
    assert configuration.vehicle.wheel_radius == (0.46, 0.46, 0.455, 0.46)
    assert configuration.vehicle.geometry.axles_per_bogie == (2, 2)
    scales = {s.name: s.scale for m in configuration.messages for s in m.signals}
    assert abs(scales["vehicle_speed"] - 1 / 3.6) < 1e-12
    assert abs(scales["wheel_speed.1"] - 0.10471975511965977) < 1e-12
    assert scales["tractive_effort.1"] == -1000.0


DBC_OF_THE_MOTORS = """VERSION ""
NS_ :
BS_:
BU_: X
BO_ 256 Odo: 8 X
 SG_ TrainSpeed : 0|16@1+ (0.01,0) [0|0] "km/h" X
BO_ 257 Axles: 8 X
 SG_ Wheel1 : 0|16@1+ (0.1,0) [0|0] "rpm" X
 SG_ Wheel3 : 32|16@1+ (0.1,0) [0|0] "rpm" X
BO_ 258 Motor1: 8 X
 SG_ Effort : 0|16@1- (0.02,0) [0|0] "kN" X
BO_ 259 Motor2: 8 X
 SG_ Effort : 0|16@1- (0.02,0) [0|0] "kN" X
"""


@pytest.mark.costly
def test_a_motor_that_drives_two_axles_tracks_as_the_guide_says(tmp_path, monkeypatch):
    from adhesion_can.cli.main import main

    text = (ROOT / "docs/guides/own_database.md").read_text()
    monkeypatch.chdir(tmp_path)
    Path("motors.toml").write_text(re.findall(r"```toml\n(.*?)```", text, re.DOTALL)[1])
    Path("motors.dbc").write_text(DBC_OF_THE_MOTORS)
    (printed,) = re.findall(r"^adhesion-can (simulate --config motors.*)$", text, re.MULTILINE)
    assert main(shlex.split(printed)) == 0
    words = ["replay", "motors.log", "--config", "motors.toml", "--json", "r.json"]
    assert main(words) == 0
    counts = json.loads(Path("r.json").read_text())["setpoints_by_status"]
    assert counts["TRACKING"] > 0.85 * sum(counts.values())


@pytest.mark.costly
def test_the_python_of_the_guide_runs(tmp_path, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib", reason="the guide plots with it")
    matplotlib.use("Agg")
    guide = (ROOT / "docs" / "guides" / "python.md").read_text()
    code = re.search(r"```python\n(.*?)```", guide, re.DOTALL)[1]
    # The README shows the first of these lines.
    short = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)[1]
    assert set(short.splitlines()) <= set(code.splitlines())
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(code, "python.md", "exec"), names)  # noqa: S102  as a reader would
    assert [cause.effect for cause in names["diagnosis"].causes] == ["load_dependence"]
    assert (tmp_path / "curve.png").stat().st_size > 10_000


def test_the_examples_of_the_theory_are_right():
    """Numbers of docs/theory.md, computed by the package."""
    text = (ROOT / "docs" / "theory.md").read_text()
    top = burckhardt.peak(0.40, 60.0, 0.30)
    target = burckhardt.slip_at_share(0.98, 0.40, 60.0, 0.30)
    inertial = float(kinematics.wheelset_effort(2.0, 200.0, 0.625))
    adhesion = float(kinematics.adhesion_coefficient(90e3, 245e3, 2.0, 200.0, 0.625))
    for shown in (
        f"$\\lambda$ = {float(kinematics.slip_ratio(16.8, 10.0, 0.625)):.2f}.",
        f"takes {inertial:.0f} N, and $\\mu$ = {adhesion:.4f}",
        f"$\\lambda_m$ = {float(top.lambda_m):.4f} with",
        f"with $\\mu_\\text{{max}}$ = {float(top.mu_max):.4f}",
        f"$\\lambda_t$ = {target:.4f}: 2 % less force takes {1 - target / float(top.lambda_m):.0%}",
    ):
        assert shown.replace("%", " %").replace("  %", " %") in text, shown


def printed_commands():
    """Command lines of ours that the documents print."""
    lines = []
    for page in PAGES:
        if "decisions" not in page.parts:
            text = page.read_text().replace("\\\n", " ")
            lines += re.findall(r"^ *adhesion-can (.*)$", text, re.MULTILINE)
    return sorted(set(lines))


@pytest.mark.parametrize("line", printed_commands())
def test_a_printed_command_has_only_arguments_that_exist(line):
    command, *arguments = shlex.split(line.partition(" > ")[0], comments=True)
    assert command in COMMANDS
    parser = argparse.ArgumentParser(exit_on_error=False)
    importlib.import_module(f"adhesion_can.cli.{command}").add_arguments(parser)
    parser.parse_args(arguments)
