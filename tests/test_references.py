"""The generated pages of docs/reference are those that the present code gives."""

import sys
from pathlib import Path

import pytest

from adhesion_can.bus.database import load_database
from adhesion_can.cli.main import COMMANDS
from adhesion_can.config.load import settings_sections
from adhesion_can.physics.readings import Role

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "reference"
sys.path.insert(0, str(ROOT / "tools"))
import references  # noqa: E402
from reference_pages import PAGES  # noqa: E402
from reference_pages.settings import as_toml, unit_of  # noqa: E402


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_up_to_date(name):
    assert (FOLDER / name).read_text() == PAGES[name](), "run tools/references"


def test_every_key_has_its_row_with_default_and_unit():
    page = (FOLDER / "configuration.md").read_text()
    for section, keys in settings_sections().items():
        rows = page.partition(f"## `[{section}]`\n")[2].partition("\n## ")[0]
        for key in keys:
            assert f"| `{key}` |" in rows, (section, key)
    assert "| `false_alarm` | `1e-09` | 1e-100 .. 0.5 | 1 |" in page
    assert "| `hold_s` | `1` | 0 .. 3600 | s |" in page
    assert "| `axle_load_N` | `245000` | 1 .. 1e+07; 1 to 64 values | N |" in page


def test_every_role_has_its_row_with_units():
    page = (FOLDER / "configuration.md").read_text()
    for role in set(Role) - {Role.CHANNEL}:
        assert f"| `{role}" in page, role


def test_every_message_and_signal_is_listed():
    page = (FOLDER / "messages.md").read_text()
    for message in load_database().db.messages:
        assert f"## `{message.name}`\n" in page
        for signal in message.signals:
            assert f"`{signal.name}`" in page
    assert "| `LambdaM` | 32, 16 | 1e-05 | 0 | 0 .. 0.65534 |" in page


def test_every_command_is_listed():
    page = (FOLDER / "commands.md").read_text()
    for name in COMMANDS:
        assert f"\n## `{name}`\n" in page


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("Time constants of the forgetting, s, longest first.", "s"),
        ("Standard deviation of the level, relative to the curve, 1. Larger: more.", "1"),
        ("Standard deviations of the population, eq. 16, 1. Larger: wider.", "1"),
        ("Share of the samples beyond the peak.", "1"),
        ("Height of something.", None),
    ],
)
def test_units_are_read_from_the_first_sentence(text, unit):
    assert unit_of(text) == unit


def test_defaults_are_toml():
    assert as_toml((3600.0, 15.0)) == "[3600, 15]"
    assert as_toml((0.625,) * 6) == "0.625"
    assert (as_toml(True), as_toml("mean"), as_toml(1e-9)) == ("true", '"mean"', "1e-09")


def test_a_stale_page_is_told(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(references, "FOLDER", tmp_path)
    monkeypatch.setattr(sys, "argv", ["references"])
    assert references.main() == 0
    monkeypatch.setattr(sys, "argv", ["references", "--check"])
    assert references.main() == 0
    (tmp_path / "messages.md").write_text("old")
    assert references.main() == 1
    assert "messages.md is not up to date: run tools/references" in capsys.readouterr().out
