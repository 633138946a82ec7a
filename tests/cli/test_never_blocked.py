"""Nobody who reads, connects or pauses keeps the service from its setpoints and its last frames.

Each test runs `adhesion-can run` in a process of its own and judges by the frames on the bus. Times
are bounds for a busy machine; before, setpoints stopped for good in most of these.
"""

import itertools
import os
import resource
import signal
import socket
import subprocess
import time
import urllib.request
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from adhesion_can.recordings.candump import ReadReport, read_candump
from tests.loopback_bus import PATIENCE_S, ServiceProcess
from tests.service.test_core import status
from tests.wire import decoded, seal_ok

END_S = 10.0
"""Longest time for an end, s: well below one on an idle machine."""
OWN = [0x201, 0x202, 0x203, *[0x204] * 6, 0x211]
PIPE_BYTES = 1 << 16


@contextmanager
def full_pipe():
    """Writing end of a pipe that is full, and that nobody empties."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    for size in (4096, 1):
        while True:
            try:
                os.write(writer, b"x" * size)
            except BlockingIOError:
                break
    os.set_blocking(writer, True)
    try:
        yield writer
    finally:
        os.close(writer)
        os.close(reader)


def assert_taken_back(service):
    """The last frame of every message says 'not available', and receivers accept it."""
    last = [frame for _, frame in service.frames[-len(OWN) :]]
    assert [frame.arbitration_id for frame in last] == OWN
    assert status(last) == "INIT"
    assert all(map(seal_ok, last))
    for frame in last[:-1]:
        assert all(str(value) == "not available" for value in list(decoded(frame).values())[3:])


def assert_goes_on(service, number=100):
    """So many setpoints come, at their cycle as far as the machine allows."""
    began = time.monotonic()
    service.wait_for_more(number)
    arrivals = [t for t, _ in service.setpoints(began)]
    gaps = [after - before for before, after in itertools.pairwise(arrivals)]
    # What blocked before blocked for good.
    assert max(gaps) < END_S


@pytest.mark.costly
def test_a_reader_of_stderr_that_stalls(tmp_path):
    with full_pipe() as stderr, ServiceProcess(tmp_path, stderr=stderr) as service:
        assert_goes_on(service)
        code, took_s = service.end()
        assert (code, took_s < END_S) == (0, True)
        assert_taken_back(service)


@pytest.mark.costly
def test_an_error_at_the_start_with_a_reader_of_stderr_that_stalls(tmp_path):
    with full_pipe() as stderr, ServiceProcess(tmp_path, "--log", "/", stderr=stderr) as service:
        assert service.process.wait(PATIENCE_S) == 2


@pytest.fixture
def pipe(tmp_path):
    path = tmp_path / "log.pipe"
    os.mkfifo(path)
    return path


@pytest.mark.costly
def test_a_reader_of_the_log_that_stalls(tmp_path, pipe):
    """It has opened the pipe and reads nothing: in a second or two the pipe is full."""
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        with ServiceProcess(tmp_path, "--log", str(pipe), "--json", "run.json") as service:
            assert_goes_on(service, 400)
            code, took_s = service.end()
            assert (code, took_s < END_S) == (0, True)
            assert_taken_back(service)
            assert "they were not written before the service ended" in service.said()
    finally:
        os.close(reader)


@pytest.mark.costly
def test_a_reader_of_the_log_that_goes_on_gets_every_line(tmp_path, pipe):
    """It stalls for longer than the pipe holds; the lines waited."""
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    os.set_blocking(reader, True)
    with ServiceProcess(tmp_path, "--log", str(pipe)) as service:
        service.wait_for_more(150)
        with os.fdopen(reader, "rb") as file:
            lines = subprocess.Popen(["cat"], stdin=file, stdout=subprocess.PIPE)
        service.wait_for_more(20)
        # Nobody but its reader holds the pipe open.
        code, _ = service.end()
        text, _ = lines.communicate(timeout=PATIENCE_S)
        assert code == 0
        assert len(text) > PIPE_BYTES
        report = ReadReport()
        items = list(read_candump(text.splitlines(keepends=True), report))
        assert report.passed_over == 0
        logged = [one.data for one in items if getattr(one, "arbitration_id", 0) == 0x201]
        assert logged == [frame.data for _, frame in service.setpoints()]


@pytest.mark.costly
def test_a_pipe_that_nobody_reads_is_an_error_with_a_word_of_help(tmp_path, pipe):
    with ServiceProcess(tmp_path, "--log", str(pipe)) as service:
        assert service.process.wait(PATIENCE_S) == 2
        (line,) = service.said().splitlines()
        assert "is a pipe without a reader; start its reader first, or name a file" in line
        assert service.frames == []


@pytest.mark.costly
def test_a_result_that_nobody_takes_holds_no_end_up(tmp_path, pipe):
    with ServiceProcess(tmp_path, "--json", str(pipe)) as service:
        service.wait_for_more(10)
        code, took_s = service.end()
        assert (code, took_s < END_S) == (0, True)
        assert_taken_back(service)
        assert "not written before the service ended" in service.said()


@pytest.mark.costly
@pytest.mark.parametrize(("pause_s", "later_s"), [(0.15, 0.0), (3.0, 0.0), (3.0, 0.01)])
def test_a_paused_process_that_is_to_end_takes_back_what_it_sent(tmp_path, pause_s, later_s):
    """As by `docker pause`, `docker unpause` and `docker stop`."""
    with ServiceProcess(tmp_path, "--log", "run.log") as service:
        service.wait_for_more(60)
        service.process.send_signal(signal.SIGSTOP)
        time.sleep(pause_s)
        went_on = time.monotonic()
        before = len(service.frames)
        service.process.send_signal(signal.SIGCONT)
        time.sleep(later_s)
        code, took_s = service.end()
        assert (code, took_s < END_S) == (0, True)
        assert_taken_back(service)
        # No burst of what was due meanwhile.
        assert len(service.frames[before:]) <= 20 * len(OWN)
        assert service.frames[-1][0] - went_on < END_S
    sent = [frame.data for _, frame in service.frames if frame.arbitration_id != 0x211]
    again = replayed(tmp_path / "run.log")
    assert again[-len(OWN) + 1 :] == sent[-len(OWN) + 1 :]
    # What it composed and left out stands in between.
    rest = iter(again)
    assert all(data in rest for data in sent)


def replayed(log):
    """Payloads that a replay of a log sends, without those of ServiceStatus."""
    from adhesion_can.config import load_configuration
    from adhesion_can.recordings.recording import Recording
    from adhesion_can.service.core import ServiceCore
    from adhesion_can.service.replay import replay

    sent = []
    replay(Recording(log), ServiceCore(load_configuration()), sent.append)
    return [frame.data for frame in sent if frame.arbitration_id != 0x211]


@pytest.mark.costly
def test_connections_to_the_metrics_that_say_nothing(tmp_path):
    """More than there are descriptors; the bus is lost meanwhile, and comes back."""
    with ExitStack() as stack:
        service = stack.enter_context(ServiceProcess(tmp_path, "--metrics", "0"))
        service.wait_until(lambda: "listening on" in service.said(), "listening")
        resource.prlimit(service.process.pid, resource.RLIMIT_NOFILE, (64, 64))
        address = service.said().split("metrics at ")[1].split()[0]
        port = int(address.rsplit(":", 1)[1].split("/")[0])
        for _ in range(300):
            one = stack.enter_context(socket.create_connection(("127.0.0.1", port), PATIENCE_S))
            one.sendall(b"GET /metrics HTTP/1.1\r\nHost:")
        assert_goes_on(service, 50)
        open_now = list(Path(f"/proc/{service.process.pid}/fd").iterdir())
        assert len(open_now) < 48
        service.lose_bus()
        service.wait_until(lambda: "the bus is back" in service.said(), "bus that is back")
        assert_goes_on(service, 50)
        with urllib.request.urlopen(address, timeout=PATIENCE_S) as answer:  # noqa: S310  our own
            assert b"adhesion_can_bus_reopened_total 1.0" in answer.read()
        code, took_s = service.end()
        assert (code, took_s < END_S) == (0, True)
        assert_taken_back(service)


@pytest.mark.costly
@pytest.mark.parametrize("number", [signal.SIGQUIT, signal.SIGTERM, signal.SIGINT])
def test_signals_that_end_it_take_back_what_was_sent(tmp_path, number):
    with ServiceProcess(tmp_path) as service:
        service.wait_for_more(10)
        code, took_s = service.end(number)
        assert (code, took_s < END_S) == (0, True)
        assert_taken_back(service)


@pytest.mark.costly
def test_signals_without_a_meaning_do_not_end_it(tmp_path):
    with ServiceProcess(tmp_path) as service:
        service.wait_for_more(10)
        for number in (signal.SIGUSR1, signal.SIGUSR2):
            service.process.send_signal(number)
            service.wait_for_more(20)
        assert service.end()[0] == 0


@pytest.mark.costly
def test_the_watchdog_is_fed_by_the_loop_alone(tmp_path):
    """A stalled reader takes nothing from it; a loop that stands still feeds nobody."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager, full_pipe() as stderr:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(PATIENCE_S)
        environment = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "200000"}
        with ServiceProcess(tmp_path, stderr=stderr, environment=environment) as service:
            assert manager.recv(200).startswith(b"READY=1")
            for _ in range(5):
                assert manager.recv(200) == b"WATCHDOG=1"
            service.wait_for_more(10)
            # Nobody reads any more: notices stay, until there is no room for them.
            assert_goes_on(service, 200)
            assert service.end()[0] == 0
            assert_taken_back(service)
