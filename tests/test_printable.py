"""Text of strangers: nothing of it reaches a terminal that the terminal would obey."""

import ast
import io
import math
import os
import random
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from adhesion_can.cli.main import main
from adhesion_can.monitoring.snapshot import MessageRole, MessageState, Transport
from adhesion_can.printable import printable, say
from adhesion_can.recordings.candump import format_frame
from adhesion_can.reporting.terminal.view import ViewOptions, ViewPage, draw
from adhesion_can.reporting.text import FittingTable, console
from tests.reporting.terminal.snapshots import message, snapshot
from tests.wire import Bench

PACKAGE = Path(__file__).resolve().parent.parent / "adhesion_can"
TITLE = "\x1b]0;PWNED\x07\x1b[31m"
HOSTILE = (
    f"{TITLE}evil",
    "two\nERROR: lines",
    "good\rbad",
    "a\u202egnp",
    "b\u2066c\u2069",
    "l\u2028p\u2029",
    "c1\x9b31m",
    "del\x7f",
    "[red]no markup[/] [/unclosed :smile:",
)
HARMFUL = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")


def test_letters_of_all_writing_stay():
    for text in ("μ_max ≥ 0,3 °C", "Räder", "車輪速度", "سرعة", "“quoted” ’s", "a b\u00a0c"):
        assert printable(text) == text


def test_controls_have_their_escapes():
    assert printable("\x1b[31m\x07\x7f\x9b\n\t") == r"\x1b[31m\x07\x7f\x9b\n\t"
    assert printable("a\u202eb\u2066c\u2028") == r"a\u202eb\u2066c\u2028"
    assert printable(os.fsdecode(b"\xff.log")) == r"\udcff.log"


@given(st.text())
def test_nothing_harmful_is_left(text):
    clean = printable(text)
    assert not HARMFUL.search(clean)
    assert "\n" not in clean
    clean.encode()
    assert printable(clean) == clean
    file = io.StringIO()
    say(text, file)
    assert file.getvalue() == f"{clean}\n"


@pytest.mark.costly
def test_there_is_one_place_that_prints():
    found = [
        f"{path.relative_to(PACKAGE)}:{node.lineno}"
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "print"
    ]
    assert [place.split(":")[0] for place in found] == ["printable.py"], "others call say()"


@pytest.mark.parametrize("text", HOSTILE)
def test_tables_and_sentences_hold_escapes(text):
    file = io.StringIO()
    out = console(file)
    out.print(FittingTable(text, (text, "b"), [(text, text)]))
    out.print(text)
    printed = file.getvalue()
    assert not HARMFUL.search(printed)
    assert printed.count(printable(text)) == 5


# --- commands ------------------------------------------------------------------------------------


def table_file(path, heading):
    rng = random.Random(1)
    lines = [f"time_s,slip,adhesion,speed,{heading}"]
    for k in range(600):
        slip = rng.uniform(0, 0.2)
        mu = 0.4 * (1 - math.exp(-60 * slip)) - 0.3 * slip + rng.gauss(0, 0.01)
        lines.append(f"{k * 0.02:.2f},{slip:.6f},{mu:.6f},{20 + k % 7},{rng.random():.6f}")
    path.write_text("\n".join(lines) + "\n", newline="")
    return path


def database_file(path, name, unit):
    from xml.sax.saxutils import quoteattr

    path.write_text(
        '<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0"><Document/>'
        f'<Bus name="b"><Message id="0x101" name={quoteattr(name)} length="8">'
        f'<Signal name={quoteattr(name)} offset="0" length="16"><Value unit={quoteattr(unit)}/>'
        "</Signal></Message></Bus></NetworkDefinition>"
    )
    return path


def log_file(path):
    frames = Bench().drive(10**12, 10**12 + 500_000)
    path.write_text("".join(map(format_frame, frames)))
    return path


def said(capfd, *words):
    """Status and text of a command."""
    status = main(list(map(str, words)))
    found = capfd.readouterr()
    text = found.out + found.err
    assert not HARMFUL.search(text), repr(text)
    return status, text


@pytest.mark.parametrize("command", ["check", "identify", "diagnose"])
def test_headings_of_a_table(tmp_path, capfd, command):
    path = table_file(tmp_path / "a.csv", f"{TITLE}evil")
    status, text = said(capfd, command, path)
    assert status == 0
    assert "evil" in text or command == "identify"


@pytest.mark.parametrize(
    "heading", ['"a\nb\nERROR: fake"', '"good\rbad"', "a\u202egnp", "x\x9b31m"]
)
def test_lines_cannot_be_forged(tmp_path, capfd, heading):
    _, text = said(capfd, "check", table_file(tmp_path / "a.csv", heading))
    assert not any(line.startswith(("ERROR", "bad")) for line in text.splitlines())


@pytest.mark.costly
def test_channels_of_an_mf4(tmp_path, capfd):
    asammdf = pytest.importorskip("asammdf")
    times = np.arange(600) * 0.02
    names = ("slip", "adhesion", "speed", f"{TITLE}evil")
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append(
            [
                asammdf.Signal(
                    np.abs(np.sin(times + k)) * 0.1, times, name=name, unit=("", "\x1b[2J")[k == 3]
                )
                for k, name in enumerate(names)
            ]
        )
        mdf.save(tmp_path / "a.mf4")
    status, text = said(capfd, "check", tmp_path / "a.mf4")
    assert status == 0
    assert "evil" in text


@pytest.mark.parametrize("name", [f"{TITLE}evil.log", "b\u202egol.log", "two\nlines.log"])
@pytest.mark.parametrize("content", [b"\0no log", None])
def test_names_of_files(tmp_path, capfd, name, content):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    status, text = said(capfd, "check", path)
    assert status == 2
    assert text.count("\n") <= 2


def test_words_of_the_command_line(capfd):
    with pytest.raises(SystemExit) as end:
        main(["check", "--no\x1b[31mthing", "a.log"])
    assert end.value.code == 2
    found = capfd.readouterr()
    assert r"--no\x1b[31mthing" in found.err
    assert not HARMFUL.search(found.out + found.err)


@pytest.mark.parametrize("name", ["a\u202egnp", "x\u2028y", "=cmd()", "[/red]", "車" * 30])
def test_names_of_a_database(tmp_path, capfd, name):
    log = log_file(tmp_path / "a.log")
    database = database_file(tmp_path / "a.kcd", name, "\u202e" if name != "=cmd()" else "V")
    assert said(capfd, "convert", log, "--dbc", database, "--out", tmp_path / "a.csv")[0] == 0
    assert said(capfd, "init", "--dbc", database, "--yes")[0] in (0, 2)


@pytest.mark.parametrize("page", ViewPage)
@pytest.mark.parametrize("name", [*HOSTILE, "車輪速度" * 8, "é\u0301" * 20])
def test_the_monitor_draws_no_control(page, name):
    shown = snapshot(
        messages=(
            message(name, 0x101, state=MessageState.SILENT, age_us=9_000_000),
            message(name, 0x700, MessageRole.OTHER, cycle_us=None),
        ),
        transport=Transport(name=name * 3, recording=name, notes=(name, name)),
        remarks=(name,),
    )
    for width in (80, 100, 160):
        lines = draw(shown, width, 30, ViewOptions(page=page))
        assert [cell_len(line.plain) for line in lines] == [width] * 30
        assert not any(HARMFUL.search(line.plain) or "\n" in line.plain for line in lines)
    assert replace(shown).transport.name == name * 3


def test_the_log_of_the_service_is_clean():
    from adhesion_can.cli.narrator import Narrator

    for form in ("text", "json"):
        file = io.StringIO()
        Narrator(file, form).print("".join(HOSTILE))
        assert not HARMFUL.search(file.getvalue())
        assert file.getvalue().count("\n") == 1


@pytest.mark.parametrize("command", ["check", "diagnose"])
def test_pages_escape_what_strangers_wrote(tmp_path, command):
    bad = "</script><script>alert(1)</script><img src=x onerror=alert(2)>"
    path = table_file(tmp_path / "a.csv", f'"{bad}"')
    page = tmp_path / "a.html"
    assert main([command, str(path), "--html", str(page)]) == 0
    text = page.read_text()
    assert "<script>alert(1)" not in text
    assert "<img src=x" not in text
