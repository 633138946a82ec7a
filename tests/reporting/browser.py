"""A browser for tests: Chromium over the pipe of its DevTools protocol, one for all pages."""

import itertools
import json
import os
import shutil
import subprocess
import time
from importlib import resources

import pytest

WAIT_S = 60
"""Longest wait for an answer: a machine may be busy."""


def chromium():
    """The browser's path; the test is skipped where there is none."""
    found = shutil.which("chromium") or shutil.which("google-chrome")
    if found is None:
        pytest.skip("no Chromium here")
    return found


def axe_script():
    """The accessibility checker's script; the test is skipped where the package is missing."""
    package = pytest.importorskip("axe_core_python", reason="axe-core-python is not installed")
    return (resources.files(package) / "axe.min.js").read_text("utf-8")


class Browser:
    """Chromium without a window or a network but this host, with one tab."""

    def __init__(self, folder):
        to_browser, self._to = os.pipe()
        self._from, from_browser = os.pipe()

        def pipes():
            # The protocol reads from descriptor 3 and writes to 4.
            reading, writing = os.dup(to_browser), os.dup(from_browser)
            os.dup2(reading, 3)
            os.dup2(writing, 4)

        self._process = subprocess.Popen(
            [
                chromium(), "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
                "--disable-background-networking", "--disable-component-update", "--disable-sync",
                "--no-first-run",
                f"--user-data-dir={folder}", "--remote-debugging-pipe",
                "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
                "--proxy-server=127.0.0.1:9",
                "about:blank",
            ],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, preexec_fn=pipes,  # noqa: PLW1509
            close_fds=False,
        )  # fmt: skip
        os.close(to_browser)
        os.close(from_browser)
        self._numbers, self._buffer, self.events = itertools.count(1), b"", []
        self._session = None
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        attached = self._call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self._call(f"{domain}.enable")

    def _receive(self):
        """The next message, which is noted where it is an event."""
        while b"\0" not in self._buffer:
            part = os.read(self._from, 1 << 20)
            if not part:
                raise RuntimeError("the browser has gone")
            self._buffer += part
        text, _, self._buffer = self._buffer.partition(b"\0")
        message = json.loads(text)
        if "method" in message:
            self.events.append(message)
        return message

    def _call(self, method, **parameters):
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while (answer := self._receive()).get("id") != number:
            pass
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return answer["result"]

    def open(self, path, width=1280, *, dark=False, script=""):
        """Open a page from disk and wait until it is drawn; `script` runs before its own."""
        self.events = []
        size = {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
        self._call("Emulation.setDeviceMetricsOverride", **size)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._call("Emulation.setEmulatedMedia", features=[scheme])
        added = self._call("Page.addScriptToEvaluateOnNewDocument", source=script)
        self._call("Page.navigate", url=path.as_uri())
        end = time.monotonic() + WAIT_S
        ready = (
            "document.readyState === 'complete' && "
            "(!document.getElementById('plotly') && !document.querySelector('script.figure') "
            "|| document.documentElement.dataset.drawn === 'yes')"
        )
        while not self.evaluate(ready) and not self.complaints and time.monotonic() < end:
            time.sleep(0.02)
        self._call("Page.removeScriptToEvaluateOnNewDocument", identifier=added["identifier"])

    def evaluate(self, expression):
        """Value of an expression in the page; a promise is waited for."""
        done = self._call(
            "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in done:
            raise RuntimeError(done["exceptionDetails"])
        return done["result"].get("value")

    def pointer(self, kind, x, y):
        """Move, press or release the mouse ('mouseMoved', ..) at a place in the window, px."""
        pressed = {} if kind == "mouseMoved" else {"button": "left", "clickCount": 1}
        self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **pressed)

    def wait_until(self, expression):
        """Wait until an expression is true in the page."""
        end = time.monotonic() + WAIT_S
        while not self.evaluate(expression):
            if time.monotonic() > end:
                raise RuntimeError(f"not so after {WAIT_S} s: {expression}")
            time.sleep(0.02)

    def press_enter(self):
        """Press Enter and let it go, wherever the page has its keyboard."""
        key = {"key": "Enter", "code": "Enter", "windowsVirtualKeyCode": 13}
        self._call("Input.dispatchKeyEvent", type="keyDown", text="\r", **key)
        self._call("Input.dispatchKeyEvent", type="keyUp", **key)

    @property
    def complaints(self):
        """What the console says, errors of scripts, and what the page may not load."""
        said = []
        for event in self.events:
            parameters = event["params"]
            if event["method"] == "Runtime.consoleAPICalled":
                said.append(str(parameters["args"]))
            elif event["method"] == "Runtime.exceptionThrown":
                said.append(str(parameters["exceptionDetails"]))
            elif event["method"] == "Log.entryAdded":
                said.append(parameters["entry"]["text"])
        return said

    def picture(self, *, whole=True):
        """The page as a PNG, base64."""
        return self._call("Page.captureScreenshot", captureBeyondViewport=whole)["data"]

    def pdf(self):
        """The page as it is printed on A4, base64."""
        return self._call("Page.printToPDF", paperWidth=8.27, paperHeight=11.69)["data"]

    def violations(self):
        """Serious and critical findings of axe-core, a line each."""
        self.evaluate(axe_script() + ";1")
        # The drawings are hidden from a reader, who has caption and table; they are most of a page.
        run = (
            "axe.run({exclude: [['.main-svg']]}, {resultTypes: ['violations']})"
            ".then((r) => r.violations)"
        )
        return [
            f"{one['impact']}: {one['id']}: {[n['html'][:160] for n in one['nodes'][:3]]}"
            for one in self.evaluate(run)
            if one["impact"] in {"serious", "critical"}
        ]

    def close(self):
        self._process.kill()
        self._process.wait()
        os.close(self._to)
        os.close(self._from)


def require_drawn(browser, page):
    """Assert that the page which is open is drawn, whole, and within the window.

    Args:
        browser: Browser in which the page was opened.
        page: Page that was written.

    """
    assert browser.complaints == [], browser.complaints  # this module is not rewritten by pytest
    seen = browser.evaluate(MEASURE)
    figures = page.figures
    assert seen["plots"] == len(figures)
    assert seen["drawn"] == len(figures)
    # Every trace became one: a line or points, or bars; those of a grid and of panels alike.
    shown = [t for figure in figures for t in figure.data if t.get("visible") != "legendonly"]
    assert seen["traces"] >= len(shown)
    # Nothing but tables, in boxes of their own, is wider than the window.
    assert seen["scroll"] <= seen["width"]
    assert seen["right"] <= seen["width"]
    # Headings are in order: one of the first level, and none that skips a level.
    assert seen["levels"][0] == 1
    assert all(b - a <= 1 for a, b in itertools.pairwise(seen["levels"]))


MEASURE = """(() => {
  const all = (query) => [...document.querySelectorAll(query)];
  const svgs = all(".plot .main-svg");
  return {
    plots: all(".plot").length,
    drawn: all(".plot.js-plotly-plot").length,
    traces: all(".plot g.trace").length,
    right: Math.ceil(Math.max(0, ...svgs.map((s) => s.getBoundingClientRect().right))),
    width: document.documentElement.clientWidth,
    scroll: document.documentElement.scrollWidth,
    levels: all("h1, h2, h3, h4").map((h) => Number(h.tagName[1])),
  };
})()"""
"""Measures of the page that is open."""
