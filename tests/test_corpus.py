"""`tools/corpus` tells apart what is read, what is refused rightly and what differs."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tools.corpus import Outcome, look, main  # noqa: E402

GOOD = 'VERSION ""\nBU_: A\nBO_ 288 M: 2 A\n SG_ s : 0|12@1+ (0.5,-3) [0|0] "" A\n'
FAULTY = GOOD + 'VAL_ 288 t 0 "off" ;\n'
LOG = "(1.000000) can0 120#1027\n(1.010000) can0 7FF#\n"
FRAMES = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2\n" + "1000,00000120,false,Rx,0,2,10,27\n" * 3


def test_outcomes(tmp_path, capsys, monkeypatch):
    for name, text in (
        ("good.dbc", GOOD),
        ("faulty.dbc", FAULTY),
        ("words.dbc", "no database at all"),
        ("a.log", LOG),
        ("frames.csv", FRAMES),
        ("numbers.csv", "a,b\n1,2\n"),
        ("other.bin", "whatever"),
    ):
        (tmp_path / name).write_text(text)
    found = {result.path.name: result for result in look([tmp_path])}
    assert {name: result.outcome for name, result in found.items()} == {
        "good.dbc": Outcome.EQUAL,
        "faulty.dbc": Outcome.BOTH_REFUSE,
        "words.dbc": Outcome.BOTH_REFUSE,
        "a.log": Outcome.EQUAL,
        "frames.csv": Outcome.ALONE,
    }
    assert "read with --lenient" in found["faulty.dbc"].reason
    monkeypatch.setattr(sys, "argv", ["corpus", str(tmp_path)])
    assert main() == 0
    assert "databases: 3: 1 read and equal, 2 refused by both" in capsys.readouterr().out


def test_a_difference_is_told(tmp_path, monkeypatch):
    (tmp_path / "a.log").write_text(LOG)
    monkeypatch.setattr("tools.corpus._frames", lambda _: iter(()))
    (result,) = look([tmp_path])
    assert result.outcome is Outcome.REFUSED
