"""The live page as a folder: the files of page/, facts.json, the components in JavaScript, and packages from npm."""

import contextlib
import json
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

from smc_mujoco.common.errors import ScenarioError, items_of, shown
from smc_mujoco.common.files import plain
from smc_mujoco.control import estimator, surface
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import checked_name
from smc_mujoco.control.law import law as find_law
from smc_mujoco.control.law import laws as laws_for
from smc_mujoco.control.properties import reads
from smc_mujoco.exchange.c.javascript import to_js
from smc_mujoco.exchange.live import facts as known
from smc_mujoco.exchange.live import npm
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.grid import listed_laws

PAGE_FOLDER = Path(__file__).parent / "page"
DEFAULT_PLANTS = ("inverted_pendulum", "duffing", "van_der_pol")  # the paper's three plants with one joint
FACTS_FILE = "facts.json"  # a folder with this file is a live page, which may be replaced


def live(
    plants: Sequence[str | Plant] = DEFAULT_PLANTS,
    laws: Sequence[Component | Template | str] = (),
    out: str | os.PathLike[str] = "live",
) -> Path:
    """Build the live page: plants and laws in a browser, where MuJoCo simulates them and the reader moves the sliders.

    The folder works on every web server, also without network, such as `python -m http.server --directory live`. The
    first call fetches MuJoCo for browsers and three.js with npm. Node.js has npm, and so has the extra: pip install
    'smc-mujoco[live]'.

    Args:
      plants: plants of the library with one motor, or their names.
      laws: your own laws, also as text, see `law`, in addition to those of the library.
      out: the folder to write.

    Returns:
      The path of its index.html.

    Raises:
      ScenarioError: a plant or law that the page cannot have, no npm, or a folder with other files in it.
    """
    names = [plants] if isinstance(plants, str | Plant) else items_of("plants", plants)
    chosen = known.checked(names or DEFAULT_PLANTS)
    users = [checked_name(coerce.law(law)) for law in (listed_laws(laws) if laws else ())]
    functions = {("law", law.name): to_js(law) for law in users}
    offered = list(users)
    for component in _library(chosen):
        with contextlib.suppress(ScenarioError):  # raised for one that has no translation, such as a law in C
            if (component.kind, component.name) not in functions:
                functions[component.kind, component.name] = to_js(component)
                offered.append(component)
    page = known.facts(chosen, offered, users)
    folder = _writable(Path(out))
    vendor = npm.fetched()
    shutil.copytree(PAGE_FOLDER, folder, dirs_exist_ok=True)
    shutil.copytree(vendor, folder / "vendor", dirs_exist_ok=True)
    (folder / "components.js").write_text(_script(functions), encoding="utf-8")
    (folder / FACTS_FILE).write_text(json.dumps(plain(page), separators=(",", ":")), encoding="utf-8")
    return folder / "index.html"


def _library(chosen: Sequence[Plant]) -> list[Component]:
    """Return the library's laws that suit one of the plants, its surfaces and its velocity estimators."""
    laws = [find_law(name) for name in dict.fromkeys(name for plant in chosen for name in laws_for(plant))]
    # surfaces that read an acceleration are for actuators with a lag, which the page does not have
    surfaces = [template() for template in surface.catalogue().values() if "a" not in reads(template)]
    return [*laws, *surfaces, *(template() for template in estimator.catalogue().values())]


def _script(functions: Mapping[tuple[str, str], str]) -> str:
    """Return a module that exports laws, surfaces and estimators, each an object of functions by name."""
    lines = []
    for kind in ("law", "surface", "estimator"):
        entries = [f"{json.dumps(name)}: {text},\n" for (of, name), text in functions.items() if of == kind]
        lines.append(f"export const {kind}s = {{\n{''.join(entries)}}};\n")
    return "".join(lines)


def _writable(folder: Path) -> Path:
    """Return the folder if it is new, empty or a live page; refuse others."""
    try:
        folder.stat()
        other = not folder.is_dir() or (any(folder.iterdir()) and not (folder / FACTS_FILE).is_file())
    except FileNotFoundError:
        other = False
    except (OSError, ValueError) as error:  # a name that no folder can have
        raise ScenarioError(f"cannot write the live page to {shown(str(folder))}: {error}") from None
    if other:
        raise ScenarioError(f"cannot write the live page to {folder}: something else is there, choose another folder")
    return folder
