"""Blocks of frames give the bytes, samples and counts that frames one by one give."""

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import ADVANCE, SECOND_SENDER, STOP, Frame, Mark
from adhesion_can.config import load_configuration
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.effects import ActiveEffect, effect_by_id
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.samples import Samples
from adhesion_can.recordings.candump import ReadReport
from adhesion_can.recordings.sequence import _StrayDetector, _without_strays
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.replay import replay, replay_blocks
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import SCENARIOS
from adhesion_can.simulation.surroundings import Surroundings
from tests.wire import Bench

CONFIG = load_configuration()


class SummingEstimator:
    """An estimator whose estimate depends on every bit of its samples and every update."""

    def __init__(self):
        self.total, self.updates = 0.0, 0

    def update(self, samples, now_us):
        self.updates += 1
        for field in fields(Samples):
            if field.name != "covariates":
                self.total += float(np.sum(getattr(samples, field.name))) % 1.7
        for name, column in sorted(samples.covariates.items()):
            self.total += len(name) * float(np.sum(column)) % 1.3
        if self.updates % 97 == 0:
            raise ValueError("fails now and then")
        mu_max = 0.1 + self.total % 0.5
        return Estimate(
            c1=0.4, c2=60.0, c3=0.3, covariance=np.eye(3), mu_max=mu_max, mu_max_std=0.001,
            lambda_m=0.05 + self.total % 0.01, lambda_m_std=0.002, noise_std=0.01, samples=500,
            identifiable=Identifiable(mu_max=True, lambda_m=True), surface_since_us=0,
            change_probability=float(self.updates % 50 == 0), doubt=Doubt(self.updates % 9),
        )  # fmt: skip


def blocks_of(items, rng, cuts):
    """The items in blocks that may be empty, with the channels that a reader would give."""
    whole = Block.from_frames(items)
    places = [0, *sorted(rng.integers(0, len(items) + 1, cuts).tolist()), len(items)]
    return [whole.select(slice(a, b)) for a, b in pairwise(places) if b > a]


def run_core(run, config, make, **how):
    setpoints, samples, sent = [], [], []
    core = ServiceCore(config, make, lambda t, o: setpoints.append((t, o)), samples.append)
    summary = run(core, sent.append, **how)
    return core, sent, setpoints, samples, summary


def assert_same(items, config=CONFIG, make=SummingEstimator, cuts=5, seed=0, **how):
    rng = np.random.default_rng(seed)
    blocks = blocks_of(items, rng, cuts)
    one, *a = run_core(lambda *x, **h: replay(items, *x, **h), config, make, **how)
    run = lambda *x, **h: replay_blocks(blocks, *x, **h)  # noqa: E731
    other, *b = run_core(run, config, make, **how)
    assert b[0] == a[0]  # frames, 0x211 among them
    assert b[1] == a[1]  # setpoints
    assert len(a[2]) == len(b[2])
    for s, t in zip(a[2], b[2], strict=True):
        for field in fields(Samples):
            x, y = getattr(s, field.name), getattr(t, field.name)
            if field.name == "covariates":
                assert x.keys() == y.keys()
                assert all(np.array_equal(x[name], y[name]) for name in x)
            else:
                np.testing.assert_array_equal(x, y)
    assert b[3] == a[3]  # summary
    assert other.counts == one.counts
    assert other.faults == one.faults
    assert other.dropped_samples == {k: n for k, n in one.dropped_samples.items() if n}
    assert other.left_out_samples == one.left_out_samples
    assert (other.now_us, other.next_due_us) == (one.now_us, one.next_due_us)
    assert (other.outputs, other.speed_derived) == (one.outputs, one.speed_derived)
    for theirs, ours in zip(one.receiver.records, other.receiver.records, strict=True):
        assert ours == theirs
    return one, a[0]


def simulated(scenario, seconds, seed=1, effects=()):
    how = RunSettings(scenario, seconds, seed, effects=effects)
    return [f for step in Simulation(how, CONFIG.database).run() for f in step]


@pytest.mark.costly
@pytest.mark.parametrize(
    "scenario",
    [s for s in SCENARIOS if s.name == "polach-sweep" or not s.name.startswith("polach-")],
    ids=lambda s: s.name,
)
def test_all_scenarios_give_the_same_bytes(scenario):
    """With the tracker, as a replay runs."""
    core, sent = assert_same(simulated(scenario, 2.6), make=None, cuts=7)
    assert core.counts.samples > 1000
    assert len(sent) > 850


@pytest.mark.costly
def test_an_extended_model_gives_the_same_bytes():
    """With late instruments and effects that need covariates, some of which come late."""

    def active(name, *values):
        effect = effect_by_id(name)
        return ActiveEffect(effect, values or tuple(p.typical for p in effect.parameters))

    effects = tuple(map(active, ("humidity", "effort_delay", "speed_delay", "effort_bias")))
    model = ExtendedModel((0.36, 24.0, 0.5), effects=effects)
    items = simulated(SCENARIOS[-1], 5.0, effects=effects)
    assert_same(items, config=replace(CONFIG, model=model), make=None)


@pytest.mark.costly
def test_effects_with_memory_and_steps_give_the_same_bytes():
    """Slip work and sand are remembered across the cuts of the blocks; rain comes and goes."""
    surroundings = Surroundings(
        sanding_period_s=2.0, sanding_s=0.8, rain_period_s=3.0, shower_s=2.0
    )
    scenario = replace(SCENARIOS[-1], surroundings=surroundings)
    chosen = (
        effect_by_id("contact_heating"), effect_by_id("rain", "steps"),
        effect_by_id("sanding", "axles"),
    )  # fmt: skip
    effects = tuple(ActiveEffect(e, tuple(p.typical for p in e.parameters)) for e in chosen)
    model = ExtendedModel((0.36, 24.0, 0.5), effects=effects)
    items = simulated(scenario, 5.0, effects=effects)
    assert_same(items, config=replace(CONFIG, model=model), make=None)


@pytest.mark.costly
def test_frames_and_columns_are_the_same_with_laws_of_the_instruments():
    laws = (
        ("load_transfer", "", 1.0), ("effort_gain", "heat", 0.1, 40.0),
        ("speed_error", "low_pass", 0.3), ("curving_resistance", "", 2.0),
        ("brake_blending", "", 0.2), ("wheel_once_per_turn", "", 0.01, 1.0, 2.0),
    )  # fmt: skip
    effects = tuple(ActiveEffect(effect_by_id(n, form), tuple(v)) for n, form, *v in laws)
    model = ExtendedModel((0.36, 24.0, 0.5), effects=effects)
    items = simulated(SCENARIOS[-1], 5.0, effects=effects)
    assert_same(items, config=replace(CONFIG, model=model), make=None)


def spoiled(seed, seconds=3.0):
    """A drive with every kind of trouble."""
    rng = np.random.default_rng(seed)
    bench, items = Bench(), []
    pause = int(rng.choice([0, 0, 300_000, 2_500_000, 61_000_000, 130_000_000]))
    source = int(rng.choice([1, 4]))
    shaky = float(rng.choice([0.0, 0.7]))
    first = int(rng.integers(0, 10**7))
    wrong = Frame(first, 0x101, bytes(8))
    items += [x for x in (wrong, Mark(first, SECOND_SENDER), wrong) if rng.random() < 0.5]
    names = [n for n in bench.counts if rng.random() < 0.97 or n == "VehicleSpeed"]
    half = first + int(seconds / 2 * 1e6) // 10_000 * 10_000
    spans = ((first, half), (half + pause, half + pause + int(seconds / 2 * 1e6)))
    for a, b in spans:
        for frame in bench.drive(a, b, names, source=source, slip=float(rng.uniform(0, 0.1))):
            kind = rng.random()
            t_us = frame.t_us + int(rng.integers(0, 4000)) * (rng.random() < shaky)
            data = bytearray(frame.data)
            if kind < 0.01:
                continue
            if kind < 0.02:
                data[int(rng.integers(0, 8))] ^= 1 << int(rng.integers(0, 8))
            elif kind < 0.025:
                data = data[:5]
            elif kind < 0.03:
                items.append(frame)  # twice
            elif kind < 0.035:
                items.append(Mark(t_us, ADVANCE))
            elif kind < 0.037:
                items.append(Mark(t_us + int(rng.integers(-5000, 5000)), SECOND_SENDER))
            elif kind < 0.0375:
                items.append(Mark(t_us, STOP))
            elif kind < 0.045:
                t_us += int(rng.integers(-30_000, 30_000))
            elif kind < 0.05:
                items.append(Frame(t_us, 0x7A0, b"foreign"))
            elif kind < 0.053:
                items.append(Frame(t_us, 0x201, bytes(8)))
            elif kind < 0.056:
                items.append(Frame(t_us, 0x101, b"", is_remote=True))
            elif kind < 0.058:
                items.append(Frame(t_us, 4, b"", is_error=True))
            elif kind < 0.0585:
                bench.counts[str(rng.choice(list(bench.counts)))] = int(rng.integers(0, 15))
            elif kind < 0.0595:
                t_us += 10**9  # a broken stamp
            items.append(Frame(max(t_us, 0), frame.arbitration_id, bytes(data)))
        source = int(rng.choice([source, 1, 4, 3]))
    return items


def without_strays(items, report):
    """The items less those with a stamp is far ahead, one by one."""
    detector, suspect = _StrayDetector(report), None
    for item in items:
        suspect_is_valid, valid = detector.add(item.t_us)
        if suspect is not None and suspect_is_valid:
            yield suspect
        suspect = None if valid else item
        if valid:
            yield item
    if suspect is not None:
        yield suspect


@pytest.mark.costly
@settings(max_examples=10, derandomize=True)
@given(st.integers(0, 2**32), st.integers(0, 8))
def test_spoiled_drives_give_the_same_bytes(seed, cuts):
    items = list(without_strays(spoiled(seed), ReadReport()))
    assert_same(items, cuts=cuts, seed=seed)


@pytest.mark.parametrize("span", [(0.5, 1.2), (0.0, 0.0), (1.0, None), (99.0, None)])
def test_a_part_of_a_recording_gives_the_same_bytes(span):
    assert_same(spoiled(5), from_s=span[0], to_s=span[1])


@settings(max_examples=60, derandomize=True)
@given(st.lists(st.sampled_from([0, 1, 10**6, 61 * 10**6, -(10**6), -70 * 10**6]), max_size=30),
       st.integers(0, 4))  # fmt: skip
def test_broken_stamps_are_found_in_blocks_too(steps, cuts):
    stamps = np.cumsum([10**9, *steps]).tolist()
    items = [Frame(t, n, b"") for n, t in enumerate(stamps)]
    rng = np.random.default_rng(len(steps))
    one, other = ReadReport(), ReadReport()
    expected = list(without_strays(items, one))
    blocks = list(_without_strays(blocks_of(items, rng, cuts), other))
    assert [item for block in blocks for item in block.items()] == expected
    assert (other.kinds, other.notes) == (one.kinds, one.notes)
