"""Scores of arms: where the tip is and how hard it presses, and every metric of each joint by
itself.

The tip is the site that `plant.tip` names. Its path follows from the joints' positions. A joint
without a channel is assumed to stay where it starts.

MuJoCo computes the forces of contact at the logged state, command and disturbances of each sample.
So they are not means over a control period. They are unknown if an actuator has a state that a
trace lacks, such as a motor's current, or the rotor behind a backlash. LuGre friction, friction by
a formula and a motor's ripple are left out. That does not matter on an arm: a sliding contact's
spring carries 99 % of a change of load, see `mechanisms.hardware.contact`.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array, ArrayPair, Numbers
from smc_mujoco.common.constraints import Positive, constrained
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.layout import (
    OWN,
    channel_names,
    drive_ids,
    initial_pose,
    joint_ids,
)
from smc_mujoco.metrics import conventions, fold
from smc_mujoco.metrics.catalogue import group_scores
from smc_mujoco.metrics.conventions import group_trace, groups
from smc_mujoco.metrics.once_per_trace import once_per_trace
from smc_mujoco.simulation import model as models
from smc_mujoco.simulation.run import states
from smc_mujoco.simulation.signals import Push

if TYPE_CHECKING:
    from smc_mujoco.mechanisms.plant import Plant
    from smc_mujoco.simulation.scenario import Scenario
    from smc_mujoco.simulation.trace import Trace

# share of a run after which forces are scored; chosen, so that the tip has touched the surface
FORCE_START = 0.2


class Contacts(NamedTuple):
    """Contacts of a run at its samples. All values are NaN after a failure."""

    force: Array  # sum of the normal forces, N, (K + 1,); 0 without contact
    depth: Array  # penetration of the deepest contact, m, (K + 1,); 0 without contact
    push: Array  # sum of the normal forces on the arm, as a vector in space, N, (K + 1, 3)


def tip_path(plant: Plant, x: Array, factors: Numbers | None = None) -> Array:
    """Return the tip's positions in space, m, (K, 3), at the channels' positions x, (K, n).

    Args:
      factors: of the true plant's parameters, see `Scenario.factors`. None: the nominal plant.

    Raises:
      ScenarioError: the plant has no tip.
    """
    if not plant.tip:
        raise ScenarioError(
            f"{plant.name} has no tip: make it with smc.plant_from(..., tip='SITE')"
        )
    model = plant.load(factors)
    data = mujoco.MjData(model)
    site = model.site(plant.tip).id
    data.qpos[:] = initial_pose(model)
    addresses = model.jnt_qposadr[joint_ids(model)]
    tip = np.empty((len(x), 3))
    for k, joints in enumerate(x):
        data.qpos[addresses] = joints
        mujoco.mj_kinematics(model, data)
        tip[k] = data.site_xpos[site]
    return tip


@once_per_trace
def tip_paths(trace: Trace) -> ArrayPair:
    """Return the actual path of the tip (true plant) and the wanted one (nominal plant), m, (K + 1,
    3), read-only.
    """
    scenario = trace.scenario
    jump = trace.scenario.jump_sample
    parts = (trace.x[:jump], 0), (trace.x[jump:], scenario.jump_step)
    pieces = []
    for x, step in parts:
        if len(x):
            pieces.append(tip_path(scenario.plant, x, scenario.factors(step)))
    actual = np.concatenate(pieces)
    paths = actual, tip_path(scenario.plant, trace.r)
    for path in paths:
        path.flags.writeable = False
    return paths


def tip_error(trace: Trace) -> Array:
    """Return the tip's distance from its wanted path, m, (K + 1,). Raises like `tip_path`."""
    actual, reference = tip_paths(trace)
    return np.linalg.norm(actual - reference, axis=1)


def knows_contacts(scenario: Scenario) -> bool:
    """Return whether a scenario has contacts whose forces follow from a trace."""
    meets = any(part.solid for part in scenario.contact)
    return meets and not _with_hidden_state(scenario)


def _with_hidden_state(scenario: Scenario) -> list:
    """Return the actuators with a state, or a force, that a trace lacks."""
    parts = []
    for part in scenario.actuator:
        follows = part.in_callback or part.delay or part.lateness or part.act is not None
        if follows or not part.drives:
            parts.append(part)
    return parts


@once_per_trace
def contacts(trace: Trace) -> Contacts:
    """Return the normal forces and the penetrations of a run's contacts, read-only."""
    scenario = trace.scenario.resolved
    if not scenario.contact:
        raise ScenarioError(f"the scenario of {scenario.plant.name} has no contact: give contact=")
    if hidden := _with_hidden_state(scenario):
        part = type(hidden[0]).__name__
        raise ScenarioError(
            f"the state of {part} is not in a trace, so its contacts are unknown: run without "
            f"{part}"
        )
    compiled = models.compile_model(scenario)
    model = models.with_values(compiled, scenario)
    data = mujoco.MjData(model)
    joints = joint_ids(model)
    positions = model.jnt_qposadr[joints]
    rates = model.jnt_dofadr[joints]
    drives = model.actuator_ctrladr[drive_ids(model)]
    n = scenario.plant.driven
    scale = np.array(scenario.drive_train.scales)
    pushes = []
    for d in scenario.disturbance:
        if isinstance(d, Push) and scenario.plant.direct:
            pushes.append((model.body(d.body).id, d))
    count = len(trace.t)
    contacts = Contacts(np.zeros(count), np.zeros(count), np.zeros((count, 3)))
    data.qpos[:] = initial_pose(model)
    jump = trace.scenario.jump_sample
    states_of_all = None
    if any(part.loose for part in scenario.contact):
        states_of_all = states(trace, trace.t)
    for k in range(len(trace.t)):
        if np.isnan(trace.x[k]).any():  # the run has failed
            for values in contacts:
                values[k:] = np.nan
            break
        if k == jump:
            models.put_values(model, compiled, scenario, scenario.jump_step)
            mujoco.mj_setConst(model, mujoco.MjData(model))
        if states_of_all is not None:  # a ball, which no channel moves
            poses, speeds = states_of_all
            data.qpos[:] = poses[k]
            data.qvel[:] = speeds[k]
        data.qpos[positions] = trace.x[k]
        data.qvel[rates] = trace.v[k]
        data.qfrc_applied[rates] = trace.d[k]
        data.ctrl[drives] = scale * trace.applied[k, :n]
        data.xfrc_applied[:] = 0.0
        for body, push in pushes:
            force = np.array([push.x, push.y, push.z])
            size = push.value(trace.t[k], push)[0]
            data.xfrc_applied[body, :3] += size * force
        mujoco.mj_forward(model, data)
        _add_contacts(model, data, contacts, k)
    for values in contacts:
        values.flags.writeable = False
    return contacts


def _add_contacts(model: mujoco.MjModel, data: mujoco.MjData, contacts: Contacts, k: int) -> None:
    """Add MuJoCo's present contacts to sample k."""
    wrench = np.zeros(6)
    for i in range(data.ncon):
        mujoco.mj_contactForce(model, data, i, wrench)
        contacts.force[k] += wrench[0]
        contacts.depth[k] = max(contacts.depth[k], -data.contact.dist[i])
        # 1 for a geom of the machine that moves, else 0; the normal points from first to second
        bodies = model.geom_bodyid[data.contact.geom[i]]
        moves = np.array([model.body(j).name.startswith(OWN) for j in bodies])
        moves = (model.body_weldid[bodies] != 0) & ~moves
        first, second = moves.astype(float)
        normal = data.contact.frame[i, :3]
        contacts.push[k] += (second - first) * wrench[0] * normal


@constrained
def tip_scores(trace: Trace, force: Positive | None = None) -> dict[str, float]:
    """Return scores of an arm's tip, by name.

        law = "computed_torque_sliding"
        trace = smc.run(smc.Scenario(plant="panda", law=law, duration=0.5))
        print(smc.metrics.tip_scores(trace)["max_error"])

    Args:
      force: the force with which it should press, N; None: the gain `force` of its law, if there is
        one.

    Returns:
      max_error, rms_error, last_error, m: the distance of the tip from where the references want
      it, the first two over the whole run, from t = 0, unlike rms_error of `smc.score`. With a
      contact whose forces `contacts` knows, over the last 80 % of the run: mean_force, N;
      force_error, by which it exceeds the wanted force, % of that; force_ripple, the force's
      standard deviation, N; touching, the share of the time in contact, %; and depth, the deepest
      penetration in the whole run, m.

    Raises:
      ScenarioError: the plant has no tip, or the run failed.
    """
    conventions.refuse(trace)
    error = tip_error(trace)
    values = {
        "max_error": error.max(),
        "rms_error": np.sqrt((error**2).mean()),
        "last_error": error[-1],
    }
    if knows_contacts(trace.scenario):
        pressed = contacts(trace)
        start = FORCE_START * (1.0 - fold.ROUNDING) * np.ptp(trace.t)
        late = pressed.force[trace.t >= trace.t[0] + start]
        values["mean_force"] = late.mean()
        if reference_force := force or trace.scenario.law.gains.get("force"):
            values["force_error"] = 100.0 * (late.mean() / reference_force - 1.0)
        values["force_ripple"] = late.std()
        values["touching"] = 100.0 * (late > 0.0).mean()
        values["depth"] = pressed.depth.max()
    return {name: float(value) for name, value in values.items()}


def joint_scores(trace: Trace) -> dict[str, dict[str, float]]:
    """Return the metrics of each joint by itself, {"joint1": {"settling_time": ...}, ...}, in the
    channels' order.

        law = "computed_torque_sliding"
        trace = smc.run(smc.Scenario(plant="panda", law=law, duration=0.5))
        print(smc.metrics.joint_scores(trace)["joint4"]["itae"])

    In addition to the catalogue's metrics there are peak_power, the largest |force of the drive
    times velocity|, W, and work, the integral of |force times velocity|, J. Raises like
    `smc.score`.

    Returns:
      Joint -> metric -> value.
    """
    conventions.refuse(trace)
    values = {}
    names = channel_names(trace.scenario.plant)
    for group in groups(trace.scenario):
        for i in group.channels:
            effort = trace.scenario.efforts[i]
            joint = dataclasses.replace(group, channels=(i,), effort=effort)
            part = group_trace(trace, joint)
            power = np.abs(trace.force[:, i] * trace.v[:, i])
            of_joint = group_scores(joint, part)
            of_joint["peak_power"] = float(power.max())
            of_joint["work"] = float(np.trapezoid(power, trace.t))
            values[names[i]] = of_joint
    return {name: values[name] for name in names}
