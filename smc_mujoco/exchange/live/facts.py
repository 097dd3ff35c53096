"""facts.json of the live page: what the page knows of plants, laws, surfaces and velocity estimators.

Labels, formulas, colours, gains and their ranges come from the catalogues, the numbers of a model from the plant. The
page loads the plant's MJCF and sets the same fields of the model as a run does.
"""

import contextlib
import inspect
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.common.errors import ScenarioError, unknown
from smc_mujoco.common.mjcb import compiled
from smc_mujoco.common.version import __version__
from smc_mujoco.control import gain_sets
from smc_mujoco.control.component import Component
from smc_mujoco.control.docstring import entry
from smc_mujoco.control.law import Measurement, laws, suits
from smc_mujoco.control.properties import reads
from smc_mujoco.draw import style
from smc_mujoco.draw.film import arrows
from smc_mujoco.mechanisms.hardware.friction import Coulomb
from smc_mujoco.mechanisms.hardware.part import drive_ids, joint_ids
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Field, Plant, catalogue, field_array, model_path
from smc_mujoco.simulation import controller
from smc_mujoco.simulation import scenario as defaults
from smc_mujoco.simulation.conditions import SENSOR_NOISE, SINE

MODEL_FIELDS = frozenset({"f", "g", "fq", "gq"})  # fields of the measurement that need the nominal mechanism
SLIDER_FACTOR = 10.0  # of a slider's ends over and under the gain, where tuning has no range: chosen
MAX_ACRONYM_LETTERS = 3  # names of at most so many letters are written in capitals, such as PID
OPENING_LAWS = ("observer_free", "classical")  # laws with which the page opens: the paper's, and classical sliding mode


def plants() -> list[str]:
    """List the plants that the page can have: one motor, a model that is one file, and no dry friction of its own."""
    return [name for name, plant in catalogue().items() if _why_not(plant) == ""]


def _why_not(plant: Plant) -> str:
    """Return why the page cannot have a plant, worded to follow its name; "" if it can."""
    if plant.driven != 1:
        return f"has {plant.driven} motors"
    if not plant.smooth:
        return "has dry friction in its equation"
    if plant.name not in catalogue() or not _mjcf(plant).is_file():
        return "is not one MJCF file of the package"
    return ""


def checked(names: Sequence[str | Plant]) -> list[Plant]:
    """Return the plants of these names."""
    for name in names:
        if isinstance(name, str) and name not in catalogue():
            raise unknown("plant", name, plants())
    chosen = [as_plant(name) for name in dict.fromkeys(names)]
    for plant in chosen:
        if why := _why_not(plant):
            known = ", ".join(plants())
            raise ScenarioError(f"the live page cannot show {plant.name}, which {why}: choose from {known}")
    return chosen


def facts(chosen: Sequence[Plant], offered: Sequence[Component], users: Sequence[Component]) -> dict[str, Any]:
    """Return facts.json as a dict."""
    models = [_mjcf(plant).read_text(encoding="utf-8") for plant in chosen]
    included = {name for text in models for name in re.findall(r'<include file="([^"]+)"', text)}
    kinds = {kind: [part for part in offered if part.kind == kind] for kind in ("law", "surface", "estimator")}
    return {
        "version": __version__,
        "includes": {name: model_path(name).read_text(encoding="utf-8") for name in sorted(included)},
        "noise": {"position": SENSOR_NOISE.position, "velocity": SENSOR_NOISE.velocity},
        "max_step": defaults.MAX_STEP,
        "realistic_step": defaults.REALISTIC_STEP,
        "control_period": defaults.Scenario.control_period,
        "last_stage": controller.LAST_STAGE,
        "max_state": controller.MAX_STATE,
        "max_control": controller.MAX_CONTROL,
        "arrow": {
            "arc": arrows.HINGE_LENGTH, "of_radius": arrows.RADIUS_SHARE, "of_length": arrows.LENGTH_SHARE,
            "long": arrows.LONG_PENDULUM, "off_arc": arrows.ARC_DISTANCE, "off_rail": arrows.RAIL_DISTANCE,
            "shortest": arrows.MIN_LENGTH,
        },
        "own": [law.name for law in users],
        "plants": {plant.name: _plant(plant, kinds, users) for plant in chosen},
        "laws": {law.name: _component(law) | _law(law) for law in kinds["law"]},
        "surfaces": {surface.name: _component(surface) for surface in kinds["surface"]},
        "estimators": {estimator.name: _component(estimator) for estimator in kinds["estimator"]},
    }  # fmt: skip


def _component(component: Component) -> dict[str, Any]:
    """Return the facts about a law, surface or estimator that the page shows and the engine needs."""
    parts = entry(component.template) if component.template is not None and component.template.doc else None
    name = component.name.rstrip("_")
    return {
        "label": name.upper() if len(name) <= MAX_ACRONYM_LETTERS else style.in_words(name),
        "formula": parts.formula if parts and parts.formula != component.name else "",
        "source": parts.source if parts else "",
        "order": list(component.gains),
        "gains": dict(component.gains),
        "memory": component.memory,
    }


def _law(law: Component) -> dict[str, Any]:
    """Return the facts that only laws have."""
    read = reads(law.template) if law.template is not None else frozenset(Measurement._fields)
    return {
        "label": style.law_name(law), "colour": style.law_colour(law),
        "colour_dark": style.lighter(style.law_colour(law)),
        "family": law.template.family if law.template is not None else "", "requires_model": law.requires_model,
        "reads_model": bool(read & MODEL_FIELDS), "takes_surface": "has_surface" in read and law.relative_degree == 1,
    }  # fmt: skip


def _plant(plant: Plant, kinds: Mapping[str, Sequence[Component]], users: Sequence[Component]) -> dict[str, Any]:
    """Return the facts about a plant, with gains and ranges of the components that are offered on it."""
    model = mujoco.MjModel.from_xml_path(str(_mjcf(plant)))
    joints = [model.joint(int(joint)) for joint in joint_ids(model)]
    resolved = defaults.Scenario(plant=plant, law="none").resolved
    suited = set(laws(plant))
    offered = [law for law in kinds["law"] if (law.name in suited if law.name in laws() else suits(law, plant))]
    gains = {law.name: _gains(law, plant, law in users) for law in offered}
    return {
        "label": style.plant_name(plant),
        "equation": _equation(plant),
        "mjcf": _mjcf(plant).read_text(encoding="utf-8"),
        "x0": list(resolved.x0),
        "u_max": resolved.limits[0],
        "effort": plant.efforts[0],
        "channels": [
            {"name": joint.name, "qpos": int(joint.qposadr[0]), "dof": int(joint.dofadr[0]), "unit": unit}
            for joint, unit in zip(joints, plant.units, strict=True)
        ],
        "ctrl": int(drive_ids(model)[0]),
        "extent": float(model.stat.extent),  # m, of the picture
        "center": model.stat.center.tolist(),
        "fields": _fields(model, plant),
        "skins": _skins(plant),
        "friction": [_part(model, field) for field in Coulomb(1.0).fields(model)],
        "laws": list(gains),
        "gains": gains,
        "ranges": {law.name: _ranges(law, plant, gains[law.name]) for law in offered},
        "surface_ranges": {part.name: _ranges(part, plant, part.gains) for part in kinds["surface"]},
        "estimator_ranges": {part.name: _ranges(part, plant, part.gains) for part in kinds["estimator"]},
        "start": _opening([law.name for law in users if law.name in gains], list(gains)),
        "started": max(range(plant.n), key=lambda i: abs(resolved.x0[i])),
        "beside": abs(plant.lane[0]) > abs(plant.lane[1]),
        "conditions": _conditions(plant, resolved),
    }


def _opening(users: Sequence[str], offered: Sequence[str]) -> list[str]:
    """Return the names of at most two laws with which the page opens: the user's, OPENING_LAWS, then others."""
    names = [*users, *(name for name in OPENING_LAWS if name in offered), *(name for name in offered if name != "none")]
    return list(dict.fromkeys(names))[:2]


def _mjcf(plant: Plant) -> Path:
    return model_path(f"{plant.name}.xml")


def _conditions(plant: Plant, s: defaults.Resolved) -> list[dict[str, Any]]:
    """Return the conditions that have a slider: name, label, unit, range, value and step. The ranges are chosen."""
    started = max(range(plant.n), key=lambda i: abs(s.x0[i]))
    reach, bound, unit, effort = abs(s.x0[started]), s.limits[0], plant.units[started], plant.efforts[0]
    far = min(2.0 * reach, defaults.MAX_ANGLE if unit == "rad" else math.inf)
    noisy = f"Noise (× {SENSOR_NOISE.position:g} {plant.units[0]}, {SENSOR_NOISE.velocity:g} {plant.units[0]}/s)"
    begins = "Start, x at t = 0" if started == 0 else "Start of the free joint"
    rows = [
        ("start", begins, unit, -far, far, s.x0[started], 0.01),
        ("reference", "Reference r", plant.units[0], -reach, reach, 0.0, 0.01),
        ("bound", "Bound on u", effort, bound / 20, bound if plant.limits else 3.0 * bound, bound, None),
        ("mass", "Mass of the plant", "×", 0.5, 3.0, 1.0, 0.05),
        ("friction", "Dry friction in each joint", effort, 0.0, 0.2 * bound, 0.0, bound / 200),
        ("delay", "Delay of u", "ms", 0.0, 50.0, 0.0, 1.0),
        ("period", "Control period", "ms", 1.0, 50.0, 1.0, 1.0),
        ("noise", noisy, "×", 0.0, 3.0, 0.0, 0.1),
        ("amplitude", "Disturbance, amplitude of a sine", effort, 0.0, bound, 0.0, bound / 100),
        ("omega", "Disturbance, frequency", "rad/s", 0.5, 30.0, SINE.omega, 0.5),
    ]
    names = ("name", "label", "unit", "least", "most", "value", "step")
    return [dict(zip(names, row, strict=True)) for row in rows]


def _equation(plant: Plant) -> str:
    """Return the plant's equation: what follows the colon in the first line of its file's docstring."""
    lines = (inspect.getmodule(plant.build).__doc__ or "").splitlines()  # pyright: ignore[reportOptionalMemberAccess]
    first = lines[0].partition(": ")[2]
    return first.partition(", x the")[0].partition("  (")[0].rstrip(".") if "=" in first else ""


def _fields(model: mujoco.MjModel, plant: Plant) -> dict[str, list[list[float]]]:
    """Return field -> its flat values with the plant's parameters, and those with twice the mass.

    All fields are linear in the mass, so the page can compute them for any mass.
    """
    written: list[dict[str, np.ndarray]] = [{}, {}]
    for fields, factor in zip(written, (1.0, 2.0), strict=True):
        for name, at, value, adds in plant.fields(model, plant.values({"mass": factor})):
            values = fields.setdefault(name, field_array(model, name).astype(float).copy())
            values[at] = values[at] + value if adds else value
    return {name: [fields[name].ravel().tolist() for fields in written] for name in written[0]}


def _skins(plant: Plant) -> list[dict[str, Any]]:
    """Return the skins, such as springs, that the plant's build adds to its MJCF. Bones move vertices by weights."""
    model, skins = compiled(plant.spec()), []
    for i in range(model.nskin):
        first, count = model.skin_vertadr[i], model.skin_vertnum[i]
        face, faces = model.skin_faceadr[i], model.skin_facenum[i]
        bones = range(model.skin_boneadr[i], model.skin_boneadr[i] + model.skin_bonenum[i])
        weights = np.zeros((count, len(bones)))
        for column, bone in enumerate(bones):
            at = slice(model.skin_bonevertadr[bone], model.skin_bonevertadr[bone] + model.skin_bonevertnum[bone])
            weights[model.skin_bonevertid[at], column] = model.skin_bonevertweight[at]
        skins.append(
            {
                "rgba": model.mat_rgba[model.skin_matid[i]].tolist(),
                "vertices": model.skin_vert[first : first + count].round(5).ravel().tolist(),
                "faces": model.skin_face[face : face + faces].ravel().tolist(),
                "weights": weights.round(5).ravel().tolist(),
                "bones": [_bone(model, bone) for bone in bones],
            }
        )
    return skins


def _bone(model: mujoco.MjModel, bone: int) -> dict[str, Any]:
    """Return the body that a bone of a skin follows, and its pose when the skin is at rest."""
    return {
        "body": model.body(int(model.skin_bonebodyid[bone])).name,
        "position": model.skin_bonebindpos[bone].tolist(),
        "quaternion": model.skin_bonebindquat[bone].tolist(),
    }


def _part(model: mujoco.MjModel, field: Field) -> dict[str, Any]:
    """Return what a part writes into a field of the model: the places in the flat field, and a value for each."""
    values = field_array(model, field.name)
    places = np.arange(values.size).reshape(values.shape)[field.at]
    return {
        "name": field.name,
        "at": places.ravel().tolist(),
        "value": np.broadcast_to(field.value, places.shape).ravel().tolist(),
        "adds": field.adds,
    }


def _gains(law: Component, plant: Plant, users: bool) -> dict[str, float]:
    """Return a law's gains on a plant: its own, or tuned ones for a law of the library that has them."""
    values = dict(law.gains)
    if not users:
        with contextlib.suppress(ScenarioError):
            values = dict(gain_sets.law(plant, law.name).gains)
    return values


def _ranges(component: Component, plant: Plant, values: Mapping[str, float]) -> dict[str, list[float]]:
    """Return gain -> least and largest value of its slider, for gains to be chosen: no exponent or initial value."""
    known: Mapping[str, tuple[float, float]] = {}
    with contextlib.suppress(ScenarioError):
        scales = search_space.scales(plant, defaults.default_u_max(plant))
        if component.kind != "estimator":  # an estimator's gains follow from noise and sampling, not from the plant
            known = search_space.box(component, scales)
    ranges = {}
    for name, value in values.items():
        if name in known:
            ranges[name] = [min(known[name][0], value), max(known[name][1], value)]
        elif 0.0 < value < math.inf and not (component.template and component.template.gains[name].held):
            ranges[name] = [value / SLIDER_FACTOR, value * SLIDER_FACTOR]
    return ranges
