"""Recordings that allow no verdict, or not all of it: no crash, no name, and a reason."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from tests.diagnosis.bad_logs import CYCLE_S, MISSING, readings, write
from tests.diagnosis.diagnosis_helpers import diagnosed
from tests.seeds import first_quick

PLAIN = readings()


def axle(given, field, number, value):
    """One axle's signal at a value throughout."""
    columns = getattr(given, field).copy()
    columns[:, number - 1] = value
    return replace(given, **{field: columns})


def span(given, field, from_s, to_s, value):
    """A signal at a value for some time."""
    columns = getattr(given, field).copy()
    cycle = CYCLE_S[field]
    columns[round(from_s / cycle) : round(to_s / cycle)] = value
    return replace(given, **{field: columns})


def whole(given, field, value):
    return replace(given, **{field: 0 * getattr(given, field) + value})


def run(folder, given=PLAIN, **how):
    """Diagnosis of spoilt readings; nothing is hidden, so nothing may be named."""
    answer = diagnosed(folder, write(folder / "a.log", given, **how))
    assert answer.status == 0, answer.err
    assert answer.named == set(), answer.out
    return answer


# --- what is missing


@pytest.mark.costly
@pytest.mark.parametrize(
    ("message", "effects"),
    [
        ("Environment", ("humidity", "rail_temperature", "sanding")),
        pytest.param("TrackGeometry", ("curve_creep",), marks=pytest.mark.slow),
    ],
)
def test_a_message_that_is_absent_leaves_its_effects_untested(message, effects, tmp_path):
    answer = run(tmp_path, without=(message,))
    assert answer.verdict == "nothing_found"
    for effect in effects:
        assert "no signal gives" in answer.untested[effect]
    evidence = {one["effect"] for one in answer.document["evidence"]}
    assert not evidence & set(effects)
    assert "load_dependence" in evidence


@pytest.mark.slow
def test_loads_that_are_not_measured_are_reported_as_missing(tmp_path):
    answer = run(tmp_path, without=("AxleLoads1", "AxleLoads2"))
    assert answer.verdict in {"nothing_found", "unexplained"}
    if answer.verdict == "unexplained":
        # They are not the configured ones, and move otherwise: this may be seen.
        assert answer.document["channel"] in {"axle_load", "tractive_effort", "axle"}
        assert answer.document["gain"]["percent"] > 0


@pytest.mark.costly
@pytest.mark.parametrize(
    "how",
    [
        {"without": ("TractiveEffort2",)},
        pytest.param({"without": ("WheelSpeeds2",)}, marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_a_bogie_that_is_not_received_is_reported(how, tmp_path):
    answer = run(tmp_path, **how)
    assert answer.verdict == "nothing_found"
    for number in (4, 5, 6):
        assert any(what.startswith(f"axle {number}") for what in answer.untested)
    tested = {one["axle"] for one in answer.document["evidence"]}
    assert tested == {0, 1, 2, 3}


@pytest.mark.costly
@pytest.mark.parametrize("field", ["wheel_speed", pytest.param("effort", marks=pytest.mark.slow)])
def test_an_axle_that_is_not_available_is_reported(field, tmp_path):
    answer = run(tmp_path, axle(PLAIN, field, 3, MISSING[field]))
    assert answer.verdict == "nothing_found"
    assert any(what.startswith("axle 3") for what in answer.untested)
    assert any("axle 3" in reason for reason in answer.document["left_out"])


def test_one_axle_alone_identifies_no_radius(tmp_path):
    given = PLAIN
    for number in range(2, 7):
        for field in ("wheel_speed", "effort"):
            given = axle(given, field, number, MISSING[field])
    answer = run(tmp_path, given)
    assert {"wheel_radius", "rail_cleaning"} <= set(answer.untested)


@pytest.mark.costly
@pytest.mark.parametrize(
    "given",
    [
        axle(PLAIN, "load", 1, 0.0),
        pytest.param(axle(PLAIN, "load", 1, 500.0), marks=pytest.mark.slow),
    ],
)
def test_a_load_that_cannot_be_is_left_out(given, tmp_path):
    answer = run(tmp_path, given)
    assert answer.verdict == "nothing_found"
    assert any("load" in reason for reason in answer.document["left_out"])
    assert any(what.startswith("axle 1") for what in answer.untested)


@pytest.mark.slow
def test_a_channel_that_is_mostly_not_available_is_reported_as_such(tmp_path):
    answer = run(tmp_path, span(PLAIN, "humidity", 10, 40, MISSING["humidity"]))
    assert "not available" in answer.untested["humidity"]
    assert "humidity" not in {one["effect"] for one in answer.document["evidence"]}


@pytest.mark.costly
def test_channels_that_do_not_move_are_told(tmp_path):
    given = whole(whole(PLAIN, "humidity", 50.0), "curvature", 0.0)
    given = whole(whole(given, "rail_temperature", 20.0), "sanding", 0.0)
    answer = run(tmp_path, given)
    assert answer.verdict == "nothing_found"
    for effect in ("humidity", "curve_creep", "rail_temperature", "sanding"):
        assert "does not change" in answer.untested[effect]


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ({"without": ("VehicleSpeed",)}, "1 of 5 needed messages is missing (VehicleSpeed 0x111)"),
        ({"without": ("TractiveEffort1", "TractiveEffort2")}, "2 of 5 needed messages are"),
        ({"given": whole(PLAIN, "speed", MISSING["speed"])}, "vehicle speed"),
        ({"given": whole(PLAIN, "speed", 0.4)}, "below v_min"),
        ({"given": whole(PLAIN, "load", 0.0)}, "load"),
        ({"stamps": lambda t: 0 * t + 1_000_000}, "vehicle speed"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_without_one_usable_row_it_is_an_error_with_the_reason(how, reason, tmp_path):
    given = how.pop("given", PLAIN) if "given" in how else PLAIN
    answer = diagnosed(tmp_path, write(tmp_path / "a.log", given, **how))
    assert answer.status == 2
    assert answer.err.count("\n") == 1
    assert ("no usable row" in answer.err) is ("without" not in how)
    assert reason in answer.err


# --- gaps and times


GAPS = {
    "three gaps of four seconds": {"kept": lambda _, t: t % 15 < 11},
    "a long one": {"kept": lambda _, t: (t < 20) | (t > 45)},
    "of the vehicle speed": {"kept": lambda name, t: (t % 8 < 6) | (name != "VehicleSpeed")},
    "of one message in three": {"kept": lambda _, t: np.round(t * 100) % 3 > 0},
}


@pytest.mark.costly
@pytest.mark.parametrize(
    "kind",
    first_quick(GAPS),
)
def test_gaps_cost_the_rows_beside_them_and_no_more(kind, tmp_path):
    answer = run(tmp_path, **GAPS[kind])
    assert answer.verdict == "nothing_found"
    if kind != "of one message in three":
        assert any("gap" in reason for reason in answer.document["left_out"])


@pytest.mark.parametrize(
    ("field", "from_s", "to_s"),
    [
        ("wheel_speed", 20, 30),
        pytest.param("effort", 20, 30, marks=pytest.mark.slow),
        pytest.param("speed", 20, 30, marks=pytest.mark.slow),
        pytest.param("load", 20, 30, marks=pytest.mark.slow),
    ],
)
def test_values_not_available_for_a_time_are_a_gap(field, from_s, to_s, tmp_path):
    answer = run(tmp_path, span(PLAIN, field, from_s, to_s, MISSING[field]))
    assert answer.verdict == "nothing_found"


TIMES = {
    "halves in the wrong order": lambda t: np.where(t < 30_000_000, t + 30_000_000, t - 30_000_000),
    "half a second from before": lambda t: np.where(
        (t > 30_000_000) & (t < 30_500_000), t - 20_000_000, t
    ),
    "stamps that jitter": lambda t: np.maximum(
        t + np.random.default_rng(1).integers(-9000, 9000, len(t)), 0
    ),
    "a jump of a year": lambda t: np.where(t < 30_000_000, t, t + 31_536_000_000_000),
}


@pytest.mark.costly
@pytest.mark.parametrize(
    "kind",
    [
        k if k == "half a second from before" else pytest.param(k, marks=pytest.mark.slow)
        for k in TIMES
    ],
)
def test_time_that_runs_backwards_or_jumps_is_told(kind, tmp_path):
    answer = run(tmp_path, stamps=TIMES[kind])
    if kind != "a jump of a year":
        assert "stamped earlier" in answer.notes or "the clock steps back" in answer.notes


@pytest.mark.parametrize("seconds", [3, 12, 20])
def test_too_short_a_drive_carries_no_verdict(seconds, tmp_path):
    answer = run(tmp_path, kept=lambda _, t: (t >= 5) & (t < 5 + seconds))
    assert answer.verdict == "nothing_found"
    assert answer.document["gain"] is None
    assert set(answer.untested) >= {"everything"}
    assert "No verdict" in answer.out


# --- signals that stand still


STILL = {
    "vehicle speed for 20 s": span(PLAIN, "speed", 20, 40, PLAIN.speed[1000]),
    "wheels for 20 s": span(PLAIN, "wheel_speed", 20, 40, PLAIN.wheel_speed[2000]),
    "wheels all along": whole(PLAIN, "wheel_speed", PLAIN.wheel_speed[100]),
    "efforts for 20 s": span(PLAIN, "effort", 20, 40, 50e3),
    "efforts all along": whole(PLAIN, "effort", 50e3),
    "no effort at all": whole(PLAIN, "effort", 0.0),
    "effort of one axle": axle(PLAIN, "effort", 3, 50e3),
    "wheel of one axle": axle(PLAIN, "wheel_speed", 3, 15.0),
}
QUICK = ("wheels all along", "no effort at all")
REFUSED = {"wheel of one axle": "axle 3: while coasting, the rim speed is"}
"""Signals that cannot be what they are said to be, and what is said of them."""


@pytest.mark.parametrize(
    "kind",
    [
        k if k in QUICK else pytest.param(k, marks=pytest.mark.slow)
        for k in sorted(STILL.keys() - REFUSED)
    ],
)
def test_a_signal_that_stands_still_has_no_cause(kind, tmp_path):
    answer = run(tmp_path, STILL[kind])
    if kind == "no effort at all":
        assert answer.document["gain"] is None


@pytest.mark.slow
@pytest.mark.parametrize("kind", REFUSED)
def test_a_signal_that_stands_still_all_along_is_refused_by_its_name(kind, tmp_path):
    answer = diagnosed(tmp_path, write(tmp_path / "a.log", STILL[kind]))
    assert answer.status == 2
    assert REFUSED[kind] in answer.err


# --- anything


FAULTS = st.tuples(
    st.sampled_from(["wheel_speed", "effort", "speed", "load", "humidity"]),
    st.sampled_from(["missing", "zero", "still", "noise", "largest"]),
    st.integers(0, 55),
    st.sampled_from([0.05, 0.5, 3.0, 30.0]),
    st.integers(0, 5),
)
"""Signal, fault, from, for how long, s, and at which axle."""
GONE = st.tuples(
    st.sampled_from(
        ["WheelSpeeds1", "VehicleSpeed", "TractiveEffort2", "Environment", "AxleLoads1"]
    ),
    st.integers(0, 60),
    st.sampled_from([0.02, 0.3, 2.0, 20.0]),
)
"""Message, from, for how long, s."""


def spoilt(found, field, fault, from_s, length_s, number):
    """Readings with one more fault."""
    columns, top = getattr(found, field).copy(), MISSING[field]
    rows = slice(round(from_s / CYCLE_S[field]), round((from_s + length_s) / CYCLE_S[field]))
    where = (rows,) if columns.ndim == 1 else (rows, number)
    if not columns[where].size:
        return found
    rng = np.random.default_rng(from_s)
    columns[where] = {
        "missing": top,
        "zero": 0.0,
        "still": columns[where][0],
        "noise": rng.uniform(0, 0.9 * top, columns[where].shape),
        "largest": 0.99 * top,
    }[fault]
    return replace(found, **{field: columns})


def fuzzed(folder, faults, gone):
    found = PLAIN
    for fault in faults:
        found = spoilt(found, *fault)

    def kept(name, t):
        there = np.ones(len(t), dtype=bool)
        for message, from_s, length_s in gone:
            if name == message:
                there &= (t < from_s) | (t >= from_s + length_s)
        return there

    answer = diagnosed(folder, write(folder / "a.log", found, kept=kept))
    assert answer.status in {0, 2}
    if answer.status == 2:
        assert answer.err.count("\n") == 1, answer.err
        assert answer.err.startswith("adhesion-can diagnose: ")
    return answer


@pytest.mark.costly
@settings(max_examples=3, derandomize=True, phases=[Phase.generate])
@given(faults=st.lists(FAULTS, max_size=3), gone=st.lists(GONE, max_size=3))
def test_whatever_is_wrong_with_the_signals_it_answers(faults, gone, tmp_path_factory):
    fuzzed(tmp_path_factory.mktemp("f"), faults, gone)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.timeout(1200)
@settings(max_examples=60, phases=[Phase.reuse, Phase.generate])
@given(faults=st.lists(FAULTS, max_size=3), gone=st.lists(GONE, max_size=3))
def test_whatever_is_wrong_with_the_signals_it_answers_long(faults, gone, tmp_path_factory):
    fuzzed(tmp_path_factory.mktemp("f"), faults, gone)


@pytest.mark.costly
@settings(max_examples=1, derandomize=True, phases=[Phase.generate])
@given(seed=st.integers(0, 10_000))
def test_frames_that_are_lost_at_random_name_nothing(seed, tmp_path_factory):
    """Two in a hundred, of every message: the counters tell, and nothing else happens."""
    rng = np.random.default_rng(seed)
    folder = tmp_path_factory.mktemp("f")
    answer = run(folder, kept=lambda _, t: rng.random(len(t)) > 0.02)
    assert answer.verdict == "nothing_found"


@pytest.mark.costly
@pytest.mark.parametrize("line", [100, pytest.param(20_000, marks=pytest.mark.slow)])
def test_bytes_that_flip_are_rejected_and_the_rest_is_read(line, tmp_path):
    path = write(tmp_path / "a.log", PLAIN)
    lines = path.read_text().splitlines()
    lines[line : line + 50] = [
        f"{text[:-1]}{'0' if text[-1] != '0' else '1'}" for text in lines[line : line + 50]
    ]
    lines[line + 60] = "(12.5 garbage"
    path.write_text("\n".join(lines) + "\n")
    answer = diagnosed(tmp_path, path)
    assert (answer.status, answer.verdict) == (0, "nothing_found")
    assert "failed their checks" in answer.notes
