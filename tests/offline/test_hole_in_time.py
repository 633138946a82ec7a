"""A hole of weeks in the stamps costs what the frames cost, and is reported in one line."""

import csv
import json
import tracemalloc

import numpy as np
import pytest

from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.offline.extract_samples import UPDATE_US, SampleExtractor
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from tests.diagnosis.bad_logs import readings, write

HOLE_US = 35 * 86_400 * 1_000_000
MOST_BYTES = 300 << 20


def log(path, hole_us):
    """8 s of a drive, with a hole in the middle."""
    return write(
        path, readings(8.0), stamps=lambda t_us: np.where(t_us > 4_000_000, t_us + hole_us, t_us)
    )


@pytest.fixture(scope="module")
def broken(tmp_path_factory):
    return log(tmp_path_factory.mktemp("hole") / "hole.log", HOLE_US)


@pytest.mark.costly
@pytest.mark.parametrize(
    "words",
    [
        ("check",),
        ("identify",),
        ("diagnose",),
        ("replay", "--table", "t.csv"),
        ("convert", "--out", "t.csv"),
        ("convert", "--raster", "10ms", "--out", "t.csv"),
    ],
    ids=" ".join,
)
def test_no_command_takes_memory_for_the_time_in_which_nothing_was_sent(
    words, broken, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    command, *options = words
    tracemalloc.start()
    try:
        assert main([command, str(broken), *options]) in {0, 1}
        assert tracemalloc.get_traced_memory()[1] < MOST_BYTES
    finally:
        tracemalloc.stop()


def test_check_reports_the_hole_once_and_not_message_by_message(broken, tmp_path):
    assert main(["check", str(broken), "--json", str(tmp_path / "c.json")]) == 1
    failures = json.loads((tmp_path / "c.json").read_text())["failures"]
    (line,) = [one for one in failures if "no frames for" in one]
    assert line.startswith("no frames for 3024000 s, from 4.000 s on")
    assert not [one for one in failures if "cycles" in one]


def test_a_gap_of_one_message_is_still_reported_beside_the_hole(tmp_path):
    path = log(tmp_path / "hole.log", HOLE_US)
    lines = path.read_text().splitlines()
    lines = [
        x for x in lines if not (" 111#" in x and 1.0 < float(x[1:].split(")")[0]) % 100 < 2.0)
    ]
    path.write_text("\n".join(lines) + "\n")
    assert main(["check", str(path), "--json", str(tmp_path / "c.json")]) == 1
    failures = json.loads((tmp_path / "c.json").read_text())["failures"]
    assert any("VehicleSpeed" in one and "2 gaps" in one for one in failures)


@pytest.mark.parametrize("hole_us", [50_000, 130_000, 500_000, 5_000_000, 90_000_000])
def test_the_samples_are_those_of_a_collection_each_20_ms(hole_us, tmp_path, monkeypatch):
    path = log(tmp_path / "hole.log", hole_us)

    def samples():
        extractor = SampleExtractor(load_configuration())
        found = extractor.run(blocks_in_sequence(open_recordings([path])))
        return found, extractor.dropped

    ours, dropped = samples()

    def every_time(self, t_us, origin_us):
        first = self.last_us + UPDATE_US - (self.last_us - origin_us) % UPDATE_US
        return np.arange(first, int(t_us[-1]) + 1, UPDATE_US)

    monkeypatch.setattr(SampleExtractor, "_due_times", every_time)
    plain, dropped_plain = samples()
    assert dropped == dropped_plain
    for name in ("t_us", "axle", "slip", "adhesion", "speed", "load", "adhesion_var"):
        assert np.array_equal(getattr(ours, name), getattr(plain, name)), name


def test_a_raster_has_no_rows_in_the_hole_and_says_so(broken, tmp_path, capsys):
    out, origin = tmp_path / "r.csv", 0.0
    words = ["convert", str(broken), "--raster", "7ms", "--out", str(out)]
    assert main([*words, "--json", str(tmp_path / "r.json")]) == 0
    (line,) = [x for x in capsys.readouterr().out.splitlines() if x.startswith("no rows in 1 hole")]
    assert "3024000 s" in line
    assert line in json.loads((tmp_path / "r.json").read_text())["problems"]
    with out.open() as file:
        time_s = np.array([float(row["time_s"]) for row in csv.DictReader(file)])
    origin = time_s[0]
    assert (time_s - origin) / 0.007 == pytest.approx(np.round((time_s - origin) / 0.007), abs=0.2)
    gaps = np.diff(time_s) > 0.0071
    assert gaps.sum() == 1
    assert time_s[:-1][gaps][0] == pytest.approx(7.0, abs=0.05)
