"""Laws and other components from text: `pid`, `pid(kp=50,ki=50,kd=8)`, or a file with a law.

    smc.law("gains.json")        # what `smc-mujoco tune --out gains.json` wrote
    smc.law("my_law.py", lam=5)  # a law made by @smc.law_function
    smc.law("my_law.py(gains.json)")  # the same, after it was tuned
    smc.law("my_laws.py:second(k1=2)")  # one of several laws of a file
    smc.law("slow: classical(k=2, c=3)")

Files are Python (.py), tunings (.json), C (.c, .so) and FMUs (.fmu). Gains in brackets may follow a
file, too. A text is parsed and never evaluated, but the code of a file is run. So data that others
wrote is restored by component_json.py, which runs no files.
"""

import ast
import contextlib
import dataclasses
import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from smc_mujoco.common import annexes
from smc_mujoco.common.aliases import Data
from smc_mujoco.common.errors import ScenarioError, find, shown, warn_once
from smc_mujoco.common.files import read_json, reading, unsealed
from smc_mujoco.common.scripts import IN_FILE, execute, object_named
from smc_mujoco.common.text import UNDERSCORED
from smc_mujoco.control import component_json, gain_sets
from smc_mujoco.control.component import Component, GainValue, Template
from smc_mujoco.control.law import Law, all_laws
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import plant_catalogue as plants_known

# pid(kp=50,ki=50,kd=8)
NAME_AND_GAINS = re.compile(r"(?P<head>[^()]+?)\s*(?:\((?P<gains>.*)\))?", re.DOTALL)
# slow: pid(kp=50)
LABELLED = re.compile(
    r"(?P<label>[^:()]+)(?<!\.py):\s*(?P<rest>.+(?:\(.*\)|\.\w+(?::\w+)?)\s*)", re.DOTALL
)

# my_law.py(gains.json)
FILE_AND_TUNING = re.compile(r"(?P<file>[^()]+\.\w+(?::\w+)?)\s*\((?P<tuning>[^()=]+\.json)\)")

UNREADABLE = SyntaxError, ValueError, RecursionError, MemoryError


def law(
    text: str | Law | Template,
    /,
    plant: Plant | str | None = None,
    **gains: float | Sequence[float],
) -> Law:
    """Return a law from a text, with these gains.

        smc.law("pid", kp=30.0)          # the other gains are its defaults
        smc.law("pid", plant="duffing")  # the gains that searches found for this plant

    `smc.law(...).named("slow")` gives it another name, and `smc.law("pid").gains` are its gains.
    `print(smc.law("pid").template.doc)` shows a law's equation, and what its gains mean, with their
    units.

    Args:
      text: the name of a law of the library, such as "pid"; a name with gains, such as
        "pid(kp=50,ki=50,kd=8)"; or a file with one law: FILE.json that `smc-mujoco tune` wrote,
        FILE.py, FILE.c or FILE.fmu, also with its tuning, as "FILE.py(FILE.json)"; one of several
        laws of a file, as "FILE.py:name". Or your own law itself.
      plant: a Plant or the name of one. The gains that are not given are then those that the
        package ships for a law of the library on it, of the search with the least J.
      gains: one number for all channels, or a sequence with one for each driven channel.

    Returns:
      A Law, for `law` of a Scenario.

    Raises:
      ScenarioError: an unknown law or gain, a gain out of range, a file without a law or with
        several, or a plant for which no gains of the law are shipped.

    Warns:
      GainWarning: gains that violate a condition of the law's theorem.
      ScenarioWarning: a plant whose parameters are not those for which gains were tuned.
    """
    if plant is not None and "plant" in getattr(text, "gains", ()):  # a gain of one's own law
        gains = {"plant": plant, **gains}  # pyright: ignore[reportAssignmentType]
    elif plant is not None:
        return _shipped(text, as_plant(plant), gains)
    if isinstance(text, Template) and text.kind == "law":
        return _with_gains(text(), gains)
    if isinstance(text, Law) and text.kind == "law":
        return _with_gains(text, gains)
    of_text = laws_of_text(text)
    if len(of_text) > 1:
        names = []
        for item in of_text:
            names.append(item if isinstance(item, str) else item.name)
        raise ScenarioError(
            f"{text} has several laws, {', '.join(names)}: give one, as FILE.py:{names[0]}"
        )
    first = of_text[0]
    return _with_gains(all_laws()[first]() if isinstance(first, str) else first, gains)


def _shipped(text: object, plant: Plant, gains: Mapping[str, float | Sequence[float]]) -> Law:
    """Return a law of the library with these gains, and the others as shipped for a plant."""
    if not isinstance(text, str):
        raise ScenarioError(
            f"law {shown(text)} is none of the library by its name: leave plant={plant.name!r} out"
        )
    head, gains_of_text = _parts("law", text, "pid(kp=50,ki=50,kd=8)")
    shipped = gain_sets.law_with_gains(plant, head)
    warn_once(gain_sets.other_parameters_warning(plant))
    if not (gains_of_text or gains):
        return shipped
    return all_laws()[head].bind({**shipped.gains, **gains_of_text, **gains}, warn=True)


def laws_of_text(text: object) -> list[str | Law]:
    """Return the laws of a text. The name of a law of the library stays a name, which sets of gains
    need.
    """
    if not isinstance(text, str) or text in all_laws():
        find("law", text, all_laws())
        return [str(text)]
    if os.path.exists(text):
        head = text
        gains = {}
    elif labelled := LABELLED.fullmatch(text):
        return [law(labelled["rest"]).named(labelled["label"].strip())]
    elif tuned := FILE_AND_TUNING.fullmatch(text):
        of_file = _tuned(tuned["tuning"])
        own = law(tuned["file"])
        module = getattr(own.function, "__module__", "")
        # a law that has another name by `named` is still of its module
        if own.name != of_file.name and module != _described(tuned["tuning"])["law"].get("module"):
            raise ScenarioError(
                f"{tuned['tuning']} has gains of law {of_file.name!r}, and {tuned['file']} has law "
                f"{own.name!r}: give the file of the same law"
            )
        component_json.check_gains(of_file.name, of_file.gains, own.gains)
        return [dataclasses.replace(_with_gains(own, of_file.gains), source=of_file.source)]
    else:
        head, gains = _parts("law", text, "pid(kp=50,ki=50,kd=8)")
    if IN_FILE.fullmatch(head):
        return [_with_gains(law(object_named(head, "law", _is_law)), gains)]
    if read := _reader(head):
        return [_with_gains(law, gains) for law in read(head)]
    return [find("law", head, all_laws()).bind(gains, warn=True)]


def component(kind: str, text: str, known: Mapping[str, Template], example: str) -> Component:
    """Return a component of a catalogue from its name, with gains in brackets or without. Errors
    give the example.
    """
    head, gains = _parts(kind, text, example)
    return find(kind, head, known).bind(gains, warn=True)


def _parts(kind: str, text: str, example: str) -> tuple[str, dict[str, GainValue]]:
    """Return the part of a text before its brackets, and the gains in the brackets."""
    try:
        matched = NAME_AND_GAINS.fullmatch(text.strip())
        if not matched:
            raise ValueError
        return matched["head"], _gains(matched["gains"] or "")
    except UNREADABLE:
        raise ScenarioError(f"{kind} {shown(text)} cannot be read: write it as {example}") from None


def _gains(text: str) -> dict[str, GainValue]:
    """Return the gains in a text such as "kp=50, ki=(1, 2)"; one of UNREADABLE for another text."""
    call = ast.parse(f"f({text})", mode="eval").body
    if not isinstance(call, ast.Call) or call.args or UNDERSCORED.search(text):
        raise ValueError
    gains: dict[str, GainValue] = {}
    for word in call.keywords:
        if word.arg is None or word.arg in gains:
            raise ValueError
        if isinstance(word.value, ast.Tuple | ast.List):
            gains[word.arg] = tuple(float(ast.unparse(number)) for number in word.value.elts)
        else:
            gains[word.arg] = float(ast.unparse(word.value))
    return gains


def _with_gains(law: Law, gains: Mapping[str, float | Sequence[float]]) -> Law:
    """Return a law with some gains changed."""
    if not gains:
        return law
    if law.template is None:
        raise ScenarioError(f"law {law} takes no gains here: leave {', '.join(gains)} out")
    return law.template.bind({**law.gains, **gains}, warn=True)


def _is_law(thing: Any) -> bool:
    """Return whether a thing of a user's file is a law, with gains or to be given them."""
    return isinstance(thing, Law | Template) and thing.kind == "law"


def _of_python(path: str) -> list[Law]:
    """Return the laws of a Python file: of @smc.law_function, with their default gains, and of
    smc.law_from.
    """
    templates = {}
    bound = {}
    for value in filter(_is_law, execute(Path(path)).values()):
        if isinstance(value, Template):
            templates[value.name] = value
        else:
            bound[value.name] = value
    laws = []
    for name, template in templates.items():
        if template is not all_laws().get(name):
            laws.append(template())
    # a law that is a template with gains is not one more
    functions = {template.function for template in (*templates.values(), *all_laws().values())}
    for law in bound.values():
        if functions.isdisjoint(part.function for part in law.parts):
            laws.append(law)
    if not laws:
        raise ScenarioError(
            f"{path} has no law: write @smc.law_function above a function (y, gains, memory), "
            "or law = smc.law_from(..)"
        )
    return laws


def _of_tuning(path: str) -> list[Law]:
    law = _tuned(path)
    if law.function is None:
        raise ScenarioError(
            f"law {law.name} of {path} is your own: give its file with it, as FILE.py({path})"
        )
    return [law]


def _tuned(path: str) -> Law:
    """Return the law of a tuning, with its search as the source of the gains."""
    scenario = _described(path)
    with _reading(path):
        tuned = component_json.restored_law(scenario["law"], scenario["source"])
        of_library = scenario["plant"]["module"].startswith("smc_mujoco.mechanisms.plants.")
    if of_library:
        find(f"plant of {path}", scenario["plant"]["name"], plants_known())
    return tuned


def _described(path: str) -> Data:
    """Return the scenario of a tuning, as data."""
    with _reading(path) as file:
        return unsealed(read_json(file))["scenario"]


def _reading(path: str) -> contextlib.AbstractContextManager[Path]:
    return reading(path, "tuning", "give a .json file that smc-mujoco tune or Tuned.save wrote")


def _of_c(path: str) -> list[Law]:
    return [annexes.module("smc_mujoco.exchange.c.law_from_c", f"law {path}").law_from_c(path)()]


def _of_fmu(path: str) -> list[Law]:
    return [
        annexes.module("smc_mujoco.exchange.fmu.law_from_fmu", f"law {path}").law_from_fmu(path)()
    ]


READERS: dict[str, Callable[[str], list[Any]]] = {  # by suffix
    ".py": _of_python,
    ".json": _of_tuning,
    ".c": _of_c,
    ".so": _of_c,
    ".fmu": _of_fmu,
}


def _reader(text: str) -> Callable[[str], list[Any]] | None:
    """Return the function that reads the laws of a file; None if the text names no file."""
    suffix = Path(text).suffix
    exists = os.path.exists(text)
    if suffix in READERS and not exists:
        raise ScenarioError(f"no file {text!r}: give a file with a law in it, or a name")
    if suffix not in READERS and exists:
        raise ScenarioError(f"{text} is no file of a law: give {', '.join(READERS)}, or a name")
    return READERS.get(suffix)


def parsed_gains(text: str, what: str) -> dict[str, GainValue]:
    """Return the gains in a text such as "lam=6,k1=3 5", where k1 is 3 and 5 for two joints. Errors
    call it `what`.
    """
    numbers = re.compile(r"=\s*([^\s,]+(?:\s+[^\s,]+)+)")
    listed = numbers.sub(lambda found: f"=({','.join(found[1].split())})", text.strip(" ,"))
    try:
        return _gains(listed)
    except UNREADABLE:
        raise ScenarioError(
            f"{what} is {shown(text)}: give names and numbers, each once, such as lam=6,k1=3"
        ) from None
