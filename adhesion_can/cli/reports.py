"""Results of the commands in all their outputs: JSON, page, pictures, browser and terminal."""

import argparse
import tempfile
import webbrowser
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import RenderableType

from adhesion_can.cli.outputs import Output, add_file, talk, write_json
from adhesion_can.errors import InputError
from adhesion_can.printable import say
from adhesion_can.reporting.next_steps.next_step import NextStep
from adhesion_can.reporting.page import Page, require_extra, write_page
from adhesion_can.reporting.pictures import require_pictures, write_pictures
from adhesion_can.reporting.text import console

PICTURES = ("png", "svg")
"""Formats of pictures, each an option."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """Result of a command, as its outputs have it.

    Attributes:
        document: Content of --json, without its provenance.
        origin: Provenance.
        parts: Lines and tables for the terminal; made when they are printed.
        step: Line with which the result ends.
        page: Function from the provenance in words to the page; None: there is no page.

    """

    document: Mapping[str, Any]
    origin: Mapping[str, Any]
    parts: Iterable[RenderableType]
    step: NextStep
    page: Callable[[dict[str, str]], Page] | None = None

    def deliver(self, options: argparse.Namespace) -> None:
        """Write and print what the options ask for."""
        write_json(options.json, {**self.document, "next": self.step.line, **self.origin})
        written: list[str] = []
        if self.page is not None and is_asked_for(options):
            made = self.page(page_provenance(self.origin, options))
            written = write_report(replace(made, next_step=self.step.line), options)
        if talk(options):
            out = console()
            for part in (*self.parts, *written, self.step.line):
                out.print(part)


# Functions with names, since two parsers of a command have to be equal.
def _require_page(path: Path, _option: str) -> None:
    require_extra(str(path))


def _require_browser(_value: object, option: str) -> None:
    require_extra(option)


def add_report(parser: argparse.ArgumentParser, *, html: bool = True) -> None:
    """Options --html, --open, --png and --svg.

    Args:
        parser: Parser of the command.
        html: Whether the page has an option; False where the command always writes it.

    """
    group = parser.add_argument_group("report (extra 'report')")
    if html:
        about = "write the report to one file"
        add_file(parser, "--html", "F", about, _require_page, group)
    where = " (a temporary file without --html)" if html else ""
    about = f"open the report in a browser{where}"
    browser = Output("--open", _require_browser, is_file=False)
    browser.add(parser, group, action="store_true", help=about)
    for name in PICTURES:
        what = f"write the report's figures as {name.upper()}: F.{name}, F-2.{name}, .."
        add_file(parser, f"--{name}", f"F.{name}", what, _require_picture, group)


def _require_picture(path: Path, option: str) -> None:
    name = option.removeprefix("--")
    if path.suffix.lower() != f".{name}":
        raise InputError(f"{option} {path}", f"does not end in .{name}", f"write F.{name}")
    require_pictures(str(path))


def is_asked_for(options: argparse.Namespace) -> bool:
    """Whether the options ask for a report or its pictures."""
    names = ("html", "open", *PICTURES)
    return any(getattr(options, name, None) for name in names)


def missing_report(html: Path) -> str:
    """Why a page that nobody asked for by an option cannot be written; '' where it can."""
    try:
        require_extra(str(html))
    except InputError as error:
        return str(error)
    return ""


def write_report(made: Page, options: argparse.Namespace, html: Path | None = None) -> list[str]:
    """Write the page and its pictures, and open it.

    Args:
        made: Report.
        options: Options of `add_report`.
        html: File of the page where the command has no option for it.

    Returns:
        Line for each file.

    """
    lines = []
    path = html or getattr(options, "html", None)
    if path is None and options.open:
        path = Path(tempfile.mkdtemp(prefix="adhesion-can-")) / f"{options.command}.html"
    if path is not None:
        write_page(made, path, own_name=html is not None)
        lines.append(f"written: {path}")
    for name in PICTURES:
        target = getattr(options, name)
        if target is not None:
            lines += [f"written: {picture}" for picture in write_pictures(made, target)]
    if options.open and path is not None and not webbrowser.open(path.resolve().as_uri()):
        say(f"no browser was found: open {path} by hand")
    return lines


def page_provenance(origin: Mapping[str, Any], options: argparse.Namespace) -> dict[str, str]:
    """Provenance for a page: the command that repeats the work, version and hashes."""
    command = origin.get("command", options.command_line)
    entries = {"command": str(command), "version": str(origin["version"])}
    named = [(name, origin.get(name)) for name in ("dbc", "configuration", "model")]
    named += [("input", file) for file in origin.get("inputs", ())]
    for name, file in named:
        if file is None:
            continue
        hashed = f", sha256 {file['sha256']}" if file["sha256"] else ""
        key, number = name, 1
        while key in entries:
            number += 1
            key = f"{name} {number}"
        entries[key] = f"{file['path']}{hashed}"
    return entries
