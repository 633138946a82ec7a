"""Every command that finds something ends with one line that says what to do next."""

import json
import shlex
from html import unescape

import pytest

from adhesion_can.cli.main import build_parser, main


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a drive in which the wheels of axle 3 are 1 % smaller than configured."""
    folder = tmp_path_factory.mktemp("next")
    log, model = folder / "drive.log", folder / "model.toml"
    simulate = ["simulate", "--scenario", "sweep", "--duration", "130", "--seed", "5"]
    main([*simulate, "--effect", "wheel_radius=-0.01,axle=3", "--log", str(log)])
    main(["diagnose", str(log), "--extended", str(model), "--json", str(folder / "diagnose.json")])
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "finding"),
    [
        ("diagnose", "Axle 3's wheel is "),
        ("calibrate", "Axle 3's wheel is "),
        ("check", "The data are "),
        ("identify", ""),
        ("replay", "The service doubts its curve: axles differ."),
        ("evaluate", "The model's effects are of practical use on these data: gain "),
    ],
)
def test_the_last_line_says_what_to_do(folder, capsys, command, finding):
    log, page, document = folder / "drive.log", folder / "page.html", folder / "out.json"
    model = ["--model", str(folder / "model.toml")] if command == "evaluate" else []
    html = [] if command == "identify" else ["--html", str(page)]
    capsys.readouterr()
    assert main([command, str(log), *model, *html, "--json", str(document)]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith(finding)
    assert last.count("Next: ") == 1
    assert json.loads(document.read_text())["next"] == last
    if html:
        assert f'<p class="next">{last}</p>' in unescape(page.read_text())
    # What it says can be typed: a command with its options, on this file.
    words = shlex.split(last.partition("Next: ")[2].partition(", or write")[0])
    assert words[0] == "adhesion-can"
    options = build_parser().parse_args(words[1:])
    assert log in (*getattr(options, "log", ()), *getattr(options, "inputs", ()))


@pytest.mark.slow
def test_json_on_stdout_has_the_line_and_no_text(folder, capsys):
    capsys.readouterr()
    assert main(["check", str(folder / "drive.log"), "--json", "-"]) == 0
    assert "Next: adhesion-can" in json.loads(capsys.readouterr().out)["next"]
