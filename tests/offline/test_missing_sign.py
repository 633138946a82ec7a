"""A slip or a force without its sign, and data that the user says to be right."""

import json

import numpy as np
import pytest

from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.errors import ConfigError
from adhesion_can.offline.plausibility import inspect_points
from adhesion_can.offline.points import MeasuredPoints

RNG = np.random.default_rng(8)
SLIP = RNG.uniform(0.004, 0.12, 240) * np.where(np.arange(240) % 80 < 40, 1, -1)
ADHESION = np.sign(SLIP) * (0.44 * (1 - np.exp(-60 * np.abs(SLIP))) - 0.5 * np.abs(SLIP))


def said(slip, adhesion):
    return [
        one for one in inspect_points(MeasuredPoints(slip, adhesion)) if "has no sign" in one.what
    ]


@pytest.mark.parametrize("noise", [0.0, 0.0005])
def test_a_slip_or_a_force_that_is_never_below_0_is_told(noise):
    slip = SLIP + noise * RNG.standard_normal(240)
    (one,) = said(np.abs(slip), ADHESION)
    assert one.fatal
    assert "the slip is never below 0, but the force is in 50 % of the rows" in one.what
    (one,) = said(slip, np.abs(ADHESION))
    assert "the force is never below 0, but the slip is in 50 %" in one.what


@pytest.mark.parametrize(
    ("slip", "adhesion"),
    [(SLIP, ADHESION), (np.abs(SLIP), np.abs(ADHESION)), (-np.abs(SLIP), -np.abs(ADHESION))],
    ids=["both ways", "traction alone", "braking alone"],
)
def test_signs_that_agree_are_no_finding(slip, adhesion):
    assert said(slip, adhesion) == []


def test_a_force_that_stands_still_has_another_fault():
    assert said(SLIP, np.full(240, 0.2) + 0.005 * RNG.standard_normal(240)) == []


def test_friction_braking_without_a_force_is_no_finding():
    adhesion = np.where(SLIP < 0, 0.003 * RNG.standard_normal(240), ADHESION)
    assert said(SLIP, adhesion) == []


def test_a_few_rows_of_coasting_with_noise_are_no_finding():
    slip = np.concatenate([np.abs(SLIP), 0.001 * RNG.standard_normal(60)])
    adhesion = np.concatenate([np.abs(ADHESION), 0.01 * RNG.standard_normal(60)])
    assert said(slip, adhesion) == []


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "a.csv"
    rows = zip(np.abs(SLIP), ADHESION, strict=True)
    path.write_text("slip,adhesion\n" + "".join(f"{x:.5f},{y:.5f}\n" for x, y in rows))
    return path


def test_assume_plausible_goes_on_and_says_so(table, tmp_path, capsys):
    assert main(["identify", str(table)]) == 2
    assert "if the data are right, pass --assume plausible" in capsys.readouterr().err
    out = tmp_path / "o.json"
    assert main(["identify", str(table), "--assume", "plausible", "--json", str(out)]) == 0
    assert "assumed to be right: the slip is never below 0" in capsys.readouterr().out
    assert any("assumed to be right" in one for one in json.loads(out.read_text())["problems"])
    assert main(["check", str(table)]) == 1
    assert main(["check", str(table), "--assume", "plausible"]) == 0
    assert "WARNING: the slip is never below 0" in capsys.readouterr().out


def test_the_configuration_can_say_it_too(table, tmp_path):
    config = tmp_path / "a.toml"
    config.write_text('[table]\nassume = "plausible"\nslip = "slip"\n')
    assert load_configuration(config).assume_plausible
    assert main(["identify", str(table), "--config", str(config)]) == 0
    config.write_text('[table]\nassume = "what I like"\n')
    with pytest.raises(ConfigError, match=r'table\.assume: .*write "plausible"'):
        load_configuration(config)
