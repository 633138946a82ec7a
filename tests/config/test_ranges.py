"""Every number and every list of the configuration has a range, and holds at both of its ends."""

import tracemalloc
from dataclasses import fields
from math import inf, nextafter
from types import UnionType
from typing import get_args, get_origin, get_type_hints

import numpy as np
import pytest

from adhesion_can.config import Configuration, load_configuration
from adhesion_can.config import load as load_module
from adhesion_can.config.roles_section import _RoleTable
from adhesion_can.config.table_section import _ColumnTable
from adhesion_can.config.toml_tables import nested_sections, section_keys
from adhesion_can.config.vehicle_section import AXLES, GEOMETRY, PER_AXLE, WHOLE_VEHICLE
from adhesion_can.errors import ConfigError
from adhesion_can.physics.vehicle import Geometry, Locomotive
from adhesion_can.ranges import Range, range_of
from adhesion_can.service.core import ServiceCore
from tests.wire import Bench

MOST_BYTES = 512 << 20
"""What a service may allocate with any configuration that loads."""
ROLE = 'roles."wheel_speed.1"'
CLASSES = {
    "vehicle": (Locomotive, PER_AXLE | WHOLE_VEHICLE),
    "vehicle.geometry": (Geometry, GEOMETRY),
    ROLE: (_RoleTable, None),
    "table.slip": (_ColumnTable, None),
    **{name: (kind, None) for name, kind in nested_sections(Configuration)},
}
"""Class of each section, and the fields by key where they differ."""
NEEDED = {ROLE: 'signal = "WheelSpeeds1.WheelSpeed_Ax1"\n', "table.slip": 'column = "kappa"\n'}
"""Keys that a section must have beside the one that is looked at."""
BESIDE = {
    ("run_length", "hypotheses", "lowest"): "dense = 1\n",
    ("run_length", "dense", "highest"): "hypotheses = 1000\n",
    ("evolution", "upper", "lowest"): "lower = [0, 0, 0]\n",
    ("evolution", "theta0", "lowest"): "lower = [0, 0, 0]\n",
    ("evolution", "theta0", "highest"): "upper = [10, 1e5, 1000]\n",
    ("limits", "speed_max", "lowest"): "speed_min = 0.01\n",
}
"""Keys without which a value at an end of its range contradicts the default of another key."""
CONTRADICTIONS = {
    ("vehicle.geometry", "axles_per_bogie", "lowest"): "not given, for bogies of 1 axles",
    ("vehicle.geometry", "axles_per_bogie", "highest"): "not given, for bogies of 64, 64, 64",
    ("evolution", "lower", "highest"): "each lower bound must be below its upper bound",
    ("limits", "speed_min", "highest"): "speed_max must be above speed_min",
    (ROLE, "factor", "zero"): "0 makes every value 0",
}
"""Values within their range that contradict another key whatever that one says, and the reason."""


def annotations():
    """(section, key, annotation) of every key."""
    for section, (kind, names) in CLASSES.items():
        hints = get_type_hints(kind, include_extras=True)
        for key, name in (names or {key: key for key in section_keys(kind)}).items():
            yield section, key, hints[name]
    yield "vehicle", "axles", AXLES


def bare(annotation):
    """Type without its range, and without 'or None'."""
    while get_origin(annotation) is UnionType or hasattr(annotation, "__metadata__"):
        annotation = get_args(annotation)[0]
    return annotation


def numeric(annotation):
    kind = bare(annotation)
    kinds = get_args(kind) if get_origin(kind) is tuple else (kind,)
    return kinds[0] in {int, float}


NUMBERS = [key for key in annotations() if numeric(key[2])]
ENDS = [(*key, end) for key in NUMBERS for end in ("lowest", "highest")]


@pytest.fixture(autouse=True)
def one_database(monkeypatch):
    """The packaged database, read once for all files."""
    database = load_configuration().database if not _database else _database[0]
    _database[:] = [database]
    monkeypatch.setattr(load_module, "load_database", lambda *_, **__: database)


_database = []


def value_at(annotation, end):
    """Value at an end of its range: all numbers of a list there, and as many as it may have."""
    found, kind = range_of(annotation), bare(annotation)
    numbers = [getattr(within, end) for within in found.each]
    if found.length is not None:
        return numbers * (found.length.least if end == "lowest" else found.length.most)
    if get_origin(kind) is tuple:
        return numbers if len(numbers) > 1 else numbers * len(get_args(kind))
    return numbers[0] if kind is int else float(numbers[0])


def written(value):
    if isinstance(value, list):
        return f"[{', '.join(map(written, value))}]"
    return str(value).lower() if isinstance(value, bool) else repr(value)


def load(folder, section, key, text, beside=""):
    path = folder / "my.toml"
    more = NEEDED.get(section, "") + beside
    path.write_text(f"[{section}]\n{more}{key} = {text}\n", encoding="utf-8")
    return load_configuration(path)


def refusal(folder, section, key, text):
    with pytest.raises(ConfigError) as caught:
        load(folder, section, key, text)
    line = str(caught.value)
    assert "\n" not in line
    assert len(line) < 500
    return line


def name(given):
    return ".".join(str(part) for part in given if isinstance(part, str))


def test_every_number_and_every_list_of_any_length_has_a_range():
    for section, key, annotation in NUMBERS:
        found, kind = range_of(annotation), bare(annotation)
        assert found.each, f"{section}.{key}"
        assert all(-inf < one.lowest < one.highest < inf for one in found.each)
        if get_origin(kind) is tuple:
            of_any_length = get_args(kind)[-1] is Ellipsis
            assert (found.length is not None) is of_any_length, f"{section}.{key}"
            assert len(found.each) in {1, len(get_args(kind))}


@pytest.mark.costly
@pytest.mark.parametrize("given", ENDS, ids=name)
def test_a_value_at_an_end_serves_within_bounds_of_memory(given, tmp_path):
    section, key, annotation, end = given
    value = value_at(annotation, end)
    if (section, key, end) in CONTRADICTIONS:
        assert CONTRADICTIONS[section, key, end] in refusal(tmp_path, section, key, written(value))
        return
    config = load(tmp_path, section, key, written(value), BESIDE.get((section, key, end), ""))
    if section == ROLE:
        return  # one role alone serves nobody
    tracemalloc.start()
    try:
        core, bench = ServiceCore(config, config.make_estimator), Bench()
        with np.errstate(all="ignore"):
            for frame in bench.drive(0, 300_000):
                core.feed(frame)
                core.advance(frame.t_us)
        assert tracemalloc.get_traced_memory()[1] < MOST_BYTES
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("given", ENDS, ids=name)
def test_a_value_beyond_an_end_is_an_error_with_key_value_and_range(given, tmp_path):
    section, key, annotation, end = given
    side, kind = (-1 if end == "lowest" else 1), bare(annotation)
    value = value_at(annotation, end)
    numbers = value if isinstance(value, list) else [value]
    is_whole = int in (get_args(kind) or (kind,))
    beyond = [x + side if is_whole else nextafter(float(x), side * inf) for x in numbers]
    text = written(beyond if isinstance(value, list) else beyond[0])
    line = refusal(tmp_path, section, key, text)
    within = range_of(annotation).each[0]
    assert key in line
    assert f"not within {within}" in line
    assert "write " in line


@pytest.mark.parametrize("given", [key for key in NUMBERS if range_of(key[2]).length], ids=name)
def test_a_list_too_short_or_too_long_is_an_error_with_its_length(given, tmp_path):
    section, key, annotation = given
    length, number = range_of(annotation).length, range_of(annotation).each[0].highest
    for count in (length.least - 1, length.most + 1, 100_000):
        line = refusal(tmp_path, section, key, written([number] * count))
        assert f"{count} values; write {length.least} to {length.most}" in line


@pytest.mark.parametrize("given", NUMBERS, ids=name)
def test_what_is_no_such_number_is_an_error_of_one_line(given, tmp_path):
    section, key, _ = given
    for text in ("nan", "inf", "-inf", "1e400", "true", '"1"', "[]", "[[1]]", "{}", str(2**63 - 1)):
        assert key in refusal(tmp_path, section, key, text)


@pytest.mark.parametrize("given", [key for key in NUMBERS if bare(key[2]) is float], ids=name)
def test_a_negative_zero_counts_as_zero(given, tmp_path):
    section, key, annotation = given
    (within,) = range_of(annotation).each
    if not within.lowest <= 0.0 <= within.highest:
        assert "not within" in refusal(tmp_path, section, key, "-0.0")
    elif (section, key, "zero") in CONTRADICTIONS:
        assert CONTRADICTIONS[section, key, "zero"] in refusal(tmp_path, section, key, "-0.0")
    else:
        load(tmp_path, section, key, "-0.0")


def test_a_long_value_is_cut_in_its_error(tmp_path):
    assert len(refusal(tmp_path, "tracker", "curves", written("x" * 10_000))) < 300


def test_the_examples_that_took_terabytes(tmp_path):
    assert "2000000000 is not within 64 .. 16384" in refusal(
        tmp_path, "tracker", "curves", "2000000000"
    )
    many = written([float(100_000 - i) for i in range(100_000)])
    assert "100000 values; write 1 to 16" in refusal(tmp_path, "memory", "times_s", many)


def test_a_program_that_builds_settings_keeps_to_the_same_ranges():
    with pytest.raises(ValueError, match=r"curves must be within 64 \.\. 16384, not 32"):
        type(load_configuration().estimators.tracker)(curves=32)


def test_a_range_is_written_with_all_digits_that_matter():
    assert str(range_of(int)) == str(Range()) == ""
    assert str(range_of(AXLES)) == "1 .. 64"
    assert {field.name for field in fields(Range)} == {"each", "length"}
