"""Lines in a service's log that tell to which model it changed."""

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.errors import ConfigError, RecordingError
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.effects import ActiveEffect, effect_by_id
from adhesion_can.recordings.candump import read_line
from adhesion_can.recordings.recording import Recording
from adhesion_can.service.model_changes import ModelChange, read_model_changes

SIZES = st.floats(-0.02, 0.02, allow_subnormal=False)
TIMES = st.integers(0, 10**15)


def model_of(size=0.01, variance=1e-8):
    effect = ActiveEffect(effect_by_id("speed_scale"), (size,))
    return ExtendedModel((0.3, 60.0, 0.3), effects=(effect,), covariances=(((variance,),),))


def large_model():
    """A model of several effects with their covariances, whose comment needs several lines."""
    effects = tuple(
        ActiveEffect(
            effect_by_id(name), tuple(p.typical / 3 for p in effect_by_id(name).parameters)
        )
        for name in ("speed_scale", "effort_bias", "adhesion_recovery")
    )
    sizes = [len(one.values) for one in effects]
    covariances = tuple(
        tuple(tuple(1e-9 / (7 + r + c) for c in range(n)) for r in range(n)) for n in sizes
    )
    covariance = tuple(tuple(1e-5 / (3 + r + c) for c in range(3)) for r in range(3))
    return ExtendedModel((0.3, 60.0, 0.3), covariance, effects, covariances)


def lines_of(change):
    """Lines of the log with a change."""
    return change.to_lines().encode().splitlines(keepends=True)


def content(change):
    model = change.model
    told = None if model is None else (model.base, model.effects, model.covariances)
    return change.t_us, told


@given(TIMES, st.none() | SIZES.map(model_of))
def test_a_change_is_read_as_it_was_written(t_us, model):
    change = ModelChange(t_us, model)
    (found,) = read_model_changes(lines_of(change), "a.log")
    assert content(found) == content(change)


@pytest.mark.parametrize("model", [model_of(), large_model(), None])
def test_other_readers_pass_over_the_lines(tmp_path, model):
    lines = ModelChange(1_700_000_000_123_456, model).to_lines()
    assert all(read_line(line.encode()) == "comment" for line in lines.splitlines())
    path = tmp_path / "a.log"
    path.write_text(f"(1.000000) vcan0 123#00\n{lines}(2.000000) vcan0 123#01\n")
    messages = list(can.LogReader(path))
    assert [m.timestamp for m in messages if m.data] == [1.0, 2.0]
    assert [frame.t_us for frame in Recording(path)] == [1_000_000, 2_000_000]
    (found,) = read_model_changes(Recording(path).comments(), "a.log")
    assert content(found)[1] == content(ModelChange(0, model))[1]


def test_a_large_model_takes_several_lines_each_of_which_is_needed():
    change = ModelChange(5_000_000, large_model())
    lines = lines_of(change)
    assert len(lines) >= 2
    (found,) = read_model_changes(lines, "a.log")
    assert content(found) == content(change)
    for missing in range(len(lines)):
        with pytest.raises(RecordingError, match=r"a\.log"):
            list(read_model_changes(lines[:missing] + lines[missing + 1 :], "a.log"))


@settings(max_examples=200)
@given(st.data())
def test_a_damaged_line_is_an_error_or_the_same_model(data):
    (line,) = lines_of(ModelChange(5_000_000, model_of()))
    line = line.rstrip()
    place = data.draw(st.integers(len(b"#5.000000# adhesion-can-model:"), len(line) - 1))
    damaged = data.draw(
        st.sampled_from([line[:place], line[:place] + b"!" + line[place + 1 :], line + b" more"])
    )
    try:
        found = [content(one) for one in read_model_changes([damaged], "a.log")]
    except (RecordingError, ConfigError) as error:
        found = str(error)
    assert found == [content(ModelChange(5_000_000, model_of()))] or "a.log" in found


@pytest.mark.parametrize("line", [b"# adhesion", b"# a comment\n", b"(1.0) a 123#00\n", b""])
def test_other_comments_are_no_changes(line):
    assert list(read_model_changes([line], "a.log")) == []
