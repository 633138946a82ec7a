"""What is said of workers that cannot do the work, and of places that cannot be used."""

import http.server
import os
import signal
import threading

import dask
import pytest
from distributed.scheduler import KilledWorker

from adhesion_can.errors import InputError
from adhesion_can.extras import install_package
from adhesion_can.fleet.cluster import gigabytes, open_cluster, probe, require_workers
from adhesion_can.fleet.dataset import DataSet, put
from adhesion_can.fleet.places import open_place
from adhesion_can.fleet.rows import number
from adhesion_can.version import __version__

pytestmark = pytest.mark.cluster


class Answering:
    """A client all of whose workers give one answer."""

    def __init__(self, answer):
        self.answer = answer

    def nthreads(self):
        return {} if self.answer is None else {"tcp://a:1": 1}

    def run(self, function, *words, on_error):
        return {"tcp://a:1": self.answer}


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (None, "the scheduler has no workers; start some with 'dask worker tcp://s'"),
        (ModuleNotFoundError("No module named 'adhesion_can'"), "lacks the package"),
        (RuntimeError("broken"), "worker tcp://a:1 cannot start (broken)"),
        (("0.0.1", ""), "has adhesion-can 0.0.1, this is " + __version__),
        ((__version__, "cannot access /x"), "cannot access /x; mount it there under the same path"),
    ],
)
def test_a_worker_that_cannot_do_the_work_is_named_with_the_fix(tmp_path, answer, said):
    with pytest.raises(InputError) as error:
        require_workers(Answering(answer), "tcp://s", str(tmp_path / "out"), None)
    assert said in str(error.value)
    assert not list(tmp_path.rglob(".probe*"))


def test_a_worker_says_what_it_does_not_see(tmp_path):
    token = tmp_path / "token"
    assert probe(str(token), "abc", None)[1].startswith("cannot access the folder of --out")
    token.write_text("xyz")
    assert probe(str(token), "abc", None)[1].startswith("has a different folder")
    token.write_text("abc")
    assert probe(str(token), "abc", str(tmp_path / "gone")) == (
        __version__, f"cannot access {tmp_path / 'gone'}")  # fmt: skip
    assert probe(str(token), "abc", str(token)) == (__version__, "")


def test_an_output_that_cannot_be_written_is_said_before_the_work(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="cannot be written"):
        require_workers(Answering((__version__, "")), None, str(tmp_path / "file" / "out"), None)


def test_a_data_set_that_cannot_be_listed_is_an_error_with_the_fix(monkeypatch):
    """Libraries of object stores raise errors that are no OSError."""
    data = DataSet("memory://out")

    def find(*_, **__):
        raise RuntimeError("no credentials")

    monkeypatch.setattr("fsspec.implementations.memory.MemoryFileSystem.find", find)
    with pytest.raises(InputError, match=r"memory://out: cannot be read \(no credentials\); check"):
        data.read_units()


def test_a_file_appears_whole_or_not_at_all(tmp_path):
    place, final = open_place(str(tmp_path)), tmp_path / "a" / "b.parquet"
    put(place, str(final), b"first")
    with pytest.raises(TypeError):
        put(place, str(final), "no bytes")
    assert final.read_bytes() == b"first"
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["b.parquet"]


@pytest.mark.parametrize("vehicle", ["007", "BR 185/7", "..", "ü%=", "a\\b", "x" * 80])
def test_a_vehicle_of_any_name_comes_back(tmp_path, vehicle):
    data = DataSet(str(tmp_path))
    unit = {"unit_id": "u", "path": "/p", "vehicle": vehicle, "status": "done", "steps": ["check"],
            "fingerprint": "1", "settings": "s", "package_version": "v"}  # fmt: skip
    data.write(unit, {"segments": []})
    (kept,) = DataSet(str(tmp_path)).read_units().values()
    assert (kept.vehicle, kept.unit_id, kept.day) == (vehicle, "u", None)
    assert len(list(tmp_path.rglob("*.parquet"))) == 2
    assert all(len(p.relative_to(tmp_path).parts) == 4 for p in tmp_path.rglob("*.parquet"))
    data.remove(kept)
    assert not list(tmp_path.rglob("*.parquet"))


def test_a_file_behind_an_url_is_fetched_hashed_and_removed_again(tmp_path, monkeypatch):
    import hashlib
    import tempfile

    (tmp_path / "web").mkdir()
    content = bytes(range(256)) * 40_000  # more than one chunk
    (tmp_path / "web" / "a b.log").write_bytes(content)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def __init__(self, *words):
            super().__init__(*words, directory=str(tmp_path / "web"))

        def log_message(self, *words):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Quiet) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            place = open_place(f"http://127.0.0.1:{server.server_port}/a%20b.log")
            with place.fetched() as (path, digest):
                assert path.read_bytes() == content
                assert digest == hashlib.sha256(content).hexdigest()
            assert not path.parent.exists()
            gone = open_place(f"http://127.0.0.1:{server.server_port}/gone.log")
            assert gone.info() is None
            with pytest.raises(InputError, match=r"gone\.log: cannot be read"), gone.fetched():
                pass
        finally:
            server.shutdown()
            thread.join()


def test_a_package_that_is_not_installed_is_named():
    with pytest.raises(InputError) as error:
        open_place("gs://bucket/a.log")
    assert str(error.value) == (
        f"gs://bucket/a.log: gs:// needs another package; {install_package('gcsfs')}"
    )


@pytest.mark.parametrize("text", ["0", "-1", "nan", "inf", "much"])
def test_memory_is_a_positive_number(text):
    with pytest.raises(ValueError):
        gigabytes(text)
    assert gigabytes("1.5") == 1_500_000_000


def test_numbers_that_are_none_are_null():
    assert [number(v) for v in (None, float("nan"), float("inf"), 1)] == [None, None, None, 1.0]


def test_a_worker_that_takes_long_to_start_again_is_waited_for():
    with (
        dask.config.set({"distributed.deploy.lost-worker-timeout": "1ms"}),
        open_cluster(None, workers=1) as client,
    ):
        with pytest.raises(KilledWorker):
            client.submit(signal.raise_signal, signal.SIGKILL).result(timeout=60)
        assert client.submit(sum, [1, 2]).result(timeout=120) == 3


@pytest.mark.skipif("MALLOC_TRIM_THRESHOLD_" in os.environ, reason="set by whoever runs the tests")
def test_workers_keep_freed_memory_for_the_next_array_and_use_one_thread(client):
    # With dask's own threshold two workers do no more than one.
    client.wait_for_workers(2, timeout=120)  # a busy machine may still be starting one again
    found = client.run(lambda: dict(os.environ))
    assert len(found) == 2
    for environment in found.values():
        assert "MALLOC_TRIM_THRESHOLD_" not in environment
        assert environment["OMP_NUM_THREADS"] == environment["OPENBLAS_NUM_THREADS"] == "1"
