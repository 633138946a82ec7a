"""Samples as columns: from rows, together, selected, folded."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.physics.burckhardt import adhesion
from adhesion_can.physics.estimate import Identifiable
from adhesion_can.physics.readings import Role
from adhesion_can.physics.samples import NO_SAMPLES, Sample, Samples

FIXED = settings(derandomize=True, deadline=None, max_examples=50)
INTEGERS = ("t_us", "axle", "speed_us")
FLOATS = [f.name for f in dataclasses.fields(Sample) if f.name not in {*INTEGERS, "covariates"}]

ROWS = st.lists(
    st.builds(
        Sample,
        t_us=st.integers(0, 2**60),
        axle=st.integers(1, 6),
        speed_us=st.integers(0, 2**60),
        **{name: st.floats(-1e6, 1e6) for name in FLOATS},
        covariates=st.dictionaries(st.sampled_from("abc"), st.floats(-1, 1)),
    ),
    max_size=8,
)


def rows_of(samples: Samples) -> list[Sample]:
    return [
        Sample(
            **{name: int(getattr(samples, name)[k]) for name in INTEGERS},
            **{name: float(getattr(samples, name)[k]) for name in FLOATS},
            covariates={name: float(column[k]) for name, column in samples.covariates.items()},
        )
        for k in range(len(samples))
    ]


def common(rows: list[Sample]) -> list[Sample]:
    names = set.intersection(*(set(r.covariates) for r in rows)) if rows else set()
    return [
        dataclasses.replace(r, covariates={n: r.covariates[n] for n in sorted(names)}) for r in rows
    ]


def test_columns_have_the_names_of_the_rows():
    names = [f.name for f in dataclasses.fields(Sample)]
    assert [f.name for f in dataclasses.fields(Samples)] == names


@FIXED
@given(ROWS)
def test_columns_hold_the_rows_and_the_covariates_that_all_carry(rows):
    columns = Samples.from_rows(iter(rows))
    assert len(columns) == len(rows)
    assert columns.t_us.dtype == columns.axle.dtype == np.int64
    assert columns.slip.dtype == np.float64
    assert rows_of(columns) == common(rows)


@FIXED
@given(st.lists(ROWS, min_size=1, max_size=4))
def test_concatenation_is_that_of_the_rows(parts):
    whole = Samples.concatenate([Samples.from_rows(part) for part in parts])
    assert rows_of(whole) == common([row for part in parts for row in common(part)])


def test_empty_parts_take_no_covariates_away_and_all_empty_is_empty():
    full = Samples.from_rows([Sample(1, 1, 0.1, 0.2, 1, 10, 2e5, covariates={"rain": 1.0})])
    empty = Samples.from_rows([])
    for parts in ([empty, full], [full, empty], [empty, full, empty]):
        assert list(Samples.concatenate(parts).covariates) == ["rain"]
    nothing = Samples.concatenate([empty, empty])
    assert len(nothing) == 0
    assert nothing.t_us.dtype == np.int64
    h, z = nothing.folded()
    assert h.shape == z.shape == (0,)


@FIXED
@given(ROWS, st.data())
def test_selection_is_that_of_the_rows(rows, data):
    columns, known = Samples.from_rows(rows), common(rows)
    mask = np.array(
        data.draw(st.lists(st.booleans(), min_size=len(rows), max_size=len(rows))), bool
    )
    assert rows_of(columns.select(mask)) == [r for r, keep in zip(known, mask, strict=True) if keep]
    cut = data.draw(st.integers(0, len(rows)))
    assert rows_of(columns.select(slice(cut, None))) == known[cut:]
    assert rows_of(columns.select(np.arange(len(rows))[::-1])) == known[::-1]


def test_folding_lays_braking_on_traction():
    slips = np.linspace(0.001, 0.3, 50)
    mu = adhesion(slips, 0.4, 60.0, 0.3)
    both = Samples.curve(np.concatenate([slips, -slips]), np.concatenate([mu, -mu]))
    h, z = both.folded()
    assert (h >= 0).all()
    assert np.array_equal(h[:50], h[50:])
    assert np.array_equal(z[:50], z[50:])
    assert np.array_equal(z[:50], mu)


def test_folding_keeps_a_force_against_the_slip_negative():
    # Not |μ|: an offset that turns the force round must show, not vanish.
    h, z = Samples.curve(np.array([0.01, -0.01]), np.array([-0.05, 0.05])).folded()
    assert z.tolist() == [-0.05, -0.05]
    assert h.tolist() == [0.01, 0.01]


def test_curve_has_consistent_columns():
    samples = Samples.curve([0.1, 0.2], [0.3, 0.4])
    for f in dataclasses.fields(Samples):
        if f.name != "covariates":
            assert len(getattr(samples, f.name)) == 2
    assert samples.t_us.dtype == np.int64
    assert (samples.load > 0).all()
    # They are exact.
    errors = ("load_std", "slip_var", "adhesion_var", "slip_common_var", "transient_var")
    for name in errors:
        assert (getattr(samples, name) == 0).all()
    row = Sample(0, 1, 0.1, 0.3, 1.0, 10.0, 245e3)
    assert [getattr(row, name) for name in errors] == [0.0] * 5


def test_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Samples.from_rows([]).slip = np.zeros(3)


@pytest.mark.parametrize("mu", [False, True])
@pytest.mark.parametrize("lam", [False, True])
def test_both_is_both(mu, lam):
    assert Identifiable(mu, lam).both is (mu and lam)


def test_roles_per_axle_are_the_contracts():
    assert {role for role in Role if role.per_axle} == {
        Role.WHEEL_SPEED,
        Role.TRACTIVE_EFFORT,
        Role.AXLE_LOAD,
    }


def test_rows_become_columns_and_the_same_rows_again():
    rows = [
        Sample(1, 1, 0.1, 0.2, 1.0, 10.0, 2e5, speed_us=3, covariates={"rain": 1.0}),
        Sample(2, 4, -0.1, -0.2, -1.0, 10.0, 2e5, slip_var=1e-6, covariates={"rain": 0.5}),
    ]
    assert Samples.from_rows(rows).to_rows() == rows
    assert NO_SAMPLES.to_rows() == []


def test_samples_equal_where_all_their_columns_do():
    row = Sample(1, 1, 0.1, 0.2, 1.0, 10.0, 2e5, covariates={"rain": 1.0})
    one = Samples.from_rows([row])
    assert one.equals(Samples.from_rows([row]))
    for other in (
        [],
        [row, row],
        [dataclasses.replace(row, axle=2)],
        [dataclasses.replace(row, speed_share=0.5)],
        [dataclasses.replace(row, covariates={})],
        [dataclasses.replace(row, covariates={"rain": 0.9})],
    ):
        assert not one.equals(Samples.from_rows(other))


def test_loads_that_were_not_measured_are_a_common_relative_error():
    samples = dataclasses.replace(
        Samples.curve(np.full(8, 0.01), np.full(8, 0.2)),
        load=np.full(8, 2e5),
        load_std=np.full(8, 4e3),
    )
    assert samples.load_common_std == pytest.approx(0.02)
    half = dataclasses.replace(samples, load_std=np.repeat([0.0, 4e3], 4))
    assert half.load_common_std == pytest.approx(0.02 / np.sqrt(2))
    assert NO_SAMPLES.load_common_std == 0.0
