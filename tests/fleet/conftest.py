"""Recordings of three vehicles, an object store, and two workers that all tests here share."""

import logging
import os
import re

import pytest

from adhesion_can.cli.main import main
from adhesion_can.fleet.cluster import open_cluster

NOON = 1_769_860_800
"""2026-01-31 12:00 UTC."""
KEYS = {
    "AWS_ACCESS_KEY_ID": "test",
    "AWS_SECRET_ACCESS_KEY": "test",
    "AWS_DEFAULT_REGION": "us-east-1",
    "AWS_REQUEST_CHECKSUM_CALCULATION": "when_required",
}


def with_clock(text, began=NOON):
    """Text of a candump with stamps of a clock that was set."""
    return re.sub(r"^\((\d+)\.", lambda m: f"({int(m[1]) + began}.", text, flags=re.MULTILINE)


@pytest.fixture(scope="package")
def drives(tmp_path_factory):
    """Folder with a folder for each vehicle, five recordings in all, the one of 007 with a date."""
    folder = tmp_path_factory.mktemp("drives")
    for number, vehicle in enumerate(("007", "BR 185", "BR 185", "tram", "tram")):
        log = folder / vehicle / f"drive{number}.log"
        log.parent.mkdir(exist_ok=True)
        scenario = "sweep" if number == 0 else "dry"
        assert not main(["simulate", "--scenario", scenario, "--duration", "4", "--seed",
                         str(number), "--log", str(log)])  # fmt: skip
        if number == 0:
            log.write_text(with_clock(log.read_text()))
    return folder


@pytest.fixture(scope="package")
def store():
    """Object store's server on this machine, as boto3 and s3fs find it: its address."""
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    before = dict(os.environ)
    os.environ.update(KEYS, AWS_ENDPOINT_URL=f"http://{host}:{port}")
    yield os.environ["AWS_ENDPOINT_URL"]
    os.environ.clear()
    os.environ.update(before)
    server.stop()


@pytest.fixture(scope="package")
def client(store):  # noqa: ARG001  its address is in the environment, which workers inherit
    """Client of a cluster of two workers, which reach the store."""
    with open_cluster(None, workers=2) as found:
        # Dask silences the handlers of its loggers: pytest's among them, which all tests share.
        for name in ("distributed", "bokeh"):
            for handler in logging.getLogger(name).handlers:
                if type(handler).__module__.startswith("_pytest"):
                    handler.setLevel(logging.NOTSET)
        yield found


@pytest.fixture(scope="package")
def fleet(client):
    """Function that runs the command on that cluster: its exit status."""

    def run(*words):
        address = client.scheduler.address
        return main(["fleet", *map(str, words), "--scheduler", address, "--no-progress"])

    return run


@pytest.fixture(scope="package")
def made(drives, fleet, tmp_path_factory):
    """Folder in which `out` is the data set of the drives, and of one file that is none."""
    folder = tmp_path_factory.mktemp("made")
    bad = folder / "bad" / "torn.log"
    bad.parent.mkdir()
    bad.write_text("this is no recording\n")
    assert not fleet(drives, bad, "--out", folder / "out")
    return folder
