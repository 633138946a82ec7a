"""`monitor --serve`: the view in a browser, for whoever has the token, and for nobody else."""

import http.client
import re
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from adhesion_can.cli.main import main
from adhesion_can.cli.monitor_viewer import viewer_command
from adhesion_can.extras import install_extra
from tests.monitoring.recorded import closed_loop, write_log
from tests.reporting.browser import Browser
from tests.terminals import Terminal

pytest.importorskip("textual_serve")

WAIT_S = 120.0
"""Longest wait, s: a machine may be busy."""
KEEP_TEXT = """
window.received = "";
const Real = window.WebSocket;
window.WebSocket = class extends Real {
  constructor(...words) {
    super(...words);
    this.addEventListener("message", (event) => {
      if (event.data instanceof ArrayBuffer)
        window.received += new TextDecoder().decode(event.data);
    });
  }
};
"""
"""Script that keeps what the page's terminal is given: it draws on a canvas, which has no text."""


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("served") / "full.log", closed_loop()[0])


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    shown = Browser(tmp_path_factory.mktemp("profile"))
    yield shown
    shown.close()


class Page:
    """A page by its address, as `Browser.open` takes it."""

    def __init__(self, address):
        self.address = address

    def as_uri(self):
        return self.address


class Served:
    """A monitor that serves, and its address."""

    def __init__(self, log, folder, more=""):
        command = f"adhesion-can monitor {log} --serve --speed 0.125 {more}"
        self.log = log
        self.terminal = Terminal(command, folder, "served")
        self.terminal.wait_for("Ctrl-C ends", WAIT_S)
        (self.line,) = self.terminal.err.read_text().splitlines()
        self.address = re.search(r"http://\S+", self.line)[0]
        self.parts = urlsplit(self.address)

    def status(self, path, **headers):
        """Status and text of an answer to a request."""
        connection = http.client.HTTPConnection(self.parts.netloc, timeout=WAIT_S)
        connection.request(
            "GET", path, headers={k.replace("_", "-"): v for k, v in headers.items()}
        )
        answer = connection.getresponse()
        text = answer.read().decode()
        connection.close()
        return answer.status, text

    def viewers(self):
        """Processes of this server's pages."""
        found = set()
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                words = (entry / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue  # it has ended meanwhile
            if b"--in-page" in words and str(self.log).encode() in words:
                found.add(entry.name)
        return found


@pytest.fixture
def served(log, tmp_path):
    one = Served(log, tmp_path)
    yield one
    if one.terminal.process.poll() is None:
        one.terminal.kill()


def seen(browser):
    """What the page's terminal was given, less its control sequences, with single blanks."""
    return " ".join(
        re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", browser.evaluate("window.received")).split()
    )


def until(ready, what):
    end = time.monotonic() + WAIT_S
    while not (found := ready()):
        assert time.monotonic() < end, f"no {what} within {WAIT_S} s"
        time.sleep(0.05)
    return found


@pytest.mark.costly
def test_the_view_is_in_a_browser_with_its_keys_and_ends_with_ctrl_c(served, browser):
    assert re.fullmatch(
        r"monitor: open http://127\.0\.0\.1:\d+/\?token=[\w-]{32} in a browser on this host; "
        r"Ctrl-C ends",
        served.line,
    )
    browser.open(Page(served.address), script=KEEP_TEXT)

    def has(text):
        until(lambda: text in seen(browser), text)

    has("adhesion over slip ratio")
    assert browser.evaluate("document.title") == "adhesion-can monitor"
    assert browser.evaluate("document.body.classList.contains('-first-byte')")
    # Nothing is fetched from another host.
    sources = browser.evaluate("performance.getEntriesByType('resource').map((r) => r.name)")
    assert sources
    assert all(urlsplit(name).netloc == served.parts.netloc for name in sources)
    until(lambda: browser.evaluate("document.activeElement.tagName") == "TEXTAREA", "focus")
    browser.press_enter()
    has("Enter signals arrows select")
    browser.press_enter()
    has("WheelSpeed_Ax1")
    assert len(served.viewers()) == 1
    # With the page still open it ends at once, with its processes and without a word.
    assert served.terminal.interrupt(WAIT_S) == 0
    assert served.terminal.err.read_text().splitlines() == [served.line]
    assert served.terminal.out.read_text() == ""
    until(lambda: not served.viewers(), "end of the page's process")
    until(lambda: browser.evaluate("document.body.classList.contains('-closed')"), "closed page")


def test_without_the_token_there_is_no_page_and_no_process(served):
    token = served.parts.query.removeprefix("token=")
    cookie = f"adhesion-can-{served.parts.port}={token}"
    own = f"http://{served.parts.netloc}"
    socket = {
        "Connection": "Upgrade", "Upgrade": "websocket", "Sec_WebSocket_Version": "13",
        "Sec_WebSocket_Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    }  # fmt: skip
    refused = [
        served.status("/"),
        served.status("/?token="),
        served.status(f"/?token={token[:-1]}"),
        served.status("/?token=%C3%A9"),
        # A name of another host that leads here.
        served.status(f"/?token={token}", Host=f"evil.example:{served.parts.port}"),
        served.status("/ws"),
        served.status("/ws", Origin=own, **socket),
        served.status(f"/ws?token={token}", Origin=own, **socket),
        served.status("/ws", Origin=own, Cookie=cookie[:-1], **socket),
        # A page of another server on this host, whose socket has the cookie.
        served.status("/ws", Origin="http://127.0.0.1:1", Cookie=cookie, **socket),
        served.status("/ws", Cookie=cookie, **socket),
    ]
    assert {status for status, _ in refused} == {403}
    assert all("open the whole address" in text for _, text in refused)
    assert served.status("/download/x")[0] == 404
    assert served.viewers() == set()
    status, page = served.status(f"/?token={token}")
    assert status == 200
    assert f"ws://{served.parts.netloc}/ws" in page


def test_it_listens_on_loopback_alone(served):
    listening = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    port = f"{served.parts.port:04X}"
    hosts = {words[1].split(":")[0] for words in listening if words[1].endswith(f":{port}")}
    assert hosts == {"0100007F"}


def test_it_ends_with_the_duration(log, tmp_path):
    served = Served(log, tmp_path, "--duration 0.5")
    assert served.terminal.wait(WAIT_S) == 0


def test_a_page_ends_with_a_server_that_is_killed(log, tmp_path, browser):
    served = Served(log, tmp_path)
    browser.open(Page(served.address), script=KEEP_TEXT)
    until(lambda: "adhesion over slip ratio" in seen(browser), "the view")
    served.terminal.kill()
    until(lambda: not served.viewers(), "end of the page's process")


@pytest.mark.costly
def test_a_source_that_fails_in_a_page_is_said_there(log, tmp_path, browser):
    gone = tmp_path / "gone.log"
    gone.write_bytes(log.read_bytes())
    served = Served(gone, tmp_path)
    gone.unlink()
    browser.open(Page(served.address), script=KEEP_TEXT)
    until(lambda: "Reload the page to try again." in seen(browser), "the error")
    assert "No such file" in seen(browser)
    assert served.terminal.interrupt(WAIT_S) == 0


# --- wrong usage


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--port", "8000"], "--port: applies to --serve only"),
        (["--serve", "--plain"], "--serve and --plain: exclude each other"),
        (["--serve", "--json", "-"], "--serve and --json: exclude each other"),
        (["--serve", "--record", "x.log"], "--serve and --record: exclude each other"),
        (["--serve", "--port", "99999"], "'99999' is not a port"),
        (["--serve", "--port", "taken"], "cannot be listened on (Address already in use)"),
    ],
)
def test_wrong_usage_is_one_line(log, capsys, words, said):
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        words = [str(taken.getsockname()[1]) if word == "taken" else word for word in words]
        try:
            status = main(["monitor", str(log), *words])
        except SystemExit as error:
            status = error.code
    assert status == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.strip().splitlines()) == 1


def test_what_cannot_be_shown_is_not_served(capsys, tmp_path):
    assert main(["monitor", str(tmp_path / "nothing.log"), "--serve"]) == 2
    assert "nothing.log: No such file" in capsys.readouterr().err


def test_without_the_extra_it_says_what_to_type(log, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "adhesion_can.cli.monitor_server", None)
    assert main(["monitor", str(log), "--serve"]) == 2
    err = capsys.readouterr().err
    assert "--serve: needs textual-serve" in err
    assert err.strip().endswith(install_extra("serve"))
    assert len(err.strip().splitlines()) == 1


@pytest.mark.costly
def test_the_command_of_a_page():
    words = viewer_command("adhesion-can monitor 'a b.log' --serve --port 8000 --speed 2")
    assert words == (
        f"exec {sys.executable} -m adhesion_can.cli.main monitor --in-page 'a b.log' "
        "--serve --port 8000 --speed 2"
    )
