"""Laws written out as C99: one file without dependencies, in the signature of `smc_law.h`.

The C is translated from the law's own Python, operation by operation, so that in double precision it gives the bits of
the compiled law where the C library's functions are the same. There is no division by zero to raise in C: it gives
inf or NaN, which ends a run likewise.
"""

import functools
import inspect
import platform
import re
import textwrap
from collections.abc import Mapping

from smc_mujoco.common.errors import ScenarioError, shown, unknown
from smc_mujoco.common.jit import AtAddress
from smc_mujoco.common.version import __version__
from smc_mujoco.control.c import build
from smc_mujoco.control.c.calls import MATH
from smc_mujoco.control.c.translate import rows, translate
from smc_mujoco.control.c.values import Untranslatable, plain
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import Measurement, catalogue
from smc_mujoco.control.law import law as find_law

NUMBERS = ("double", "float", "q15")
Q15 = "observer_free_q15"
EXACT = ("-std=c99", "-Os", "-ffp-contract=off")  # as sizes are measured


def law_to_c(law: Component | Template | str, numbers: str = "double") -> str:
    """A law as one file of C99, with its gains as defaults: `smc.law_from_c` reads it back.

    Args:
      law: a Law, its Template, or its name.
      numbers: "double", "float", or "q15", which is for the paper's law, observer_free: words of 16 bits.

    Raises:
      ScenarioError: no such law or numbers, or it uses Python that has no translation, which is named.
    """
    if numbers not in NUMBERS:
        raise unknown("type of numbers", numbers, NUMBERS)
    law = find_law(law) if isinstance(law, str) else law() if isinstance(law, Template) else law
    if not isinstance(law, Component) or law.kind != "law" or law.function is None:
        raise ScenarioError(f"cannot write {shown(law)} in C: give smc.law(...), one of your own, or a name")
    if isinstance(law.function, AtAddress):
        raise ScenarioError(f"law {law.name!r} is in C already: take {law.function.__module__}")
    if numbers == "q15":
        law = _in_q15(law)
        slots, code = 0, _fixed(law.gains)
    else:
        try:
            slots, code = _translated(law, single=numbers == "float")
        except Untranslatable as error:
            raise ScenarioError(f"law {law.name!r} cannot be written in C: {error}") from None
    real = ["#define SMC_REAL float"] if numbers == "float" else []
    code = "\n".join([*_includes(code), "", *real, *_said(law, slots), code, ""])
    return f"{_head(law, numbers, slots, _measured(code))}\n{code}"


def _in_q15(law: Component) -> Component:
    """The fixed-point law of the gains; of the paper's law too."""
    if law.name == "observer_free" and law.function is catalogue()["observer_free"].function:
        law = catalogue()[Q15].bind(law.gains, warn=True)
    if law.function is not catalogue()[Q15].function:
        raise ScenarioError(
            f"law {law.name!r} has no Q15 form: give observer_free or {Q15}, or write double or float numbers"
        )
    return law


def _translated(law: Component, single: bool) -> tuple[int, str]:
    """How many numbers of memory a law uses, and what follows the signature."""
    found = translate(law.function, single)
    code = "\n\n".join([*found.constants, *found.functions])
    for kind, reads, names in (("measurement", r"->(\w+)", Measurement._fields), ("gain", r"\bGAIN_(\w+)", law.gains)):
        for name in re.findall(reads, code):
            if name not in map(plain, names):
                raise Untranslatable(f"it reads an {unknown(kind, name, names)}")
    return found.slots, code


def _includes(code: str) -> list[str]:
    """The standard headers that it needs."""
    wanted = {"math.h": rf"\b(?:{'|'.join(MATH)})f?\(|\bNAN\b|\bINFINITY\b", "stdint.h": r"\bint(?:16|32)_t\b"}
    return [f"#include <{name}>" for name, what in wanted.items() if re.search(what, code)]


def _fixed(gains: Mapping[str, float]) -> str:
    """The fixed-point law, its table and the words of its gains."""
    from smc_mujoco.control.laws import observer_free_q15 as q15

    words = {
        "ON_E": q15.word.py_func(gains["k1"] * gains["e_range"] / 8.0, 16.0),
        "ON_DE": q15.word.py_func(gains["de_range"] / 8.0, 16.0),
        "LAM": q15.word.py_func(gains["lam"], gains["u_range"]),
        "TABLE": rows([str(n) for n in q15.TABLE]),
    }
    text = (build.HERE / "q15.c").read_text().rstrip()
    return re.sub(r"@(\w+)@", lambda found: str(words[found[1]]), text)


def _said(law: Component, slots: int) -> list[str]:
    """The signature, the names of the gains, and what the file says of itself."""
    lines = [build.HEADER.read_text()]
    if law.gains:
        lines.append(f"enum {{ {', '.join(f'GAIN_{plain(name)}' for name in law.gains)} }};")
    text = ",".join(f"{plain(name)}={value!r}" for name, value in law.gains.items())
    lines += [
        f'const char smc_law_gains[] = "{text}";',
        f"const int smc_law_memory = {slots};",
        "const int smc_law_real = sizeof(smc_real);",
        f"const int smc_law_degree = {law.relative_degree};",
        f"const int smc_law_modelled = {int(law.requires_model)};",
    ]
    return [*lines, ""]


def _head(law: Component, numbers: str, slots: int, size: str) -> str:
    """The comment at the top: formula, what is known, source, gains, sizes."""
    template = catalogue().get(law.name)
    known = template is not None and template.function is law.function
    doc = template.doc if template is not None and known else inspect.cleandoc(law.function.__doc__ or "")
    lines = [f"{law.name}: a control law in C99, written out by smc_mujoco {__version__}.", "", *doc.splitlines(), ""]
    size_of = {"double": 8, "float": 4, "q15": 8}[numbers]
    given = ", ".join(f"{name} = {value:g}" for name, value in law.gains.items()) or "none"
    facts = {
        "gains": f"{given}; gains[] in this order",
        "numbers": {"q15": "words of 16 bits, sums of 32, and double where they meet the plant"}.get(numbers, numbers),
        "state": f"{slots * size_of} bytes a channel, memory[{slots}]; no static data but constants, no malloc",
        "code": size,
        "licence": "use without restriction, without warranty",
        "build": "cc -std=c99 -O2 -ffp-contract=off, and -lm",
    }
    for name, fact in facts.items():
        lines += textwrap.wrap(f"{name:8} {fact}", 112, subsequent_indent=" " * 9, break_on_hyphens=False)
    body = "\n".join(f" * {line}".rstrip() for line in lines).replace("*/", "* /")
    return f"/*{body[2:]}\n */".replace("/*", "/ *").replace("/ *", "/*", 1)


@functools.cache
def _tools(command: tuple[str, ...]) -> tuple[str, str]:
    """A compiler's version, and the program that tells the sizes of what it makes."""
    version = build.timed([*command, "-dumpversion"], 60.0).stdout.strip()
    return version, build.timed([*command, "-print-prog-name=size"], 60.0).stdout.strip() or "size"


def _measured(code: str) -> str:
    """Bytes of code and of constants, where there are a compiler and its `size`."""
    source, target, command = build.fresh(".c"), build.fresh(".o"), build.compiler()
    source.write_text(code)
    try:
        done = build.timed([*command, *EXACT, "-c", str(source), "-o", str(target)], 60.0)
        made, tool = _tools(tuple(command))
        table = build.timed([tool, "-A", str(target)], 60.0).stdout
    except (OSError, build.Late):
        return "not measured: there is no compiler here"
    found = [(name, int(n)) for name, n in re.findall(r"^\.(text|rodata)\S*\s+(\d+)", table, re.MULTILINE)]
    if done.returncode or not found:
        return "not measured: the compiler here does not say"
    text, constants = (sum(n for name, n in found if name == kind) for kind in ("text", "rodata"))
    return f"{text} bytes, and {constants} of constants ({command[0]} {made} -Os, {platform.machine()})"
