"""modelDescription.xml and buildDescription.xml of an FMU."""

import math
import xml.etree.ElementTree as xml
from collections.abc import Iterable, Sequence

from smc_mujoco.common.version import __version__
from smc_mujoco.exchange.fmu.contents import EXTRA_OUTPUTS, OUTPUTS, ExportedLaw, Variable

# Kind of variable -> causality, variability, initial.
VARIABLE_ROLES = {
    "SMC_CLOCK": ("independent", "continuous", None),
    "SMC_INPUT": ("input", "discrete", None),
    "SMC_COMPUTED": ("local", "discrete", "calculated"),
    "SMC_PARAMETER": ("parameter", "tunable", "exact"),
    "SMC_CONSTANT": ("local", "constant", "exact"),
    "SMC_STATE": ("local", "discrete", "exact"),
}


def model_description(
    listed: Sequence[Variable], exported: ExportedLaw, identifier: str, token: str
) -> str:
    """Return modelDescription.xml of an FMU for Co-Simulation."""
    root = xml.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=exported.law.name,
        instantiationToken=token,
        description=controller_line(exported),
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
    categories = xml.SubElement(root, "LogCategories")
    xml.SubElement(categories, "Category", name="error", description="why a call failed")
    xml.SubElement(
        root, "DefaultExperiment", startTime="0.0", stopTime="10.0", stepSize=repr(exported.period)
    )
    variables = xml.SubElement(root, "ModelVariables")
    structure = xml.SubElement(root, "ModelStructure")
    for reference, variable in enumerate(listed):
        variables.append(_variable(reference, variable))
    outputs = []
    for reference, variable in enumerate(listed):
        if is_output(variable):
            outputs.append(str(reference))
    for element in ("Output", "InitialUnknown"):
        for reference in outputs:
            xml.SubElement(structure, element, valueReference=reference)
    return written(root)


def is_output(variable: Variable) -> bool:
    """Return whether a variable is u, s or an actuator's control, or an element of u or s."""
    return variable.name.partition("[")[0] in (*OUTPUTS, *EXTRA_OUTPUTS)


def _variable(reference: int, variable: Variable) -> xml.Element:
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


def controller_line(exported: ExportedLaw) -> str:
    """Return the controller in one line."""
    parts = [f"law {exported.law}"]
    if exported.surface:
        parts.append(f"surface {exported.surface}")
    if exported.estimator:
        parts.append(f"velocity estimator {exported.estimator}")
    return f"Sliding-mode controller: {', '.join(parts)}; every {exported.period:g} s"
