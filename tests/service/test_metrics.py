"""Figures for Prometheus: what the server answers, beside what the service counted."""

import errno
import json
import re
import socket
import time
import urllib.request
from contextlib import ExitStack, suppress
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from prometheus_client.parser import text_string_to_metric_families
from prometheus_client.registry import Collector

from adhesion_can.bus.frame import Frame
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.recordings.candump import ReadReport, read_candump
from adhesion_can.recordings.python_can_messages import to_message
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.counters import COUNTERS, read_counters
from adhesion_can.service.lateness import BOUNDS_US, Lateness
from adhesion_can.service.metrics import ServiceCollector
from adhesion_can.service.metrics_server import AGAIN_S, MOST_CONNECTIONS, MetricsServer
from tests.service.test_core import KNOWN, FixedEstimator
from tests.service.test_live import (
    PATIENCE_S,
    Running,
    opened,
    send_drive,
    wait_until,
    wall_clock,
)

DASHBOARD = Path(__file__).resolve().parents[2] / "tools" / "grafana" / "adhesion-can.json"


def scrape(address):
    """Samples by name and labels, as Prometheus reads them."""
    with urllib.request.urlopen(address, timeout=30) as answer:  # noqa: S310  our own server
        text = answer.read().decode()
    return {
        (sample.name, *sorted(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


@pytest.fixture(scope="module")
def drive():
    """A service after a drive of half a second, and what it answers then."""
    with (
        opened("metrics") as sender,
        Running(ServiceCore(load_configuration(), FixedEstimator), opened("metrics")) as live,
    ):
        server = MetricsServer("127.0.0.1", 0, ServiceCollector(live.service, lambda: 3))
        try:
            send_drive(sender, 0.3)
            # The last frame that waits is never dropped, however busy the machine is.
            sender.send(to_message(Frame(wall_clock(), 0x111, bytes(8))))
            wait_until(lambda: live.core.receiver.rejected)
            during = {}
            while ("adhesion_can_mu_max",) not in during:
                send_drive(sender, 0.2)
                during = scrape(server.address)
            wait_until(lambda: sum(live.service.lateness.counts) >= 20)
            live.service.stop()
            live.thread.join(60)
            yield live, during, scrape(server.address)
        finally:
            server.close()


def test_every_counter_has_its_figure(drive):
    live, during, after = drive
    counted = read_counters(live.service)
    lines = [line.encode() for line in live.lines]
    logged = [item for item in read_candump(lines, ReadReport()) if isinstance(item, Frame)]
    own = sum(frame.arbitration_id in range(0x201, 0x212) for frame in logged)
    assert counted["received"] == len(logged) - own > 0
    assert counted["sent"] == own > 0
    for counter in COUNTERS:
        name = (f"adhesion_can_{counter.metric}_total",)
        assert after[name] == counted[counter.key]
        assert during[name] <= after[name]
    assert after[("adhesion_can_log_lines_lost_total",)] == 3


def test_rejections_are_told_by_message_and_reason(drive):
    live, _, after = drive
    found = {key: v for key, v in after.items() if key[0] == "adhesion_can_frames_rejected_total"}
    assert sum(found.values()) == live.service.core.receiver.rejected >= 1
    name = "adhesion_can_frames_rejected_total"
    assert found[(name, ("message", "VehicleSpeed"), ("reason", "checksum"))] == 1


def test_estimate_and_status_are_those_of_the_latest_due_time(drive):
    _, during, after = drive
    assert during[("adhesion_can_mu_max",)] == pytest.approx(KNOWN.mu_max, abs=1e-5)
    states = {key[1][1]: v for key, v in after.items() if key[0] == "adhesion_can_status"}
    assert states == {name: float(name == "INIT") for name in states}
    # What is not available has no figure; a last value that stays would be an invented one.
    assert ("adhesion_can_mu_max",) not in after


def test_the_lateness_of_every_setpoint_is_counted(drive):
    live, _, after = drive
    count = after[("adhesion_can_setpoint_lateness_seconds_count",)]
    assert count == sum(live.service.lateness.counts) >= 20
    by_bound = [
        after[("adhesion_can_setpoint_lateness_seconds_bucket", ("le", f"{bound / 1e6}"))]
        for bound in BOUNDS_US
    ]
    assert by_bound == sorted(by_bound)
    assert by_bound[-1] <= count


class Nothing(Collector):
    """No figures."""

    def collect(self):
        return []


@pytest.fixture
def server():
    server = MetricsServer("127.0.0.1", 0, Nothing())
    yield server
    server.close()


def connected(server):
    host, port = server.address.split("/")[2].split(":")
    return socket.create_connection((host, int(port)), PATIENCE_S)


def test_of_many_half_open_requests_the_oldest_make_room(server):
    with ExitStack() as stack:
        halves = [stack.enter_context(connected(server)) for _ in range(50)]
        for half in halves:
            half.sendall(b"GET /met")
        assert scrape(server.address) == {}
        assert len(server._server._since_s) <= MOST_CONNECTIONS
        assert has_ended(halves[0])


def has_ended(connection):
    """Whether the other side ends a connection."""
    try:
        return connection.recv(1) == b""
    except ConnectionError:
        return True


def test_a_request_that_goes_on_for_too_long_is_ended(server, monkeypatch):
    """Byte by byte, so that no wait for the next one is too long."""
    monkeypatch.setattr("adhesion_can.service.metrics_server.REQUEST_S", 0.5)
    with connected(server) as slow:
        end = time.monotonic() + PATIENCE_S
        with suppress(ConnectionError):
            while time.monotonic() < end:
                slow.sendall(b"x")
                time.sleep(0.05)
        assert time.monotonic() < end


def test_where_no_connection_can_be_taken_it_is_not_tried_all_the_time(server, monkeypatch):
    tried = []

    class Listener:
        def __init__(self, listening):
            self._listening = listening

        def __getattr__(self, name):
            return getattr(self._listening, name)

        def accept(self):
            tried.append(time.monotonic())
            raise OSError(errno.EMFILE, "too many open files")

    monkeypatch.setattr(server._server, "socket", Listener(server._server.socket))
    with connected(server):
        wait_until(lambda: len(tried) >= 5)
    assert all(after - before >= AGAIN_S for before, after in pairwise(tried))


@given(st.lists(st.integers(0, 300_000)))
def test_lateness_counts_each_time_in_its_class(times):
    lateness = Lateness()
    for late_us in times:
        lateness.add(late_us)
    assert lateness.sum_us == sum(times)
    for bound in BOUNDS_US:
        assert lateness.count_beyond(bound) == sum(late_us > bound for late_us in times)


def test_the_dashboard_asks_for_figures_that_there_are(drive):
    _, during, after = drive
    known = {key[0] for key in (*during, *after)}
    dashboard = json.loads(DASHBOARD.read_text(encoding="utf-8"))
    asked = [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]]
    asked += [one["definition"] for one in dashboard["templating"]["list"] if "definition" in one]
    names = {name for text in asked for name in re.findall(r"adhesion_can_\w+", text)}
    assert names - known == set()
    assert len({panel["id"] for panel in dashboard["panels"]}) == len(dashboard["panels"])


@pytest.mark.parametrize("text", ["x", "70000", "-1", "127.0.0.1:", "1.5", "²"])
def test_a_port_that_is_none_is_refused(capsys, text):
    with pytest.raises(SystemExit) as ended:
        main(["run", "-i", "virtual", "-c", "x", f"--metrics={text}"])
    assert ended.value.code == 2
    assert "is neither a port from 0 to 65535" in capsys.readouterr().err


def test_a_port_that_is_taken_is_told(capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        words = ["run", "-i", "virtual", "-c", "x", "--duration", "0.1", "--metrics", str(port)]
        assert main(words) == 2
    said = capsys.readouterr().err
    assert f"--metrics 127.0.0.1:{port}" in said
    assert "name another port" in said
