"""Recordings that are not as they should be: the answers that docs/recordings.md gives."""

import csv
import gzip
import json

import can
import pytest
import zstandard

from adhesion_can.cli.main import main
from adhesion_can.recordings.candump import format_frame
from adhesion_can.recordings.python_can_messages import to_message
from tests.wire import Bench

FRAMES = list(Bench().drive(10**12, 10**12 + 3_000_000))
LINES = [format_frame(frame) for frame in FRAMES]
WHOLE = "".join(LINES)


def spoiled():
    """The text with a bad line after every 1000."""
    out = []
    for number, line in enumerate(LINES, start=1):
        out.append(line)
        if number % 1000 == 0:
            out.append(["not a line\n", "(1.0) can0 101#0011x\n"][number // 1000 % 2])
    return "".join(out)


CUT = WHOLE[: WHOLE.rindex("#") + 6]
ODD = {
    "as it should be": (WHOLE, len(FRAMES), {}),
    "cut in the middle of a payload": (CUT, len(FRAMES) - 1, {"cut": 1}),
    "cut in the middle of a stamp": (WHOLE + "(1000004.0", len(FRAMES), {"cut": 1}),
    "a bad line every 1000": (spoiled(), len(FRAMES), {"malformed": len(FRAMES) // 1000}),
    "CR LF": (WHOLE.replace("\n", "\r\n"), len(FRAMES), {}),
    "without the last line's end": (WHOLE.rstrip("\n"), len(FRAMES), {}),
    "blank lines and comments": ("# can0\n\n" + WHOLE, len(FRAMES), {"blank": 1, "comment": 1}),
}
SUFFIXES = (".asc", ".blf", ".trc", ".csv", ".db", ".mf4")


@pytest.mark.parametrize(
    ("kind", "packed"),
    [
        *((kind, "") for kind in ODD),
        *((kind, packed) for kind in list(ODD)[:2] for packed in (".gz", ".zst")),
    ],
)
def test_no_line_ends_the_reading(kind, packed, tmp_path):
    text, frames, lines = ODD[kind]
    pack = {"": bytes, ".gz": gzip.compress, ".zst": zstandard.compress}[packed]
    log = tmp_path / f"d.log{packed}"
    log.write_bytes(pack(text.encode()))
    told = tmp_path / "told.json"
    assert main(["replay", str(log), "--json", str(told)]) == 0
    document = json.loads(told.read_text())
    assert document["frames"] == frames
    assert document["frames_rejected"] == 0
    assert document["lines"] == {"frame": frames, **lines}
    passed_over = [p for p in document["problems"] if "lines skipped" in p]
    assert len(passed_over) == bool({"cut", "malformed"} & lines.keys())

    assert main(["convert", str(log), "--out", str(tmp_path / "o.csv"), "--json", str(told)]) == 0
    document = json.loads(told.read_text())
    assert document["decoded"] == frames
    assert document["lines"] == {"frame": frames, **lines}
    with (tmp_path / "o.csv").open() as file:
        assert len(list(csv.DictReader(file))) == frames


def fails(capsys, *arguments):
    assert main(list(map(str, arguments))) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    assert said.out == ""
    return said.err


CONVERT = ("convert", "--out", "o.csv")
COMMANDS = [("replay",), ("check",), ("identify",), ("diagnose",), ("calibrate",), CONVERT]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: c[0])
def test_an_empty_file_is_an_error_and_nothing_is_written(command, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, content in (("e.log", b""), ("e.log.gz", gzip.compress(b"")), ("n.log", b"\n# x\n")):
        (tmp_path / name).write_bytes(content)
        said = "it has no data frames;" if command == CONVERT else "it has no frames;"
        assert f"{name}: {said}" in fails(capsys, *command, name)
    assert not (tmp_path / "o.csv").exists()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_content_counts_whatever_the_name(suffix, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with can.Logger(tmp_path / f"a{suffix}") as log:
        for frame in FRAMES[:20]:
            log.on_message_received(to_message(frame))
    (tmp_path / "t.log").write_text(WHOLE)
    for path in (f"a{suffix}", "t.log"):
        other = "b.log" if path[0] == "a" else f"t{suffix}"
        written = []
        for name in (path, other):
            if name == other:
                (tmp_path / path).rename(tmp_path / other)
            assert main(["convert", "--out", "o.csv", name]) == 0
            written.append((tmp_path / "o.csv").read_text())
            said = capsys.readouterr().out
            assert ("by its content" in said) is (name == other), said
        assert written[0] == written[1]


@pytest.mark.parametrize("suffix", [s for s in SUFFIXES if s != ".db"])
def test_every_format_gives_the_same_columns(suffix, tmp_path):
    with can.Logger(tmp_path / f"a{suffix}") as log:
        for frame in FRAMES[:300]:
            log.on_message_received(to_message(frame))
    (tmp_path / "a.log").write_text("".join(LINES[:300]))
    rows = {}
    for name in (f"a{suffix}", "a.log"):
        out = tmp_path / "o.csv"
        assert main(["convert", str(tmp_path / name), "--out", str(out)]) == 0
        with out.open() as file:
            rows[name] = [
                {k: v for k, v in r.items() if k != "time_s"} for r in csv.DictReader(file)
            ]
    assert rows[f"a{suffix}"] == rows["a.log"]
    assert len(rows["a.log"]) == 300


def test_a_packed_file_that_is_cut_names_no_line(tmp_path, capsys):
    whole = gzip.compress(WHOLE.encode())
    (tmp_path / "a.log.gz").write_bytes(whole[: len(whole) * 2 // 3])
    main(["replay", str(tmp_path / "a.log.gz")])
    out = capsys.readouterr().out
    assert "a.log.gz: the compressed file ends early" in out
    assert "(line , ..)" not in out
