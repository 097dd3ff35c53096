"""Whether a user's compiled model can be a plant: its numbers are numbers, and its names none that plants use."""

import mujoco
import numpy as np

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.custom import mjcf
from smc_mujoco.mechanisms.hardware.part import PLAY, ROTOR
from smc_mujoco.mechanisms.plant import LARGEST

OURS = ("smc:", PLAY, ROTOR)  # what the names of our own parts begin with,
NAMED = [getattr(mujoco.mjtObj, f"mjOBJ_{kind}") for kind in ("BODY", "JOINT", "GEOM", "TENDON", "TEXT")]  # of these
UNUSED = (
    "_user",
    "numeric_data",
    "key_",
    "bvh_",
    "aabb",
    "invweight0",
)  # fields that set no motion, or follow from others
KINDS = {
    "body": mujoco.mjtObj.mjOBJ_BODY,
    "jnt": mujoco.mjtObj.mjOBJ_JOINT,
    "geom": mujoco.mjtObj.mjOBJ_GEOM,
    "site": mujoco.mjtObj.mjOBJ_SITE,
    "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "tendon": mujoco.mjtObj.mjOBJ_TENDON,
    "eq": mujoco.mjtObj.mjOBJ_EQUALITY,
}


def check_model(label: str, model: mujoco.MjModel) -> None:
    """Raise ScenarioError for NaN or enormous numbers, and for names that plants use themselves."""
    check_numbers(label, model)
    for name in [text.decode() for text in model.names.split(b"\0")]:
        begins = next((start for start in OURS if name.startswith(start)), None)
        kinds = [kind.name[6:].lower() for kind in NAMED if begins and mujoco.mj_name2id(model, kind, name) >= 0]
        if kinds:
            raise ScenarioError(
                f"{label} has a {kinds[0]} {name!r}, and names that begin with {begins!r} are smc_mujoco's own: "
                "give it another"
            )


def check_numbers(label: str, model: mujoco.MjModel) -> None:
    """Raise ScenarioError for a number that is NaN, infinite or beyond 1e15 SI units; ranges may be infinite."""
    named = sorted(mjcf.fields(model), key=lambda name: name.partition("_")[0] not in KINDS)  # what has names first
    arrays = [(name, getattr(model, name)) for name in named]
    arrays += [(f"opt.{name}", np.atleast_1d(getattr(model.opt, name))) for name in ("gravity", "wind", "density")]
    for field, values in arrays:
        if values.dtype.kind != "f" or any(part in field for part in UNUSED):
            continue
        wrong = np.isnan(values) if field.endswith("range") else ~(np.abs(values) <= LARGEST)
        if wrong.any():
            place = tuple(np.argwhere(wrong)[0])
            raise ScenarioError(
                f"{field} of {label} is {values[place]:g}{_where(model, field, int(place[0]))}: "
                f"give finite numbers of at most {LARGEST:g} in its MJCF"
            )


def _where(model: mujoco.MjModel, field: str, i: int) -> str:
    """Return the body, joint, ... to which a number in a field belongs."""
    owner = field.partition("_")[0]
    if owner == "dof":
        owner, i = "jnt", int(model.dof_jntid[i])
    name = mujoco.mj_id2name(model, KINDS[owner], i) if owner in KINDS else None
    return f" at {KINDS[owner].name[6:].lower()} {name!r}" if name else ""
