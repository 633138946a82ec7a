"""`check` says 'usable' where slip and adhesion come out plausible for every axle alone.

Each configuration here was 'usable', with exit status 0.
"""

import pytest

from adhesion_can.bus.roles import packaged_choices
from adhesion_can.cli.main import main


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("check") / "drive.log"
    words = ["simulate", "--scenario", "sweep", "--duration", "40", "--seed", "3"]
    assert main([*words, "--log", str(path)]) == 0
    return path


def roles(*without, **changed):
    """A table of the packaged roles without some of them, some with other keys."""
    lines = ["[roles]"]
    for choice in packaged_choices():
        name = choice.name
        if not name.startswith(without or ("-",)):
            keys = changed.get(name.replace(".", "_"), "")
            signal = f'"{choice.message}.{choice.signal}"'
            lines.append(f'"{name}" = {{ signal = {signal}{keys} }}')
    return "\n".join(lines)


def test_the_drive_is_usable_as_it_is(log, capsys):
    assert main(["check", str(log)]) == 0
    assert "usable" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("config", "says"),
    [
        ("[vehicle]\naxle_load_N = 98.1\n", ("axle 1: axle_load_N = 98.1",)),
        ("[vehicle]\nwheel_radius_m = 9.9\n", ("axle 1: the slip reaches",)),
        (roles("vehicle_speed"), ("no role gives vehicle speed",)),
        (roles(wheel_speed_2=", factor = -1"), ("axle 2",)),
        (roles(tractive_effort_5=", factor = -1"), ("axle 5",)),
        (roles("wheel_speed.5", "wheel_speed.6", "tractive_effort.5", "tractive_effort.6"),
         ("axle 5 of 6",)),
    ],
    ids=["load", "radius", "no speed", "speed reversed", "force reversed", "four mapped of six"],
)  # fmt: skip
def test_what_cannot_be_is_named_with_status_1(log, tmp_path, capsys, config, says):
    path = tmp_path / "own.toml"
    path.write_text(config)
    status = main(["check", str(log), "--config", str(path)])
    said = " ".join("".join(capsys.readouterr()).split())
    assert status == 1, said
    for words in says:
        assert words in said
