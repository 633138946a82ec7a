"""What a person is likely to type wrongly, and the one line that comes: where, what, the fix."""

import csv
import gzip
import re

import can
import pytest

from adhesion_can.bus.database import packaged_path
from adhesion_can.cli.main import main
from adhesion_can.recordings.candump import parse_line
from adhesion_can.recordings.python_can_messages import to_message


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A drive of 3 s, its samples, and the same under wrong names, formats and units."""
    folder = tmp_path_factory.mktemp("mistakes")
    log, samples = folder / "drive.log", folder / "samples.csv"
    assert main(["simulate", "--scenario", "dry", "--duration", "3", "--log", str(log)]) == 0
    assert main(["replay", str(log), "--samples", str(samples)]) == 0
    text, dbc = log.read_text(), packaged_path().read_text()
    with can.ASCWriter(folder / "was.asc") as writer:
        for line in text.splitlines(keepends=True):
            writer(to_message(parse_line(line.encode())))
    (folder / "was.asc").rename(folder / "asc.log")
    with can.BLFWriter(folder / "cut.blf") as writer:
        writer(to_message(parse_line(text.splitlines()[0].encode())))
    (folder / "cut.blf").write_bytes((folder / "cut.blf").read_bytes()[:150])
    (folder / "cut.log.gz").write_bytes(gzip.compress(text.encode())[:40])
    (folder / "log.asc").write_text(text)
    (folder / "empty.log").write_text("")
    (folder / "empty.csv").write_text("")
    (folder / "folder.log").mkdir()
    for name, factor in (("ms", 1e3), ("us", 1e6), ("thousandth", 1e-3)):
        (folder / f"{name}.log").write_text(with_stamps(text, lambda t, k=factor: k * t))
    (folder / "rpm.dbc").write_text(dbc.replace('"rad/s"', '"rpm"'))
    (folder / "other_ids.dbc").write_text(
        re.sub(r"\b(257|258|273|289|290|305|306|321|337)\b", r"1\1", dbc)
    )
    for name, factor in (("ms", 1e3), ("us", 1e6)):
        with samples.open() as source, (folder / f"{name}.csv").open("w") as target:
            rows = list(csv.DictReader(source))
            writer = csv.DictWriter(target, rows[0])
            writer.writeheader()
            writer.writerows({**row, "time_s": float(row["time_s"]) * factor} for row in rows)
    return folder


def with_stamps(text, change):
    """Candump text whose stamps are changed by a function."""
    lines = text.splitlines(keepends=True)
    stamps = [float(line[1 : line.index(")")]) for line in lines]
    return "".join(
        f"({change(stamp):.6f}){line[line.index(')') + 1 :]}"
        for stamp, line in zip(stamps, lines, strict=True)
    )


REFUSED = {
    "repaly drive.log": "adhesion-can: no command 'repaly'; similar names: replay",
    "replay drive.log --form 1": "replay: no option --form; similar names: --from",
    "replay drive.log --tabel=x.csv": "replay: no option --tabel; similar names: --table",
    "replay --zzzzz drive.log": "replay: no option --zzzzz; see 'adhesion-can replay --help'",
    "simulate dry --scenario dry": "simulate: 'dry' is one argument too many",
    "simulate --scenario dry": "simulate: --log and -i: neither is given; name a log, or a bus",
    "simulate --scenario dry --log a.log -c vcan0": "--log and -i: both are given",
    "identify drive.log --curve polak": "identify: --curve: no 'polak'; similar names: polach",
    "experiment 4": "experiment: 1|2|3: no '4'; known: 1, 2, 3",
    "run -i socketkan -c vcan0": "similar names: socketcan",
    "run": "run: -i: no interface is given; pass for example -i socketcan -c vcan0",
    "run -i udp_multicast -c 239.74.163.2 --bus-kwargs hoplimit=0": "similar names: hop_limit",
    "run -c vcan0": "run: -i: no interface is given",
    "replay nowhere.log": "nowhere.log: No such file or directory; check the path",
    "replay folder.log": "folder.log: Is a directory; check the path",
    "replay empty.log": "empty.log: it has no frames; is it a recording of a bus",
    "replay cut.log.gz": "cut.log.gz: it has no frames; cut.log.gz: the compressed file ends",
    "replay cut.log.gz --realtime": "it has no frames; cut.log.gz: the compressed file ends",
    "check cut.log.gz": "it has no frames; cut.log.gz: the compressed file ends early",
    "diagnose cut.log.gz": "it has no frames; cut.log.gz: the compressed file ends early",
    "check cut.blf": "cut.blf: it has no frames; cut.blf: the file is truncated: it has 150 of the",
    "convert cut.blf --out x.csv": "it has no data frames; cut.blf: the file is truncated",
    "identify empty.csv": "empty.csv: a .csv with neither a 'slip' column",
    "replay samples.csv": "a table of samples, not a recording; give it to 'identify'",
    "replay drive.log --from 100": "ends 3.000 s after its first frame, before --from 100",
    "replay drive.log --dbc drive.log": "not a CAN database, judging by its name; give a .dbc",
    "replay drive.log --config rpm.dbc": "a CAN database, judging by its name, not a config",
    "check drive.log --dbc other_ids.dbc": "5 of 5 needed messages are missing (WheelSpeeds1 0x4E9",
    "replay ms.log": "its stamps seem to be in ms (WheelSpeeds1 arrives every 10000 ms",
    "identify us.log": "its stamps seem to be in us",
    "check us.log": "its stamps seem to be in us",
    "replay us.log": "its stamps seem to be in us",
    "replay us.log --realtime": "its stamps seem to be in us",
    "diagnose thousandth.log": "its stamps seem to be a thousandth of the time in seconds",
    "calibrate drive.log": "of the simulated scenarios, 'sweep' coasts",
}
"""The line by what is typed, after 'adhesion-can', in a folder with the files of the fixture."""


@pytest.mark.parametrize("typed", REFUSED)
def test_a_mistake_is_one_line_that_names_the_fix(folder, monkeypatch, capsys, typed):
    monkeypatch.chdir(folder)
    for name in ("CAN_INTERFACE", "CAN_CHANNEL"):
        monkeypatch.delenv(name, raising=False)
    before = sorted(folder.iterdir())
    try:
        code = main(typed.split())
    except SystemExit as error:
        code = error.code
    line = capsys.readouterr().err
    assert code == 2
    assert line.count("\n") == 1
    assert REFUSED[typed] in line
    assert "simulate: simulate:" not in line
    assert sorted(folder.iterdir()) == before


FOUND = {
    "check drive.log --dbc rpm.dbc": "it may be in rad/s, not in rpm",
    "check ms.csv": "if the column is in ms, pass --column time_s=time_s,unit=ms",
    "check us.csv": "if the column is in us, pass --column time_s=time_s,unit=us",
}
"""A sentence of `check` by what is typed."""


@pytest.mark.parametrize("typed", FOUND)
def test_check_names_the_wrong_unit(folder, monkeypatch, capsys, typed):
    monkeypatch.chdir(folder)
    main(typed.split())
    said = capsys.readouterr().out
    assert FOUND[typed] in said
    assert "of more than three cycles" not in said
    assert "opposite signs" not in said


def test_a_hole_or_another_rate_is_no_other_unit(folder, capsys, tmp_path):
    """Two drives an hour apart, and a drive at half its rate, are told as what they are."""
    text = (folder / "drive.log").read_text()
    later = with_stamps(text, lambda t: t + 3600)
    (tmp_path / "hole.log").write_text(text + later)
    (tmp_path / "slow.log").write_text(with_stamps(text, lambda t: 2 * t))
    for name in ("hole", "slow"):
        main(["check", str(tmp_path / f"{name}.log")])
        assert "stamps seem to be" not in capsys.readouterr().out
