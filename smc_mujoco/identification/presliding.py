"""Presliding: dry friction that gives way before it slides, as one of the things that a model may
lack.

Dry friction of replays holds a joint until it breaks away. That of a real joint bends first, and
MuJoCo's default creeps, so inertia, friction and delay would absorb that. At the solution the logs
are replayed with friction that gives way in each of these ways.
"""

import copy
import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence

import mujoco
import numpy as np

from smc_mujoco.common.data import frozen_data
from smc_mujoco.identification.lack_of_fit import Lack
from smc_mujoco.identification.log_rig import RUN_STEP, LogRig
from smc_mujoco.identification.replays import Replays, Slopes
from smc_mujoco.identification.rig import Values
from smc_mujoco.mechanisms.custom.model_constraints import SOFT_SOLIMP, SOFT_SOLREF
from smc_mujoco.mechanisms.hardware.friction import LuGre
from smc_mujoco.mechanisms.layout import channel_names, dof_ids
from smc_mujoco.mechanisms.plant import Field, Plant
from smc_mujoco.mechanisms.plant import Values as Parameters

BENDS = 2e-4, 1e-3, 4e-3  # rad (m), by which a joint gives way before it slides; chosen
SLIDES_AT = 1.0  # rad/s (m/s): of bristles without a Stribeck drop, where it changes nothing
DAMPING = 0.6  # of bristles, relative to the root of stiffness and inertia; chosen
WRITTEN_SOFTNESS = "0.0201 1"  # MuJoCo's default itself counts as not written, and is hardened
FOUND = "coulomb", "stiffness", "damping"  # of bristles


@frozen_data
class PreslidingFields:
    """Plant.fields of a plant whose dry friction creeps as MuJoCo's default does, or, if `bends`,
    is left to bristles.
    """

    inner: Callable[[mujoco.MjModel, Parameters], Iterator[Field]]
    bends: bool

    def __call__(self, model: mujoco.MjModel, p: Parameters) -> Iterator[Field]:
        yield from self.inner(model, p)
        dofs = np.arange(model.nv)
        if self.bends:
            yield Field("dof_frictionloss", dofs, 0.0)
            return
        yield Field("dof_solref", dofs, SOFT_SOLREF)
        yield Field("dof_solimp", dofs, SOFT_SOLIMP)
        model.opt.noslip_iterations = 0  # a number, which no Field can write


def presliding(
    rig: LogRig, replays: Replays, slopes: Slopes, integrator: str | None = None
) -> list[Lack]:
    """Return the ways in which dry friction may give way in the logs, as what the model lacks.

    `rig`: with the values of the slopes. `integrator`: of the replays; None for that of each
    scenario.
    """
    if not rig.plant.rubs:
        return []
    if not all(part.drives for part in rig.base.actuator):  # rotors beside joints
        return []
    trial = copy.copy(replays)
    control = rig.repeated(replays.pieces[0].part).control_period  # pyright: ignore[reportArgumentType]
    trial.steps = {"physics_step": control / math.ceil(control / RUN_STEP - 1e-9)}
    if integrator is not None:
        trial.steps["integrator"] = integrator
    (holding,) = trial.residuals([slopes.point])
    lacks = []
    for way, yielding in _ways(rig).items():
        trial.twin = yielding
        (residuals,) = trial.residuals([slopes.point])
        changes = []
        for after, before in zip(residuals, holding, strict=True):
            changes.append(after - before)
        text = f"presliding: in the logs dry friction gives way before it slides, {way}"
        lacks.append(Lack(text, changes, gives_way=True))
    return lacks


def _ways(rig: LogRig) -> dict[str, LogRig]:
    """Return how friction gives way, and what to do -> the rig with such friction."""
    fields = rig.numbers_of(Values(**rig.values))
    model = fields["plant"].load()
    dofs = dof_ids(model)
    levels = model.dof_frictionloss[dofs].tolist()
    inertias = model.dof_M0[dofs].tolist()
    joints = channel_names(rig.plant)
    creeps = "as MuJoCo's default does: if a simulation made the logs, " + _softness(joints, levels)
    rigs = {creeps: dataclasses.replace(rig, plant=_yielding(rig.plant, False))}
    for bend in BENDS:
        bristles = []
        for joint, level, inertia in zip(joints, levels, inertias, strict=True):
            if level:
                k = level / bend
                damping = DAMPING * math.sqrt(k * inertia)
                bristles.append(LuGre(level, level, SLIDES_AT, k, damping, on=(joint,)))
        base = dataclasses.replace(rig.base, friction=(*rig.base.friction, *bristles))
        way = f"as bristles that bend by {1e3 * bend:g} mrad (mm): {_with_bristles(rig, bristles)}"
        rigs[way] = dataclasses.replace(rig, base=base, plant=_yielding(rig.plant, True))
    return rigs


def _softness(joints: Sequence[str], levels: Sequence[float]) -> str:
    """Return what to write into the file, where dry friction creeps as MuJoCo's default does."""
    lines = []
    for joint, level in zip(joints, levels, strict=True):
        if level:
            lines.append(f'<joint name="{joint}" ... solreffriction="{WRITTEN_SOFTNESS}"/>')
    return f"write {', '.join(lines)} into the file, and find the numbers again"


def _with_bristles(rig: LogRig, bristles: Sequence[LuGre]) -> str:
    """Return what to do, in the words of the command, where dry friction bends as bristles do."""
    parts = []
    paths = []
    for bristle in bristles:
        (joint,) = bristle.on
        texts = []
        for value in (
            bristle.coulomb,
            bristle.static,
            bristle.stribeck,
            bristle.stiffness,
            bristle.damping,
        ):
            texts.append(f"{value:.3g}")
        parts.append(f"'{joint}': LuGre({', '.join(texts)})")
        for name in FOUND:
            paths.append(f"friction.{joint}.{name}")
    cure = f"find --for {','.join(paths)} in place of frictionloss, with --condition "
    cure += f'"bristles: friction={{{", ".join(parts)}}}"'
    model = rig.base.plant.load()
    if np.any(model.dof_frictionloss[dof_ids(model)] > 0.0):
        cure += ", and without frictionloss in the file"
    return cure


def _yielding(plant: Plant, bends: bool) -> Plant:
    """Return the plant with dry friction that gives way, or none at all."""
    return dataclasses.replace(
        plant,
        fields=PreslidingFields(plant.fields, bends),
        rubs=False,
        smooth=plant.smooth and bends,
    )
