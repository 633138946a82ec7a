"""Traces and samples of whole recordings in blocks, against frame after frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import load_configuration
from adhesion_can.errors import RecordingError
from adhesion_can.offline.extract_samples import UPDATE_US, SampleExtractor, extract_samples
from adhesion_can.offline.load_traces import load_traces
from adhesion_can.physics.readings import Role, SpeedSource
from adhesion_can.physics.samples import Samples
from tests.service.test_column_replay import blocks_of, spoiled

CONFIG = load_configuration()


def clamped(items):
    """Frames with stamps that do not run backwards."""
    now = 0
    for item in items:
        if isinstance(item, Frame):
            now = max(now, item.t_us)
            yield item._replace(t_us=now)


@settings(max_examples=8, derandomize=True)
@given(st.integers(0, 2**32), st.integers(0, 5))
def test_readings_of_blocks_are_those_of_frames(seed, cuts):
    items = spoiled(seed, seconds=1.5)
    loaded = load_traces(blocks_of(items, np.random.default_rng(seed), cuts), CONFIG, "x")
    receiver, expected, source, derived, trailing = Receiver(CONFIG.messages), {}, None, 0, 0
    for frame in clamped(items):
        readings = receiver.accept(frame)
        if not isinstance(readings, list):
            continue
        source = next((r.value for r in readings if r.role is Role.SPEED_SOURCE), source)
        for r in readings:
            value = np.nan if r.value is None else r.value
            if r.role is Role.VEHICLE_SPEED:
                trailing += source == SpeedSource.TRAILING_AXLE
                derived += source == SpeedSource.DRIVEN_AXLES
                value = np.nan if source == SpeedSource.DRIVEN_AXLES else value
            expected.setdefault((r.role, r.axle), {})[r.t_us] = value
    for key, trace in loaded.traces().items():
        np.testing.assert_array_equal(trace.t_us, list(expected.get(key, {})))
        np.testing.assert_array_equal(trace.value, list(expected.get(key, {}).values()))
    assert loaded.traces().keys() >= expected.keys()
    assert (loaded.derived, loaded.trailing) == (derived, trailing)
    assert loaded.rejected == receiver.rejected


@pytest.mark.costly
@settings(max_examples=6, derandomize=True)  # a broken stamp costs 50 000 collections
@given(st.integers(0, 2**32), st.integers(0, 5))
def test_samples_of_blocks_are_those_of_frames(seed, cuts):
    """On the grid of collections that blocks use."""
    items = spoiled(seed, seconds=1.5)
    extractor = SampleExtractor(CONFIG)
    samples = extractor.run(blocks_of(items, np.random.default_rng(seed), cuts))
    receiver, former, formed, due = Receiver(CONFIG.messages), CONFIG.make_former(), [], None
    frames = list(clamped(items))
    for frame in frames:
        due = frame.t_us + UPDATE_US if due is None else due
        while frame.t_us >= due:
            formed += former.collect(due).to_rows()
            due += UPDATE_US
        readings = receiver.accept(frame)
        for reading in readings if isinstance(readings, list) else ():
            former.add(reading)
    rows = formed + former.collect(frames[-1].t_us + 1).to_rows()
    expected = Samples.from_rows(rows)
    assert len(samples) == len(expected)
    for name in ("t_us", "axle", "slip", "adhesion", "load", "speed_us", "transient_var"):
        np.testing.assert_array_equal(getattr(samples, name), getattr(expected, name))
    assert samples.covariates.keys() >= set().union(*(row.covariates for row in rows))
    for name, column in samples.covariates.items():
        one_by_one = [row.covariates.get(name, np.nan) for row in rows]
        np.testing.assert_array_equal(column, one_by_one)
    assert extractor.dropped == +former.dropped
    assert extractor.counts["frames"] == len(frames)


@pytest.mark.parametrize("load", [load_traces, extract_samples])
def test_a_recording_without_a_known_frame_is_an_error(load):
    foreign = Block.from_frames([Frame(0, 0x7A0, b"x")])
    with pytest.raises(RecordingError, match=r"5 of 5 needed .*; the recording has 0x7A0; pass"):
        load([foreign], CONFIG, "x.log")
    with pytest.raises(RecordingError, match="it has no frames"):
        load([], CONFIG, "x.log")
