"""Plants as users name them: by a name of the library, or by an MJCF model and the joints to control.

as_plant("duffing")
as_plant("arm.xml:shoulder,elbow")
"""

import re
from pathlib import Path
from typing import Any

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.mechanisms.plant import Plant, plant

MODEL = re.compile(r"(?P<path>.*\.xml)(?::(?P<joints>.*))?", re.DOTALL)


def as_plant(value: object) -> Plant:
    """Return a plant: itself, by its name, or from "FILE.xml:joint,joint"."""
    made = from_text(value) if isinstance(value, str) else value
    if not isinstance(made, Plant):
        raise ScenarioError(
            f"plant is {shown(made)}: give a name that smc.plants() lists, smc.plant(...), or FILE.xml:joint,joint"
        )
    return made


def from_text(text: str, folder: Path = Path(), **values: Any) -> Plant:
    """Return a plant by its name and parameters, or from FILE.xml:joint,joint in a folder and `plant_from`'s arguments.

    A comma or a plus sign is between the joints: plants are separated by commas on the command line.
    """
    if not (model := MODEL.fullmatch(text)):
        return plant(text, **values)
    from smc_mujoco.mechanisms.custom.plant_from import plant_from

    path, joints = model["path"], [joint.strip() for joint in re.split("[+,]", model["joints"] or "")]
    if not any(joints):
        raise ScenarioError(f"plant {text!r} names no joints: say which are controlled, as {path}:shoulder+elbow")
    return plant_from(folder / path, list(filter(None, joints)), **values)
