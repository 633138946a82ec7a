"""The description of an FMU, modelDescription.xml, from a slave's variables (FMI 2.0)."""

from collections.abc import Mapping, Sequence
from hashlib import sha256
from itertools import pairwise
from math import isinf, isnan
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from adhesion_can.fmu.variables import Causality, Variable, VariableType
from adhesion_can.version import __version__

UNITS: Mapping[str, Mapping[str, str]] = {
    "1": {},
    "%": {"factor": "0.01"},
    "m/m": {},
    "s": {"s": "1"},
    "m/s": {"m": "1", "s": "-1"},
    "rad/s": {"rad": "1", "s": "-1"},
    "N": {"kg": "1", "m": "1", "s": "-2"},
    "1/m": {"m": "-1"},
    "degC": {"K": "1", "offset": "273.15"},
}
"""Exponents of the base units, factor and offset of the units that FMI can compare."""
ABOUT = {
    "service": "Identifies the wheel/rail adhesion curve from wheel speeds, vehicle speed and "
    "tractive effort, and gives the creep setpoint",
    "locomotive": "A simulated locomotive on rails whose adhesion changes, with noisy sensors",
    "controller": "A reference creep controller: efforts from speeds and the service's setpoints",
}
"""What each kind of FMU does."""
NEEDS = (
    f"The target needs Python 3.11 or later with adhesion-can {__version__}; the environment "
    "variable ADHESION_CAN_PYTHON names its interpreter"
)
CATEGORY = "logStatusError"
"""Category of the messages to the host's logger."""


def model_identifier(kind: str) -> str:
    """Name of the FMU's library without its suffix."""
    return f"adhesion_can_{kind}"


def describe(
    kind: str, variables: Sequence[Variable], step_s: float, origin: Mapping[str, str]
) -> tuple[str, str]:
    """The description, and its GUID.

    Args:
        kind: Kind of the FMU.
        variables: Variables by their value references.
        step_s: Step to take where the master has no other, s.
        origin: What the FMU was made of, by name: hashes of its configuration, database and model.

    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=f"adhesion-can {kind}",
        guid="",
        description=f"{ABOUT[kind]}. {NEEDS}.",
        version=__version__,
        license="MIT",
        generationTool=f"adhesion-can {__version__}",
        variableNamingConvention="flat",
        numberOfEventIndicators="0",
    )
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model_identifier(kind),
        needsExecutionTool="true",
        canHandleVariableCommunicationStepSize="true",
        canInterpolateInputs="false",
        maxOutputDerivativeOrder="0",
        canRunAsynchronuously="false",
        canBeInstantiatedOnlyOncePerProcess="false",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="false",
        canSerializeFMUstate="false",
        providesDirectionalDerivative="false",
    )
    _add_units(root, variables)
    _add_types(root, variables)
    SubElement(SubElement(root, "LogCategories"), "Category", name=CATEGORY)
    stop_s = next((variable.start for variable in variables if variable.name == "duration"), 60.0)
    SubElement(
        root,
        "DefaultExperiment",
        startTime="0",
        stopTime=_number(stop_s),
        stepSize=_number(step_s),
    )
    tool = SubElement(SubElement(root, "VendorAnnotations"), "Tool", name="adhesion-can")
    origins = SubElement(tool, "Origins")  # FMI allows one element in a tool's annotation
    for name, text in origin.items():
        SubElement(origins, "Origin", name=name, sha256=text)
    _add_variables(root, variables)
    _add_structure(root, variables)
    indent(root)
    digest = sha256(tostring(root)).hexdigest()
    cuts = (0, 8, 12, 16, 20, 32)
    guid = "-".join(digest[a:b] for a, b in pairwise(cuts))
    root.set("guid", f"{{{guid}}}")
    text = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n', f"{{{guid}}}"


def _add_units(root: Element, variables: Sequence[Variable]) -> None:
    used = dict.fromkeys(variable.unit for variable in variables if variable.unit)
    if not used:
        return
    units = SubElement(root, "UnitDefinitions")
    for name in used:
        unit = SubElement(units, "Unit", name=name)
        if name in UNITS:  # a unit of the user's has its name alone
            SubElement(unit, "BaseUnit", dict(UNITS[name]))


def _add_types(root: Element, variables: Sequence[Variable]) -> None:
    used = dict.fromkeys(variable.enumeration for variable in variables if variable.enumeration)
    if not used:
        return
    types = SubElement(root, "TypeDefinitions")
    for kind in used:
        items = SubElement(SubElement(types, "SimpleType", name=kind.name), "Enumeration")
        for name, number, meaning in kind.items:
            SubElement(items, "Item", name=name, value=str(number), description=meaning)


def _add_variables(root: Element, variables: Sequence[Variable]) -> None:
    parent = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        is_real = variable.type is VariableType.REAL
        variability = "continuous" if is_real else "discrete"
        scalar = SubElement(
            parent,
            "ScalarVariable",
            name=variable.name,
            valueReference=str(reference),
            description=variable.description,
            causality=variable.causality.value,
            variability="fixed" if variable.causality is Causality.PARAMETER else variability,
        )
        value = SubElement(scalar, variable.type.value)
        if variable.enumeration is not None:
            value.set("declaredType", variable.enumeration.name)
        if variable.unit:
            value.set("unit", variable.unit)
        if variable.causality is Causality.OUTPUT:
            scalar.set("initial", "calculated")
        elif variable.type is VariableType.BOOLEAN:
            value.set("start", "true" if variable.start else "false")
        elif is_real:
            value.set("start", _number(variable.start))
        else:
            value.set("start", str(int(variable.start)))


def _add_structure(root: Element, variables: Sequence[Variable]) -> None:
    """Outputs depend on no input of the same time; their first values on the parameters."""
    structure = SubElement(root, "ModelStructure")
    places = {
        causality: [n for n, variable in enumerate(variables, 1) if variable.causality is causality]
        for causality in Causality
    }
    parameters = " ".join(map(str, places[Causality.PARAMETER]))
    for name, dependencies in (("Outputs", ""), ("InitialUnknowns", parameters)):
        unknowns = SubElement(structure, name)
        for place in places[Causality.OUTPUT]:
            SubElement(unknowns, "Unknown", index=str(place), dependencies=dependencies)


def _number(value: float) -> str:
    """A number as XML Schema spells it."""
    if isnan(value):
        return "NaN"
    if isinf(value):
        return "INF" if value > 0.0 else "-INF"
    return repr(value)
