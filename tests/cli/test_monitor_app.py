"""The terminal program of `monitor`, headless: keys, what is shown, what is written."""

import asyncio
import signal
from types import SimpleNamespace

import pytest

from adhesion_can.bus.frame import Frame
from adhesion_can.cli import monitor as command
from adhesion_can.cli.monitor_log import LogSource, survey
from adhesion_can.cli.monitor_session import MonitorSession
from adhesion_can.config import load_configuration
from adhesion_can.recordings.recording import Recording
from tests.monitoring.recorded import closed_loop, write_log

pytest.importorskip("textual")

from textual.app import App
from textual.widgets import Input

from adhesion_can.cli.monitor_app import MonitorApp
from adhesion_can.reporting.terminal.view import ViewPage


class Clock:
    """A clock that goes on where it is told to, so that no test depends on the machine."""

    def __init__(self):
        self.now_s = 0.0

    def __call__(self):
        return self.now_s


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("app") / "full.log", closed_loop()[0])


def piloted(log, steps, size=(80, 24)):
    """Run the app, and steps with it: a coroutine of what has app, pilot and clock."""
    config, clock = load_configuration(), Clock()
    source = LogSource([log], survey([log], config), None, clock=clock)
    session = MonitorSession(config, source)

    async def run():
        app = MonitorApp(session)
        async with app.run_test(size=size) as pilot:
            clock.now_s = 2.0
            app.turn()
            await steps(SimpleNamespace(app=app, pilot=pilot, clock=clock))
        return app

    try:
        return asyncio.run(run())
    finally:
        session.close()


def text_of(app):
    return app.view.render().plain


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
def test_it_fills_the_terminal(log, size):
    async def steps(on):
        lines = text_of(on.app).splitlines()
        assert [len(line) for line in lines] == [size[0]] * size[1]
        assert "2.0 of 8.0 s" in lines[0]
        assert lines[1].startswith("TRACKING: the peak is known")
        assert "adhesion over slip ratio" in text_of(on.app)

    piloted(log, steps, size)


def test_pause_step_and_speed(log):
    async def steps(on):
        await on.pilot.press("space")
        on.clock.now_s += 3.0
        on.app.turn()
        assert "PAUSED  2.0 of" in text_of(on.app)
        await on.pilot.press("full_stop")
        assert "PAUSED  2.1 of" in text_of(on.app)
        await on.pilot.press("space", "plus")
        on.clock.now_s += 1.0
        on.app.turn()
        assert "4.1 of 8.0 s  x2" in text_of(on.app)
        await on.pilot.press("minus", "minus")
        assert "x0.5" in text_of(on.app)

    piloted(log, steps)


def test_a_filter_is_typed_kept_and_taken_back(log):
    async def steps(on):
        await on.pilot.press("f", *"wheel", "enter")
        assert "messages with 'wheel'" in text_of(on.app)
        assert "TractiveEffort1" not in text_of(on.app)
        # Escape leaves it as it was.
        await on.pilot.press("f", "x", "escape")
        assert on.app.view.chosen.wanted == "wheel"
        assert not on.app.query_one(Input).display
        await on.pilot.press("f", *["backspace"] * 5, "enter")
        assert "TractiveEffort1" in text_of(on.app)
        assert on.app.view.chosen.page is ViewPage.OVERVIEW

    piloted(log, steps)


def test_a_jump_and_one_that_is_no_time(log):
    async def steps(on):
        await on.pilot.press("space", "g", *"5.5", "enter")
        for _ in range(200):
            on.app.turn()
            if "PAUSED  5.5 of" in text_of(on.app):
                break
        assert "PAUSED  5.5 of" in text_of(on.app)
        await on.pilot.press("g", *"soon", "enter")
        assert "PAUSED  5.5 of" in text_of(on.app)
        assert any("is not a time" in note.message for note in on.app._notifications)

    piloted(log, steps)


@pytest.mark.parametrize("key", ["f", "g"])
def test_a_prompt_does_not_replace_the_view(log, key):
    async def steps(on):
        before = text_of(on.app).splitlines()
        await on.pilot.press(key)
        prompt = on.app.query_one(Input)
        assert prompt.display
        assert on.app.view.size == (80, 24)
        # It lies over the line of keys, the last one.
        assert prompt.region == (0, 23, 80, 1)
        assert text_of(on.app).splitlines()[4:] == before[4:]

    piloted(log, steps)


def test_pages_and_scrolling(log):
    async def steps(on):
        await on.pilot.press("m")
        assert "ServiceStatus" in text_of(on.app)
        assert "adhesion over slip ratio" not in text_of(on.app)
        await on.pilot.press("w")
        assert "axles hold it" in text_of(on.app)
        await on.pilot.press("question_mark")
        assert "lines 1 to" in text_of(on.app)
        await on.pilot.press(*["pagedown"] * 9)
        assert "the monitor never sends." in text_of(on.app)
        await on.pilot.press("up")
        last = text_of(on.app)
        await on.pilot.press("down", "down")
        assert text_of(on.app) != last
        await on.pilot.press("question_mark")
        assert "adhesion over slip ratio" in text_of(on.app)

    piloted(log, steps)


def test_enter_opens_the_list_and_the_signals_of_the_selected_message(log):
    async def steps(on):
        await on.pilot.press("enter")
        assert " >101 " in text_of(on.app)
        await on.pilot.press("down", "down", "up", "pagedown", "pagedown")
        assert " >211 " in text_of(on.app)  # the last one
        await on.pilot.press("up", "up", "up", "up", "enter")
        assert "┌ AdhesionSetpoint, id 201 " in text_of(on.app)
        assert "TRACKING" in text_of(on.app)
        # The signals are live: another frame has another counter.
        before = text_of(on.app)
        on.clock.now_s += 0.02
        on.app.turn()
        assert text_of(on.app) != before
        # A prompt is left without the page.
        await on.pilot.press("f", "escape")
        assert "┌ AdhesionSetpoint, id 201 " in text_of(on.app)
        await on.pilot.press("escape")
        assert " >201 " in text_of(on.app)
        await on.pilot.press("escape")
        assert "adhesion over slip ratio" in text_of(on.app)

    piloted(log, steps)


def test_enter_opens_the_only_message_that_the_filter_shows(log):
    async def steps(on):
        await on.pilot.press("m", "f", *"quality", "enter", "enter")
        assert "┌ AdhesionQuality, id 203 " in text_of(on.app)
        await on.pilot.press(
            "escape", "f", *["backspace"] * 7, *"nothing", "enter", "down", "enter"
        )
        assert "no name or id contains this" in text_of(on.app)

    piloted(log, steps)


def test_a_jump_in_minutes_says_that_it_catches_up(log, monkeypatch):
    monkeypatch.setattr("adhesion_can.cli.monitor_log.TURN_S", -1.0)  # little a turn

    async def steps(on):
        await on.pilot.press("g", *"0:07", "enter")
        assert "Catching up to 7 s" in text_of(on.app)
        assert "CATCHING UP" in text_of(on.app).splitlines()[0]
        for _ in range(1000):
            on.app.turn()
            if "7.0 of 8.0 s" in text_of(on.app):
                break
        assert "7.0 of 8.0 s" in text_of(on.app)
        assert "CATCHING UP" not in text_of(on.app)

    piloted(log, steps)


def test_a_recording_is_written_and_named(log, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    async def steps(on):
        await on.pilot.press("r")
        on.clock.now_s += 1.0
        on.app.turn()
        assert " REC " in text_of(on.app)
        await on.pilot.press("r", "w")
        on.clock.now_s += 1.0
        on.app.turn()
        assert "recorded" in text_of(on.app)

    piloted(log, steps)
    (path,) = tmp_path.iterdir()
    assert path.name.startswith("monitor-")
    kept = [item for item in Recording(path) if isinstance(item, Frame)]
    expected = [f for f in closed_loop()[0] if 2_000_000 < f.t_us <= 3_000_000]
    assert [(f.t_us, f.data) for f in kept] == [(f.t_us, f.data) for f in expected]


@pytest.mark.parametrize("keys", [["q"], ["ctrl+c"], ["f", "ctrl+c"]])
def test_it_ends_with_q_and_ctrl_c(log, keys):
    async def steps(on):
        await on.pilot.press(*keys)

    assert piloted(log, steps).return_code == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
@pytest.mark.usefixtures("restored_signals")
def test_a_signal_ends_it_as_q_does(log, number):
    async def steps(on):
        signal.raise_signal(number)
        for _ in range(100):
            await on.pilot.pause(0.01)
            if on.app._exit:
                break
        assert on.app._exit

    assert piloted(log, steps).return_code == 0


@pytest.mark.parametrize(("fails", "status"), [(False, 0), (True, 1)])
def test_a_view_that_fails_is_no_success(log, monkeypatch, capsys, fails, status):
    def turn(app):
        if fails:
            raise RuntimeError("the view is broken")
        app.exit()

    monkeypatch.setattr(MonitorApp, "turn", turn)
    monkeypatch.setattr(MonitorApp, "run", lambda app: App.run(app, headless=True))
    config = load_configuration()
    session = MonitorSession(config, LogSource([log], survey([log], config), None))
    assert command._app_maker()(session, None) == status
    session.close()
    assert ("the view is broken" in capsys.readouterr().err) is fails
