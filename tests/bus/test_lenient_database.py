"""Databases with a faulty message: refused with the fix, or read without it."""

import pytest

from adhesion_can.bus.database import load_database
from adhesion_can.cli.main import main
from adhesion_can.errors import DatabaseError

SOUND = """BO_ 100 Speed: 8 A
 SG_ v : 0|16@1+ (0.01,0) [0|0] "m/s" A

"""
TOO_LARGE = """BO_ 3000 Big: 8 A
 SG_ x : 0|8@1+ (1,0) [0|0] "" A
 SG_ y : 8|8@1+ (1,0) [0|0] "" A

"""
HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: A\n\n'
TAIL = 'CM_ SG_ 3000 x "too large";\nCM_ SG_ 100 v "speed";\n'


def written(path, *parts):
    path.write_text(HEAD + "".join(parts) + TAIL)
    return path


def test_a_faulty_message_is_told_and_left_out(tmp_path):
    path = written(tmp_path / "a.dbc", TOO_LARGE, SOUND, TOO_LARGE.replace("3000 Big", "4000 Huge"))
    with pytest.raises(DatabaseError, match="--lenient"):
        load_database(path)
    found = load_database(path, lenient=True)
    assert [message.name for message in found.db.messages] == ["Speed"]
    assert found.db.messages[0].signals[0].comment == "speed"
    assert [one.split()[2].rstrip(":") for one in found.left_out] == ["Big", "Huge"]
    assert all("more than 11 bits" in one for one in found.left_out)


def test_a_sound_database_is_the_same(tmp_path):
    path = written(tmp_path / "a.dbc", SOUND)
    strict, lenient = load_database(path), load_database(path, lenient=True)
    assert lenient.left_out == ()
    assert strict.sha256 == lenient.sha256
    assert [m.name for m in strict.db.messages] == [m.name for m in lenient.db.messages]


@pytest.mark.parametrize("text", ["BO_ x", "BO_ 100 Speed: 8 A\n SG_ v 0|16@1+\n", "{}"])
@pytest.mark.parametrize("lenient", [False, True])
def test_what_is_no_database_stays_an_error(tmp_path, text, lenient):
    path = tmp_path / "a.dbc"
    path.write_text(text)
    with pytest.raises(DatabaseError, match=r"a\.dbc: not a "):
        load_database(path, lenient=lenient)


def test_the_command_says_what_it_left_out(tmp_path, capsys):
    path = written(tmp_path / "a.dbc", TOO_LARGE, SOUND)
    log, out = tmp_path / "a.log", tmp_path / "a.csv"
    log.write_text("(0.000000) can0 064#1027000000000000\n(0.010000) can0 064#1127000000000000\n")
    assert main(["convert", str(log), "--dbc", str(path), "--out", str(out)]) == 2
    assert "--lenient" in capsys.readouterr().err
    assert main(["convert", str(log), "--dbc", str(path), "--lenient", "--out", str(out)]) == 0
    assert "skipped message Big" in capsys.readouterr().err
    assert "100.01" in out.read_text()


OF_BIG = 'VAL_ 3000 x 0 "a; b" 1 "on" ;\nSIG_VALTYPE_ 3000 y : 1;\n'
WITHOUT_SIGNAL = 'VAL_ 100 w 0 "off;" 1 "on" ;\nVAL_ 100 v 0 "rest" ;\nSIG_VALTYPE_ 77 u : 1;\n'


def test_a_message_is_left_out_with_all_that_refers_to_it(tmp_path):
    path = written(tmp_path / "a.dbc", TOO_LARGE, SOUND, OF_BIG)
    found = load_database(path, lenient=True)
    assert [message.name for message in found.db.messages] == ["Speed"]
    assert [one.split()[2].rstrip(":") for one in found.left_out] == ["Big"]


def test_statements_without_a_signal_are_told_and_left_out(tmp_path):
    path = written(tmp_path / "a.dbc", SOUND, WITHOUT_SIGNAL)
    with pytest.raises(DatabaseError, match="remove these statements, or pass --lenient"):
        load_database(path)
    found = load_database(path, lenient=True)
    assert found.db.messages[0].signals[0].choices == {0: "rest"}
    assert found.left_out == (
        "skipped VAL_ 100 w: there is no such signal",
        "skipped SIG_VALTYPE_ 77 u: there is no such signal",
    )
