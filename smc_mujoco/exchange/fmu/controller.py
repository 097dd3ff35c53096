"""The controller that an FMU contains: its variables and its C.

The variables are numbers in one array, in the order of their value references: time, inputs, outputs, intermediate
results, parameters, the control period, and the memories of law, surface and estimator. `fmu.c` knows the array and
nothing of the law. `controller.c` computes, like the callback,

    estimator -> surface -> law -> saturation
"""

import dataclasses
import functools
import math
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from smc_mujoco.control.component import Component
from smc_mujoco.control.estimator import Estimator
from smc_mujoco.control.law import Law
from smc_mujoco.control.surface import Surface
from smc_mujoco.control.units import ACCELERATION, FORCE, INPUT_GAIN, POSITION, SPEED, TIME, Unit
from smc_mujoco.exchange.c import export
from smc_mujoco.exchange.c.translate import plain
from smc_mujoco.simulation.controller import MAX_CONTROL

MAX_DOUBLE = sys.float_info.max  # stands for infinity, because not every importer reads INF

INPUTS: dict[str, tuple[Unit | None, str]] = {  # input -> its unit and description, in the order of the variables
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
MODEL_INPUTS = {"f", "g", "fq", "gq"}  # of the nominal model
REQUIRED_INPUTS = ("x", "r", "dr")  # inputs of every FMU
OUTPUTS = ("u", "s")
SYMBOLS = (  # names that the linker sees
    "smc_law", "smc_surface", "smc_estimator", "smc_controller", "smc_variables", "smc_law_gains", "smc_law_memory",
    "smc_law_real", "smc_law_degree", "smc_law_modelled",
)  # fmt: skip
# In C, the rest of a function that returns where there is no model.
UNREACHED = re.compile(r"(if \(\w+->model == 0\.0\) \{\s*return [^;]*;\s*\}).*?^\}", re.MULTILINE | re.DOTALL)


class Variable(NamedTuple):
    """A variable of the FMU."""

    name: str  # in modelDescription.xml
    kind: str  # a smc_kind of smc_fmu.h, such as SMC_INPUT
    description: str  # in words
    unit: Unit | None = None  # None if it has none, or if that is unknown
    start: float = 0.0
    minimum: float = -math.inf  # the smallest value that can be set
    positive: bool = False  # whether it must be greater than 0


@dataclasses.dataclass(frozen=True, kw_only=True)
class Controller:
    """A law with all that it needs to control a joint."""

    law: Law
    surface: Surface | None  # None: the law's own
    estimator: Estimator | None  # None: a measured velocity
    period: float  # control period, s
    u_max: float  # bound on |u|; may be infinite
    modelled: bool  # whether the law reads the nominal model

    @property
    def parts(self) -> dict[str, Component]:
        """Kind -> component, without those that are None."""
        parts = {"law": self.law, "surface": self.surface, "estimator": self.estimator}
        return {kind: part for kind, part in parts.items() if part is not None}

    @functools.cached_property
    def code(self) -> dict[str, tuple[int, str]]:
        """Kind -> number of memory slots, and C code, of each component."""
        return {kind: export.translated(part) for kind, part in self.parts.items()}


def variables(controller: Controller) -> list[Variable]:
    """Return the variables in the order of their value references."""
    wanted = inputs(controller)
    listed = [Variable("time", "SMC_CLOCK", "time", TIME)]
    for name, (unit, words) in INPUTS.items():
        if name in wanted:
            start = float(name in ("g", "gq"))  # laws divide by these two
            listed.append(Variable(name, "SMC_INPUT", words, unit, start))
    listed.append(Variable("u", "SMC_COMPUTED", "command, within u_max", FORCE))
    listed.append(Variable("s", "SMC_COMPUTED", "sliding variable"))
    if controller.surface:
        listed.append(Variable("v_eq", "SMC_COMPUTED", "acceleration of the error that keeps s constant"))
    if controller.estimator:
        listed.append(Variable("v_estimated", "SMC_COMPUTED", "estimated velocity", SPEED))
    bound = controller.u_max if math.isfinite(controller.u_max) else MAX_DOUBLE
    listed.append(Variable("u_max", "SMC_PARAMETER", "bound on the magnitude of u", FORCE, bound, 0.0, True))
    for kind, part in controller.parts.items():
        listed += [parameter(kind, part, name, value) for name, value in part.gains.items()]
    listed.append(Variable("dt", "SMC_CONSTANT", "control period: the law runs this often", TIME, controller.period))
    for kind, (slots, _) in controller.code.items():
        words = f"of the memory of the {kind}"
        listed += [Variable(f"{kind}.memory[{k}]", "SMC_STATE", f"number {k} {words}") for k in range(1, slots + 1)]
    return listed


def inputs(controller: Controller) -> set[str]:
    """Return the names of the inputs that the components read."""
    texts = [text if controller.modelled else UNREACHED.sub(r"\1", text) for _, text in controller.code.values()]
    read, wanted = reads("".join(texts)), {*REQUIRED_INPUTS}
    if controller.estimator is None or "v" in reads(controller.code["estimator"][1]):
        wanted.add("v")
    if read & {"a", "ddr"}:  # a is ddr if no estimator gives it
        wanted.add("ddr")
    if controller.modelled:
        wanted |= read & MODEL_INPUTS
    return wanted | (read & {"q", "dq"})


def reads(code: str) -> set[str]:
    """Return the fields of the measurement that some functions read."""
    return set(re.findall(r"->(\w+)", code))  # a function may call the measurement other than y


def parameter(kind: str, part: Component, name: str, value: float) -> Variable:
    """Return a gain of a component as a parameter."""
    gain = part.template.gains[name] if part.template and name in part.template.gains else None
    unit = gain.unit_at(part.gains) if gain else None
    positive = bool(gain and gain.positive)
    minimum = 0.0 if gain and (gain.positive or gain.nonnegative) else -math.inf
    limits = ", greater than 0" if positive else ", at least 0" if minimum == 0.0 else ""
    finite = value if math.isfinite(value) else math.copysign(MAX_DOUBLE, value)
    words = f"gain {name} of the {kind} {part.name}{limits}"
    return Variable(f"{kind}.{plain(name)}", "SMC_PARAMETER", words, unit, finite, minimum, positive)


# C


def place(variable: str) -> str:
    """Return the name, in C, of a variable's index in the array."""
    return "SMC_AT_" + re.sub(r"\W", "_", variable)


def header(listed: Sequence[Variable], controller: Controller, identifier: str, token: str) -> str:
    """Return controller.h: the sizes, and the indices of the variables. `identifier`: the model's name in C."""
    memory = next((i for i, variable in enumerate(listed) if variable.kind == "SMC_STATE"), len(listed))
    own_names = "\n".join(f"#define {name} {identifier}_{name}" for name in SYMBOLS)
    indices = "\n".join(f"    {place(variable.name)}," for variable in listed)
    return f"""/* controller.h: sizes of this controller, and the indices of its variables. */
#ifndef SMC_CONTROLLER_H
#define SMC_CONTROLLER_H

/* own names, so that several FMUs can be linked into one program */
{own_names}

#include "smc_fmu.h"

#define SMC_TOKEN "{token}"
#define SMC_DT {controller.period!r} /* s */
#define SMC_TIME {place("time")}
enum {{
{indices}
    SMC_VARIABLES,
    SMC_MEMORY = {memory} /* the first variable that outlives a sample */
}};

#endif
"""


def source(listed: Sequence[Variable], body: Iterable[str]) -> str:
    """Return controller.c: the variables, and a function with the statements `body`."""
    limits = {0.0: "0.0", -math.inf: "-INFINITY"}
    lines = (f'"{v.name}", {v.kind}, {v.start!r}, {limits[v.minimum]}, {int(v.positive)}' for v in listed)
    table = "\n".join(f"    {{{line}}}," for line in lines)
    statements = "\n".join(f"    {line}" for line in body)
    return f"""/* controller.c: estimator, surface, law and saturation, in the order of smc_mujoco's own runs. */
#include "controller.h"

#include <float.h>
#include <math.h>
#include <stddef.h>

const smc_variable smc_variables[] = {{
{table}
}};

/* Returns a gain or a bound. The largest double means that there is none. */
static double number(double x)
{{
    return x >= DBL_MAX ? INFINITY : x <= -DBL_MAX ? -INFINITY : x;
}}

int smc_controller(double *value, double t)
{{
{statements}
}}
"""


def body(controller: Controller) -> Iterator[str]:
    """Yield the statements of smc_controller, without indentation."""
    wanted = inputs(controller)

    def value(name: str, absent: str = "0.0") -> str:
        return absent if name in INPUTS and name not in wanted else f"value[{place(name)}]"

    for kind, part in controller.parts.items():
        yield f"const double {kind}_gains[] = {{"
        yield from (f"    number({value(f'{kind}.{plain(name)}')})," for name in part.gains)
        yield from ("    0.0,",) if not part.gains else ()
        yield "};"
        first = f"&{value(f'{kind}.memory[1]')}" if controller.code[kind][0] else "NULL"
        yield f"double *{kind}_memory = {first};"
    yield "smc_measurement y = {0};"
    yield "double out[2];"
    yield "int failure;"
    yield f"y.t = t, y.dt = SMC_DT, y.model = {float(controller.modelled)!r};"
    yield f"y.limit = number({value('u_max')});"
    yield f"y.x = {value('x')}, y.r = {value('r')}, y.dr = {value('dr')};"
    yield f"y.ddr = y.a = {value('ddr')};"
    if controller.estimator:
        yield f"const smc_reading reading = {{SMC_DT, y.x, {value('v')}}};"
        yield from _call("estimator", "&reading")
        yield f"y.v = {value('v_estimated')} = out[0];"
        yield "if (!isnan(out[1])) y.a = out[1];"
    else:
        yield f"y.v = {value('v')};"
    yield "y.e = y.x - y.r, y.de = y.v - y.dr;"
    yield f"y.f = {value('f', 'NAN')}, y.g = {value('g', 'NAN')};"
    yield f"y.q = {value('q')}, y.dq = {value('dq')}, y.fq = {value('fq')}, y.gq = {value('gq')};"
    if controller.surface:
        yield from _call("surface", "&y")
        yield f"y.has_surface = 1.0, y.s = out[0], y.v_eq = {value('v_eq')} = out[1];"
    yield from _call("law", "&y")
    yield "const double u = fmin(fmax(out[0], -y.limit), y.limit), s = out[1];"
    yield f"{value('u')} = u, {value('s')} = s;"
    yield f"if (!(isfinite(out[0]) && isfinite(s) && fabs(u) < {MAX_CONTROL!r})) return SMC_NOT_FINITE;"
    yield "return 0;"


def _call(kind: str, measured: str) -> Iterator[str]:
    """Yield the call of a component, and the return if it fails. `measured`: its first argument, in C."""
    yield f"failure = smc_{kind}({measured}, {kind}_gains, {kind}_memory, out);"
    yield "if (failure) return failure;"


def component_file(component: Component, slots: int, text: str) -> str:
    """Return the C file of a surface or an estimator, with its number of memory slots and its C code."""
    title = f"/* {component.name}: {component.kind}, with {slots} numbers of memory. */"
    head = [title, *export.includes(text), '#include "controller.h"', "", *export.gain_names(component)]
    return "\n".join([*head, "", text, ""])
