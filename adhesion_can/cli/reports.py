"""Options of the commands that write a report, and its files: page, pictures, browser."""

import argparse
import tempfile
import webbrowser
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from adhesion_can.errors import InputError
from adhesion_can.printable import say
from adhesion_can.reporting.page import Page, require_extra, write_page
from adhesion_can.reporting.pictures import require_pictures, write_pictures

PICTURES = ("png", "svg")
"""Formats of pictures, each an option."""


def add_report(parser: argparse.ArgumentParser, *, html: bool = True) -> None:
    """Options --html, --open, --png and --svg.

    Args:
        parser: Parser of the command.
        html: Whether the page has an option; False where the command always writes it.

    """
    group = parser.add_argument_group("report (extra 'report')")
    if html:
        group.add_argument("--html", type=Path, metavar="F", help="write the report to one file")
    where = " (a temporary file without --html)" if html else ""
    group.add_argument("--open", action="store_true", help=f"open the report in a browser{where}")
    for name in PICTURES:
        group.add_argument(
            f"--{name}",
            type=Path,
            metavar=f"F.{name}",
            help=f"write the report's figures as {name.upper()}: F.{name}, F-2.{name}, ..",
        )


def is_asked_for(options: argparse.Namespace) -> bool:
    """Whether the options ask for a report or its pictures."""
    names = ("html", "open", *PICTURES)
    return any(getattr(options, name, None) for name in names)


def report_files(options: argparse.Namespace) -> dict[str, Path | None]:
    """Files of the options, for `require_outputs`."""
    return {f"--{name}": getattr(options, name, None) for name in ("html", *PICTURES)}


def require_report(options: argparse.Namespace) -> None:
    """Raise an InputError for a report that could not be written after the work."""
    for name in PICTURES:
        path = getattr(options, name)
        if path is None:
            continue
        if path.suffix.lower() != f".{name}":
            raise InputError(f"--{name} {path}", f"does not end in .{name}", f"write F.{name}")
        require_pictures(str(path))
    html = getattr(options, "html", None)
    if html is not None or options.open:
        require_extra("--open" if html is None else str(html))


def missing_report(html: Path) -> str:
    """Why a page that nobody asked for by an option cannot be written; '' where it can."""
    try:
        require_extra(str(html))
    except InputError as error:
        return f"no report: {error}"
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
            lines += [f"written: {one}" for one in write_pictures(made, target)]
    if options.open and path is not None and not webbrowser.open(path.resolve().as_uri()):
        say(f"no browser was found: open {path} by hand")
    return lines


def page_provenance(origin: Mapping[str, Any], options: argparse.Namespace) -> dict[str, str]:
    """Provenance for a page: the command that repeats the work, version and hashes."""
    entries = {"command": options.command_line, "version": str(origin["version"])}
    named = [(name, origin.get(name)) for name in ("dbc", "configuration", "model")]
    named += [("input", one) for one in origin.get("inputs", ())]
    for name, one in named:
        if one is None:
            continue
        hashed = f", sha256 {one['sha256']}" if one["sha256"] else ""
        key, number = name, 1
        while key in entries:
            number += 1
            key = f"{name} {number}"
        entries[key] = f"{one['path']}{hashed}"
    return entries
