"""Numbers of the joints and bodies of a user's model, such as shoulder.damping, as parameters of
its plant.

    Scenario(plant=arm, mismatch={"shoulder.damping": 1.5, "elbow.armature": 0.02})
    Scenario(plant=arm, mismatch={"hand.payload": 0.5})  # kg, at the hand's centre of mass

A mismatch or a jump multiplies such a number. One that is 0 in the model it adds, in the number's
unit. A payload is a point mass.
"""

import dataclasses
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Names
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import unknown
from smc_mujoco.mechanisms.custom.model_constraints import SOFT_SOLREF, sets_friction_solref
from smc_mujoco.mechanisms.custom.user_model import with_compensation
from smc_mujoco.mechanisms.hardware.part import HARD_SOLIMP, HARD_SOLREF
from smc_mujoco.mechanisms.layout import OWN, ROTOR, all_joints, loaded
from smc_mujoco.mechanisms.plant import Field, Plant, Values

SLIDING = 0.02  # of the largest speed, below which a joint's direction counts in part; chosen
SLIDE = mujoco.mjtJoint.mjJNT_SLIDE.value


def sliding(v: np.ndarray) -> np.ndarray:
    """Return the direction of speeds, smooth where they are small beside the largest: a measured
    direction is noise there.
    """
    return np.tanh(v / (SLIDING * np.abs(v).max() + 1e-12))


class JointField(NamedTuple):
    """A number that every joint of a model has. A row of KINDS is all that identification needs of
    a new one.
    """

    field: str  # of the MjModel
    hinge: str  # unit for a hinge
    slide: str  # unit for a slide
    # position, speed and acceleration of a joint, (K,) -> the force that a unit of it takes, (K,)
    slope: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
    least: float = 0.0  # end of its range


KINDS = {
    "damping": JointField("dof_damping", "N m s/rad", "N s/m", lambda x, v, a: v),
    "frictionloss": JointField("dof_frictionloss", "N m", "N", lambda x, v, a: sliding(v)),
    "armature": JointField("dof_armature", "kg m^2", "kg", lambda x, v, a: a),
    "stiffness": JointField("jnt_stiffness", "N m/rad", "N/m", lambda x, v, a: x),
}
PAYLOAD = "payload"  # kg, of a body


class ModelNumber(NamedTuple):
    """A number of a joint or a body."""

    owner: str
    kind: str
    value: float  # in the model
    unit: str


def model_numbers(plant: Plant) -> dict[str, ModelNumber]:
    """Return JOINT.KIND and BODY.payload -> the number, for all joints and moving bodies of a
    user's model; empty for other plants.
    """
    if not plant.is_user_model:
        return {}
    model = loaded(plant)
    numbers = {}
    for joint in all_joints(plant):
        slides = model.jnt_type[model.joint(joint).id] == SLIDE
        for name, kind in KINDS.items():
            values = getattr(model, kind.field)[_place(model, joint, name)]
            value = float(np.ravel(values)[0])
            unit = kind.slide if slides else kind.hinge
            numbers[f"{joint}.{name}"] = ModelNumber(joint, name, value, unit)
    for i in range(model.nbody):
        body = model.body(i).name
        if body and model.body_weldid[i] and not body.startswith((ROTOR, OWN)):
            numbers[f"{body}.{PAYLOAD}"] = ModelNumber(body, PAYLOAD, 0.0, "kg")
    return numbers


def with_model_numbers(plant: Plant, names: Iterable[str]) -> Plant:
    """Return the plant with numbers of its joints and bodies among its parameters.

    Raises:
      ScenarioError: no joint or body of the model has a number of this name.
    """
    numbers = model_numbers(plant)
    added = {}
    for name in names:
        if name in plant.parameters:
            continue
        if name not in numbers:
            raise unknown(f"parameter of {plant.name}", name, [*plant.parameters, *numbers])
        added[name] = numbers[name]
    if not added:
        return plant
    owned = tuple((number.owner, number.kind) for number in added.values())
    fields = NumberFields(plant.fields, owned)
    nominal = plant.nominal
    if plant.by_mujoco:
        nominal = dataclasses.replace(nominal, fields=fields)
    absent = {}
    rubbing = []
    parameters = dict(plant.parameters)
    for name, number in added.items():
        parameters[name] = number.value
        if not number.value:
            absent[name] = number.unit
        if number.kind == "frictionloss":
            rubbing.append(number.owner)
    # only MuJoCo's constraints are as soft as the file says
    model = loaded(plant)
    soft = any(
        sets_friction_solref(model, _place(model, joint, "frictionloss")) for joint in rubbing
    )
    return dataclasses.replace(
        plant,
        parameters=parameters,
        fields=fields,
        nominal=nominal,
        added=dict(plant.added) | absent,
        rubs=not soft and (plant.rubs or bool(rubbing)),
        smooth=plant.smooth and not soft,
    )


@frozen_data
class NumberFields:
    """Plant.fields of a plant with numbers of joints and bodies among its parameters."""

    inner: Callable[[mujoco.MjModel, Values], Iterator[Field]]
    numbers: tuple[tuple[str, str], ...]  # joint or body, and kind, of each

    def __call__(self, model: mujoco.MjModel, p: Values) -> Iterator[Field]:
        yield from with_compensation(model, self._changed(model, p))

    def _changed(self, model: mujoco.MjModel, p: Values) -> Iterator[Field]:
        yield from self.inner(model, p)
        for owner, kind in self.numbers:
            value = vars(p)[f"{owner}.{kind}"]
            if kind == PAYLOAD:
                yield Field("body_mass", model.body(owner).id, value, adds=True)
                continue
            place = _place(model, owner, kind)
            yield Field(KINDS[kind].field, place, value)
            # dry friction that the model does not have yet is as hard as Coulomb's
            if kind == "frictionloss" and tuple(model.dof_solref[place]) == SOFT_SOLREF:
                yield Field("dof_solref", place, HARD_SOLREF)
                yield Field("dof_solimp", place, HARD_SOLIMP)


def _place(model: mujoco.MjModel, joint: str, kind: str) -> int:
    """Return where the number of a joint is in its field."""
    if KINDS[kind].field.startswith("jnt"):
        return model.joint(joint).id
    return int(model.joint(joint).dofadr[0])


def dotted(names: Iterable[str]) -> Names:
    """Return those of the names that may be numbers of joints or bodies."""
    return tuple(name for name in names if "." in str(name))
