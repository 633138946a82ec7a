"""`check` says 'usable' where slip and adhesion come out plausible for every axle alone.

Each configuration here was 'usable', with exit status 0.
"""

import json
import re

import numpy as np
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


@pytest.mark.costly
def test_the_drive_is_usable_as_it_is(log, capsys):
    assert main(["check", str(log)]) == 0
    assert "usable" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("config", "says"),
    [
        ("[vehicle]\naxle_load_N = 98.1\n", (": axle_load_N = 98.1 in [vehicle]", "axles 1 to 6")),
        ("[vehicle]\nwheel_radius_m = 9.9\n", ("axles 1 to 6: the slip reaches",)),
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


@pytest.mark.parametrize(("slip_max", "why"), [
    (0.0005, "the vehicle coasts"), (0.01, "and still rises; drive to larger slips"),
], ids=["coasting", "low effort"])  # fmt: skip
def test_it_says_where_no_peak_can_be_known(tmp_path, capsys, slip_max, why):
    rng = np.random.default_rng(2)
    slip = rng.uniform(0, slip_max, 2000)
    mu = 0.5 * (1 - np.exp(-30.0 * slip)) + 0.002 * rng.standard_normal(2000)
    rows = [f"{i / 100},{s},{m}" for i, (s, m) in enumerate(zip(slip, mu, strict=True))]
    path = tmp_path / "low.csv"
    path.write_text("\n".join(["time_s,slip,adhesion", *rows, ""]))
    assert main(["check", str(path)]) == 0
    said = capsys.readouterr().out
    (line,) = [one for one in said.splitlines() if "the peak is not in the data: " in one]
    assert line.startswith("NOT KNOWABLE: 0.0 .. 20.0 s: ")
    assert line.endswith(why)
    assert "verdict: usable signals, but they show no peak" in said
    assert main(["check", str(path), "--json", "-"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["tables"]
    assert (found["usable"], found["shows_peak"]) == (True, False)


def test_every_tag_that_is_shown_has_its_meaning(log, tmp_path, capsys):
    path = tmp_path / "own.toml"
    path.write_text("[sensors]\neffort_std = 100.0\n")
    assert main(["check", str(log), "--config", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    (legend,) = [one for one in lines if one.startswith("(") and one.endswith(")")]
    tags = {one.partition(":")[0] for one in lines if re.match("[A-Z ]+: ", one)}
    assert {"WARNING", "FOUND"} <= tags
    assert set(re.findall("[A-Z][A-Z ]+(?=:)", legend)) == tags


def test_times_of_a_dated_recording_begin_at_0(log, tmp_path, capsys):
    """The frames of a second are left out, 20 s from the first one."""
    dated = tmp_path / "dated.log"
    rows = []
    for line in log.read_text().splitlines():
        time_s, rest = line[1:].split(")", 1)
        if not 20.0 <= float(time_s) < 21.0:
            rows.append(f"({1795720780.5 + float(time_s):.6f}){rest}")
    dated.write_text("\n".join([*rows, ""]))
    assert main(["check", str(dated)]) == 1
    said = capsys.readouterr().out
    assert said.count("2026-11-26 19:19:40 UTC") == 1
    assert re.search(r"the longest 10\d\d ms at (19\.9\d\d|20\.000) s", said)
    assert "1795720" not in said
