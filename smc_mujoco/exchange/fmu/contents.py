"""The controller that an FMU contains: its variables and its C.

The variables are numbers in one array, in the order of their value references: time, inputs,
outputs, intermediate results, parameters, the control period, and the memories of law, surface and
estimator. `fmu.c` knows the array and nothing of the law. `controller.c` computes, like the
callback,

    estimator -> surface -> law -> saturation

With a law of many joints, every vector and matrix is one variable for each element, x[1], x[2],
M[1,1], M[1,2], counted from 1 as in FMI's structured names. The arrays of FMI 3.0 are not used,
because FMPy's `simulate_fmu` takes no inputs of several shapes. The elements follow each other in
the array of variables, so C reads them as an array.
"""

import itertools
import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.control.component import Component, gain_at
from smc_mujoco.control.estimator import Estimator
from smc_mujoco.control.law import Law
from smc_mujoco.control.surface import Surface
from smc_mujoco.exchange.c import compensation, export_c
from smc_mujoco.exchange.c.compensation import Compensate
from smc_mujoco.exchange.c.translation.c_text import c_name
from smc_mujoco.exchange.c.translation.values import JOINTS
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.model import mixer
from smc_mujoco.simulation.step import MAX_CONTROL

MAX_DOUBLE = sys.float_info.max  # stands for infinity, because not every importer reads INF

# Input -> its description, in the order of the variables: of every FMU, and of one channel
# or of many joints.
COMMON_INPUTS = {
    "x": "measured position, rad or m",
    "v": "measured velocity, rad/s or m/s",
    "r": "reference, rad or m",
    "dr": "first derivative of the reference",
    "ddr": "second derivative of the reference",
}
CHANNEL_INPUTS = {
    "f": "nominal f of x'' = f + g u, at the measured x and v",
    "g": "nominal g of x'' = f + g u, at the measured x and v",
    "q": "measured position of the joint without actuator that this one moves",
    "dq": "velocity of the joint without actuator",
    "fq": "nominal fq of q'' = fq + gq u",
    "gq": "nominal gq of q'' = fq + gq u",
}
JOINT_INPUTS = {
    "h": "nominal h of M x'' + h = u, at the measured x and v",
    "g": "nominal gravity and springs, at the measured x",
    "M": "nominal mass matrix of M x'' + h = u, at the measured x",
    "C": "nominal matrix of Coriolis forces C v, M' - 2 C skew-symmetric",
    "J": "nominal Jacobian of the tip, in the world: its velocity is J v",
}
# of the nominal model; C and J are what coriolis and jacobian need
MODEL_INPUTS = {"f", "g", "fq", "gq", "M", "h"}
OUTPUTS = ("u", "s")
EXTRA_OUTPUTS = ("control", "compensation")  # of some FMUs
SYMBOLS = (  # names that the linker sees
    "smc_law",
    "smc_surface",
    "smc_estimator",
    "smc_controller",
    "smc_variables",
    "smc_law_gains",
    "smc_law_memory",
    "smc_law_real",
    "smc_law_degree",
    "smc_law_modelled",
    "smc_law_shared",
    "smc_pose",
    "smc_errors",
    "smc_actuators",
    compensation.NAME,
)


class Variable(NamedTuple):
    """A variable of the FMU."""

    name: str  # in modelDescription.xml
    kind: str  # a smc_kind of smc_fmu.h, such as SMC_INPUT
    description: str  # in words
    start: float = 0.0
    minimum: float = -math.inf  # the smallest value that can be set
    positive: bool = False  # whether it must be greater than 0


@keyword_dataclass
class ExportedLaw:
    """A law with all that an FMU needs to control one joint, or many."""

    law: Law
    surface: Surface | None  # None: the law's own
    estimator: Estimator | None  # None: a measured velocity
    period: float  # control period, s
    u_max: tuple[float, ...]  # bound on |u| of each joint; may be infinite
    modelled: bool  # whether the law reads the nominal model
    joints: int = 0  # of a law of many joints; 0 for a law of one channel
    plant: Plant | None = None  # of a free body the law commands the actuators
    compensate: Compensate | None = None  # what is added to u
    leads: tuple[float, ...] = ()  # of the reference of each joint through a play, rad or m, if any
    eps: float = 0.0  # speed of the reference at which it leads by nearly all of it

    @property
    def places(self) -> tuple[str, ...]:
        """What follows the name of a quantity: "", or "[1]", "[2]", ... for each joint."""
        return tuple(f"[{i + 1}]" for i in range(self.joints)) or ("",)

    @property
    def parts(self) -> dict[str, Component]:
        """Kind -> component, without those that are None."""
        parts = {"law": self.law, "surface": self.surface, "estimator": self.estimator}
        present = {}
        for kind, part in parts.items():
            if part is not None:
                present[kind] = part
        return present

    @cached_property
    def code(self) -> dict[str, tuple[int, str]]:
        """Kind -> number of memory slots, and C code, of each component."""
        code = {}
        for kind, part in self.parts.items():
            if kind != "law":
                code[kind] = export_c.translated(part)
        of_law = export_c.translated(
            self.law,
            joints=self.joints,
            plant=self.plant,
            compensate=self.compensate,
            adds=False,
        )
        return {"law": of_law, **code}

    @property
    def actuators(self) -> int:
        """Number of actuators that it commands itself."""
        return len(mixer(self.plant)) if self.plant else 0

    @property
    def of_body(self) -> bool:
        """Whether the law is of a free body, whose errors are those of a pose."""
        return "smc_errors(" in self.code["law"][1]


def variables(exported: ExportedLaw) -> list[Variable]:
    """Return the variables in the order of their value references."""
    places = exported.places
    input_names = inputs(exported)
    listed = [Variable("time", "SMC_CLOCK", "time, s")]
    of_model = JOINT_INPUTS if exported.joints else CHANNEL_INPUTS
    for name, words in {**COMMON_INPUTS, **of_model}.items():
        if name in input_names:
            for index, start in _starts(name, exported).items():
                listed.append(Variable(name + index, "SMC_INPUT", words, start))
    computed = {"u": "command, within u_max, N or N m", "s": "sliding variable"}
    if exported.compensate:
        computed["compensation"] = "what compensates friction, a part of u before u_max, N or N m"
    if exported.surface:
        computed["v_eq"] = "acceleration of the error that keeps s constant"
    if exported.estimator:
        computed["v_estimated"] = "estimated velocity, rad/s or m/s"
    for name, words in computed.items():
        listed.extend(Variable(name + place, "SMC_COMPUTED", words) for place in places)
    for i in range(exported.actuators):
        words = "command of an actuator, for u"
        listed.append(Variable(f"control[{i + 1}]", "SMC_COMPUTED", words))
    words = "bound on the magnitude of u, N or N m"
    for place, bound in zip(places, exported.u_max, strict=True):
        start = min(bound, MAX_DOUBLE)
        listed.append(Variable(f"u_max{place}", "SMC_PARAMETER", words, start, 0.0, True))
    for kind, part in exported.parts.items():
        listed += _gains(kind, part, places if kind == "law" else ("",))
    words = "control period, s: the law runs this often"
    listed.append(Variable("dt", "SMC_CONSTANT", words, exported.period))
    for kind, (slots, _) in exported.code.items():
        listed += _memory(kind, slots, exported.joints)
    return listed


def _gains(kind: str, part: Component, places: Sequence[str]) -> Iterator[Variable]:
    """Yield the gains of a component, each for all places unless they share it."""
    for name, value in part.gains.items():
        indices = places
        if kind == "law" and name in part.shared:
            indices = ("",)
        for i, index in enumerate(indices):
            yield parameter(kind, part, name, gain_at(value, i), index)


def _memory(kind: str, slots: int, joints: int) -> Iterator[Variable]:
    """Yield the numbers of a component's memory, for each joint."""
    for i in range(max(1, joints)):
        for k in range(1, slots + 1):
            words = f"number {k} of the memory of the {kind}"
            index = str(k)
            if joints:
                words += f", joint {i + 1}"
                index = f"{i + 1},{k}"
            yield Variable(f"{kind}.memory[{index}]", "SMC_STATE", words)


def _starts(name: str, exported: ExportedLaw) -> dict[str, float]:
    """Return what follows the name of an input, of each element -> its value before it is set.

    It is 1 where laws divide by the input, as by g or the diagonal of M, else 0.
    """
    if name not in ("M", "C", "J"):
        return dict.fromkeys(exported.places, float(name in ("g", "gq") and not exported.joints))
    columns = range(1, exported.joints + 1)
    rows = {"J": range(1, 4)}.get(name, columns)
    starts = {}
    for i, j in itertools.product(rows, columns):
        starts[f"[{i},{j}]"] = float(name == "M" and i == j)
    return starts


def inputs(exported: ExportedLaw) -> set[str]:
    """Return the names of the inputs that the components read, without indices."""
    read = set[str]()
    for _, text in exported.code.values():
        read |= reads(text)
    names = {"x", "r", "dr"}
    if exported.estimator is None or "v" in reads(exported.code["estimator"][1]):
        names.add("v")
    if read & {"a", "ddr"}:  # a is ddr if no estimator gives it
        names.add("ddr")
    if exported.modelled:
        names |= read & MODEL_INPUTS
        if "coriolis" in read:
            names.add("C")
        if "jacobian" in read:
            names.add("J")
    return names | (read & {"q", "dq"})


def reads(code: str) -> set[str]:
    """Return the fields of the measurement that some functions read."""
    return set(re.findall(r"->(\w+)", code))  # a function may call the measurement other than y


def parameter(kind: str, part: Component, name: str, value: float, index: str = "") -> Variable:
    """Return a gain of a component, or its element for one joint, such as "[1]", as a parameter."""
    gain = part.template.gains.get(name) if part.template else None
    minimum = -math.inf
    limits = ""
    positive = False
    if gain:
        positive = gain.positive
        if gain.positive or gain.nonnegative:
            minimum = 0.0
            limits = ", greater than 0" if gain.positive else ", at least 0"
    finite = value if math.isfinite(value) else math.copysign(MAX_DOUBLE, value)
    words = f"gain {name} of the {kind} {part.name}{limits}"
    full = f"{kind}.{c_name(name)}{index}"
    return Variable(full, "SMC_PARAMETER", words, finite, minimum, positive)


# C


def index_name(variable: str) -> str:
    """Return the name, in C, of a variable's index in the array."""
    return "SMC_AT_" + re.sub(r"\W", "_", variable)


def header(listed: Sequence[Variable], exported: ExportedLaw, identifier: str, token: str) -> str:
    """Return controller.h: the sizes, and the indices of the variables.

    `identifier`: the model's name in C.
    """
    kinds = [variable.kind for variable in listed]
    memory = len(kinds) - kinds.count("SMC_STATE")
    own_names = "\n".join(f"#define {name} {identifier}_{name}" for name in SYMBOLS)
    joints = ""
    if exported.joints:
        joints = f"\n#define {JOINTS} {exported.joints}"
    indices = "\n".join(f"    {index_name(variable.name)}," for variable in listed)
    return f"""/* controller.h: sizes of this controller, and the indices of its variables. */
#ifndef SMC_CONTROLLER_H
#define SMC_CONTROLLER_H

/* own names, so that several FMUs can be linked into one program */
{own_names}
{joints}
#include "smc_fmu.h"

#define SMC_TOKEN "{token}"
#define SMC_DT {exported.period!r} /* s */
#define SMC_TIME {index_name("time")}
enum {{
{indices}
    SMC_VARIABLES,
    SMC_MEMORY = {memory} /* the first variable that outlives a sample */
}};

#endif
"""


def controller_source(listed: Sequence[Variable], helpers: str, body: Iterable[str]) -> str:
    """Return controller.c: the variables, the functions `helpers`, and a last one with the
    statements `body`.
    """
    limits = {0.0: "0.0", -math.inf: "-INFINITY"}
    table = ""
    for v in listed:
        numbers = f"{v.start!r}, {limits[v.minimum]}, {int(v.positive)}"
        table += f'    {{"{v.name}", {v.kind}, {numbers}}},\n'
    statements = "".join(f"    {line}\n" for line in body)
    return f"""/* controller.c: estimator, surface, law and saturation, in the order of a run. */
#include "controller.h"

#include <float.h>
#include <math.h>
#include <stddef.h>

const smc_variable smc_variables[] = {{
{table}}};

/* Returns a gain or a bound. The largest double means that there is none. */
static double number(double x)
{{
    return x >= DBL_MAX ? INFINITY : x <= -DBL_MAX ? -INFINITY : x;
}}

{helpers}int smc_controller(double *value, double t)
{{
{statements}}}
"""


def helpers(exported: ExportedLaw) -> str:
    """Return the C functions that a law of many joints calls: coriolis, for C(x, v) w, and
    jacobian.
    """
    input_names = inputs(exported)
    needs = reads(exported.code["law"][1])
    functions = ""
    if "coriolis" in needs:
        matrix = "(void)plant, (void)w"
        add = ""
        if "C" in input_names:
            matrix = f"const double *C = (const double *)plant + {index_name('C[1,1]')}"
            term = "out[i] += C[i * SMC_JOINTS + j] * w[j];"
            add = f"\n        for (int j = 0; j < SMC_JOINTS; j++) {term}"
        functions += f"""/* out = C w */
static void coriolis(void *plant, const double *w, double *out)
{{
    {matrix};
    for (int i = 0; i < SMC_JOINTS; i++) {{
        out[i] = 0.0;{add}
    }}
}}

"""
    if "jacobian" in needs:
        source = "NAN"
        unused = "    (void)plant;\n"
        if "J" in input_names:
            source = f"((const double *)plant)[{index_name('J[1,1]')} + i]"
            unused = ""
        functions += f"""static void jacobian(void *plant, double *out)
{{
{unused}    for (int i = 0; i < 3 * SMC_JOINTS; i++) out[i] = {source};
}}

"""
    return functions


def body(listed: Sequence[Variable], exported: ExportedLaw) -> Iterator[str]:
    """Yield the statements of smc_controller, without indentation.

    What is of each joint is in a loop over j.
    """
    input_names = inputs(exported)
    many = exported.joints
    j = ""
    u = "[0]"
    s = "[1]"
    size = "2"
    moved = ""
    if many:
        j = u = "[j]"
        s = "[SMC_JOINTS + j]"
        size = "2 * SMC_JOINTS"
        moved = " + j"

    def value(name: str, absent: str = "0.0") -> str:
        if name in COMMON_INPUTS | CHANNEL_INPUTS | JOINT_INPUTS and name not in input_names:
            return absent
        return f"value[{index_name(name + exported.places[0])}{moved}]"

    def for_each(lines: Iterable[str]) -> Iterable[str]:
        if not many:
            return lines
        inner = [f"    {line}" for line in lines]
        return ["for (int j = 0; j < SMC_JOINTS; j++) {", *inner, "}"]

    yield from _tables(listed, exported)
    if exported.leads:
        yield f"static const double leads[] = {{{', '.join(map(repr, exported.leads))}}};"
    yield "smc_measurement y = {0};"
    yield f"double out[{size}];"
    yield "int failure;"
    yield f"y.t = t, y.dt = SMC_DT, y.model = {float(exported.modelled)!r};"
    for name in ("coriolis", "jacobian"):
        if name in reads(exported.code["law"][1]):
            yield f"y.plant = value, y.{name} = {name};"
    yield from for_each(_measured(exported, value, j))
    if exported.of_body:
        yield "smc_errors(y.x, y.v, y.r, y.dr, y.e, y.de);"
    if many and exported.modelled and "M" in input_names:
        first = index_name("M[1,1]")
        yield f"for (int j = 0; j < SMC_JOINTS * SMC_JOINTS; j++) y.M[j] = value[{first} + j];"
    if exported.surface:
        yield from _call("surface", "&y", "surface_memory")
        yield f"y.has_surface = 1.0, y.s = out[0], y.v_eq = {value('v_eq')} = out[1];"
    yield from _call("law", "&y", "law_memory")
    if exported.compensate:
        added = value("compensation")
        yield from for_each([f"{added} = out{u};"])
        yield f"smc_compensation(&y, value + {index_name('compensation' + exported.places[0])});"
        yield from for_each([f"out{u} += {added};"])
    yield from for_each(
        [
            f"const double u = fmin(fmax(out{u}, -y.limit{j}), y.limit{j}), s = out{s};",
            f"{value('u')} = u, {value('s')} = s;",
            f"if (!(isfinite(out{u}) && isfinite(s) && fabs(u) < {MAX_CONTROL!r}))",
            "    return SMC_NOT_FINITE;",
        ]
    )
    if exported.actuators:
        yield f"smc_actuators(&y, out, value + {index_name('control[1]')});"
    yield "return 0;"


def _tables(listed: Sequence[Variable], exported: ExportedLaw) -> Iterator[str]:
    """Yield the lines that collect the gains of each component, and find its memory."""
    names = {variable.name for variable in listed}
    for kind, part in exported.parts.items():
        yield f"const double {kind}_gains[] = {{"
        for name in part.gains:
            element = f"{kind}.{c_name(name)}"
            elements = [element]
            if kind == "law" and exported.joints:
                elements *= exported.joints
            if element not in names:
                elements = [element + place for place in exported.places]
            for name_in_fmu in elements:
                yield f"    number(value[{index_name(name_in_fmu)}]),"
        if not part.gains:
            yield "    0.0,"
        yield "};"
        memory = "NULL"
        if exported.code[kind][0]:
            memory = f"&value[{index_name(f'{kind}.memory[1]')}]"
            if exported.joints:
                memory = f"&value[{index_name(f'{kind}.memory[1,1]')}]"
        yield f"double *{kind}_memory = {memory};"


def _measured(exported: ExportedLaw, value: Callable[..., str], j: str) -> Iterator[str]:
    """Yield the statements that fill in the measurement of one joint.

    `value` returns a variable in C, `j` an index.
    """
    yield f"y.limit{j} = number({value('u_max')});"
    yield f"y.x{j} = {value('x')}, y.r{j} = {value('r')}, y.dr{j} = {value('dr')};"
    if exported.leads:
        yield f"if (leads[{'j' if j else 0}] != 0.0)"
        yield f"    y.r{j} += leads[{'j' if j else 0}] * tanh(y.dr{j} / {exported.eps!r});"
    yield f"y.ddr{j} = y.a{j} = {value('ddr')};"
    if exported.estimator:
        slots = exported.code["estimator"][0]
        yield f"const smc_reading reading = {{SMC_DT, y.x{j}, {value('v')}}};"
        memory = "estimator_memory"
        if j and slots:
            memory += f" + {slots} * j"
        yield from _call("estimator", "&reading", memory)
        yield f"y.v{j} = {value('v_estimated')} = out[0];"
        yield f"if (!isnan(out[1])) y.a{j} = out[1];"
    else:
        yield f"y.v{j} = {value('v')};"
    yield f"y.e{j} = y.x{j} - y.r{j}, y.de{j} = y.v{j} - y.dr{j};"
    if not j:
        yield f"y.f = {value('f', 'NAN')}, y.g = {value('g', 'NAN')};"
        yield f"y.q = {value('q')}, y.dq = {value('dq')};"
        yield f"y.fq = {value('fq')}, y.gq = {value('gq')};"
    elif exported.modelled:
        yield f"y.h{j} = {value('h')}, y.g{j} = {value('g')};"
    else:
        yield "y.M[j * SMC_JOINTS + j] = 1.0;"


def _call(kind: str, measured: str, memory: str) -> Iterator[str]:
    """Yield the call of a component, and the return if it fails. The arguments are in C."""
    yield f"failure = smc_{kind}({measured}, {kind}_gains, {memory}, out);"
    yield "if (failure) return failure;"


def component_file(component: Component, slots: int, text: str) -> str:
    """Return the C file of a surface or an estimator, with its number of memory slots and its C
    code.
    """
    title = f"/* {component.name}: {component.kind}, with {slots} numbers of memory. */"
    head = [
        title,
        *export_c.includes(text),
        '#include "controller.h"',
        "",
        *export_c.gain_names(component),
    ]
    return "\n".join([*head, "", text, ""])
