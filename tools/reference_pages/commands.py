"""The commands with their arguments, from their parsers."""

import argparse
from collections.abc import Iterator
from importlib import import_module

from adhesion_can.cli.bus_options import TITLE
from adhesion_can.cli.commands import COMMANDS, GROUPS, example_lines
from reference_pages.markdown import GENERATED, code, page, plain, table

INTRODUCTION = """
Exit status: 0 done, 1 a check failed, 2 bad input, with one line that says what, where and how to
correct it. `adhesion-can COMMAND --help` prints the same arguments. Commands that open a bus take
python-can's options `-i`, `-c`, `-b`, `--fd` and `--bus-kwargs` (`--help-bus` prints all of them),
its `~/.canrc` and its environment `CAN_*`. Every command takes `--progress` and `--no-progress`:
the progress of long work, on stderr; without either it is shown on a terminal.
"""
USUAL_GROUPS = ("options", "positional arguments", "vehicle and database")
"""Titles of groups that say nothing of their options."""


def commands_page() -> str:
    """Every command with its arguments."""
    overview = [
        [group, f"[`{name}`](#{name})", command.line]
        for group in GROUPS
        for name, command in COMMANDS.items()
        if command.group == group
    ]
    headings = ["use", "command", "what it does"]
    parts = ["# Commands", GENERATED, INTRODUCTION, table(headings, overview)]
    for name, command in COMMANDS.items():
        parser = argparse.ArgumentParser(prog=f"adhesion-can {name}", add_help=False)
        import_module(f"adhesion_can.cli.{name}").add_arguments(parser)
        groups = parser._action_groups  # noqa: SLF001  argparse lists its arguments nowhere else
        own = [group for group in groups if group.title != TITLE]
        parts += [f"## `{name}`", *description(parser, command.line)]
        rows = [row for group in own for row in argument_rows(group, parser)]
        if rows:
            parts.append(table(["argument", "meaning"], rows))
        if len(own) < len(groups):
            parts.append("And python-can's options of the bus.")
        parts.append("\n".join(["```sh", *example_lines(name), "```"]))
    return page(parts)


def description(parser: argparse.ArgumentParser, line: str) -> list[str]:
    """Paragraphs of a command's description and epilogue; what is laid out in lines stays so."""
    texts = [text.strip() for text in (parser.description or line, parser.epilog) if text]
    return [f"```text\n{text}\n```" if "\n" in text else text for text in texts]


def argument_rows(
    group: argparse._ArgumentGroup, parser: argparse.ArgumentParser
) -> Iterator[list[str]]:
    """Spelling and meaning of the arguments of a group."""
    formatter = parser._get_formatter()  # noqa: SLF001  it fills defaults into the texts
    of_group = "" if group.title in USUAL_GROUPS else str(group.title or "")
    for action in group._group_actions:  # noqa: SLF001  as above
        if action.help == argparse.SUPPRESS:
            continue
        text = formatter._expand_help(action) if action.help else of_group  # noqa: SLF001
        yield [code(spelling(action)), plain(text)]


def spelling(action: argparse.Action) -> str:
    """An argument as one writes it: `--duration S`, `LOG ..`."""
    value = ""
    if action.nargs != 0:
        choices = "{" + ",".join(map(str, action.choices)) + "}" if action.choices else ""
        metavar = action.metavar if isinstance(action.metavar, str) else ""
        value = metavar or choices or action.dest.upper()
        value += " .." if action.nargs in ("+", "*") else ""
    return f"{', '.join(action.option_strings)} {value}".strip()
