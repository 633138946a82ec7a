"""Effects and estimators of other distributions: what is taken, and what is refused and how."""

import importlib.metadata
import sys
from dataclasses import dataclass, replace
from types import ModuleType, SimpleNamespace

import pytest

from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.errors import ConfigError, InputError, PluginError
from adhesion_can.estimation.registry import ESTIMATORS, estimator_by_name, known_estimators
from adhesion_can.physics.effects import (
    EFFECTS,
    Change,
    Observability,
    Parameter,
    Requirements,
    effect_by_id,
    effect_position,
    known_effects,
    registry,
)
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.plugins import load_plugins
from adhesion_can.simulation.effect_option import parse_effects

CACHES = (known_effects, registry._positions, known_estimators)


@dataclass(frozen=True)
class Halved:
    """An effect as somebody else may write it."""

    id: str = "halved"
    form: str = ""
    title: str = "adhesion is lost"
    parameters: tuple = (Parameter("share", "1", 0.5, 0.0, 0.9, "share lost"),)
    literature: str = "nobody"
    requires: Requirements = Requirements()
    observability: Observability = Observability()

    def change(self, contact, values, _lags):
        return Change(contact.slip, 1.0 - values[0])


@pytest.fixture
def installed(monkeypatch):
    """Installs objects as entry points: (group, name, object, distribution)."""
    module = ModuleType("somebody_elses")
    monkeypatch.setitem(sys.modules, "somebody_elses", module)
    points = []

    def install(group, name, value, distribution="somebody"):
        setattr(module, name, value)
        point = importlib.metadata.EntryPoint(name, f"somebody_elses:{name}", group)
        vars(point).update(dist=SimpleNamespace(name=distribution))
        points.append(point)

    def entry_points(group):
        return [point for point in points if point.group == group]

    monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)
    for cache in CACHES:
        cache.cache_clear()
    yield install
    monkeypatch.undo()
    for cache in CACHES:
        cache.cache_clear()


@pytest.mark.parametrize("offered", [Halved, Halved()], ids=["class", "object"])
def test_an_effect_comes_after_the_built_in_ones_and_is_found_by_its_id(installed, offered):
    installed("adhesion_can.effects", "any_name", offered)
    assert known_effects() == (*EFFECTS, Halved())
    assert effect_by_id("halved") == Halved()
    assert effect_position(Halved()) == len(EFFECTS)
    assert [effect_position(effect) for effect in EFFECTS] == list(range(len(EFFECTS)))


def test_effects_stand_in_the_order_of_their_distributions(installed):
    installed("adhesion_can.effects", "a", Halved(id="of_zoe"), "zoe")
    installed("adhesion_can.effects", "b", Halved(id="of_adam"), "adam")
    assert [effect.id for effect in known_effects()[len(EFFECTS) :]] == ["of_adam", "of_zoe"]


class NoMethod:
    change = None

    def __getattr__(self, name):
        return getattr(Halved(), name)


@pytest.mark.parametrize(
    ("offered", "what"),
    [
        (Halved(id="humidity"), "an effect 'humidity' exists already"),
        (replace(Halved(), id="load_dependence", form="power"), "dependence power' exists"),
        (Halved(id="Halved!"), "its 'id' must consist of lower case letters"),
        (Halved(title=None), "its 'title' is not of type str"),
        (Halved(requires=("speed",)), "its 'requires' is not of type Requirements"),
        (Halved(observability="speed"), "its 'observability' is not of type Observability"),
        (Halved(parameters=()), "its 'parameters' must be one Parameter or more"),
        (Halved(parameters=("share",)), "its 'parameters' must be one Parameter or more"),
        (
            Halved(parameters=(Parameter("share", "1", 0.5, 0.1, 0.9, "share"),)),
            "its size, 'share', must allow 0",
        ),
        (NoMethod(), "it needs a method 'change' or 'amend'"),
        ("humidity", "its 'id' is not of type str"),
    ],
)
def test_what_is_no_effect_is_refused_with_the_name_of_its_distribution(installed, offered, what):
    installed("adhesion_can.effects", "theirs", offered, "bad-effects")
    with pytest.raises(PluginError, match=what) as caught:
        known_effects()
    assert caught.value.where == "bad-effects: entry point 'theirs' of adhesion_can.effects"
    assert "uninstall" in caught.value.fix


def test_a_module_that_cannot_be_imported_is_named(installed, monkeypatch):
    installed("adhesion_can.effects", "theirs", Halved())
    monkeypatch.delitem(sys.modules, "somebody_elses")
    with pytest.raises(PluginError, match=r"somebody: .* cannot be loaded .ModuleNotFoundError"):
        load_plugins("adhesion_can.effects")


def test_a_broken_distribution_is_one_line_of_the_command(installed, capsys):
    installed("adhesion_can.effects", "theirs", Halved(id="sanding"), "bad-effects")
    assert main(["simulate", "--help"]) == 2
    error = capsys.readouterr().err.strip()
    assert error.startswith("adhesion-can: bad-effects: entry point 'theirs'")
    assert "\n" not in error


def test_an_effect_over_a_channel_that_is_not_simulated_is_refused(installed):
    leaves = Halved(requires=Requirements(covariates=("leaf_film", "leaf_cover")))
    installed("adhesion_can.effects", "theirs", leaves)
    with pytest.raises(InputError, match="leaf_film or leaf_cover, which is not simulated"):
        parse_effects(["halved"], Locomotive())


def test_an_estimator_is_made_by_its_name(installed):
    made = []

    def make(settings):
        made.append(settings)
        return ESTIMATORS["rls"](settings)

    installed("adhesion_can.estimators", "theirs", make)
    config = load_configuration(None)
    assert type(config.make_estimator("theirs")) is type(config.make_estimator("rls"))
    load = config.vehicle.axle_load[0]
    instruments = config.estimators.instruments.on_load(load)
    assert made == [replace(config.estimators, instruments=instruments)]
    assert [*known_estimators()] == [*ESTIMATORS, "theirs"]
    with pytest.raises(ConfigError, match="gradient, theirs"):
        config.make_estimator("nobodys")


@pytest.mark.parametrize(
    ("name", "offered", "what"),
    [("paper", lambda _: None, "'paper' exists already"), ("theirs", 3, "cannot be called")],
)
def test_what_is_no_estimator_is_refused(installed, name, offered, what):
    installed("adhesion_can.estimators", name, offered)
    with pytest.raises(PluginError, match=what):
        known_estimators()
    assert estimator_by_name("tracker") is ESTIMATORS["tracker"]  # which asks nobody
