"""What holds or hits a machine, moment by moment: whether it sticks or slides, touches, and how it lies in its play.

A film shows no more than a state every HOLD seconds: a blow of 5 ms is told for HOLD, and a rest is told if it lasts as
long. Rest is that of `measure.at_rest`. Touch is geometry: the scenario's own model, posed at each sample, and MuJoCo's
collisions. Where a backlash has the joint to itself the flank that pushes is read off the reaction; beside friction
and contacts, whose forces mix with its own, off what the actuator delivers, and that it is in play cannot be told.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from smc_mujoco.mechanisms.hardware.backlash import Backlash
from smc_mujoco.mechanisms.hardware.contact import HIT, RUB
from smc_mujoco.mechanisms.hardware.friction import Coulomb, LuGre
from smc_mujoco.mechanisms.hardware.part import joint_ids
from smc_mujoco.metrics import conventions
from smc_mujoco.simulation import model as assembly
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace

HOLD = 0.15  # s, chosen: nine pictures of a film at 60 fps, and long enough to read a word
CALM, HELD, STRUCK = range(3)  # moods


class State(NamedTuple):
    """What is told of a machine, and how loudly."""

    words: str
    mood: int


class Shape(NamedTuple):
    """A scenario's mechanism from a time on, s."""

    time: float
    model: mujoco.MjModel


def shapes(scenario: Scenario) -> list[Shape]:
    """The mechanism as the run starts, and after its jump."""
    steps = [0] if scenario.jump is None else [0, scenario.jump_step]
    compiled = assembly.model([scenario])
    return [Shape(step * scenario.physics_step, assembly.numbered(compiled, scenario, step)) for step in steps]


def told(trace: Trace, times: np.ndarray, hold: float = HOLD) -> list[State | None]:
    """What is told at each time; None where there is nothing to tell, and once the run has failed."""
    dry, gap = rubs(trace.scenario), play(trace.scenario)
    touch = np.any(np.stack([held(on, trace.t, hold) for on in touching(trace).T]), axis=0)
    sliding = np.array([held(first_too(~on, trace.t, hold), trace.t, hold) for on in resting(trace).T])
    lies = [lying(flank, trace.t, hold) for flank in flanks(trace).T] if gap else []
    found: list[State | None] = []
    for time in times.tolist():
        k = int(np.searchsorted(trace.t, time + 1e-9)) - 1
        words = ([stick_words(~sliding[:, k])] if dry else []) + ([play_words([lie[k] for lie in lies])] if gap else [])
        if trace.diverged_at is not None and time >= trace.diverged_at:
            found.append(None)
        elif touch[k]:
            found.append(State("contact", STRUCK))
        else:
            holds = dry and not sliding[:, k].all()
            found.append(State(", ".join(words), HELD if holds else CALM) if words else None)
    return steady(found, times, hold)


def resting(trace: Trace) -> np.ndarray:
    """Where each channel is at rest beside those of its group, (K + 1, n)."""
    rest = np.empty(trace.x.shape, bool)
    for group, part in conventions.parts(trace).items():
        rest[:, group.channels] = conventions.at_rest(part)
    return rest


def steady(found: Sequence[State | None], times: np.ndarray, hold: float) -> list[State | None]:
    """The states without the words that pass before they can be read: the ones before stay instead. Blows are kept."""
    runs = [list(run) for _, run in itertools.groupby(range(len(found)), key=lambda frame: found[frame])]
    shown = list(found)
    for run, after in itertools.pairwise(runs):
        state, stays = found[run[0]], shown[run[0] - 1] if run[0] else found[after[0]]
        brief = times[after[0]] - times[run[0]] < hold - 1e-9
        if brief and state and stays and state.mood != STRUCK and (run[0] or stays.mood != STRUCK):
            shown[run[0] : after[0]] = [stays] * len(run)
    return shown


def rubs(scenario: Scenario) -> bool:
    """Whether something rubs that can hold the machine: dry friction in its joints, or of what it lies on."""
    joints = any((isinstance(f, Coulomb) and f.level > 0.0) or isinstance(f, LuGre) for f in scenario.friction)
    return joints or (scenario.contact.kind != "none" and bool(_rubbing(shapes(scenario)[0].model)))


def touches(scenario: Scenario) -> bool:
    """Whether there is something to run into."""
    return scenario.contact.kind != "none" and bool(_channels(shapes(scenario)[0].model)[0])


def play(scenario: Scenario) -> float:
    """The gap of the scenario's backlash, 0 without one."""
    return next((part.gap for part in scenario.actuator if isinstance(part, Backlash)), 0.0)


def touching(trace: Trace) -> np.ndarray:
    """Where each channel is in contact with an obstacle or another channel, (K + 1, n)."""
    touch = np.zeros(trace.x.shape, bool)
    if trace.scenario.contact.kind == "none":
        return touch
    parts = shapes(trace.scenario)
    data = [mujoco.MjData(shape.model) for shape in parts]
    tables = [_channels(shape.model) for shape in parts]
    for k in np.flatnonzero((trace.reaction != 0.0).any(axis=1)):
        now = sum(float(trace.t[k]) >= shape.time for shape in parts) - 1
        model, posed, (hits, owner) = parts[now].model, data[now], tables[now]
        posed.qpos[model.jnt_qposadr[joint_ids(model)]] = trace.x[k]
        mujoco.mj_kinematics(model, posed)
        mujoco.mj_collision(model, posed)
        for contact in posed.contact:
            if contact.dist <= 0.0 and frozenset(contact.geom.tolist()) in hits:
                mine = [owner[body] for body in model.geom_bodyid[contact.geom] if owner[body] >= 0]
                touch[k, mine] = True
    return touch


def _channels(model: mujoco.MjModel) -> tuple[set[frozenset[int]], np.ndarray]:
    """The pairs of geoms that hit each other, and each body's channel, -1 for one that no channel moves."""
    pairs = range(model.npair)
    hits = {_geoms(model, i) for i in pairs if model.pair(i).name.startswith(HIT)}
    owner = np.full(model.nbody, -1)
    bodies = model.jnt_bodyid[joint_ids(model)].tolist()
    for body in range(1, model.nbody):
        owner[body] = bodies.index(body) if body in bodies else owner[model.body_parentid[body]]
    return hits, owner


def _geoms(model: mujoco.MjModel, pair: int) -> frozenset[int]:
    return frozenset({int(model.pair_geom1[pair]), int(model.pair_geom2[pair])})


def _rubbing(model: mujoco.MjModel) -> list[int]:
    """The pairs that slide on each other, with friction."""
    pairs = [i for i in range(model.npair) if model.pair(i).name.startswith(RUB)]
    return [i for i in pairs if model.pair_friction[i, 0] > 0.0]


def flanks(trace: Trace) -> np.ndarray:
    """The side from which each rotor pushes its joint, -1, 0 or 1, (K + 1, n): 1 pushes towards larger x."""
    alone = not trace.scenario.friction and trace.scenario.contact.kind == "none"
    return np.sign(np.nan_to_num(trace.reaction if alone else trace.force))


def held(on: np.ndarray, t: np.ndarray, hold: float) -> np.ndarray:
    """A signal (K + 1,), each time it is on, for `hold` s more, and without gaps shorter than that."""
    last = np.maximum.accumulate(np.where(on, t, -np.inf))
    on = t - last < hold - 1e-9
    edges = np.flatnonzero(np.diff(on.astype(int), prepend=0))  # on, off, on, ...
    for off, again in zip(edges[1::2], edges[2::2], strict=False):
        on[off:again] |= t[again] - t[off] < hold
    return on


def first_too(on: np.ndarray, t: np.ndarray, hold: float) -> np.ndarray:
    """The signal, on from the start if it soon will be: a machine let go at rest is not told to stick."""
    on = on.copy()
    on[: np.searchsorted(t, t[0] + hold)] |= on[t < t[0] + hold].any()
    return on


def lying(flank: np.ndarray, t: np.ndarray, hold: float) -> np.ndarray:
    """-1 or 1: on that flank; 0: in play; 2: it goes to and fro faster than can be told, (K + 1,)."""
    touched = np.flatnonzero(flank)
    crossed = touched[1:][np.diff(flank[touched]) != 0]
    twice = crossed[1:][np.diff(t[crossed]) < hold]
    rattles = np.zeros(len(t), bool)
    rattles[twice] = True
    latest = np.maximum.accumulate(np.where(flank != 0, np.arange(len(t)), 0))
    lies = np.where(held(flank != 0, t, hold), flank[latest], 0.0)
    return np.where(held(rattles, t, hold), 2, lies).astype(int)


def stick_words(sticks: np.ndarray) -> str:
    """What is told of channels (n,) that stick or slide."""
    if sticks.all() or not sticks.any():
        return "sticks" if sticks.all() else "slides"
    return f"{sticks.sum()} of {len(sticks)} stick"


def play_words(lies: Sequence[int]) -> str:
    """What is told of channels in their play."""
    names = {-1: "left flank", 0: "in play", 1: "right flank", 2: "rattles"}
    if len(set(lies)) == 1:
        return names[int(lies[0])]
    return f"{sum(lie == 0 for lie in lies)} of {len(lies)} in play"
