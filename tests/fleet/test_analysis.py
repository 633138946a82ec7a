"""The work on one unit: the same as the commands give, and failures that are data."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.config import load_configuration
from adhesion_can.fleet.analysis import Analysis, analyse
from adhesion_can.fleet.schema import STEPS, TABLES, UNITS
from adhesion_can.fleet.unit_sources import day_of
from adhesion_can.fleet.units import Unit
from adhesion_can.fleet.work import hash_settings, hash_unit
from adhesion_can.input_files import file_sha256
from adhesion_can.offline.extract_samples import extract_samples
from adhesion_can.offline.load_traces import load_traces
from adhesion_can.offline.scan import scan
from adhesion_can.recordings.recording import Recording


@pytest.fixture(scope="module")
def config():
    return load_configuration(None, None)


@pytest.fixture(scope="module")
def log(drives):
    return drives / "007" / "drive0.log"


@pytest.mark.costly
def test_one_pass_gives_what_the_commands_read_each_for_itself(log, config):
    contents = scan(Recording(log).blocks(), config)
    samples, _ = extract_samples(Recording(log).blocks(), config, "x")
    traces = load_traces(Recording(log).blocks(), config, "x")
    for name in ("t_us", "axle", "slip", "adhesion", "speed", "load"):
        assert np.array_equal(getattr(contents.samples, name), getattr(samples, name)), name
    assert contents.traces.columns.keys() == traces.columns.keys()
    for role, axle in traces.columns:
        own, other = contents.traces.trace(role, axle), traces.trace(role, axle)
        assert np.array_equal(own.t_us, other.t_us)
        assert np.array_equal(own.value, other.value)
    assert (contents.traces.rejected, contents.traces.derived) == (traces.rejected, traces.derived)


@pytest.mark.costly
def test_every_column_is_one_of_the_schema(log, config):
    analysis = analyse(log, "x", file_sha256(log), config, STEPS)
    assert not analysis.failed, analysis.fields["error"]
    assert set(analysis.fields) <= {column.name for column in UNITS.columns}
    assert set(analysis.rows) == {table.name for table in TABLES if table is not UNITS}
    for table in TABLES:
        known = {column.name for column in table.columns}
        assert all(set(row) <= known for row in analysis.rows.get(table.name, []))
    assert analysis.rows["segments"]


@pytest.mark.costly
def test_the_commands_say_the_same(log, config, tmp_path):
    import json

    from adhesion_can.cli.main import main

    fields = analyse(log, "x", file_sha256(log), config, ("check", "identify", "replay")).fields
    said = {}
    for command in ("check", "replay", "identify"):
        file = tmp_path / f"{command}.json"
        assert main([command, str(log), "--json", str(file)]) in (0, 1)
        said[command] = json.loads(file.read_text())
    assert fields["usable"] is said["check"]["usable"]
    assert fields["samples"] == said["check"]["samples"]
    by_status = said["replay"]["setpoints_by_status"]
    assert fields["setpoints"] == sum(by_status.values())
    for status, count in by_status.items():
        assert fields[f"share_{status.lower()}"] == count / fields["setpoints"]


def test_a_step_that_fails_leaves_the_others(log, config):
    static = replace(config, sampling=replace(config.sampling, v_min=1000.0))  # nothing moves
    analysis = analyse(log, "x", file_sha256(log), static, STEPS)
    assert analysis.fields["failed_step"] in {"calibrate", "identify"}
    assert analysis.fields["setpoints"] > 0
    assert analysis.fields["frames"] > 0
    assert analysis.rows["segments"] == []


def test_an_error_that_nobody_thought_of_is_data_with_its_place():
    analysis = Analysis()

    def broken():
        return 1 // 0

    assert analysis.take("check", broken) is None
    error = analysis.fields["error"]
    assert error.startswith(
        "ZeroDivisionError: integer division or modulo by zero (test_analysis.py:"
    )
    assert analysis.fields["check_seconds"] >= 0
    analysis.take("replay", lambda: {}["x"])
    assert analysis.fields["failed_step"] == "check"  # the first one


def test_a_table_is_a_unit_without_frames(config, tmp_path):
    rng = np.random.default_rng(5)
    slip = rng.uniform(0.001, 0.15, 400)
    adhesion = 0.35 * (1 - np.exp(-40 * slip)) - 0.4 * slip + rng.normal(0, 0.003, 400)
    path = tmp_path / "points.csv"
    lines = [f"{t / 10},{s},{a}" for t, (s, a) in enumerate(zip(slip, adhesion, strict=True))]
    path.write_text("\n".join(["time_s,slip,adhesion", *lines]))
    analysis = analyse(path, "x", file_sha256(path), config, STEPS)
    assert not analysis.failed, analysis.fields["error"]
    assert analysis.fields["samples"] == 400
    assert analysis.fields["duration_s"] == pytest.approx(39.9)
    assert "frames" not in analysis.fields
    assert analysis.fields["verdict"] == "nothing_found"
    assert analysis.rows["segments"][0]["mu_max"] == pytest.approx(0.35, abs=0.06)


@pytest.mark.parametrize(
    ("first_us", "day"),
    [(None, None), (0, None), (5_000_000, None), (1_769_903_999_999_999, "2026-01-31"),
     (1_769_904_000_000_000, "2026-02-01"), (5_000_000_000_000_000, None)],
)  # fmt: skip
def test_a_day_is_that_of_a_clock_that_was_set(first_us, day):
    found = day_of(first_us)
    assert (found and found.isoformat()) == day


def test_a_key_is_of_content_and_of_all_that_rows_depend_on(config):
    unit = Unit("/a.log", "v", 5, "5 1")
    base = hash_settings(unit, config, ("check", "replay"))
    assert base == hash_settings(unit, config, ("replay", "check"))
    assert base == hash_settings(replace(unit, path="/b.log", fingerprint="x"), config,
                                 ("check", "replay"))  # fmt: skip
    others = [
        hash_settings(unit, config, ("check",)),
        hash_settings(replace(unit, vehicle="w"), config, ("check", "replay")),
        hash_settings(replace(unit, line="Gotthard"), config, ("check", "replay")),
        hash_settings(replace(unit, latitude_deg=46.0), config, ("check", "replay")),
        hash_settings(unit, replace(config, sha256="other"), ("check", "replay")),
    ]
    assert len({base, *others}) == 1 + len(others)
    assert len({hash_unit(a, b) for a in ("x", "y") for b in (base, others[0])}) == 4
