"""Tasks of a seven-joint arm, and laws of many joints with gains for them, which the scenes of arms
share.

The arm is `panda` with the friction that was identified on a real one. The laws know neither that
friction nor the payload. Gains come from the search of benchmarks/arm_study.py: for each law the
same number of random draws, on the task "sway" with 1 kg of payload and a seed that no figure uses.
GAINS has the best draws.
"""

import functools
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from smc_mujoco.common.errors import find
from smc_mujoco.control.law import Law, library_law
from smc_mujoco.control.source import SHIPPED, GainSearch
from smc_mujoco.mechanisms.plant import Plant, Values, plant
from smc_mujoco.metrics.conventions import last_exit
from smc_mujoco.metrics.tip import tip_error
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Jump, Noise, Push
from smc_mujoco.simulation.time_series import Waypoints, cartesian_path
from smc_mujoco.simulation.trace import Trace

NOISE = Noise(
    position=1e-5, velocity=1e-3
)  # rad, rad/s: chosen, as of an encoder and a filtered difference
SWAY = (
    0.3,
    0.25,
    0.3,
    0.35,
    0.4,
    0.4,
    0.5,
)  # rad: amplitude of each joint's sway, chosen for speeds up to 1 rad/s
BEAT = 0.6  # s: time from one end of a sway to the other, chosen
DRAWS = 32  # of gains for each law, in the search of benchmarks/arm_study.py
PATH_BEFORE, PATH_BEHIND = 0.0005, 0.004  # m: distances of paths from the wall's face; chosen
PROBE = 0.012  # m: radius of the probe
SPREAD = 0.05  # rad: largest distance of each joint's start from the task's own start; chosen
BLOW = 1.0  # s: time of the blow in its task
PRESS = 20.0  # N: wanted force of the tip on the wall; chosen
WALL_POSE = (
    0.0,
    0.3,
    0.0,
    -2.0,
    0.0,
    3.1,
    math.pi / 4,
)  # rad: pose from which the path along the wall is solved

BY_LIMIT = {
    "passivity_based": ("K", "k"),
    "observer_free_joint": ("lam",),
}  # gains: factor times a motor's limit
BY_INERTIA = {
    "time_delay_sliding": ("m",)
}  # gains: factor times a joint's inertia in the ready pose
OUTER = {
    f"{name}_computed_torque": name for name in ("adrc", "pd_observer", "lqi")
}  # rivals without a sliding mode
GAINS: Mapping[str, Mapping[str, float]] = {  # law -> gain, or its factor, as the search found them
    "computed_torque_sliding": {"c": 36.0, "k": 67.0, "width": 0.4},
    "super_twisting_computed_torque": {"c": 16.0, "k1": 28.0, "k2": 340.0},
    "unit_vector": {"c": 20.0, "rho": 280.0, "eps": 1.8},
    "passivity_based": {"c": 34.0, "K": 0.25, "k": 0.0056, "width": 0.1},
    "time_delay_sliding": {"c": 36.0, "k": 67.0, "width": 0.4, "m": 0.14},
    "observer_free_joint": {"k1": 39.0, "lam": 0.78},
    "adrc_computed_torque": {"wc": 34.0, "w": 130.0},
    "pd_observer_computed_torque": {"wc": 34.0, "l": 93.0},
    "lqi_computed_torque": {"q0": 5.2e8, "q1": 1.1e5, "q2": 630.0},
}


def arm() -> Plant:
    """Return the arm."""
    return plant("panda")


@functools.cache
def inertia() -> tuple[float, ...]:
    """Return the inertia of each joint in the ready pose, kg m^2: the diagonal of M."""
    panda = arm()
    rest = np.array(panda.rest)
    dynamics = panda.nominal.dynamics  # pyright: ignore
    M = dynamics(rest, np.zeros(panda.n), Values(**panda.parameters)).M
    return tuple(np.diag(M).tolist())


def gained(name: str, gains: Mapping[str, float] | None = None) -> Law:
    """Return a law with the gains that the search found.

    Args:
      name: of a law in GAINS.
      gains: other gains in place of those, with factors for the gains in BY_LIMIT and BY_INERTIA.
    """
    values = dict(find("law of the arm", name, GAINS) if gains is None else gains)
    for gain in BY_LIMIT.get(name, ()):
        values[gain] = [values[gain] * limit for limit in arm().limits]  # pyright: ignore[reportArgumentType]
    for gain in BY_INERTIA.get(name, ()):
        values[gain] = [values[gain] * joint for joint in inertia()]  # pyright: ignore[reportArgumentType]
    if name not in OUTER:
        gained_law = library_law(name, **values)
    else:
        gained_law = library_law(OUTER[name], **values).on_computed_torque()
    if gains:
        return gained_law
    return gained_law.sourced(SHIPPED, GainSearch(rule="random draws", evaluations=DRAWS))


def hybrid(friction: bool = False) -> Law:
    """Return the law that presses on the wall, with computed_torque_sliding's gains and, if
    `friction`, the arm's.
    """
    gains: dict[str, object] = {"force": PRESS, **GAINS["computed_torque_sliding"]}
    if friction:
        arm_friction = arm().friction
        gains |= {"f1": arm_friction.p1, "f2": arm_friction.p2, "f3": arm_friction.p3}
    hybrid_law = library_law("hybrid_sliding", **gains).sourced(SHIPPED)  # pyright: ignore[reportArgumentType]
    if friction:
        return hybrid_law.named("hybrid_with_friction")
    return hybrid_law


@functools.cache
def sway() -> tuple[Waypoints, ...]:
    """Return references that swing every joint back and forth with minimum jerk, from and to the
    ready pose.
    """
    times = [BEAT * k for k in range(6)]
    return tuple(
        Waypoints(times, [x, x + a, x - a, x + a, x - a, x])
        for x, a in zip(arm().rest, SWAY, strict=True)
    )


@functools.cache
def pick_and_place() -> tuple[Waypoints, ...]:
    """Return references on which the tip goes down to pick at 1 s, to the other side, and down to
    place at 3 s.
    """
    points = [
        (0.40, -0.25, 0.45),
        (0.45, -0.25, 0.25),
        (0.45, 0.0, 0.50),
        (0.45, 0.25, 0.25),
        (0.40, 0.25, 0.45),
    ]
    return tuple(
        cartesian_path(arm(), [0.0, 1.0, 2.0, 3.0, 3.8], points, site="tip", x0=arm().rest)
    )


@functools.cache
def wall_path(behind: float = -PATH_BEFORE) -> tuple[Waypoints, ...]:
    """Return references on which the tip rests until 0.4 s, and then slides along the wall,
    `behind` its face, m.
    """
    from smc_mujoco.mechanisms.plants.panda import WALL_DISTANCE

    x = WALL_DISTANCE - PROBE + behind
    points = [(x, -0.2, 0.40), (x, 0.2, 0.40), (x, 0.2, 0.55)]
    return tuple(cartesian_path(arm(), [0.4, 2.4, 3.4], points, site="tip", x0=WALL_POSE))


def scenario(task: str, law: Law, seed: int = 0, payload: float = 0.0) -> Scenario:
    """Return the scenario of a task under a law.

    Args:
      task: "sway"; "payload", a pick and place with 2 kg from 1 s on; "wall", where the tip slides
        on the wall and presses; "behind", the same path but 4 mm behind the wall's face; or "blow",
        a sway with a blow at 1 s.
      seed: of the noise and of the start, which is within SPREAD of the task's start. Seed 0 starts
        there, and so does every seed at the wall, in front of which the tip must begin.
      payload: kg that the arm carries from the start, unknown to the law.
    """
    panda = arm()
    push = Push("link5", y=400.0, time=BLOW, width=0.02)
    tasks: dict[str, tuple[Callable[[], tuple[Waypoints, ...]], dict[str, Any]]] = {
        "sway": (sway, {"duration": 3.5}),
        "blow": (sway, {"duration": 3.5, "disturbance": push}),
        "payload": (pick_and_place, {"duration": 4.2, "jump": Jump(1.0, {"payload": 2.0})}),
        "wall": (wall_path, {"duration": 3.8, "contact": "wall"}),
        "behind": (lambda: wall_path(PATH_BEHIND), {"duration": 3.8, "contact": "wall"}),
    }
    references, fields = find("task of the arm", task, tasks)
    signals = references()
    start = np.array(
        [signal.values[0] for signal in (wall_path() if task == "behind" else signals)]
    )
    if seed and task not in ("wall", "behind"):
        start = start + np.random.default_rng(seed).uniform(-SPREAD, SPREAD, panda.n)
    return Scenario(
        plant=panda,
        law=law,
        reference=signals,
        x0=tuple(start),
        seed=seed,
        noise=NOISE,
        # so that observer_free_joint compensates the gravity of the arm without payload
        model="nominal",
        mismatch={"payload": payload} if payload else {},
        friction=panda.friction,
        control_period=1e-3,
        **fields,
    )


def off_path(trace: Trace, after: float = 0.0) -> np.ndarray:
    """Return the tip's distance from its path, m, at the samples from the time `after`, s, on."""
    return tip_error(trace)[trace.t >= after]


def back_within(trace: Trace, distance: float, after: float) -> float:
    """Return the time from `after`, s, until the tip is within `distance`, m, of its path for good;
    inf for never.
    """
    distances = np.nan_to_num(off_path(trace, after), nan=math.inf)  # NaN after a failure
    return last_exit(trace.t[trace.t >= after], distances, distance)
