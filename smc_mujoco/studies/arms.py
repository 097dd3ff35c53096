"""Tasks of a seven-joint arm, and laws of many joints with gains for them: what the scenes and the study of arms share.

The arm is `panda` with the friction that was identified on a real one, of which the laws know nothing, and what it
carries, neither. Gains come from `search`: the same number of random draws for each law, on the task "sway" with 1 kg
of payload and noise of seeds that no figure uses. GAINS holds what it found.
"""

import functools
import math
from collections.abc import Callable, Mapping

import numpy as np

from smc_mujoco.common.errors import find
from smc_mujoco.control.law import Law, law
from smc_mujoco.mechanisms.plant import Plant, Values, plant
from smc_mujoco.metrics.catalogue import tv_rate
from smc_mujoco.metrics.tip import tip_error, tip_scores
from smc_mujoco.simulation.perturbations import Jump, Noise
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Push
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.simulation.waypoints import Waypoints, cartesian_path

NOISE = Noise(position=1e-5, velocity=1e-3)  # rad, rad/s: chosen, of an encoder and a filtered difference
SWAY, BEAT = (0.3, 0.25, 0.3, 0.35, 0.4, 0.4, 0.5), 0.6  # rad and s: chosen, up to a rad/s in each joint
DRAWS, SEARCH_SEED, SEARCH_PAYLOAD = 32, 1000, 1.0  # of a search, kg
ROUGH = 1000.0  # N m/s: a variation of u that counts as much as the error; chosen before any search
BEFORE, BEHIND, PROBE = 0.0005, 0.004, 0.012  # m, from the wall's face: chosen; the radius of the probe
SPREAD = 0.05  # rad, of starts about the task's own; chosen
BLOW = 1.0  # s, of the blow in its task
PRESS, REACH = 20.0, (0.0, 0.3, 0.0, -2.0, 0.0, 3.1, math.pi / 4)  # N; rad, from where the wall's path is found

# Law -> gain -> range of the search. Where a joint's own number enters, the gain is the factor on it: see `gains`.
RANGES: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "computed_torque_sliding": {"c": (3.0, 40.0), "k": (3.0, 300.0), "width": (0.03, 1.0)},
    "super_twisting_computed_torque": {"c": (3.0, 40.0), "k1": (1.0, 40.0), "k2": (1.0, 400.0)},
    "unit_vector": {"c": (3.0, 40.0), "rho": (3.0, 300.0), "eps": (0.03, 3.0)},
    "passivity_based": {"c": (3.0, 40.0), "K": (0.01, 1.0), "k": (0.003, 0.3), "width": (0.03, 1.0)},
    "time_delay_sliding": {"c": (3.0, 40.0), "k": (3.0, 300.0), "width": (0.03, 1.0), "m": (0.03, 1.0)},
    "observer_free_joint": {"k1": (3.0, 40.0), "lam": (0.1, 1.0)},
}
BY_LIMIT = {"passivity_based": ("K", "k"), "observer_free_joint": ("lam",)}  # times the limit of the joint's motor
BY_INERTIA = {"time_delay_sliding": ("m",)}  # times the joint's own inertia in the ready pose
GAINS: Mapping[str, Mapping[str, float]] = {  # as `search` found them
    "computed_torque_sliding": {"c": 36.0, "k": 67.0, "width": 0.4},
    "super_twisting_computed_torque": {"c": 16.0, "k1": 28.0, "k2": 340.0},
    "unit_vector": {"c": 20.0, "rho": 280.0, "eps": 1.8},
    "passivity_based": {"c": 34.0, "K": 0.25, "k": 0.0056, "width": 0.1},
    "time_delay_sliding": {"c": 36.0, "k": 67.0, "width": 0.4, "m": 0.14},
    "observer_free_joint": {"k1": 39.0, "lam": 0.78},
}


def arm() -> Plant:
    """Return the arm."""
    return plant("panda")


@functools.cache
def inertia() -> tuple[float, ...]:
    """Return the inertia of each joint in the ready pose, kg m^2: the diagonal of M."""
    one = arm()
    M = one.nominal.dynamics(np.array(one.rest), np.zeros(one.n), Values(**one.parameters)).M  # pyright: ignore
    return tuple(np.diag(M).tolist())


def gained(name: str, gains: Mapping[str, float] | None = None) -> Law:
    """Return a law with the gains that a search found, or with others, per joint where a joint's own number enters."""
    found = dict(find("law of the arm", name, GAINS) if gains is None else gains)
    for gain in BY_LIMIT.get(name, ()):
        found[gain] = [found[gain] * limit for limit in arm().limits]  # pyright: ignore[reportArgumentType]
    for gain in BY_INERTIA.get(name, ()):
        found[gain] = [found[gain] * one for one in inertia()]  # pyright: ignore[reportArgumentType]
    return law(name, **found)


def hybrid(friction: bool = False) -> Law:
    """Return the law that presses on the wall, with the gains of computed_torque_sliding.

    Args:
      friction: whether it knows the joints' friction.
    """
    gains: dict[str, object] = {"force": PRESS, **GAINS["computed_torque_sliding"]}
    if friction:
        known = arm().friction
        gains |= {"f1": known.p1, "f2": known.p2, "f3": known.p3}
    made = law("hybrid_sliding", **gains)  # pyright: ignore[reportArgumentType]
    return made.named("hybrid_with_friction") if friction else made


@functools.cache
def sway() -> tuple[Waypoints, ...]:
    """Return references that swing every joint to and fro, with least jerk, from the ready pose and back."""
    times = [BEAT * k for k in range(6)]
    return tuple(Waypoints(times, [x, x + a, x - a, x + a, x - a, x]) for x, a in zip(arm().rest, SWAY, strict=True))


@functools.cache
def pick_and_place() -> tuple[Waypoints, ...]:
    """Return references that bring the tip down to pick up at 1 s, over to the other side, and down to place at 3 s."""
    points = [(0.40, -0.25, 0.45), (0.45, -0.25, 0.25), (0.45, 0.0, 0.50), (0.45, 0.25, 0.25), (0.40, 0.25, 0.45)]
    return tuple(cartesian_path(arm(), [0.0, 1.0, 2.0, 3.0, 3.8], points, site="tip", x0=arm().rest))


@functools.cache
def wall_path(behind: float = -BEFORE) -> tuple[Waypoints, ...]:
    """Return references on which the tip slides along the wall, across and up, at rest until 0.4 s.

    Args:
      behind: how far the path is behind the wall's face, m; below 0: before it.
    """
    from smc_mujoco.mechanisms.plants.panda import WALL

    x = WALL - PROBE + behind
    points = [(x, -0.2, 0.40), (x, 0.2, 0.40), (x, 0.2, 0.55)]
    return tuple(cartesian_path(arm(), [0.4, 2.4, 3.4], points, site="tip", x0=REACH))


def scenario(task: str, law: Law, seed: int = 0, payload: float = 0.0) -> Scenario:
    """Return the scenario of a task under a law.

    Args:
      task: "sway"; "payload", picked up at 1 s; "wall", pressed on while the tip slides; "behind", the same path 4 mm
        behind the wall's face; or "blow", at 1 s of a sway.
      seed: of the noise, and of the start, which is within 0.05 rad of the task's. 0: at the task's own start. At the
        wall every seed starts there, as the tip must be in front of it.
      payload: kg that the arm carries from the start, unknown to the law.
    """
    one = arm()
    references: dict[str, Callable[[], tuple[Waypoints, ...]]] = {
        "sway": sway,
        "blow": sway,
        "payload": pick_and_place,
        "wall": wall_path,
        "behind": lambda: wall_path(BEHIND),
    }
    wanted = find("task of the arm", task, references)()
    start = np.array([signal.values[0] for signal in (wall_path() if task == "behind" else wanted)])
    if seed and task not in ("wall", "behind"):
        start = start + np.random.default_rng(seed).uniform(-SPREAD, SPREAD, one.n)
    fields = {
        "sway": {"duration": 3.5},
        "blow": {"duration": 3.5, "disturbance": Push("link5", y=400.0, time=BLOW, width=0.02)},
        "payload": {"duration": 4.2, "jump": Jump(1.0, {"payload": 2.0})},
        "wall": {"duration": 3.8, "contact": "wall"},
        "behind": {"duration": 3.8, "contact": "wall"},
    }[task]
    return Scenario(
        plant=one,
        law=law,
        reference=wanted,
        x0=tuple(start),
        seed=seed,
        noise=NOISE,
        model="nominal",  # with it observer_free_joint compensates gravity, of the arm without payload
        mismatch={"payload": payload} if payload else {},
        friction=one.friction,
        control_period=1e-3,
        **fields,
    )


def off_path(trace: Trace, after: float = 0.0) -> np.ndarray:
    """Return how far the tip is from where the references want it at the samples from a time in s on, m."""
    return tip_error(trace)[trace.t >= after]


def back_within(trace: Trace, distance: float, after: float) -> float:
    """Return how long after a time in s the tip is within a distance of its path for good, s; inf if it never is."""
    t = trace.t[trace.t >= after]
    out = np.flatnonzero(off_path(trace, after) > distance)
    if not len(out):
        return 0.0
    return math.inf if out[-1] == len(t) - 1 else float(t[out[-1] + 1]) - after


def cost(trace: Trace) -> float:
    """Return the objective of the search: the tip's rms error, mm, more by the roughness of u."""
    if trace.failure is not None:
        return math.inf
    return 1e3 * tip_scores(trace)["rms_error"] * (1.0 + tv_rate(trace) / ROUGH)


def search(name: str, draws: int = DRAWS) -> tuple[dict[str, float], float]:
    """Return the best of random gains of a law, to two digits, and their cost."""
    rng, ranges = np.random.default_rng(SEARCH_SEED), RANGES[name]
    tried = [
        {gain: float(f"{math.exp(rng.uniform(*np.log(bounds))):.2g}") for gain, bounds in ranges.items()}
        for _ in range(draws)
    ]
    scenarios = [scenario("sway", gained(name, gains), SEARCH_SEED, SEARCH_PAYLOAD) for gains in tried]
    costs = [cost(trace) for trace in run(scenarios)]
    best = int(np.argmin(costs))
    return tried[best], costs[best]
