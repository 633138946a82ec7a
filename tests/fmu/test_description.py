"""modelDescription.xml says of the variables what they are."""

from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest

from adhesion_can.bus.roles import SignalChoice
from adhesion_can.config import load_configuration
from adhesion_can.errors import InputError
from adhesion_can.fmu.contents import KINDS, FmuContents
from adhesion_can.fmu.description import UNITS, describe
from adhesion_can.fmu.export import describe_contents
from adhesion_can.fmu.variables import Causality, Variable
from adhesion_can.physics.channels import UserChannel
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.readings import Role
from adhesion_can.version import __version__


@pytest.fixture(scope="module")
def config():
    return load_configuration()


def parsed(contents):
    return ET.fromstring(describe_contents(contents, contents.make_slave())[0])  # noqa: S314  our own


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("integers", [False, True])
def test_references_structure_and_starts(config, kind, integers):
    root = parsed(FmuContents(kind, config, integers=integers))
    variables = root.findall("ModelVariables/ScalarVariable")
    assert [one.get("valueReference") for one in variables] == [
        str(n) for n in range(len(variables))
    ]
    assert len({one.get("name") for one in variables}) == len(variables)
    outputs = [str(n) for n, one in enumerate(variables, 1) if one.get("causality") == "output"]
    assert outputs
    for name in ("Outputs", "InitialUnknowns"):
        rows = root.findall(f"ModelStructure/{name}/Unknown")
        assert [row.get("index") for row in rows] == outputs
    for one in variables:
        is_output = one.get("causality") == "output"
        assert ("start" in one[0].attrib) is not is_output, one.get("name")
        assert one.get("description")
        unit = one[0].get("unit")
        assert unit is None or unit in {u.get("name") for u in root.iter("Unit")}
    kinds = {one[0].tag for one in variables}
    assert ("Enumeration" in kinds) is not integers
    assert (root.find("TypeDefinitions") is None) is integers
    assert root.find("CoSimulation").get("needsExecutionTool") == "true"
    assert f"Python 3.11 or later with adhesion-can {__version__}" in root.get("description")


def test_items_of_an_enumeration_are_those_of_the_bus(config):
    root = parsed(FmuContents("service", config))
    doubt = root.find("TypeDefinitions/SimpleType[@name='Doubt']/Enumeration")
    assert {item.get("name"): int(item.get("value")) for item in doubt} == {
        one.name: one.value for one in Doubt
    }


def test_the_guid_follows_the_description(config):
    contents = FmuContents("service", config)
    slave = contents.make_slave()
    text, guid = describe_contents(contents, slave)
    assert (text, guid) == describe_contents(contents, slave)
    assert f'guid="{guid}"' in text
    variables = slave.variables
    others = [
        describe("service", variables[:-1], 0.01, {}),
        describe("service", (*variables[:-1], replace(variables[-1], unit="m")), 0.01, {}),
        describe("service", variables, 0.02, {}),
        describe("controller", variables, 0.01, {}),
        describe("service", variables, 0.01, {"model": "0"}),
        describe("service", variables, 0.01, {}),
    ]
    assert len({one for _, one in others} | {guid}) == len(others) + 1


def test_a_channel_of_the_users_is_an_input_with_its_unit(config):
    channel = UserChannel("wind speed", "furlong/h", "wind <head>")
    choice = SignalChoice(Role.CHANNEL, 1, "Environment", "RailTemperature")
    rich = replace(config, channels=(channel,), choices=(*config.choices, choice))
    root = parsed(FmuContents("service", rich))
    (one,) = root.findall("ModelVariables/ScalarVariable[@name='channel_wind speed']")
    assert one.get("causality") == "input"
    assert one.get("description") == "wind <head>"
    assert one[0].get("unit") == "furlong/h"


def test_units_have_the_factors_of_the_si(config):
    used = {
        one.unit
        for kind in KINDS
        for one in FmuContents(kind, config).make_slave().variables
        if one.unit
    }
    assert used <= set(UNITS)
    assert UNITS["N"] == {"kg": "1", "m": "1", "s": "-2"}


def test_infinite_and_missing_starts_are_spelt_as_xml_schema_has_them():
    ends = {"a": float("inf"), "b": -float("inf"), "c": float("nan"), "d": 0.1}
    variables = [Variable(name, Causality.INPUT, name, "", x) for name, x in ends.items()]
    root = ET.fromstring(describe("service", variables, 0.01, {})[0])  # noqa: S314  our own
    found = [one.get("start") for one in root.iter("Real")]
    assert found == ["INF", "-INF", "NaN", "0.1"]


def test_the_controller_takes_no_model(config):
    model = object()
    contents = FmuContents("controller", replace(config, model=model))
    with pytest.raises(InputError, match="the controller uses no model"):
        contents.make_slave()
