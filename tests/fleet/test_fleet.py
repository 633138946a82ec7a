"""`adhesion-can fleet` on a cluster of two workers: results, resume, deaths, stores, queries."""

import json
import os
import re
import shutil
import signal
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from distributed import LocalCluster

from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.fleet import run
from adhesion_can.fleet.analysis import analyse
from adhesion_can.fleet.cluster import open_cluster
from adhesion_can.fleet.dataset import DataSet
from adhesion_can.fleet.plan import make_plan
from adhesion_can.fleet.schema import STEPS, TABLES
from adhesion_can.fleet.units import find_units
from adhesion_can.fleet.work import is_current
from adhesion_can.input_files import file_sha256
from tests.fleet.tables import TIMES, rows, units
from tests.fleet.workers import do_nothing, work_until_deadly

pytestmark = pytest.mark.cluster
DOCS = Path(__file__).resolve().parents[2] / "docs" / "fleet.md"
NAMES = [f"drive{number}.log" for number in range(5)]


def plan_of(folder, out, steps=("check", "identify")):
    found = find_units([str(folder)], None, str(out))
    return make_plan(found, str(out), steps, lambda path: load_configuration(path, None))


def tasks_of(folder, out, steps=("check", "identify")):
    plan = plan_of(folder, out, steps)
    return [t for t in plan.tasks(DataSet(str(out)).read_units()) if not is_current(t)]


def test_a_data_set_holds_what_one_process_finds(made, drives):
    found = units(made / "out")
    assert sorted(found) == [*NAMES, "torn.log"]
    config = load_configuration(None, None)
    for log in drives.rglob("*.log"):
        alone = analyse(log, str(log), file_sha256(log), config, STEPS)
        row = found[log.name]
        for name, value in alone.fields.items():
            if not name.endswith(TIMES):
                assert row[name] == value, name
        for table in TABLES[1:]:
            (own,) = [r for name, r in rows(made / "out", table.name).items() if log.name in name]
            wanted = [{c.name: r.get(c.name) for c in table.columns[3:]} for r in
                      alone.rows[table.name]]  # fmt: skip
            assert [{c.name: r[c.name] for c in table.columns[3:]} for r in own] == wanted
            assert {r["unit_id"] for r in own} <= {row["unit_id"]}


def test_a_unit_that_cannot_be_read_is_a_row_with_its_error(made):
    row = units(made / "out")["torn.log"]
    assert (row["status"], row["failed_step"], row["vehicle"]) == ("failed", "read", "bad")
    assert "torn.log: it has no frames; torn.log: lines skipped: 1 malfor" in row["error"]
    assert row["sha256"]
    assert row["verdict"] is None


def test_vehicle_and_day_are_folders_and_columns(made):
    row = units(made / "out")["drive0.log"]
    assert (row["vehicle"], row["day"].isoformat()) == ("007", "2026-01-31")
    assert row["started_at"].isoformat().startswith("2026-01-31T12:00:00")
    folders = {str(p.parent.relative_to(made / "out")) for p in (made / "out").rglob("*.parquet")}
    assert "units/vehicle=007/day=2026-01-31" in folders
    assert "segments/vehicle=BR 185/day=__HIVE_DEFAULT_PARTITION__" in folders
    assert not list(made.rglob("*.part"))
    assert not list(made.rglob(".probe*"))


def test_the_same_command_again_does_only_what_is_new(made, drives, fleet, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(made / "out", out)
    drive = tmp_path / "drives" / "tram"
    shutil.copytree(drives / "tram", drive)
    steps = ("--steps", "check", "--json", tmp_path / "a.json")

    def again(*words):
        assert not fleet(drive, tmp_path / "bad.log", "--out", out, *steps, *words)
        document = json.loads((tmp_path / "a.json").read_text())
        return document["units"] - document["kept"], len(document["failed"])

    def own():
        path = str(drive / "drive3.log")
        (row,) = (row for (row,) in rows(out).values() if row["path"] == path)
        return row

    (tmp_path / "bad.log").write_text("nothing\n")
    assert again() == (3, 1)  # other paths than before
    before = {p: p.stat().st_mtime_ns for p in out.rglob("vehicle=*/**/*.parquet")}
    assert again() == (0, 1)
    assert {p: p.stat().st_mtime_ns for p in out.rglob("vehicle=*/**/*.parquet")} == before
    then = own()
    os.utime(drive / "drive3.log", ns=(1, 1))  # another time, the same content
    assert again() == (0, 1)
    now = own()
    assert now["fingerprint"] != then["fingerprint"]
    assert now | {"fingerprint": then["fingerprint"]} == then
    after = {p: p.stat().st_mtime_ns for p in out.rglob("vehicle=*/**/*.parquet")}
    assert again() == (0, 1)  # it is not written, nor hashed, a second time
    assert {p: p.stat().st_mtime_ns for p in out.rglob("vehicle=*/**/*.parquet")} == after
    assert again("--retry-failed") == (1, 1)
    (drive / "drive3.log").write_bytes((drives / "007" / "drive0.log").read_bytes())
    assert again() == (1, 1)  # another content, and with it another day
    assert own()["day"].isoformat() == "2026-01-31"
    assert again("--vehicle", r"/(\w+)\.log") == (3, 1)  # another name
    assert own()["vehicle"] == "drive3"
    assert len(list((out / "units").rglob("*.parquet"))) == 6 + 3


def test_a_worker_that_is_killed_in_the_middle_changes_nothing(client, drives, tmp_path):
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert len(list(run.run_fleet(client, tasks_of(drives, whole)))) == len(NAMES)
    outcomes = run.run_fleet(client, tasks_of(drives, killed))
    first = next(outcomes)
    pids = client.run(os.getpid)
    os.kill(next(iter(pids.values())), signal.SIGKILL)
    paths = [first.path, *(outcome.path for outcome in outcomes)]
    assert sorted(Path(path).name for path in paths) == NAMES
    for table in ("units", "segments"):
        assert rows(killed, table) == rows(whole, table)
    assert all(row["status"] == "done" for row in units(killed).values())


@pytest.mark.slow
def test_a_unit_that_kills_its_workers_is_a_failed_row_and_others_are_done(
    client, drives, tmp_path
):
    folder = tmp_path / "drives"
    shutil.copytree(drives / "tram", folder / "tram")
    (folder / "tram" / "deadly.log").write_text("x")
    tasks = tasks_of(folder, tmp_path / "out", ("check",))
    outcomes = list(run.run_fleet(client, tasks, work_until_deadly))
    assert sorted(Path(one.path).name for one in outcomes) == [
        "deadly.log", "drive3.log", "drive4.log"]  # fmt: skip
    found = units(tmp_path / "out")
    assert found["deadly.log"]["failed_step"] == "worker"
    assert f"killed its worker {run.DEATHS} times" in found["deadly.log"]["error"]
    assert {found[name]["status"] for name in ("drive3.log", "drive4.log")} == {"done"}


def test_few_units_are_with_the_scheduler_however_many_there_are(client, drives, tmp_path):
    one, *_ = tasks_of(drives, tmp_path)
    asked, given = 0, 0

    def many():
        nonlocal asked
        for _ in range(200):
            asked += 1
            yield one

    window = run.IN_FLIGHT * 2  # workers; one of them may just be starting again
    for _ in run.run_fleet(client, many(), do_nothing):
        assert asked - given <= window
        given += 1
    assert given == asked == 200


def test_a_store_of_objects_gives_recordings_and_takes_the_data_set(fleet, drives, store, made):
    import boto3

    s3 = boto3.client("s3", endpoint_url=store)
    s3.create_bucket(Bucket="railway")
    for log in sorted((drives / "tram").glob("*.log")):
        s3.upload_file(str(log), "railway", f"2026/tram/{log.name}")
    s3.put_object(Bucket="railway", Key="2026/tram/torn.log", Body=b"nothing")
    words = ("s3://railway/2026/tram/*.log", "--out", "s3://railway/out", "--steps",
             "check,identify")  # fmt: skip
    assert not fleet(*words)
    kept = DataSet("s3://railway/out").read_units()
    assert sorted(kept) == [f"s3://railway/2026/tram/{name}" for name in (*NAMES[3:], "torn.log")]
    whole = json.loads(s3.get_object(Bucket="railway", Key="out/fleet.json")["Body"].read())
    assert [one["vehicle"] for one in whole["vehicles"]] == ["tram"]  # what workers just wrote
    assert whole["failed"] == 1
    local = units(made / "out")
    for path, unit in kept.items():
        name = path.rsplit("/", 1)[1]
        assert unit.vehicle == "tram"
        assert unit.fingerprint
        if name != "torn.log":
            assert (unit.status, unit.sha256) == ("done", local[name]["sha256"])
    assert kept["s3://railway/2026/tram/torn.log"].error.startswith("s3://railway/2026/tram/torn")

    def tables():
        listed = s3.list_objects_v2(Bucket="railway", Prefix="out/")["Contents"]
        return {one["Key"]: one["LastModified"] for one in listed if "/vehicle=" in one["Key"]}

    before = tables()
    assert {key.split("/")[1] for key in before} == {"units", "segments"}
    assert not fleet(*words)  # all complete: no unit is fetched or written again
    assert tables() == before


def orphan(out):
    """What a worker leaves that dies before it has written the row of its unit."""
    folder = out / "causes" / "vehicle=007" / "day=2026-01-31"
    (whole,) = folder.glob("drive0.log-*.parquet")
    for table in ("causes", "segments"):
        place = out / table / "vehicle=ghost" / "day=2026-01-31"
        place.mkdir(parents=True)
        (own,) = (out / table / "vehicle=007" / "day=2026-01-31").glob("drive0.log-*.parquet")
        content = pq.read_table(own, partitioning=None)
        changed = {"unit_id": "never-done", "vehicle": "ghost"}
        if table == "causes":
            changed["named"] = True
        for name, value in changed.items():
            at = content.schema.get_field_index(name)
            column = pa.array([value] * len(content), content.schema.field(at).type)
            content = content.set_column(at, content.schema.field(at), column)
        pq.write_table(content, place / "never-done.parquet")
    return whole.stem


@pytest.mark.parametrize("number", range(3))
def test_queries_count_complete_units_alone(made, tmp_path, monkeypatch, number):
    import duckdb

    out = tmp_path / "out"
    shutil.copytree(made / "out", out)
    answers = []
    for _ in range(2):
        monkeypatch.chdir(tmp_path)
        with duckdb.connect() as connection:
            answers.append(connection.execute(blocks("sql")[number]).fetchall())
        if len(answers) == 1:
            orphan(out)
    assert sorted(map(str, answers[0])) == sorted(map(str, answers[1]))


def test_what_an_interrupted_run_left_of_its_units_is_removed(made, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(made / "out", out)
    name = orphan(out)
    data = DataSet(str(out))
    kept = data.read_units()
    before = {path for path in out.rglob("*.parquet") if "ghost" not in str(path)}
    # Another run may be writing what is not ours, and complete units stay.
    assert data.remove_incomplete({name}, kept.values()) == 0
    assert data.remove_incomplete({"never-done"}, kept.values()) == 2
    assert set(out.rglob("*.parquet")) == before
    # A unit whose row is not there is not complete, whatever else is.
    next((out / "units").rglob(f"{name}.parquet")).unlink()
    assert data.remove_incomplete({name}, data.read_units().values()) == 3
    assert not list(out.rglob(f"{name}.parquet"))


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", DOCS.read_text(), re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("number", range(3))
def test_duckdb_answers_as_the_page_asks(made, monkeypatch, number):
    import duckdb

    monkeypatch.chdir(made)
    texts = blocks("sql")
    assert len(texts) == 3
    with duckdb.connect() as connection:
        answer = connection.execute(texts[number])
        names = [column[0] for column in answer.description]
        found = [dict(zip(names, row, strict=True)) for row in answer.fetchall()]
    if number == 0:
        named = [r for rs in rows(made / "out", "causes").values() for r in rs if r["named"]]
        assert {(r["vehicle"], r["effect"]) for r in found} == {
            (r["vehicle"], r["effect"]) for r in named
        }
    elif number == 1:
        segments = [r for rs in rows(made / "out", "segments").values() for r in rs]
        known = [r for r in segments if r["mu_max_std"] and r["lambda_m_std"]]
        assert sum(r["segments"] for r in found) == len(known) > 0
    else:
        assert [(r["vehicle"], r["failed_step"]) for r in found] == [("bad", "read")]


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_data_frames_open_as_the_page_says(made, monkeypatch, capsys, library):
    monkeypatch.chdir(made)
    (text,) = [one for one in blocks("python") if f"import {library}" in one]
    exec(compile(text, str(DOCS), "exec"), {})  # noqa: S102  the page's own words
    printed = capsys.readouterr().out
    assert "BR 185" in printed
    assert "007" in printed


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "fleet: nothing to read; give LOG .. or --units F.csv"),
        (("a.log", "--steps", "chek"), "no step 'chek'; similar names: check"),
        (("a.log", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"), "--workers: the workers"),
        (("a.log", "--memory", "much"), "--memory much: not a number of GB; write 2 or 3.5"),
        (("a.log", "--workers", "0"), "--workers 0: no worker"),
        (("a.log", "--scheduler", "tcp://127.0.0.1:1"), "--scheduler tcp://127.0.0.1:1: no answer"),
        (("a.log", "--out", "a.log"), "--out a.log: is a file; name a folder"),
        (("gone/*.log",), "no file matches this pattern"),
    ],
)
def test_wrong_usage_is_one_line_before_any_work(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("adhesion_can.fleet.cluster.CONNECT", "1s")
    (tmp_path / "a.log").write_text("(1.0) can0 101#00\n")
    out = () if "--out" in words else ("--out", "out")
    assert main(["fleet", *words, *out]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_data_set_of_another_version_is_not_mixed(made, drives, monkeypatch, capsys):
    monkeypatch.setattr("adhesion_can.fleet.dataset.SCHEMA_VERSION", 99)
    assert main(["fleet", str(drives), "--out", str(made / "out")]) == 2
    assert "version 2 of the tables; this is version 99; use another folder for --out" in (
        capsys.readouterr().err
    )


def test_a_worker_that_is_slow_to_end_holds_nothing_up(monkeypatch):
    """All work is done; where the machine is busy, a killed process may outlast dask's patience."""
    close = LocalCluster.close

    def close_late(cluster, timeout=None):
        close(cluster, timeout)
        raise TimeoutError

    monkeypatch.setattr(LocalCluster, "close", close_late)
    with open_cluster(None, workers=1) as client:
        assert client.submit(sum, [1, 2]).result(60) == 3


def test_without_a_scheduler_processes_of_this_machine_do_it(drives, tmp_path, capsys):
    words = ("--workers", "1", "--steps", "check", "--json", "-", "--no-progress")
    assert not main(["fleet", str(drives / "007"), "--out", str(tmp_path / "out"), *words])
    document = json.loads(capsys.readouterr().out)
    assert (document["units"], document["failed"]) == (1, [])
    assert units(tmp_path / "out")["drive0.log"]["usable"] is True
