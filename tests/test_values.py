"""Copies of objects with a state: what the general deep copy makes, and values shared."""

from collections import deque
from copy import deepcopy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.values import Stateful, Value


@dataclass(frozen=True)
class Point(Value):
    x: float


class Pair(NamedTuple):
    one: object
    two: object


class Box(Stateful):
    """Holds whatever it is given."""

    def __init__(self, **items):
        vars(self).update(items)


ATOMS = st.one_of(st.integers(), st.floats(allow_nan=False), st.text(max_size=3), st.none())
TREES = st.recursive(
    ATOMS,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(st.text(max_size=2), inner, max_size=3),
        st.tuples(inner, inner),
        st.lists(inner, max_size=3).map(lambda items: deque(items, maxlen=5)),
        st.sets(st.integers(), max_size=3),
    ),
    max_leaves=12,
)


def spoil(tree):
    """Change every container within a tree that can be changed."""
    if isinstance(tree, dict):
        for item in tree.values():
            spoil(item)
        tree["spoilt"] = True
    elif isinstance(tree, list | deque | tuple):
        for item in tree:
            spoil(item)
        if not isinstance(tree, tuple):
            tree.append("spoilt")
    elif isinstance(tree, set):
        tree.add("spoilt")


@given(TREES)
def test_a_copy_is_what_the_general_copy_is_and_does_not_follow_the_original(tree):
    box = Box(tree=tree)
    expected, copied = deepcopy(tree), deepcopy(box)
    assert type(copied) is Box
    assert copied.tree == expected
    spoil(box.tree)
    assert copied.tree == expected
    if isinstance(expected, deque):
        assert copied.tree.maxlen == expected.maxlen


def test_what_two_attributes_share_two_attributes_of_the_copy_share():
    shared, inner = [1, [2]], Box(numbers=[3])
    box = Box(one=shared, other={"same": shared}, first=inner, second=inner)
    twin = deepcopy(box)
    assert twin.one is twin.other["same"] is not shared
    assert twin.first is twin.second is not inner


def test_an_object_that_holds_itself_is_copied_once():
    box = Box()
    box.own = [box]
    twin = deepcopy(box)
    assert twin.own[0] is twin is not box


def test_values_are_shared_and_arrays_are_copied():
    point, array = Point(1.0), np.arange(3)
    box = Box(point=point, points=(point, point), queue=deque([point], maxlen=2), array=array)
    twin = deepcopy(box)
    assert twin.point is point
    assert twin.points is box.points
    assert twin.queue is not box.queue
    assert twin.queue[0] is point
    array[0] = 9
    assert twin.array.tolist() == [0, 1, 2]


def test_named_tuples_are_shared_where_nothing_in_them_changes():
    numbers, lists = Pair(1.0, Point(2.0)), Pair(1.0, [2.0])
    twin = deepcopy(Box(numbers=numbers, lists=lists))
    assert twin.numbers is numbers
    assert type(twin.lists) is Pair
    assert twin.lists == lists
    assert twin.lists.two is not lists.two


def test_rows_of_numbers_are_shared_and_rows_of_lists_are_copied():
    numbers = deque([Pair(1.0, None), (2, "m")], maxlen=3)
    lists = [Pair(1.0, [2.0])]
    twin = deepcopy(Box(numbers=numbers, lists=lists))
    assert twin.numbers == numbers
    assert twin.numbers is not numbers
    assert all(a is b for a, b in zip(twin.numbers, numbers, strict=True))
    lists[0].two.append(3.0)
    assert twin.lists == [Pair(1.0, [2.0])]


def test_an_array_that_two_attributes_hold_is_copied_once_with_its_order():
    array = np.asfortranarray(np.arange(6.0).reshape(2, 3))
    twin = deepcopy(Box(first=array, second=[array]))
    assert twin.first is twin.second[0] is not array
    assert twin.first.flags.f_contiguous
    assert np.array_equal(twin.first, array)


def test_objects_in_an_array_are_copied_too():
    array = np.array([[1.0], None], dtype=object)
    twin = deepcopy(Box(array=array))
    array[0].append(2.0)
    assert twin.array[0] == [1.0]
