"""A joint's stops about its goal, and a blow that drives it against them whatever u does.

A blow acts on every driven joint, so the stops are on the joint that needs the least momentum. With
d the distance of the start from the goal, the stop lies beyond the goal at `near`, d/3 or less, and
the momentum is

    p = sqrt(2 REACH M F near) + F WIDTH + D way

F is all that may hold the joint back: the bounds on u, the load, friction and springs. So the blow
has REACH times the energy that they can take from it on its way, and what they take during the blow
and damping takes on the way comes on top. Load and springs are those at the goal. M and D are those
of the pose between start and goal that asks for most, and `way` leads from there to the stop: a
joint that is damped may hardly have left its start. On plants of the library, whose laws arrive,
that pose is the goal.
"""

import math
from typing import Any, NamedTuple

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array, Pair
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.custom.scales import at_goal, usual_start
from smc_mujoco.mechanisms.hardware.obstacles import BLOW_DEPTH, Stops
from smc_mujoco.mechanisms.layout import channel_names, driven_ids, loaded, posed
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Impulse

# All chosen.
REACH = 1.5  # energy of a blow over what can be taken from it
WIDTH = 5e-3  # s, of a blow
PASSED = 0.05  # of the way from the goal to a stop, by which a joint may go into it
NEAR, FAR = (
    1 / 3,
    1.5,
)  # of the start's distance from the goal: beyond the goal, and behind the start
SHARE = 0.5  # of the way from the goal to the end of its range, at most
LEAST = 0.02  # of the start's distance, where the goal is at the end of its range
POSES = 5  # from the goal to the start, in which what a blow meets is taken
HIT = 3.0  # of the largest friction before the blow: a larger force on the joint is of a stop
# of the other joints' distance, for a joint that starts at its goal: room for what it does there
BESIDE_OTHERS = 9.0


class Stopped(NamedTuple):
    """The stops of a joint, and what drives it there."""

    momentum: float  # N m s (N s), on each driven joint
    side: float  # 1 or -1: where it goes
    joint: str
    ends: Pair  # rad or m, its stops
    depth: float  # rad per rad/s (m per m/s), of its stops


def bump(plant: Plant, time: float, rubs: float) -> tuple[Stops, Impulse]:
    """Return stops of a joint, and the blow at a time, s, that reaches them.

    Args:
      rubs: share of the bound on u that friction may have, and take of a speed of 1 rad/s (m/s).

    Raises:
      ScenarioError: no joint of the plant can be stopped.
    """
    stopped = [] if plant.pose else _stopped(plant, rubs)
    if not stopped:
        raise ScenarioError(
            f"condition 'contact' finds no driven joint of {plant.name} that stops could hold: "
            "give an obstacle yourself, as bump: contact=Ball('body', mass=0.1)"
        )
    momentum, side, joint, ends, depth = min(stopped)
    stops = Stops({joint: ends}, depth=depth)
    return stops, Impulse(side * momentum, time=time, width=WIDTH)


def unmet(trace: Any) -> str:
    """Return a sentence on stops that no blow of a run drove its joint against, or ""."""
    scenario = trace.scenario
    blows = [d for d in scenario.disturbance if isinstance(d, Impulse)]
    if not blows or trace.failure:
        return ""
    names = channel_names(scenario.plant)
    for stops in scenario.contact:
        limits = stops.limits if isinstance(stops, Stops) else {}
        for joint, (low, high) in limits.items():
            if joint not in names:
                continue
            x = trace.x[:, names.index(joint)]
            k = int(np.searchsorted(trace.t, blows[0].time))
            held = np.abs(trace.holding[:, names.index(joint)])
            # a light joint comes and leaves within a control period
            struck = held[k:].max(initial=0.0) > HIT * held[:k].max(initial=0.0)
            if low < x.min() and x.max() < high and not struck:
                return (
                    f"the blow of {scenario.plant.name} under {scenario.law.name} at "
                    f"{blows[0].time:g} s meets nothing: joint {joint!r} is at {x[k]:.3g} then, "
                    f"and its stops are at {low:.3g} and {high:.3g}; give more time before it, or "
                    "a law that has arrived"
                )
    return ""


def _stopped(plant: Plant, rubs: float) -> list[Stopped]:
    """Return each driven joint that a blow moves."""
    goal = np.array(plant.rest or plant.origin)
    away = np.array(usual_start(plant)) - goal
    if not away[: plant.driven].any():
        largest = np.abs(away).max()
        away[: plant.driven] = BESIDE_OTHERS * largest
    distances = np.abs(away)
    sides = -np.sign(away)
    rooms = [_room(plant, j, distances[j], sides[j]) for j in range(plant.driven)]
    near, far = np.transpose(rooms)
    shares = [0.0]
    if plant.is_user_model and not at_goal(plant).strayed:
        shares = np.linspace(0.0, 1.0, POSES).tolist()
    bounds = np.array(Scenario.recorded(plant=plant, law="none").drive_train.forces)
    of_poses = [_momenta(plant, rubs, bounds, near, share) for share in shares]
    gained, _ = of_poses[0]  # at the goal
    momenta = np.max([momentum for _, momentum in of_poses], axis=0)
    names = channel_names(plant)
    candidates = []
    for j in range(plant.driven):
        if not away[j] or not gained[j] > 0.0:
            continue
        near_end = goal[j] + sides[j] * near[j]
        ends = sorted((near_end, goal[j] - sides[j] * far[j]))
        ends_of_reach = (float(ends[0]), float(ends[1]))
        depth = BLOW_DEPTH
        if plant.is_user_model:  # a light joint is fast
            depth = min(depth, PASSED * near[j] / (momenta[j] * gained[j]))
        momentum = float(momenta[j])
        stopped = Stopped(momentum, float(sides[j]), names[j], ends_of_reach, float(depth))
        candidates.append(stopped)
    return candidates


def _momenta(
    plant: Plant, rubs: float, bounds: Array, near: Array, share: float
) -> tuple[Array, Array]:
    """Return the speed of each driven joint for a unit of momentum on all, (driven,), and the
    momentum that takes it to its stop, from a share of the way from the goal to the start.
    """
    at_rest = at_goal(plant)
    met = at_goal(plant, share)
    goal = np.array(plant.rest or plant.origin)
    way = share * (np.array(usual_start(plant)) - goal)
    dofs = met.dofs
    inverse = np.linalg.inv(met.M)[dofs]
    gained = inverse @ _blown(plant, goal + way)
    moved = np.where(gained > 0.0, gained, np.inf)
    resisted = bounds * (1.0 + rubs) + np.abs(at_rest.load) + at_rest.dry
    # of what moves at once, and of the joint where servos or PDs hold the others
    mass = np.maximum(1.0 / moved, met.M[dofs, dofs])
    stiffness = np.maximum(at_rest.K[dofs, dofs], 0.0) * near
    force = np.abs(inverse[:, dofs]) @ resisted / moved + stiffness
    damping = np.maximum(met.D[dofs, dofs], 0.0) + 0.5 * rubs * bounds
    distance = near + np.abs(way)[: plant.driven]
    momenta = np.sqrt(2.0 * REACH * mass * force * near) + force * WIDTH + damping * distance
    return gained, momenta


def _blown(plant: Plant, pose: Array) -> Array:
    """Return what a disturbance of 1 on every driven joint exerts in a pose, (nv,): on the joints
    of a `direct` plant, on the bodies that they carry of another.
    """
    model = loaded(plant)
    data = posed(model, pose)
    mujoco.mj_comPos(model, data)
    exerted = np.zeros(model.nv)
    for joint in driven_ids(model).tolist():
        along = np.zeros((3, model.nv))
        about = np.zeros((3, model.nv))
        body = int(model.jnt_bodyid[joint])
        mujoco.mj_jacBodyCom(model, data, along, about, body)
        if plant.direct:
            exerted[model.jnt_dofadr[joint]] += 1.0
        elif model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE:
            exerted += data.xaxis[joint] @ about
        else:
            exerted += data.xaxis[joint] @ along
    return exerted


def _room(plant: Plant, j: int, away: float, side: float) -> Pair:
    """Return how far beyond joint j's goal and how far behind it the stops are, rad or m."""
    low, high = (-math.inf, math.inf) if not plant.ranges else plant.ranges[j][1:]
    goal = (plant.rest or plant.origin)[j]
    beyond, behind = (high - goal, goal - low) if side > 0.0 else (goal - low, high - goal)
    nearest = min(NEAR * away, SHARE * beyond)
    return max(nearest, LEAST * away), min(FAR * away, behind)
