"""A number with a decimal comma in a file: the line, the key, and the number to write."""

import pytest

from adhesion_can import load_configuration
from adhesion_can.cli.main import main
from adhesion_can.config.plan_file import read_plan
from adhesion_can.errors import ConfigError


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("wheel_radius_m = 0,33  # worn", "wheel_radius_m: 0,33 has a decimal comma; write 0.33"),
        ("axle_load_N = 90,5e3", "axle_load_N: 90,5e3 has a decimal comma; write 90.5e3"),
        ('"load_std" = -1,5', '"load_std": -1,5 has a decimal comma; write -1.5'),
        (
            "geometry = { axle_spacing_m = 1,9 }",
            "axle_spacing_m: 1,9 has a decimal comma; write 1.9",
        ),
    ],
)
def test_a_decimal_comma_is_the_fault(tmp_path, capsys, line, says):
    path = tmp_path / "own.toml"
    path.write_text(f"# mine\n[vehicle]\n{line}\ntrain_mass_kg = 1\n", encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_configuration(path)
    assert str(error.value) == f"{path}: line 3: {says}"
    assert main(["check", "drive.log", "--config", str(path)]) == 2
    assert f"line 3: {says}\n" in capsys.readouterr().err


def test_a_plan_is_read_alike(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text('purpose = "a"\nstart_speed = 10,5\n')
    with pytest.raises(
        ConfigError, match="line 2: start_speed: 10,5 has a decimal comma; write 10"
    ):
        read_plan(path)


@pytest.mark.parametrize(
    "text",
    [
        "[vehicle]\nwheel_radius_m = 0.33 m\n# 0,33\n",
        "[vehicle]\nwheel_radius_m = [0.33, 0.34\n",
        '[vehicle]\naxles = "x = 1,5"\n',
        "[[[",
    ],
)
def test_any_other_fault_is_said_as_before(tmp_path, text):
    path = tmp_path / "own.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as error:
        load_configuration(path)
    assert "comma" not in str(error.value)


def test_a_missing_file_is_said_as_before(tmp_path):
    with pytest.raises(ConfigError, match="No such file"):
        load_configuration(tmp_path / "none at line 3.toml")
