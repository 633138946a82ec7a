"""`--help`: commands by their use, two examples each that are taken as printed, folded options."""

import shlex

import pytest

from adhesion_can.cli.commands import COMMANDS, GROUPS, example_lines
from adhesion_can.cli.main import build_parser, main


def printed(capsys, *words):
    """What a command line prints that ends in parsing."""
    with pytest.raises(SystemExit) as ended:
        main([*words])
    assert ended.value.code == 0
    return capsys.readouterr().out


def test_commands_are_listed_below_their_use(capsys):
    text = printed(capsys, "--help").partition("\ncommands:\n")[2]
    found, group = {}, None
    for line in text.partition("\n\n")[0].splitlines():
        if line.startswith("    "):
            found[line.split()[0]] = group
        else:
            group = line.strip().partition(":")[0]
    assert list(dict.fromkeys(found.values())) == list(GROUPS)
    assert found == {name: command.group for name, command in COMMANDS.items()}
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_ends_its_help_with_two_examples(capsys, name):
    text = printed(capsys, name, "--help")
    lines = text.partition("\nexamples:\n")[2].splitlines()
    assert [line.strip() for line in lines] == example_lines(name)
    assert sum(line.startswith("  # ") for line in lines) == 2
    assert max(map(len, lines)) <= 100


@pytest.mark.parametrize("name", COMMANDS)
def test_the_examples_are_taken_as_they_are_printed(name):
    for line in example_lines(name)[1::2]:
        typed = line.partition(" >")[0]  # what a shell takes for itself
        options = build_parser().parse_args(shlex.split(typed)[1:])
        assert options.command == name


@pytest.mark.parametrize("name", ["run", "simulate", "monitor", "control"])
def test_the_options_of_the_bus_are_three_lines_and_all_on_request(capsys, name):
    text = printed(capsys, name, "--help")
    group = text.partition("\nbus (python-can):\n")[2].partition("\n\n")[0]
    assert [line.split()[0] for line in group.splitlines()] == ["-c,", "-i,", "--help-bus"]
    assert "--bitrate" not in text
    everything = printed(capsys, name, "--help-bus")
    for option in ("--bitrate", "--data-bitrate", "--fd", "--timing", "--bus-kwargs", "socketcan"):
        assert option in everything


def test_a_folded_option_is_taken():
    options = build_parser().parse_args(["run", "-i", "virtual", "-b", "500000", "--fd"])
    assert (options.bitrate, options.fd) == (500000, True)
