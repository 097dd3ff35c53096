"""Laws, surfaces and velocity estimators in JavaScript, for a browser: their C with the syntax that differs.

The C that `translate` writes has numbers of 64 bits and few kinds of statements, all of which JavaScript has, too. So
it is rewritten line by line. Results differ from those of the C only where the two libraries' tanh, exp or pow do,
by a unit in the last place.
"""

import re

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.jit import AtAddress
from smc_mujoco.control.component import Component
from smc_mujoco.exchange.c.translate import MATH, Untranslatable, plain, translate

TYPE_PATTERN = r"(?:const )?(?:smc_real|int(?:16|32)_t)"
# Words that JavaScript reserves or gives a meaning, and C does not.
NOT_IN_C = """arguments await catch class debugger delete eval export extends finally function import in instanceof
interface let new null of package private protected public super this throw try undefined var with yield Math NaN
Infinity"""
RENAMED_FUNCTIONS = {"fabs": "abs"}  # name in C's math.h -> name in JavaScript's Math
# Functions of math.h that JavaScript does not have.
WRITTEN_OUT = {
    "copysign": "const copysign = (a, b) => (b < 0 || Object.is(b, -0) ? -Math.abs(a) : Math.abs(a));",
    "fmod": "const fmod = (a, b) => a % b;",
}
RESERVED = set(NOT_IN_C.split())
MATH_FUNCTIONS = set(MATH) - set(WRITTEN_OUT)
WORD_PATTERN = re.compile(r"(?<![\w.>$])[A-Za-z_]\w*")


def to_js(component: Component) -> str:
    """Return a component of one channel as an expression in JavaScript: a function (y, gains, memory, out).

    `y` has the fields of the measurement, or of an estimator's reading, by name. `gains` and `memory` are arrays; gains
    are in the component's order. Its two results go to out[0] and out[1]. The acceleration of an estimator that gives
    none is NaN.
    """
    what = f"{component.kind} {component.name!r}"
    if isinstance(component.function, AtAddress):
        raise ScenarioError(f"{what} is a C function, which no browser runs: give it in Python")
    if component.joint or component.of_channel(0) is not component:
        raise ScenarioError(f"{what} is of several joints: give one of a single joint")
    try:
        _, code = translate(component, single=False)
    except Untranslatable as error:
        raise ScenarioError(f"{what} cannot be written in JavaScript: {error}") from None
    if re.search(r"\bfloat\b", code):
        raise ScenarioError(f"{what} computes in numbers of 32 bits: give one of 64 bits")
    if re.search(r"^ +(?:smc_real|int32_t) (?:\w+\[.*;|\*\w+ = )", code, re.MULTILINE):
        raise ScenarioError(f"{what} keeps arrays or tuples, which are not written in JavaScript: use numbers by name")
    places = [f"const GAIN_{plain(name)} = {i};" for i, name in enumerate(component.gains)]
    helpers = [text for name, text in WRITTEN_OUT.items() if re.search(rf"\b{name}\(", code)]
    body = "\n".join(["'use strict';", *places, *helpers, _rewritten(code), f"return smc_{component.kind};"])
    return f"(() => {{\n{body}\n}})()"


def _rewritten(code: str) -> str:
    """Return the functions and constant arrays of some C in JavaScript."""
    arrays = rf"^static {TYPE_PATTERN} ([\w$]+)\[\d+\] = \{{\n(.*?)\n\}};"
    code = re.sub(arrays, r"const \1 = [\n\2\n];", WORD_PATTERN.sub(_word, code), flags=re.DOTALL | re.MULTILINE)
    code = re.sub(r"^ *\(void\)[\w$]+;\n", "", code, flags=re.MULTILINE)
    code = re.sub(r"\n\{\n(.*?)\n\}(?=\n|$)", _body, code, flags=re.DOTALL)
    code = re.sub(r"^(?:static )?(?:void|int|smc_real|int32_t) ([\w$]+)\(([^)]*)\)", _head, code, flags=re.MULTILINE)
    code = re.sub(r"^( *)([\w$]+)\(([^;]*?),?\s*(&[^;]*)\);", _call, code, flags=re.MULTILINE)
    code = code.replace("(int32_t)", "~~").replace("(smc_real)", "").replace("y->", "y.")
    return re.sub(rf"(?<=[\s(]){TYPE_PATTERN} (?=[\w$]+ = )", "let ", code)


def _head(match: re.Match[str]) -> str:
    """Rewrite a function's head, without its types and the pointers to its results."""
    names = [re.split(r"[\s*]", argument)[-1] for argument in match[2].split(",") if argument.strip() != "void"]
    return f"function {match[1]}({', '.join(name for name in names if not re.fullmatch(r'out_[0-9]+', name))})"


def _body(match: re.Match[str]) -> str:
    """Rewrite a function's body: results go to local variables and are returned together."""
    body = match[1]
    if results := sorted(set(re.findall(r"\*(out_\d+) = ", body)), key=lambda name: int(name[4:])):
        body = re.sub(r"\*(out_\d+) = ", r"\1 = ", body)
        body = re.sub(r"\breturn;", f"return [{', '.join(results)}];", body)
        body = f"    let {', '.join(results)};\n{body}"
    return f"\n{{\n{body}\n}}"


def _call(match: re.Match[str]) -> str:
    """Rewrite the call of a function with several results."""
    targets = ", ".join(target.strip().removeprefix("&") for target in match[4].split(","))
    return f"{match[1]}[{targets}] = {match[2]}({match[3].strip()});"


def _word(match: re.Match[str]) -> str:
    """Rewrite a name."""
    word = match[0]
    if word in {"NAN", "INFINITY"}:
        return {"NAN": "NaN", "INFINITY": "Infinity"}[word]
    if word in MATH_FUNCTIONS and match.string[match.end() : match.end() + 1] == "(":
        return f"Math.{RENAMED_FUNCTIONS.get(word, word)}"
    return f"{word}$" if word in RESERVED else word
