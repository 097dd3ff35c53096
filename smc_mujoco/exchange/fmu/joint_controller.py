"""The controller of an FMU with a law of many joints: its variables, and the function that runs all parts at a sample.

Every vector and matrix is one variable for each element, x[1], x[2], M[1,1], M[1,2], counted from 1 as in FMI's
structured names. The arrays of FMI 3.0 are not used, because FMPy's `simulate_fmu` takes no inputs of several shapes.
The elements of a vector or matrix follow each other in the array of variables, so C reads them as an array.
"""

from collections.abc import Iterator, Mapping, Sequence

from smc_mujoco.control.component import at
from smc_mujoco.control.units import ACCELERATION, FORCE, FORCE_PER_SPEED, INERTIA, POSITION, SPEED, TIME, Unit
from smc_mujoco.exchange.c.translate import plain
from smc_mujoco.exchange.fmu.controller import Controller, Variable, bounded, parameter, place, reads
from smc_mujoco.simulation.controller import MAX_CONTROL

# Input -> its unit and description, in the order of the variables.
VECTORS: dict[str, tuple[Unit, str]] = {
    "x": (POSITION, "measured position"),
    "v": (SPEED, "measured velocity"),
    "r": (POSITION, "reference"),
    "dr": (SPEED, "first derivative of the reference"),
    "ddr": (ACCELERATION, "second derivative of the reference"),
    "h": (FORCE, "nominal h of M x'' + h = u, at the measured x and v"),
    "g": (FORCE, "nominal gravity and springs, at the measured x"),
}
MATRICES: dict[str, tuple[Unit | None, str]] = {
    "M": (INERTIA, "nominal mass matrix of M x'' + h = u, at the measured x"),
    "C": (FORCE_PER_SPEED, "nominal matrix of Coriolis forces C v, M' - 2 C skew-symmetric"),
    "J": (None, "nominal Jacobian of the tip, in the world: its velocity is J v"),
}
ALWAYS = ("x", "r", "dr")
MODEL = ("M", "h", "g")


def variables(controller: Controller, code: Mapping[str, tuple[int, str]]) -> list[Variable]:
    """Return the variables in the order of their value references. `code` is `controller.code()`."""
    joints, wanted = range(1, controller.joints + 1), inputs(controller, code)
    listed = [Variable("time", "SMC_CLOCK", "time", TIME)]
    for name, (unit, words) in VECTORS.items():
        if name in wanted:
            listed += [Variable(f"{name}[{i}]", "SMC_INPUT", words, unit) for i in joints]
    for name, (unit, words) in MATRICES.items():
        rows = range(1, 4) if name == "J" else joints
        for i in rows if name in wanted else ():
            starts = [float(name == "M" and i == j) for j in joints]  # M starts as the identity, which has an inverse
            listed += [Variable(f"{name}[{i},{j}]", "SMC_INPUT", words, unit, starts[j - 1]) for j in joints]
    listed += [Variable(f"u[{i}]", "SMC_COMPUTED", "command, within u_max", FORCE) for i in joints]
    listed += [Variable(f"s[{i}]", "SMC_COMPUTED", "sliding variable") for i in joints]
    if controller.estimator:
        listed += [Variable(f"v_estimated[{i}]", "SMC_COMPUTED", "estimated velocity", SPEED) for i in joints]
    listed += [bounded(f"u_max[{i}]", controller.u_max[i - 1]) for i in joints]
    for kind, part in controller.parts.items():
        for name, value in part.gains.items():
            one = kind != "law" or name in part.shared
            places = [""] if one else [f"[{i}]" for i in joints]
            listed += [parameter(kind, part, name, at(value, i), index) for i, index in enumerate(places)]
    listed.append(Variable("dt", "SMC_CONSTANT", "control period: the law runs this often", TIME, controller.period))
    for kind, (slots, _) in code.items():
        words = f"of the memory of the {kind}, joint"
        listed += [
            Variable(f"{kind}.memory[{i},{k}]", "SMC_STATE", f"number {k} {words} {i}")
            for i in joints
            for k in range(1, slots + 1)
        ]
    return listed


def inputs(controller: Controller, code: Mapping[str, tuple[int, str]]) -> set[str]:
    """Return the names of the inputs that the components read, without indices."""
    read, wanted = reads(code.values()), set[str](ALWAYS)
    if controller.estimator is None or "v" in reads([code["estimator"]]):
        wanted.add("v")
    if read & {"a", "ddr"}:  # a is ddr if no estimator gives it
        wanted.add("ddr")
    if controller.modelled:
        wanted |= read & set(MODEL)
        wanted |= {name for name, asked in (("C", "coriolis"), ("J", "jacobian")) if asked in read}
    return wanted


def helpers(controller: Controller, code: Mapping[str, tuple[int, str]]) -> Iterator[str]:
    """Yield the lines of the C functions that the law calls: coriolis, for C(x, v) w, and jacobian."""
    wanted, asked = inputs(controller, code), reads([code["law"]])
    if "coriolis" in asked:
        yield "/* out = C w */"
        yield "static void coriolis(void *plant, const double *w, double *out)"
        yield "{"
        yield (
            f"    const double *C = (const double *)plant + {place('C[1,1]')};" if "C" in wanted else "    (void)plant;"
        )
        yield "    for (int i = 0; i < SMC_JOINTS; i++) {"
        yield "        out[i] = 0.0;"
        if "C" in wanted:
            yield "        for (int j = 0; j < SMC_JOINTS; j++) out[i] += C[i * SMC_JOINTS + j] * w[j];"
        yield "    }"
        yield from () if "C" in wanted else ("    (void)w;",)
        yield from ("}", "")
    if "jacobian" in asked:
        yield "static void jacobian(void *plant, double *out)"
        yield "{"
        source = f"((const double *)plant)[{place('J[1,1]')} + i]" if "J" in wanted else "NAN"
        yield from () if "J" in wanted else ("    (void)plant;",)
        yield f"    for (int i = 0; i < 3 * SMC_JOINTS; i++) out[i] = {source};"
        yield from ("}", "")


def body(listed: Sequence[Variable], controller: Controller, code: Mapping[str, tuple[int, str]]) -> Iterator[str]:
    """Yield the statements of smc_controller, without indentation."""
    wanted, names = inputs(controller, code), {one.name for one in listed}

    def element(name: str) -> str:
        return f"value[{place(f'{name}[1]')} + j]"

    for kind, part in controller.parts.items():
        yield f"const double {kind}_gains[] = {{"
        for name in part.gains:
            own = f"{kind}.{plain(name)}"
            each = [own] if own in names else [f"{own}[{i + 1}]" for i in range(controller.joints)]
            each *= controller.joints if kind == "law" and own in names else 1
            yield from (f"    number(value[{place(one)}])," for one in each)
        yield from ("    0.0,",) if not part.gains else ()
        yield "};"
        yield f"double *{kind}_memory = {'&value[' + place(f'{kind}.memory[1,1]') + ']' if code[kind][0] else 'NULL'};"
    yield "smc_joint_measurement y = {0};"
    yield "double out[2 * SMC_JOINTS];"
    yield "int failure;"
    yield f"y.t = t, y.dt = SMC_DT, y.model = {float(controller.modelled)!r}, y.plant = value;"
    for name in ("coriolis", "jacobian"):
        if name in reads([code["law"]]):
            yield f"y.{name} = {name};"
    yield "for (int j = 0; j < SMC_JOINTS; j++) {"
    yield f"    y.limit[j] = number({element('u_max')});"
    yield f"    y.x[j] = {element('x')}, y.r[j] = {element('r')}, y.dr[j] = {element('dr')};"
    yield f"    y.ddr[j] = y.a[j] = {element('ddr') if 'ddr' in wanted else '0.0'};"
    if controller.estimator:
        slots = code["estimator"][0]
        yield f"    const smc_reading reading = {{SMC_DT, y.x[j], {element('v') if 'v' in wanted else '0.0'}}};"
        memory = f"estimator_memory + {slots} * j" if slots else "estimator_memory"
        yield f"    failure = smc_estimator(&reading, estimator_gains, {memory}, out);"
        yield "    if (failure) return failure;"
        yield f"    y.v[j] = {element('v_estimated')} = out[0];"
        yield "    if (!isnan(out[1])) y.a[j] = out[1];"
    else:
        yield f"    y.v[j] = {element('v')};"
    yield "    y.e[j] = y.x[j] - y.r[j], y.de[j] = y.v[j] - y.dr[j];"
    for name in ("h", "g"):
        if name in wanted:
            yield f"    y.{name}[j] = {element(name)};"
    yield from () if controller.modelled else ("    y.M[j * SMC_JOINTS + j] = 1.0;",)
    yield "}"
    if "M" in wanted:
        yield f"for (int j = 0; j < SMC_JOINTS * SMC_JOINTS; j++) y.M[j] = value[{place('M[1,1]')} + j];"
    yield "failure = smc_law(&y, law_gains, law_memory, out);"
    yield "if (failure) return failure;"
    yield "for (int j = 0; j < SMC_JOINTS; j++) {"
    yield "    const double u = fmin(fmax(out[j], -y.limit[j]), y.limit[j]), s = out[SMC_JOINTS + j];"
    yield f"    {element('u')} = u, {element('s')} = s;"
    yield f"    if (!(isfinite(out[j]) && isfinite(s) && fabs(u) < {MAX_CONTROL!r})) return SMC_NOT_FINITE;"
    yield "}"
    yield "return 0;"
