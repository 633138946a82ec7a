"""The reason why nobody vouches for a peak: the same one wherever a user looks."""

import csv
import json

import pytest

from adhesion_can.cli.main import main
from adhesion_can.physics.objection import WORDINGS, Objection
from tests.faults.catalogue import KINDS
from tests.faults.locomotive import simulate
from tests.faults.play import make_case, on_the_bus
from tests.faults.sensors import draw_noise, read

CASES = {
    "wheels_at_rest": {Objection.WHEELS_JUMP},
    "speed_less": {Objection.SPEED_JUMP, Objection.SPEED_DEVIATES},
}


@pytest.fixture(scope="module", params=CASES)
def drive(request, tmp_path_factory):
    """Name of a kind, its case, and the recording of a drive with it."""
    name = request.param
    case = make_case(name, KINDS[name].sizes[0], 2, stays=True)
    frames = on_the_bus(KINDS[name], case, read(simulate(case.world), draw_noise(case.world.seed)))
    path = tmp_path_factory.mktemp(name) / "drive.log"
    path.write_text(
        "".join(
            f"({f.t_us // 10**6}.{f.t_us % 10**6:06d}) can0 {f.arbitration_id:03X}#{f.data.hex()}\n"
            for f in frames
        )
    )
    return name, case, path


def test_check_tells_when_and_why(drive, tmp_path, capsys):
    name, case, path = drive
    main(["check", str(path), "--json", str(tmp_path / "c.json")])
    (first, *_) = json.loads((tmp_path / "c.json").read_text())["objections"]
    objection = Objection[first["objection"].upper()]
    assert objection in CASES[name]
    assert case.onset_s <= first["from_s"] <= case.onset_s + 0.5
    assert first["to_s"] > first["from_s"]
    assert f"WARNING: {first['from_s']:.1f} .. " in capsys.readouterr().out


def test_check_tells_nothing_where_the_watch_is_off(drive, tmp_path):
    _, _, path = drive
    config = tmp_path / "off.toml"
    config.write_text("[plausibility]\nenabled = false\n")
    main(["check", str(path), "--config", str(config), "--json", str(tmp_path / "c.json")])
    assert json.loads((tmp_path / "c.json").read_text())["objections"] == []


@pytest.mark.costly
def test_replay_has_it_in_its_table_and_on_its_page(drive, tmp_path):
    name, case, path = drive
    table, page = tmp_path / "t.csv", tmp_path / "r.html"
    assert main(["replay", str(path), "--table", str(table), "--html", str(page)]) == 0
    rows = list(csv.DictReader(table.read_text().splitlines()))
    told = [(float(row["time_s"]), row["objection"]) for row in rows]
    first_s, first = next((t, word) for t, word in told if word != "NONE")
    assert Objection[first] in CASES[name]
    assert case.onset_s <= first_s <= case.onset_s + 0.5
    assert not [row for row in rows if row["objection"] != "NONE" and row["status"] == "TRACKING"]
    assert WORDINGS[Objection[first]].what in page.read_text()
    # What was learned of the fault before it was objected to is not sent.
    peaks = [(float(r["mu_max"]), float(r["lambda_m"])) for r in rows if r["objection"] != "NONE"]
    known = next(row for row in reversed(rows) if float(row["time_s"]) < case.onset_s)
    wanted = float(known["mu_max"]), float(known["lambda_m"])
    assert all(peak == pytest.approx(wanted, rel=0.1) for peak in set(peaks))


@pytest.mark.costly
def test_monitor_says_it_of_what_is_on_the_bus(drive, tmp_path, capsys):
    """From the frames alone, as from a service on another machine."""
    name, case, path = drive
    sent, both = tmp_path / "sent.log", tmp_path / "both.log"
    assert main(["replay", str(path), "--frames", str(sent)]) == 0
    lines = [*path.read_text().splitlines(), *sent.read_text().splitlines()]
    both.write_text("\n".join(sorted(lines)) + "\n")
    capsys.readouterr()
    assert main(["monitor", str(both), "--json", "-"]) == 0
    objects = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    at = next(o for o in objects if o["bus_time_s"] >= case.onset_s + 1.0)
    objection = Objection[at["objection"].upper()]
    assert objection in CASES[name]
    assert any(WORDINGS[objection].what[4:] in sentence for sentence in at["words"])
    assert objects[0]["objection"] is None
