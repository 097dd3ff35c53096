"""Export laws to C99: one file without dependencies, with the signature of `smc_law.h`.

The C is translated from the law's Python, operation by operation. In double precision it equals the
compiled law bit for bit if both use the same C library. A division by zero raises nothing in C: it
gives inf or NaN, which ends a run too.
"""

import dataclasses
import inspect
import math
import re
import textwrap

from smc_mujoco.common.errors import ScenarioError, find, shown, whole
from smc_mujoco.common.jit import AtAddress
from smc_mujoco.common.version import __version__
from smc_mujoco.control.component import Component, Template, gain_at, gain_text
from smc_mujoco.control.law import FREE_BODY, all_laws, law_catalogue
from smc_mujoco.control.laws import observer_free_q15 as q15
from smc_mujoco.exchange.c import body, build, compensation
from smc_mujoco.exchange.c.compensation import Compensate
from smc_mujoco.exchange.c.translation.c_text import MATH, c_name, wrapped_lines
from smc_mujoco.exchange.c.translation.functions import translate
from smc_mujoco.exchange.c.translation.python_source import Untranslatable
from smc_mujoco.exchange.c.translation.values import JOINTS, SLOTS
from smc_mujoco.mechanisms.layout import PLACES
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.model import mixer
from smc_mujoco.simulation.prepare import reference_leads
from smc_mujoco.simulation.scenario import Scenario

NUMBER_BYTES = {"double": 8, "float": 4, "q15": 8}  # of a number of memory, by type of numbers
Q15_LAW = "observer_free_q15"
MAX_JOINTS = 100


def law_to_c(
    law: Component | Template | str | Scenario, numbers: str = "double", joints: int | None = None
) -> str:
    """Return a law as one C99 file, with its gains as defaults.

        text = smc.exchange.law_to_c(smc.law("super_twisting", k1=3.0))

    `smc.exchange.law_from_c` can load it.

    Args:
      law: a Law, its Template, or its text, see `law`; or a Scenario, which then gives the number
        of joints, what the law knows of its plant, of a free body the function that gives its
        actuators their commands, and its Feedforward: u then includes the compensation, with
        error=0, and smc_compensation gives it alone.
      numbers: "double", "float", or, only for the paper's law observer_free, "q15": words of 16
        bits.
      joints: the number of joints for which a law of many joints is written. Default: the number of
        a gain's values. A law of one channel is written once for all; if its gains differ by
        channel, write one file for each channel i, of law.of_channel(i).

    Returns:
      The text of the file.

    Raises:
      ScenarioError: no such law or type of numbers, no number of joints, a law of one channel whose
        gains differ by channel, or a law that uses Python that cannot be translated, which the
        error quotes.
    """
    find("type of numbers", numbers, NUMBER_BYTES)
    plant = compensate = None
    if isinstance(law, Scenario):
        if joints is not None:
            raise ScenarioError(
                "a scenario has its own joints: leave joints out, or give its law instead"
            )
        compensate = compensation.compensate_of(law)
        if any(reference_leads(law.resolved)):
            raise ScenarioError(
                "the scenario's Feedforward leads the reference through a play, and a file of a "
                "law reads the error that you give it: export a loop with --plain or --ros2"
            )
        plant = law.resolved.plant
        law = law.resolved.law
        joints = plant.n if law.joint else None
    law = writable(law)
    joints = number_of_joints(law, joints)
    if numbers == "q15":
        if compensate:
            raise ScenarioError(
                "a Feedforward is not written in words of 16 bits: write double or float numbers"
            )
        law = _in_q15(law)
        slots = 0
        code = _fixed_point(law)
    else:
        slots, code = translated(law, numbers == "float", joints, plant, compensate)
    return with_head(law, numbers, slots, code, joints)


def with_head(law: Component, numbers: str, slots: int, code: str, joints: int) -> str:
    """Return the file of a law that is translated."""
    facts = _facts(law, slots, joints, numbers == "float")
    head = _head(law, numbers, slots, joints, code)
    lines = [head, *includes(facts + code), ""]
    if numbers == "float":
        lines.append("#define SMC_REAL float")
    return "\n".join([*lines, facts, code, ""])


def writable(law: Component | Template | str) -> Component:
    """Return a law that can be written in C."""
    law = coerce.coerced_law(law)
    if law.function is None:
        raise ScenarioError("law 'none' cannot be written in C: give another")
    if isinstance(law.function, AtAddress):
        raise ScenarioError(f"law {law.name!r} is in C already: take {law.function.__module__}")
    if not law.joint and law.of_channel(0) is not law:
        raise ScenarioError(
            f"law {law} has gains by channel: give one number for each gain, or law.of_channel(0) "
            "in Python"
        )
    return law


def number_of_joints(law: Component, joints: int | None) -> int:
    """Return for how many joints the C of a law is:

    `joints`, or the number of values of a gain; 0 for one channel.
    """
    counts = {}
    for name, value in law.gains.items():
        if isinstance(value, tuple):
            counts[name] = len(value)
    if not law.joint:
        if joints is not None:
            raise ScenarioError(
                f"law {law.name!r} is of one channel: leave joints={shown(joints)} out"
            )
        return 0
    if law.plants == (FREE_BODY,):
        if joints is not None and whole("joints", joints, 1, MAX_JOINTS) != len(PLACES):
            raise ScenarioError(
                f"law {law.name!r} is of a free body, of {len(PLACES)} joints: leave "
                f"joints={shown(joints)} out"
            )
        joints = len(PLACES)
    if joints is None and not counts:
        raise ScenarioError(
            f"law {law.name!r} is of many joints: give their number, such as joints=7"
        )
    count = whole(
        "joints", next(iter(counts.values())) if joints is None else joints, 2, MAX_JOINTS
    )
    for name, values in counts.items():
        if values != count:
            raise ScenarioError(
                f"gain {name} of {law.name} has {values} values, {gain_text(law.gains[name])}, for "
                f"{count} joints: give one number, or {count}"
            )
    return count


def translated(
    component: Component,
    single: bool = False,
    joints: int = 0,
    plant: Plant | None = None,
    compensate: Compensate | None = None,
    adds: bool = True,
) -> tuple[int, str]:
    """Return the memory slots and the C of a component, of a law of many joints for a number of
    these.

    Of a law of a free body, or for a plant that is one, it has `body.functions`, too. A law with a
    compensation adds it to u, or has its function alone.
    """
    if plant is not None and not plant.pose:
        plant = None
    functions = {}
    if plant is not None or (joints and getattr(component, "plants", ()) == (FREE_BODY,)):
        functions = body.functions(plant)
    what = f"{component.kind} {component.name!r}"
    if compensate:
        assert component.function is not None  # see `writable`
        what += " with the scenario's Feedforward"
        functions = functions | compensation.function(compensate, joints)
        if adds:
            together = compensation.compensated(component.function, compensate, joints)
            component = dataclasses.replace(component, function=together)
    try:
        slots, code = translate(component, single, joints, functions)
    except Untranslatable as error:
        raise ScenarioError(f"{what} cannot be written in C: {error}") from None
    if plant is not None:
        count = f"enum {{ SMC_ACTUATORS = {len(mixer(plant))} }};"
        code = f"{count} /* whose controls smc_actuators sets */\n\n{code}"
    return slots, code


def includes(code: str) -> list[str]:
    """Return the lines that include the headers of C that some code needs."""
    headers = {
        "math.h": rf"\b(?:{'|'.join(MATH)})f?\(|\bNAN\b|\bINFINITY\b",
        "stdint.h": r"\bint(?:16|32)_t\b",
    }
    lines = []
    for name, needs in headers.items():
        if re.search(needs, code):
            lines.append(f"#include <{name}>")
    return lines


def gain_names(component: Component) -> list[str]:
    """Return the line that names the elements of gains[]; nothing without gains."""
    names = ", ".join(f"GAIN_{c_name(name)}" for name in component.gains)
    return [f"enum {{ {names} }};"] if names else []


def _in_q15(law: Component) -> Component:
    """Return the fixed-point law with the gains of a law, which must be the paper's or fixed-point
    itself.
    """
    if law.name == "observer_free" and law.function is law_catalogue()["observer_free"].function:
        law = law_catalogue()[Q15_LAW].bind(law.gains, warn=True)
    if law.function is not law_catalogue()[Q15_LAW].function:
        raise ScenarioError(
            f"law {law.name!r} has no Q15 form: give observer_free or {Q15_LAW}, or write "
            "double or float numbers"
        )
    return law


def _fixed_point(law: Component) -> str:
    """Return the C of the fixed-point law, with its table and the words of its gains."""
    gains = law.gains
    word = q15.word.py_func
    words = {
        "ON_E": word(gains["k1"] * gains["e_range"] / 8.0, 16.0),
        "ON_DE": word(gains["de_range"] / 8.0, 16.0),
        "LAM": word(gains["lam"], gains["u_range"]),
        "TABLE": wrapped_lines(list(map(str, q15.TABLE))),
    }
    text = (build.FOLDER / "q15.c").read_text(encoding="utf-8").rstrip()
    return re.sub(r"@(\w+)@", lambda match: str(words[match[1]]), text)


def _facts(law: Component, slots: int, joints: int, single: bool) -> str:
    """Return the header, the names of the gains, and the constants that describe the law."""
    texts = []
    values = []
    for name, value in law.gains.items():
        numbers = [gain_at(value, i) for i in range(max(joints, 1))]
        for number in numbers:
            values.append(_literal(number, single))
        if not isinstance(value, tuple):
            numbers = numbers[:1]
        texts.append(f"{c_name(name)}={' '.join(map(repr, numbers))}")
    lines = []
    if joints:
        lines += [f"#define {JOINTS} {joints}", f"#define {SLOTS} {slots}"]
    header = build.HEADER.read_text(encoding="utf-8")
    lines += [header, *gain_names(law)]
    lines.append(f'const char smc_law_gains[] = "{",".join(texts)}";')
    if values:
        defaults = f"const smc_real smc_law_defaults[] = {{{', '.join(values)}}};"
        lines += textwrap.wrap(defaults, 112)
    if joints:
        lines.append(f'const char smc_law_shared[] = "{",".join(map(c_name, law.shared))}";')
    lines.append(f"const int smc_law_memory = {slots};")
    lines.append("const int smc_law_real = sizeof(smc_real);")
    if not joints:
        lines.append(f"const int smc_law_degree = {law.relative_degree};")
    lines += [f"const int smc_law_modelled = {int(law.requires_model)};", ""]
    return "\n".join(lines)


def _literal(value: float, single: bool) -> str:
    """Return a number in C."""
    if math.isinf(value):
        return "-INFINITY" if value < 0.0 else "INFINITY"
    return f"(float){value!r}" if single else repr(value)


def _head(law: Component, numbers: str, slots: int, joints: int, code: str) -> str:
    """Return the comment at the top: formula, source, gains, sizes."""
    template = all_laws().get(law.name)
    doc = inspect.cleandoc(law.function.__doc__ or "")
    if template is not None and template.function is law.function:
        doc = template.doc
    gains = [f"{name} = {gain_text(value)}" for name, value in law.gains.items()]
    order = "gains[] in this order"
    many = ""
    unit = "channel"
    if joints:
        order += f", {joints} numbers each"
        many = f" of {joints} joints"
        unit = "joint"
    words = {"q15": "words of 16 bits, sums of 32, and double where they meet the plant"}
    memory = f"memory[{slots * max(joints, 1)}]; no static data but constants, no malloc"
    facts = {
        "gains": f"{', '.join(gains) or 'none'}; {order}",
        "numbers": words.get(numbers, numbers),
        "state": f"{slots * NUMBER_BYTES[numbers]} bytes a {unit}, {memory}",
        "licence": "use without restriction, without warranty",
        "build": "cc -std=c99 -O2 -ffp-contract=off, and -lm",
    }
    if compensation.NAME in code:
        facts["adds"] = "what the scenario's Feedforward with error=0 gives, smc_compensation, to u"
    if joints:
        read = re.findall(r"->(?!plant)(\w+)", code)
        facts["reads"] = ", ".join(dict.fromkeys(read))
    title = f"{law.name}: a control law{many} in C99, written out by smc_mujoco {__version__}."
    lines = [title, "", *doc.splitlines(), ""]
    for name, fact in facts.items():
        lines += textwrap.wrap(
            f"{name:8} {fact}", 112, subsequent_indent=" " * 9, break_on_hyphens=False
        )
    body = "\n".join(f" * {line}".rstrip() for line in lines)
    text = body[2:]
    return f"/*{text.replace('*/', '* /').replace('/*', '/ *')}\n */"
