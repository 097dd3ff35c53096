"""modelDescription.xml and buildDescription.xml of an FMU."""

import math
import xml.etree.ElementTree as xml
from collections.abc import Iterable, Sequence

from smc_mujoco.common.version import __version__
from smc_mujoco.control.units import Unit
from smc_mujoco.exchange.fmu.contents import OUTPUTS, ExportedLaw, Variable

# Kind of joint -> units of force and position: name, exponents of the base units.
JOINT_UNITS = {
    "hinge": (("N.m", {"kg": 1, "m": 2, "s": -2}), ("rad", {"rad": 1})),
    "slide": (("N", {"kg": 1, "m": 1, "s": -2}), ("m", {"m": 1})),
}
# Kind of variable -> causality, variability, initial.
VARIABLE_ROLES = {
    "SMC_CLOCK": ("independent", "continuous", None),
    "SMC_INPUT": ("input", "discrete", None),
    "SMC_COMPUTED": ("local", "discrete", "calculated"),
    "SMC_PARAMETER": ("parameter", "tunable", "exact"),
    "SMC_CONSTANT": ("local", "constant", "exact"),
    "SMC_STATE": ("local", "discrete", "exact"),
}


def unit_name(unit: Unit, joint: str) -> str:
    """Return the name of a unit in FMI, such as N.m.s/rad."""
    (force, _), (position, _) = JOINT_UNITS[joint]
    powers = {force: unit.force, position: unit.position, "s": unit.time}
    above = [_power(name, n) for name, n in powers.items() if n > 0.0]
    below = []
    for name, n in powers.items():
        if n < 0.0:
            below.append(_power(f"({name})" if "." in name else name, -n))
    return "/".join([".".join(above) or "1", *below])


def _power(name: str, n: float) -> str:
    """Return a unit to a power."""
    if n == 1.0:
        return name
    if "." in name:
        return f"({name})^{n:g}"
    return f"{name}^{n:g}"


def base_units(unit: Unit, joint: str) -> dict[str, int] | None:
    """Return SI base unit -> its exponent in a unit; None if an exponent is not whole."""
    (_, force), (_, position) = JOINT_UNITS[joint]
    powers: dict[str, float] = {}
    for parts, n in ((force, unit.force), (position, unit.position), ({"s": 1}, unit.time)):
        for name, exponent in parts.items():
            powers[name] = powers.get(name, 0.0) + n * exponent
    if any(n != int(n) for n in powers.values()):
        return None
    return {name: int(n) for name, n in powers.items() if n}


def model_description(
    listed: Sequence[Variable], exported: ExportedLaw, identifier: str, token: str, joint: str
) -> str:
    """Return modelDescription.xml of an FMU for Co-Simulation, with the units of a hinge or a
    slide.
    """
    root = xml.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=exported.law.name,
        instantiationToken=token,
        description=summary(exported),
        generationTool=f"smc_mujoco {__version__}",
        license="use without restriction, without warranty; the headers of FMI under the 2-clause "
        "BSD licence",
        variableNamingConvention="structured",
    )
    xml.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=identifier,
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        canHandleVariableCommunicationStepSize="true",
        hasEventMode="true",
        fixedInternalStepSize=repr(exported.period),
    )
    units = xml.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(v.unit for v in listed if v.unit is not None and any(v.unit)):
        definition = xml.SubElement(units, "Unit", name=unit_name(unit, joint))
        if (base := base_units(unit, joint)) is not None:
            xml.SubElement(definition, "BaseUnit", {name: str(n) for name, n in base.items()})
    categories = xml.SubElement(root, "LogCategories")
    xml.SubElement(categories, "Category", name="error", description="why a call failed")
    xml.SubElement(
        root, "DefaultExperiment", startTime="0.0", stopTime="10.0", stepSize=repr(exported.period)
    )
    variables = xml.SubElement(root, "ModelVariables")
    structure = xml.SubElement(root, "ModelStructure")
    for reference, variable in enumerate(listed):
        variables.append(_variable(reference, variable, joint))
    outputs = [str(reference) for reference, variable in enumerate(listed) if is_output(variable)]
    for element in ("Output", "InitialUnknown"):
        for reference in outputs:
            xml.SubElement(structure, element, valueReference=reference)
    return written(root)


def is_output(variable: Variable) -> bool:
    """Return whether a variable is u, s or an actuator's control, or an element of u or s."""
    return variable.name.partition("[")[0] in (*OUTPUTS, "control")


def _variable(reference: int, variable: Variable, joint: str) -> xml.Element:
    """Return the element of a variable."""
    causality, variability, initial = VARIABLE_ROLES[variable.kind]
    about = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.description,
    }
    about |= {
        "causality": "output" if is_output(variable) else causality,
        "variability": variability,
    }
    if initial is not None:
        about["initial"] = initial
    if variable.unit is not None and any(variable.unit):
        about["unit"] = unit_name(variable.unit, joint)
    if math.isfinite(variable.minimum):
        about["min"] = repr(variable.minimum)
    if variable.kind not in ("SMC_CLOCK", "SMC_COMPUTED"):
        about["start"] = repr(variable.start)
    return xml.Element("Float64", about)


def build_description(files: Iterable[str], identifier: str) -> str:
    """Return buildDescription.xml, by which an importer compiles the sources."""
    root = xml.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = xml.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    sources = xml.SubElement(
        configuration,
        "SourceFileSet",
        language="C99",
        compiler="gcc",
        compilerOptions="-ffp-contract=off",
    )
    for name in files:
        xml.SubElement(sources, "SourceFile", name=name)
    xml.SubElement(
        configuration,
        "Library",
        name="m",
        external="true",
        description="the C library's mathematics",
    )
    return written(root)


def written(root: xml.Element) -> str:
    """Return an XML element as the text of a file."""
    xml.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{xml.tostring(root, encoding="unicode")}\n'


def summary(exported: ExportedLaw) -> str:
    """Return the controller in one line."""
    parts = [f"law {exported.law}"]
    if exported.surface:
        parts.append(f"surface {exported.surface}")
    if exported.estimator:
        parts.append(f"velocity estimator {exported.estimator}")
    return f"Sliding-mode controller: {', '.join(parts)}; every {exported.period:g} s"
