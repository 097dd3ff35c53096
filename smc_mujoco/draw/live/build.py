"""The live page as a folder: the page's own files, the facts, the laws in JavaScript, and the packages from npm."""

import contextlib
import json
import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from smc_mujoco.common.errors import ScenarioError, shown, taken
from smc_mujoco.common.files import plain
from smc_mujoco.control.c.javascript import law_to_js
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import checked_name
from smc_mujoco.control.law import law as find_law
from smc_mujoco.control.law import laws as laws_for
from smc_mujoco.draw.live import facts as known
from smc_mujoco.draw.live import npm
from smc_mujoco.mechanisms.plant import Plant

PAGE = Path(__file__).parent / "page"
PLANTS = ("inverted_pendulum", "duffing", "van_der_pol")  # the paper's three plants with one joint
MARK = "facts.json"  # a folder with it is a live page, which may be replaced


def live(
    plants: Sequence[str | Plant] = PLANTS,
    laws: Sequence[Component | Template] = (),
    out: str | os.PathLike = "live",
) -> Path:
    """Build the live page: plants and laws in a browser, where MuJoCo simulates them and the reader moves the sliders.

    The folder works on every web server, also without network, such as `python -m http.server --directory live`. The
    first call fetches MuJoCo for browsers and three.js with npm, which `pip install 'smc-mujoco[live]'` brings.

    Args:
      plants: names of plants with one motor.
      laws: your own laws, beside those of the library.
      out: the folder.

    Returns:
      The path of its index.html.

    Raises:
      ScenarioError: a plant or law that the page cannot have, no npm, or a folder with other files in it.
    """
    names = [plants] if isinstance(plants, str | Plant) else taken("plants", plants)
    chosen = known.checked(names or PLANTS)
    own = [_own(law) for law in taken("laws", laws)]
    functions = {law.name: law_to_js(law) for law in own}
    library = [law for law in _library(chosen) if law.name not in functions]
    for law in library:
        with contextlib.suppress(ScenarioError):  # of one that no browser runs, such as a law in C
            functions[law.name] = law_to_js(law)
    page = known.facts(chosen, [law for law in library if law.name in functions], own)
    folder = _free(Path(out))
    vendor = npm.fetched()
    shutil.copytree(PAGE, folder, dirs_exist_ok=True)
    shutil.copytree(vendor, folder / "vendor", dirs_exist_ok=True)
    entries = ",\n".join(f"{json.dumps(name)}: {text}" for name, text in functions.items())
    (folder / "laws.js").write_text(f"export const laws = {{\n{entries},\n}};\n", encoding="utf-8")
    (folder / MARK).write_text(json.dumps(plain(page), separators=(",", ":")), encoding="utf-8")
    return folder / "index.html"


def _library(chosen: Sequence[Plant]) -> list[Component]:
    """Return the laws of the library that suit one of the plants."""
    return [find_law(name) for name in dict.fromkeys(name for plant in chosen for name in laws_for(plant))]


def _own(law: object) -> Component:
    """Return a user's law, with its default gains if it is a template."""
    made = law() if isinstance(law, Template) else law
    if not isinstance(made, Component) or made.kind != "law":
        raise ScenarioError(f"laws has {shown(law)}: give laws made by @smc.law_function")
    return checked_name(made)


def _free(folder: Path) -> Path:
    """Return a folder that is new, empty or a live page.

    Raises:
      ScenarioError: other files are in it.
    """
    if folder.exists() and (not folder.is_dir() or (any(folder.iterdir()) and not (folder / MARK).is_file())):
        raise ScenarioError(f"cannot write the live page to {folder}: something else is there, choose another folder")
    return folder
