"""What the documents say of keys, figures and files is true."""

import re
from pathlib import Path

import pytest

from adhesion_can.config.load import settings_sections
from adhesion_can.physics.readings import Role

ROOT = Path(__file__).resolve().parent.parent


def test_every_key_of_every_section_is_documented():
    text = (ROOT / "docs" / "configuration.md").read_text()
    for name, keys in settings_sections().items():
        line = next(row for row in text.splitlines() if row.startswith(f"| `[{name}]`"))
        documented = set(re.findall(r"`(\w+)`", line.split("|")[2]))
        assert set(keys) <= documented, name


def test_every_role_is_documented():
    text = (ROOT / "docs" / "configuration.md").read_text()
    for role in Role:
        assert f"`{role}" in text, role


def test_links_and_named_files_exist():
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        for target in re.findall(r"\]\((?!http)([^)#]+)\)", page.read_text()):
            assert (page.parent / target).exists(), (page.name, target)
        for name in re.findall(
            r"`((?:bus|config|diagnosis|estimation|experiments|physics|sampling|service)/[\w/]+\.py)",
            page.read_text(),
        ):
            assert (ROOT / "adhesion_can" / name).exists(), (page.name, name)


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


def test_the_configuration_of_the_readme_works(tmp_path):
    from adhesion_can.config import load_configuration

    example = re.search(r"```toml\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)[1]
    (tmp_path / "mine.toml").write_text(example)
    (tmp_path / "mine.dbc").write_text(DBC_OF_THE_EXAMPLE)
    configuration = load_configuration(tmp_path / "mine.toml")
    assert configuration.vehicle.wheel_radius == (0.46, 0.46, 0.455, 0.46)
    assert configuration.vehicle.geometry.axles_per_bogie == (2, 2)
    scales = {s.name: s.scale for m in configuration.messages for s in m.signals}
    assert abs(scales["vehicle_speed"] - 1 / 3.6) < 1e-12
    assert abs(scales["wheel_speed.1"] - 0.10471975511965977) < 1e-12
    assert scales["tractive_effort.1"] == -1000.0


def test_the_python_of_the_readme_runs(tmp_path, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib", reason="the README plots with it")
    matplotlib.use("Agg")
    code = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)[1]
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(code, "README.md", "exec"), names)  # noqa: S102  as a reader would
    assert [cause.effect for cause in names["diagnosis"].causes] == ["load_dependence"]
    assert (tmp_path / "curve.png").stat().st_size > 10_000
