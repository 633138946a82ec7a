"""`[channels]`: a signal of the bus that the user lists is a candidate, offline and online."""

import json

import numpy as np
import pytest

from adhesion_can.bus.roles import packaged_choices
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.errors import ConfigError
from adhesion_can.physics.readings import Role

SLOPE = -0.006
SIGNAL = "Environment.RelativeHumidity"
CHANNEL = f'[channels]\nfilm = {{ signal = "{SIGNAL}", unit = "um", label = "oil film" }}\n'


def drive_and_configuration(folder, duration_s):
    """A drive that depends on a signal, and a configuration that lists it as a channel."""
    what = ["--scenario", "sweep", "--duration", str(duration_s), "--seed", "4"]
    log = folder / "drive.log"
    assert main(["simulate", *what, "--effect", f"humidity={SLOPE}", "--log", str(log)]) == 0
    roles = [
        f'"{choice.name}" = "{choice.message}.{choice.signal}"'
        for choice in packaged_choices()
        if choice.role is not Role.HUMIDITY
    ]
    config = folder / "mine.toml"
    config.write_text("\n".join(["[roles]", *roles, CHANNEL]))
    return folder, log, config


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    return drive_and_configuration(tmp_path_factory.mktemp("channels"), 150)


@pytest.fixture(scope="module")
def diagnosed(bench):
    """JSON of the diagnosis, and the model that it wrote."""
    folder, log, config = bench
    out, model = folder / "d.json", folder / "m.toml"
    words = ["diagnose", str(log), "--config", str(config), "--extended", str(model)]
    assert main([*words, "--json", str(out)]) == 0
    return json.loads(out.read_text()), model


@pytest.mark.slow
def test_the_signal_is_named_with_its_label_and_unit(diagnosed):
    document, _ = diagnosed
    (cause,) = document["causes"]
    assert cause["effect"] == "channel:film"
    slope = cause["parameters"]["slope"]
    assert slope["unit"] == "1/um"
    # About the mean of the signal, 60 % less or more, at which the effect's factor is 1.
    assert slope["value"] == pytest.approx(SLOPE, rel=0.1)
    assert any("adhesion changes with oil film" in x.lower() for x in document["wrong"])


@pytest.mark.slow
@pytest.mark.long
def test_the_model_works_online(bench, diagnosed, capsys):
    folder, log, config = bench
    _, model = diagnosed
    results = []
    for extra in ((), ("--model", str(model))):
        out = folder / "r.json"
        words = ["replay", str(log), "--config", str(config), *extra, "--json", str(out)]
        assert main(words) == 0
        results.append(json.loads(out.read_text()))
    plain, extended = (one["fit"]["rmse"] for one in results)
    assert extended < 0.95 * plain
    capsys.readouterr()
    # Without the channel's signal the model cannot be used, and says which is missing.
    assert main(["replay", str(log), "--model", str(model)]) == 2
    assert "channel:film needs film" in capsys.readouterr().err


@pytest.mark.costly
def test_samples_carry_the_channel(tmp_path):
    folder, log, config = drive_and_configuration(tmp_path, 6)
    path = folder / "s.csv"
    assert main(["replay", str(log), "--config", str(config), "--samples", str(path)]) == 0
    head, *rows = path.read_text().splitlines()
    place = head.split(",").index("film")
    values = np.array([float(row.split(",")[place]) for row in rows[3000:]])
    assert 30.0 < values.min() <= values.max() < 90.0


def test_channels_beside_the_packaged_roles(tmp_path):
    path = tmp_path / "c.toml"
    path.write_text(CHANNEL)
    config = load_configuration(path)
    assert Role.WHEEL_SPEED in config.roles()
    assert [channel.name for channel in config.channels] == ["film"]
    assert config.covariates()[-1] == "film"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('speed = "A.b"', "a built-in channel has this name"),
        ('relative_humidity_percent = "A.b"', "a built-in channel has"),
        ('"a b" = "A.b"', "not a name"),
        ("film = 5", "not a table"),
        ('film = "x"', "is not Message.Signal"),
        ('film = { unit = "um" }', "names no signal"),
        ('film = { signal = "A.b", unit = 5 }', "is not a string"),
        ('film = { signal = "A.b", colour = "red" }', "unknown key"),
    ],
)
def test_what_is_no_channel_is_an_error(tmp_path, text, says):
    path = tmp_path / "c.toml"
    path.write_text(f"[channels]\n{text}\n")
    with pytest.raises(ConfigError, match=says):
        load_configuration(path)


def test_a_role_cannot_be_a_channel(tmp_path):
    path = tmp_path / "c.toml"
    path.write_text('[roles]\n"channel.1" = "A.b"\n')
    with pytest.raises(ConfigError, match=r"put other signals under \[channels\]"):
        load_configuration(path)
