"""The doubt in what `replay` and `run` write and say, with an estimator that doubts on schedule."""

import csv
import io
import json
import signal
from dataclasses import replace

import pytest

import adhesion_can
from adhesion_can.cli.main import main
from adhesion_can.cli.narrator import Narrator
from adhesion_can.config import Configuration
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.status import Status
from adhesion_can.recordings.candump import format_frame, parse_line
from adhesion_can.service.outputs import Outputs
from tests.service.test_core import KNOWN
from tests.wire import Bench, decoded

T0 = 10**12
NAMED = {"SPEED": "speed", "AXLE": "axle", "NONE": "none", "": "not available"}


class Scheduled:
    """An estimator that has a doubt from each of some times on, s after T0."""

    def __init__(self, doubts):
        self.doubts = doubts
        self.current = None

    def update(self, samples, now_us):
        for since_s, doubt in self.doubts.items():
            if now_us - T0 >= since_s * 1e6:
                self.current = doubt
        return None if self.current is None else replace(KNOWN, doubt=self.current)


@pytest.fixture
def schedule(monkeypatch):
    """Sets the doubts of every estimator that a command makes."""

    def set_doubts(doubts):
        make = lambda _, __=None: Scheduled(doubts)  # noqa: E731
        monkeypatch.setattr(Configuration, "make_estimator", make)

    return set_doubts


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A drive of 4 s."""
    path = tmp_path_factory.mktemp("drive") / "d.log"
    path.write_text("".join(map(format_frame, Bench().drive(T0, T0 + 4_000_000))))
    return path


COMING_AND_GOING = {1.0: Doubt.NONE, 2.0: Doubt.SPEED, 3.0: Doubt.AXLE, 3.5: Doubt.NONE}


def replayed(log, tmp_path):
    """(rows of the table, frames, JSON)."""
    names = [tmp_path / name for name in ("t.csv", "f.log", "r.json")]
    arguments = ["replay", str(log), "--table", str(names[0])]
    assert main([*arguments, "--frames", str(names[1]), "--json", str(names[2])]) == 0
    rows = list(csv.DictReader(names[0].read_text().splitlines()))
    frames = [parse_line(line) for line in names[1].read_bytes().splitlines(keepends=True)]
    return rows, frames, json.loads(names[2].read_text())


def test_frames_table_and_json_of_a_replay_agree_on_the_doubt(log, tmp_path, schedule):
    schedule(COMING_AND_GOING)
    rows, frames, document = replayed(log, tmp_path)
    by_time = {row["time_s"]: row["doubt"] for row in rows}
    for since_s, name in ((0.5, ""), (1.5, "NONE"), (2.5, "SPEED"), (3.2, "AXLE"), (3.8, "NONE")):
        assert by_time[f"{T0 / 1e6 + since_s:.6f}"] == name
    quality = [frame for frame in frames if frame.arbitration_id == 0x203]
    assert len(quality) == 40
    for frame in quality:
        assert str(decoded(frame)["Doubt"]) == NAMED[by_time[f"{frame.t_us / 1e6:.6f}"]]
    counted = {name: list(by_time.values()).count(name.upper()) for name in ("none", "speed")}
    assert document["setpoints_by_doubt"]["none"] == counted["none"]
    assert document["setpoints_by_doubt"]["speed"] == counted["speed"] == 50
    assert document["last"]["doubt"] == "none"


def test_a_replay_in_python_has_the_column_of_the_command(log, tmp_path, schedule):
    schedule(COMING_AND_GOING)
    rows, *_ = replayed(log, tmp_path)
    table = adhesion_can.replay(log)
    assert list(table)[-3:] == ["doubt", "family", "objection"]
    for name in ("doubt", "family", "objection"):
        assert table[name].tolist() == [row[name] for row in rows]
    shown = table.to_dict()["doubt"]
    assert (shown[0], shown[125]) == (None, "SPEED")


def test_a_replay_says_how_long_there_was_doubt_and_why(log, tmp_path, capsys, schedule):
    schedule(COMING_AND_GOING)
    replayed(log, tmp_path)
    assert (
        "doubt 37.5 % of the time (adhesion depends on speed (25.0 %), axles differ (12.5 %)): "
        "run `diagnose`\n"
    ) in capsys.readouterr().out
    schedule({1.0: Doubt.AXLE_LOAD})
    replayed(log, tmp_path)
    line = "doubt 75.0 % of the time (adhesion depends on axle load): run `diagnose`\n"
    assert line in capsys.readouterr().out


@pytest.mark.parametrize("doubts", [{0.0: Doubt.NONE}, {0.0: Doubt.NOT_AVAILABLE}, {}])
def test_a_replay_without_doubt_says_nothing_of_it(log, tmp_path, capsys, schedule, doubts):
    schedule(doubts)
    rows, _, document = replayed(log, tmp_path)
    said = capsys.readouterr().out
    assert "% of the time" not in said
    assert said.count("doubt") == said.count("the service has no doubt. Next: ")
    assert {row["doubt"] for row in rows} <= {"", "NONE"}
    if Doubt.NONE not in doubts.values():
        assert document["setpoints_by_doubt"] == {}
        assert "doubt" not in (document["last"] or {})


# --- run


def told(*doubts, status=Status.TRACKING):
    """Lines about doubts that the narrator prints for setpoints 20 ms apart, from 0.00 s on."""
    file = io.StringIO()
    narrator = Narrator(file)
    for place, doubt in enumerate(doubts):
        narrator.print_setpoint(12_300_000 + 20_000 * place, Outputs(status, doubt=doubt))
    return [line for line in file.getvalue().splitlines() if "doubt" in line]


def test_the_operator_reads_of_a_doubt_when_it_comes_changes_and_goes():
    assert told(Doubt.NONE, Doubt.NONE) == []
    assert told(Doubt.AXLE_LOAD, Doubt.AXLE_LOAD) == [
        "0.00 doubt: adhesion depends on axle load: run `diagnose`"
    ]
    assert told(Doubt.NONE, Doubt.SPEED, Doubt.SPEED, Doubt.SHAPE, Doubt.NONE, Doubt.NONE) == [
        "0.02 doubt: adhesion depends on speed: run `diagnose`",
        "0.06 doubt: the curve has another shape: run `diagnose`",
        "0.08 no more doubt",
    ]


def test_what_is_not_available_does_not_take_a_doubt_away():
    missing = Doubt.NOT_AVAILABLE
    assert told(missing, missing) == []
    assert len(told(Doubt.SPEED, missing, Doubt.SPEED)) == 1
    assert told(Doubt.SPEED, missing, Doubt.NONE)[-1] == "0.04 no more doubt"
    assert told(missing, Doubt.NONE, missing, Doubt.NONE) == []


def test_run_tells_the_doubt_and_keeps_it_in_json_and_out_of_the_state(
    tmp_path, monkeypatch, capsys, schedule
):
    def drive(service, _until):
        for frame in Bench().drive(T0, T0 + 3_000_000):
            service.core.feed(frame)
        service.bus.shutdown()

    monkeypatch.setattr("adhesion_can.cli.run.LiveService.run", drive)
    schedule({1.0: Doubt.NONE, 2.0: Doubt.DIRECTION})
    files = {name: tmp_path / f"{name}.json" for name in ("json", "state")}
    options = [word for name, path in files.items() for word in (f"--{name}", str(path))]
    handlers = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        # The second time it begins from the kept estimate.
        for _ in range(2):
            assert main(["run", "-i", "virtual", "-c", "doubt", *options]) == 0
            sentence = "adhesion differs between traction and braking"
            assert f"\n2.00 doubt: {sentence}: run `diagnose`\n" in capsys.readouterr().err
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    documents = {name: json.loads(path.read_text()) for name, path in files.items()}
    assert documents["json"]["last"]["doubt"] == "direction"
    # Nothing of a drive in doubt is learned.
    assert documents["state"]["surfaces"] == []
