"""A drive over time: a panel a role, linked axes, and a cursor that reads what was recorded."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.offline.load_traces import load_traces
from adhesion_can.physics.readings import Role
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from adhesion_can.reporting.charts import DARK
from adhesion_can.reporting.drive.signal_panels import signal_panels, signal_table
from adhesion_can.reporting.page import Page, write_page
from adhesion_can.reporting.time_panels import AXLE_COLOURS, Panel, line, panels_figure
from adhesion_can.sampling.drive_signals import SLIP, DriveSignals
from tests.reporting.test_page import Elements

CONFIG = load_configuration()
EPOCH_S = 1_790_000_000
CYCLE_US = 10_000


def drive(seconds=20, spike=None):
    """Signals of a drive with a ramp in each role; `spike` (s) has one reading far off."""
    signals = DriveSignals(200)
    t_us = np.arange(0, seconds * 1_000_000, CYCLE_US)
    ramp = t_us / 1e6
    for axle in (1, 2):
        wheel = 10.0 + ramp + axle
        if spike is not None and axle == 2:
            wheel[round(spike * 1e6 / CYCLE_US)] = 99.0
        signals.add({(Role.WHEEL_SPEED, axle): (t_us, wheel)})
        signals.add({(Role.TRACTIVE_EFFORT, axle): (t_us, 1000.0 * axle * ramp)})
        signals.add({(SLIP, axle): (t_us, 0.001 * ramp)})
    signals.add({(Role.VEHICLE_SPEED, 0): (t_us[::2], 5.0 + ramp[::2])})
    signals.add({(Role.SANDING, 0): (t_us[::100], (ramp[::100] >= 10.0).astype(float))})
    signals.add({(Role.RAIL_TEMPERATURE, 0): (t_us[::100], np.full(seconds, 12.0))})
    return signals


def titles(panels):
    return [panel.title for panel in panels]


def test_each_role_has_a_panel_in_its_order_and_wheels_are_beside_the_vehicle():
    found = signal_panels(drive(), CONFIG, 0)
    assert titles(found.panels) == [
        "speed of the vehicle and of the rims r·ω, m/s", "slip ratio", "tractive effort, kN",
        "sanding",
    ]  # fmt: skip
    speeds = {trace["name"]: trace for trace in found.panels[0].traces}
    assert list(speeds) == ["axle 1", "axle 2", "vehicle"]
    radius = CONFIG.vehicle.wheel_radius[0]
    assert speeds["axle 1"]["y"][0] == pytest.approx(11.0 * radius)
    # An axle has one colour in all panels.
    for panel in found.panels[:3]:
        assert [t["line"]["color"] for t in panel.traces][:2] == list(AXLE_COLOURS[:2])
    # What does not change is said, and has no panel.
    assert "rail temperature 12 degC" in found.caption


def test_thinned_points_of_a_ramp_are_joined_and_a_hole_is_not():
    signals = DriveSignals(100)
    t_us = np.arange(0, 60_000_000, CYCLE_US)
    t_us = t_us[(t_us < 20_000_000) | (t_us > 30_000_000)]
    signals.add({(Role.VEHICLE_SPEED, 0): (t_us, 5.0 + t_us / 1e6)})
    (panel,) = signal_panels(signals, CONFIG, 0).panels
    x, y = (np.asarray(panel.traces[0][name]) for name in "xy")
    gap = x[np.isnan(y)]
    assert len(gap) == 1
    assert 20.0 < gap[0] < 30.0


def test_the_table_of_signals_has_units_and_exact_ranges():
    table = signal_table(drive(spike=7.0), CONFIG)
    assert table.columns == ("signal", "unit", "readings", "lowest", "highest")
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["wheel_speed.2"] == ("rad/s", "2000", "12", "99")
    assert rows["tractive_effort.1"][0] == "N"
    assert rows["slip.1"][0] == ""


def written(folder, figure):
    path = folder / "page.html"
    write_page(Page("t", "l", [], {"s": [figure]}, {"command": "none"}), path)
    return path


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    shown = signal_panels(drive(spike=7.0), CONFIG, 0)
    figure = panels_figure("A drive.", shown.panels, "time, s", "drive")
    return written(tmp_path_factory.mktemp("panels"), figure)


def ranges(browser):
    """Range of the abscissa of every panel."""
    return browser.evaluate(
        "(() => { const l = document.querySelector('.plot').layout; return Object.keys(l)"
        ".filter((k) => /^xaxis\\d*$/.test(k)).map((k) => l[k].range.map(Number)); })()"
    )


def drag(browser, row, first, last):
    """Drag across a panel, from one share of its width to another."""
    box = browser.evaluate(
        f"(() => {{ const b = document.querySelectorAll('.nsewdrag')[{row}]"
        ".getBoundingClientRect(); return [b.left, b.top + b.height / 2, b.width]; })()"
    )
    browser.evaluate(f"window.scrollBy(0, {box[1]} - 400)")
    y = browser.evaluate(
        f"(() => {{ const b = document.querySelectorAll('.nsewdrag')[{row}]"
        ".getBoundingClientRect(); return b.top + b.height / 2; })()"
    )
    places = [box[0] + share * box[2] for share in (first, (first + last) / 2, last)]
    browser.pointer("mouseMoved", places[0], y)
    browser.pointer("mousePressed", places[0], y)
    for x in places[1:]:
        browser.pointer("mouseMoved", x, y)
    browser.pointer("mouseReleased", places[-1], y)


@pytest.mark.parametrize("width", [1280, 420])
def test_a_zoom_in_one_panel_moves_all(browser, made, width):
    browser.open(made, width)
    before = ranges(browser)
    assert len(before) == 4
    drag(browser, 2, 0.25, 0.75)
    browser.wait_until(
        "document.querySelector('.plot').layout.xaxis.range[0] > "
        f"{before[0][0] + 0.2 * (before[0][1] - before[0][0])}"
    )
    after = ranges(browser)
    assert after == [after[0]] * 4
    assert np.ptp(after[0]) == pytest.approx(np.ptp(before[0]) / 2, rel=0.05)
    assert browser.complaints == []


READ = """(() => ({
  at: Number(document.querySelector(".cursor output").textContent),
  values: [...document.querySelectorAll(".head")].map((head) => ({
    title: head.querySelector("b").textContent,
    read: [...head.querySelectorAll("button")].map(
      (b) => [b.getAttribute("aria-label"), b.querySelector(".value").textContent]),
  })),
}))()"""
"""What the cursor shows: its abscissa, and the texts by panel and trace."""


def number(text):
    return float(text.replace("−", "-"))


@pytest.mark.parametrize("width", [1280, 420])
def test_the_cursor_reads_what_was_recorded_in_all_panels(browser, made, width):
    browser.open(made, width)
    box = browser.evaluate(
        "(() => { const b = document.querySelector('.nsewdrag').getBoundingClientRect(); "
        "window.scrollBy(0, b.top - 200); return [b.left, b.width]; })()"
    )
    for share in (0.1, 0.62):
        browser.pointer("mouseMoved", box[0] + share * box[1], 220)
        seen = browser.evaluate(READ)
        texts = {one["title"]: dict(one["read"]) for one in seen["values"]}
        span = 2 * drive().width_us / 1e6
        radius = CONFIG.vehicle.wheel_radius[0]
        speeds = texts["speed of the vehicle and of the rims r·ω, m/s"]
        for axle in (1, 2):
            # The nearest of the readings that are drawn, to six digits.
            t_s = number(speeds[f"axle {axle}"]) / radius - 10.0 - axle
            assert abs(t_s - seen["at"]) < span
            assert round(t_s / 0.01) == pytest.approx(t_s / 0.01, abs=0.02)
        assert number(texts["tractive effort, kN"]["axle 2"]) == pytest.approx(
            2.0 * seen["at"], abs=2 * span
        )
        assert number(texts["sanding"]["sanding"]) == float(seen["at"] >= 10.0)
    # The line is where the pointer is.
    line_x = browser.evaluate("document.querySelector('.cursor-line').getBoundingClientRect().left")
    assert line_x == pytest.approx(box[0] + 0.62 * box[1], abs=1.5)


def test_a_reading_of_one_cycle_is_drawn_and_read_and_the_slider_moves_the_cursor(browser, made):
    browser.open(made, 1280)
    highest = browser.evaluate(
        "Math.max(...document.querySelector('.plot').data[1].y.filter((y) => y !== null))"
    )
    radius = CONFIG.vehicle.wheel_radius[1]
    assert highest == pytest.approx(99.0 * radius, rel=1e-5)
    browser.evaluate(
        "(() => { const s = document.querySelector('.cursor input'); s.step = 'any'; "
        "s.value = 7.0; s.dispatchEvent(new Event('input')); })()"
    )
    seen = browser.evaluate(READ)
    assert seen["at"] == pytest.approx(7.0, abs=0.01)
    assert number(dict(seen["values"][0]["read"])["axle 2"]) == pytest.approx(99.0 * radius, 1e-4)


def test_a_trace_is_hidden_by_its_button_and_headings_are_over_their_panels(browser, made):
    for width in (1280, 420):
        browser.open(made, width)
        boxes = browser.evaluate(
            "[[...document.querySelectorAll('.head')], [...document.querySelectorAll('.nsewdrag')]]"
            ".map((all) => all.map((e) => { const b = e.getBoundingClientRect(); "
            "return [b.top, b.bottom]; }))"
        )
        heads, panels = boxes
        assert len(heads) == len(panels) == 4
        for head, panel in zip(heads, panels, strict=True):
            assert head[1] == pytest.approx(panel[0], abs=1.5)
    browser.evaluate("document.querySelector('.head button').click()")
    assert browser.evaluate("document.querySelector('.plot').data[0].visible") == "legendonly"


def test_a_band_and_a_state_are_read_too(browser, tmp_path):
    x = np.array([0.0, 1.0, 2.0, 3.0])
    outline = line("interval", np.append(x, x[::-1]), np.append(x + 1, x[::-1] - 1),
                   {"color": DARK, "width": 0}) | {"fill": "toself"}  # fmt: skip
    states = [
        {"type": "scatter", "mode": "lines", "name": name, "x": [*span, None],
         "y": [name, name, None], "line": {"color": DARK, "width": 9}}
        for name, span in (("init", (0.0, 0.9)), ("tracking", (1.0, 3.0)))
    ]  # fmt: skip
    panels = [Panel("estimate", [outline]), Panel("status", states, {"type": "category"})]
    browser.open(written(tmp_path, panels_figure("c", panels, "time, s", "f")))
    for at, interval, state in ((0.1, "−1 to 1", "init"), (2.2, "1 to 3", "tracking")):
        browser.evaluate(
            "(() => { const s = document.querySelector('.cursor input'); s.step = 'any'; "
            f"s.value = {at}; s.dispatchEvent(new Event('input')); }})()"
        )
        texts = browser.evaluate(
            "[...document.querySelectorAll('.value')].map((v) => v.textContent)"
        )
        assert texts == [interval, state]


# ------------------------------------------------------------------------- of a command, as a whole


@pytest.fixture(scope="module")
def dated(tmp_path_factory):
    """A simulated drive of 30 s on six axles, its stamps dates."""
    path = tmp_path_factory.mktemp("dated") / "drive.log"
    command = ["simulate", "--scenario", "sweep", "--duration", "30", "--seed", "4"]
    assert main([*command, "--log", str(path), "--no-progress"]) == 0
    text = re.sub(
        r"^\((\d+)", lambda m: f"({int(m[1]) + EPOCH_S}", path.read_text(), flags=re.MULTILINE
    )
    path.write_text(text)
    return path


@pytest.mark.costly
@pytest.mark.parametrize("command", ["check", "replay"])
def test_a_page_draws_every_extreme_of_its_recording_from_time_0(command, dated, tmp_path):
    path = tmp_path / "page.html"
    assert main([command, str(dated), "--html", str(path), "--no-progress"]) == 0
    elements = Elements(path.read_text())
    figure = next(f for f in elements.figures() if f["panels"])
    title = "tractive effort, kN"
    traces = {t["name"]: t for t in figure["data"] if t["meta"] == title}
    recordings = open_recordings([dated])
    traced = load_traces(blocks_in_sequence(recordings, 1.0), CONFIG, "d")
    for axle in range(1, 7):
        trace = traced.trace(Role.TRACTIVE_EFFORT, axle)
        drawn = [y for y in traces[f"axle {axle}"]["y"] if y is not None]
        assert max(drawn) == pytest.approx(trace.value.max() / 1e3, rel=1e-5)
        assert min(drawn) == pytest.approx(trace.value.min() / 1e3, rel=1e-5)
    xs = [x for t in figure["data"] for x in t["x"] if x is not None]
    assert min(xs) == pytest.approx(0.0, abs=0.02)
    assert max(xs) <= 30.1
    flat = " ".join(elements.text.values())
    assert flat.count("2026-09-21") == 1
    assert str(EPOCH_S)[:5] not in re.sub(r"[0-9a-f]{64}", "", _shown(elements))


def _shown(elements):
    """What a reader sees of a page: all but scripts and styles."""
    return " ".join(
        elements.text[k] for k, (tag, _) in enumerate(elements.found)
        if tag not in {"script", "style"}
    )  # fmt: skip


def test_no_box_hides_rows_and_no_sentence_is_printed_twice(browser, dated, tmp_path):
    path = tmp_path / "page.html"
    assert main(["check", str(dated), "--html", str(path), "--no-progress"]) == 0
    for width in (1280, 420):
        browser.open(path, width)
        assert browser.evaluate(
            "[...document.querySelectorAll('.scroll')].filter((b) => !b.closest('details'))"
            ".every((b) => b.scrollHeight <= b.clientHeight + 1)"
        )
    sentences = Elements(path.read_text()).texts("li")
    assert len(sentences) == len(set(sentences))
    units = {row[0]: row[1] for row in json.loads(browser.evaluate(TABLE_OF_SIGNALS))}
    assert units["wheel_speed.1"] == "rad/s"
    assert units["axle_load.6"] == "N"
    assert units["gradient"] == "m/m"


TABLE_OF_SIGNALS = """JSON.stringify([...document.querySelectorAll("table")]
  .find((t) => t.querySelector("th").textContent === "signal").querySelectorAll("tbody tr").length
  ? [...[...document.querySelectorAll("table")]
      .find((t) => t.querySelector("th").textContent === "signal").querySelectorAll("tbody tr")]
      .map((r) => [...r.cells].map((c) => c.textContent)) : [])"""


def test_the_pages_script_is_part_of_the_package():
    folder = Path(__file__).parents[2] / "adhesion_can" / "reporting" / "templates"
    assert "class Cursor" in (folder / "cursor.js").read_text("utf-8")
