"""The controller that an FMU contains: its variables and its C.

The variables are numbers in one array, in the order of their value references: time, inputs, outputs, intermediate
results, parameters, the control period, and the memories of law, surface and estimator. `fmu.c` knows the array and
nothing of the law. `controller.c` computes, like the callback,

    estimator -> surface -> law -> saturation
"""

import dataclasses
import math
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from smc_mujoco.control.component import Component, at
from smc_mujoco.control.estimator import Estimator
from smc_mujoco.control.law import Law
from smc_mujoco.control.surface import Surface
from smc_mujoco.control.units import ACCELERATION, FORCE, INPUT_GAIN, POSITION, SPEED, TIME, Unit
from smc_mujoco.exchange.c import export
from smc_mujoco.exchange.c.translate import JOINTS, plain
from smc_mujoco.simulation.controller import MAX_CONTROL

UNBOUNDED = sys.float_info.max  # stands for infinity, because not every importer reads INF

# Input -> its unit and description, in the order of the variables.
INPUTS: dict[str, tuple[Unit | None, str]] = {
    "x": (POSITION, "measured position"),
    "v": (SPEED, "measured velocity"),
    "r": (POSITION, "reference"),
    "dr": (SPEED, "first derivative of the reference"),
    "ddr": (ACCELERATION, "second derivative of the reference"),
    "f": (ACCELERATION, "nominal f of x'' = f + g u, at the measured x and v"),
    "g": (INPUT_GAIN, "nominal g of x'' = f + g u, at the measured x and v"),
    "q": (None, "measured position of the joint without actuator that this one moves"),
    "dq": (None, "velocity of the joint without actuator"),
    "fq": (None, "nominal fq of q'' = fq + gq u"),
    "gq": (None, "nominal gq of q'' = fq + gq u"),
}
STARTS = {"g": 1.0, "gq": 1.0}  # values of inputs before they are set: laws divide by these; 0 for all others
ALWAYS = ("x", "r", "dr")  # inputs of every FMU
OUTPUTS = ("u", "s")
SYMBOLS = (  # names that the linker sees
    "smc_law", "smc_surface", "smc_estimator", "smc_controller", "smc_variables", "smc_law_gains", "smc_law_memory",
    "smc_law_real", "smc_law_degree", "smc_law_modelled", "smc_law_shared",
)  # fmt: skip


# In C, the rest of a function that returns where there is no model.
UNREACHED = re.compile(r"(if \(\w+->model == 0\.0\) \{\s*return [^;]*;\s*\}).*?^\}", re.MULTILINE | re.DOTALL)


class Variable(NamedTuple):
    """A variable of the FMU.

    Attributes:
      name: in modelDescription.xml.
      kind: a smc_kind of smc_fmu.h, such as SMC_INPUT.
      description: in words.
      unit: None if it has none, or if that is unknown.
      start: its value at the start.
      least: the smallest value that can be set; -inf for any value.
      positive: whether it must be greater than 0.
    """

    name: str
    kind: str
    description: str
    unit: Unit | None = None
    start: float = 0.0
    least: float = -math.inf
    positive: bool = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class Controller:
    """A law with all that it needs to control one joint, or many.

    Attributes:
      law, surface, estimator: components; None for the law's own surface, or a measured velocity.
      period: control period, s.
      u_max: bound on |u| of each joint; may be infinite.
      modelled: whether the law reads the nominal model.
      joints: how many joints a law of many joints has; 0 for a law of one channel.
    """

    law: Law
    surface: Surface | None
    estimator: Estimator | None
    period: float
    u_max: tuple[float, ...]
    modelled: bool
    joints: int = 0

    @property
    def parts(self) -> dict[str, Component]:
        """Kind -> component, without those that are None."""
        parts = {"law": self.law, "surface": self.surface, "estimator": self.estimator}
        return {kind: part for kind, part in parts.items() if part is not None}

    def code(self) -> dict[str, tuple[int, str]]:
        """Return kind -> number of memory slots, and C code, of each component.

        Raises:
          ScenarioError: a component uses Python that cannot be translated into C.
        """
        return {
            kind: export.translated(part, joints=self.joints if kind == "law" else 0)
            for kind, part in self.parts.items()
        }


def variables(controller: Controller, code: Mapping[str, tuple[int, str]]) -> list[Variable]:
    """Return the variables in the order of their value references. `code` is `controller.code()`."""
    reached = code.values() if controller.modelled else [(n, UNREACHED.sub(r"\1", text)) for n, text in code.values()]
    wanted = {*ALWAYS, *_needed(controller, code, reads(reached))}
    inputs = [
        Variable(name, "SMC_INPUT", words, unit, STARTS.get(name, 0.0))
        for name, (unit, words) in INPUTS.items()
        if name in wanted
    ]
    computed = [
        Variable("u", "SMC_COMPUTED", "command, within u_max", FORCE),
        Variable("s", "SMC_COMPUTED", "sliding variable"),
    ]
    if controller.surface:
        computed.append(Variable("v_eq", "SMC_COMPUTED", "acceleration of the error that keeps s constant"))
    if controller.estimator:
        computed.append(Variable("v_estimated", "SMC_COMPUTED", "estimated velocity", SPEED))
    parameters = [bounded("u_max", controller.u_max[0])]
    for kind, part in controller.parts.items():
        parameters += [parameter(kind, part, name, value) for name, value in part.gains.items()]
    period = Variable("dt", "SMC_CONSTANT", "control period: the law runs this often", TIME, controller.period)
    memory = [
        Variable(f"{kind}.memory[{i + 1}]", "SMC_STATE", f"number {i + 1} of the memory of the {kind}")
        for kind, (slots, _) in code.items()
        for i in range(slots)
    ]
    time = Variable("time", "SMC_CLOCK", "time", TIME)
    return [time, *inputs, *computed, *parameters, period, *memory]


def _needed(controller: Controller, code: Mapping[str, tuple[int, str]], read: set[str]) -> Iterator[str]:
    """Yield the inputs that the components read, in addition to ALWAYS. `read` are the fields of y in their C."""
    if controller.estimator is None or "v" in reads([code["estimator"]]):
        yield "v"
    if read & {"a", "ddr"}:  # a is ddr if no estimator gives it
        yield "ddr"
    if controller.modelled:
        yield from read & {"f", "g", "fq", "gq"}
    yield from read & {"q", "dq"}


def reads(code: Iterable[tuple[int, str]]) -> set[str]:
    """Return the fields of the measurement that some functions read."""
    return {name for _, text in code for name in re.findall(r"->(\w+)", text)}  # a function may call it other than y


def bounded(name: str, bound: float) -> Variable:
    """Return the parameter that bounds the magnitude of a command."""
    start = bound if math.isfinite(bound) else UNBOUNDED
    return Variable(name, "SMC_PARAMETER", "bound on the magnitude of u", FORCE, start, 0.0, True)


def parameter(kind: str, part: Component, name: str, value: float, index: str = "") -> Variable:
    """Return a gain of a component, or its element for one joint, such as "[1]", as a parameter."""
    gain = part.template.gains[name] if part.template and name in part.template.gains else None
    unit = gain.unit_at({key: at(one, 0) for key, one in part.gains.items()}) if gain else None
    positive = bool(gain and gain.positive)
    least = 0.0 if gain and (gain.positive or gain.nonnegative) else -math.inf
    limits = ", greater than 0" if positive else ", at least 0" if least == 0.0 else ""
    finite = value if math.isfinite(value) else math.copysign(UNBOUNDED, value)
    words = f"gain {name} of the {kind} {part.name}{limits}"
    return Variable(f"{kind}.{plain(name)}{index}", "SMC_PARAMETER", words, unit, finite, least, positive)


# C


def place(variable: str) -> str:
    """Return the name, in C, of a variable's index in the array."""
    return "SMC_AT_" + re.sub(r"\W", "_", variable)


def header(listed: Sequence[Variable], controller: Controller, identifier: str, token: str) -> str:
    """Return controller.h: the sizes, and the indices of the variables in their array.

    Args:
      listed: the variables in order.
      identifier: name of the model in C.
      token: the instantiation token.
    """
    memory = next((i for i, one in enumerate(listed) if one.kind == "SMC_STATE"), len(listed))
    lines = [
        "/* controller.h: sizes of this controller, and the indices of its variables. */",
        "#ifndef SMC_CONTROLLER_H",
        "#define SMC_CONTROLLER_H",
        "",
        "/* own names, so that several FMUs can be linked into one program */",
        *(f"#define {name} {identifier}_{name}" for name in SYMBOLS),
        "",
        *([f"#define {JOINTS} {controller.joints}"] if controller.joints else []),
        '#include "smc_fmu.h"',
        "",
        f'#define SMC_TOKEN "{token}"',
        f"#define SMC_DT {controller.period!r} /* s */",
        f"#define SMC_TIME {place('time')}",
        "enum {",
        *(f"    {place(one.name)}," for one in listed),
        "    SMC_VARIABLES,",
        f"    SMC_MEMORY = {memory} /* the first variable that outlives a sample */",
        "};",
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)


def source(listed: Sequence[Variable], helpers: Iterable[str], body: Iterable[str]) -> str:
    """Return controller.c: the table of variables, and the function that runs all parts at a sample.

    Args:
      helpers: lines of functions before that one.
      body: its statements, without indentation.
    """
    lines = [
        "/* controller.c: estimator, surface, law and saturation, in the order of smc_mujoco's own runs. */",
        '#include "controller.h"',
        "",
        "#include <float.h>",
        "#include <math.h>",
        "#include <stddef.h>",
        "",
        "const smc_variable smc_variables[] = {",
        *(
            f'    {{"{one.name}", {one.kind}, {one.start!r}, {_c_number(one.least)}, {int(one.positive)}}},'
            for one in listed
        ),
        "};",
        "",
        "/* Returns a gain or a bound. The largest double means that there is none. */",
        "static double number(double x)",
        "{",
        "    return x >= DBL_MAX ? INFINITY : x <= -DBL_MAX ? -INFINITY : x;",
        "}",
        "",
        *helpers,
        "int smc_controller(double *value, double t)",
        "{",
        *(f"    {line}" for line in body),
        "}",
        "",
    ]
    return "\n".join(lines)


def helpers(controller: Controller, code: Mapping[str, tuple[int, str]]) -> Iterator[str]:
    """Yield the lines of functions that the law calls: there are none."""
    yield from ()


def body(listed: Sequence[Variable], controller: Controller, code: Mapping[str, tuple[int, str]]) -> Iterator[str]:
    """Yield the statements of smc_controller, without indentation."""
    found = {one.name: f"value[{place(one.name)}]" for one in listed}
    for kind, part in controller.parts.items():
        yield f"const double {kind}_gains[] = {{"
        yield from (f"    number({found[f'{kind}.{plain(name)}']})," for name in part.gains)
        yield from ("    0.0,",) if not part.gains else ()
        yield "};"
        memory = "&" + found[f"{kind}.memory[1]"] if code[kind][0] else "NULL"
        yield f"double *{kind}_memory = {memory};"
    yield "smc_measurement y = {0};"
    if controller.estimator:
        yield f"const smc_reading reading = {{SMC_DT, {found['x']}, {found.get('v', '0.0')}}};"
    yield "double out[2];"
    yield "int failure;"
    yield f"y.t = t, y.dt = SMC_DT, y.limit = number({found['u_max']}), y.model = {float(controller.modelled)!r};"
    yield f"y.r = {found['r']}, y.dr = {found['dr']}, y.ddr = y.a = {found.get('ddr', '0.0')};"
    for name in ("f", "g"):
        yield f"y.{name} = {found.get(name, 'NAN')};"
    for name in ("q", "dq", "fq", "gq"):
        if name in found:
            yield f"y.{name} = {found[name]};"
    yield f"y.x = {found['x']};"
    if controller.estimator:
        yield from _call("estimator", "&reading")
        yield f"y.v = {found['v_estimated']} = out[0];"
        yield "if (!isnan(out[1])) y.a = out[1];"
    else:
        yield f"y.v = {found['v']};"
    yield "y.e = y.x - y.r, y.de = y.v - y.dr;"
    if controller.surface:
        yield from _call("surface", "&y")
        yield f"y.has_surface = 1.0, y.s = out[0], y.v_eq = {found['v_eq']} = out[1];"
    yield from _call("law", "&y")
    yield f"{found['u']} = fmin(fmax(out[0], -y.limit), y.limit);"
    yield f"{found['s']} = out[1];"
    yield f"return isfinite(out[0]) && isfinite(out[1]) && fabs({found['u']}) < {MAX_CONTROL!r} ? 0 : SMC_NOT_FINITE;"


def _call(kind: str, measured: str) -> Iterator[str]:
    """Yield the call of a component, and the return if it fails. `measured` is its first argument in C."""
    yield f"failure = smc_{kind}({measured}, {kind}_gains, {kind}_memory, out);"
    yield "if (failure) return failure;"


def _c_number(value: float) -> str:
    """Return a number in C."""
    return repr(value) if math.isfinite(value) else "-INFINITY" if value < 0.0 else "INFINITY"


def component_file(component: Component, slots: int, text: str) -> str:
    """Return the C file of a surface or an estimator, with its number of memory slots and its C code."""
    title = f"/* {component.name}: {component.kind}, with {slots} numbers of memory. */"
    names = export.gain_names(component)
    parts = [title, *export.includes(text), '#include "controller.h"', "", *names, "", text, ""]
    return "\n".join(parts)


def law_file(controller: Controller, slots: int, text: str) -> str:
    """Return the C file of the law: that of `export-c`, without the size of its code, which depends on the compiler."""
    written = export.with_head(controller.law, "double", slots, text, controller.joints, measured=False)
    return f'#include "controller.h"\n{written}'
