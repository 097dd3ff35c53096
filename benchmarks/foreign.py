"""Super-twisting over ADRC, coded twice: by this package, and by numpy alone, which shares gains
and starts only.

    python benchmarks/foreign.py

This checks the main sentence of docs/where_sliding_mode_loses.md. Two plants, both laws, their
sampling and Runge-Kutta's rule are written again here from their equations, and the scores, too. A
row is a plant, a condition, and by how many times the error (rms) and the cost of super_twisting
are less than those of adrc: the median over twelve runs by this package, then by the second coding.
Noise is drawn otherwise in each. It takes some seconds.
"""

from collections.abc import Callable
from pathlib import Path

import families
import numpy as np

from smc_mujoco.control import gain_sets

# s, s, runs, N or N m, of the variation in the cost
H, SECONDS, RUNS, BOUND, WEIGHT = 1e-3, 8.0, 12, 6.0, 1e-3
PLANTS: dict[str, Callable[..., np.ndarray]] = {  # x'' of (x, x', u)
    "duffing": lambda x, v, u: -0.2 * v + x - x**3 + u,
    "inverted_pendulum": lambda x, v, u: (
        (0.5 * 9.81 * 0.5 * np.sin(x) - 0.02 * v + u) / (0.5 * 0.5**2)
    ),
}
CELLS = (
    ("load, omega / wc", 0.5),
    ("load, omega / wc", 1.0),
    ("noise / start", 1e-3),
    ("noise / start", 1e-2),
)


class SuperTwisting:
    """u = -k1 |s|^0.5 sgn(s) + w,  w' = -k2 sgn(s),  s = x' + c x."""

    def __init__(self, gains: np.ndarray):
        self.k1, self.k2, self.c = gains
        self.w = np.zeros(RUNS)

    def __call__(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        s = v + self.c * x
        u = -self.k1 * np.sqrt(np.abs(s)) * np.sign(s) + self.w
        self.w = self.w - H * self.k2 * np.sign(s)
        return u


class Adrc:
    """u = -(wc^2 z1 + 2 wc z2 + z3) / b, with an observer of three poles at exp(-w h)."""

    def __init__(self, gains: np.ndarray):
        self.wc, w, self.b = gains
        p = np.exp(-w * H)
        self.gain = np.array([1 - p**3, 1.5 * (1 - p) ** 2 * (1 + p) / H, (1 - p) ** 3 / H**2])
        self.z = np.zeros((0, RUNS))
        self.last = np.zeros(RUNS)

    def __call__(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        if not len(self.z):
            self.z = np.array([x - H * v, v, np.zeros(RUNS)])
        z1, z2, z3 = self.z
        a = z3 + self.b * self.last
        ahead = np.array([z1 + H * z2 + H * H / 2 * a, z2 + H * a, z3])
        self.z = ahead + self.gain * (x - ahead[0])
        u = -(self.wc**2 * self.z[0] + 2 * self.wc * self.z[1] + self.z[2]) / self.b
        self.last = np.clip(u, -BOUND, BOUND)
        return u


LAWS = {"super_twisting": SuperTwisting, "adrc": Adrc}


def simulate(
    plant: str, law: Callable, x: np.ndarray, omega: float, load: float, noise: float
) -> np.ndarray:
    """Return the rms error and the cost of twelve runs, (2, runs)."""
    f = PLANTS[plant]
    rng = np.random.default_rng(0)
    steps = round(SECONDS / H)
    phase = 2 * np.pi * np.arange(RUNS) / RUNS
    v = np.zeros(RUNS)
    xs = np.empty((steps + 1, RUNS))
    us = np.empty((steps + 1, RUNS))
    for k in range(steps + 1):
        seen = (
            x + noise * rng.normal(size=RUNS),
            v + families.VELOCITY_NOISE_RATIO * noise * rng.normal(size=RUNS),
        )
        u = np.clip(law(*seen), -BOUND, BOUND)
        xs[k], us[k] = x, u

        def rate(
            after: float, state: np.ndarray, t: float = k * H, u: np.ndarray = u
        ) -> np.ndarray:
            return np.array([state[1], f(*state, u + load * np.sin(omega * (t + after) + phase))])

        state = np.array([x, v])
        k1 = rate(0.0, state)
        k2 = rate(H / 2, state + H / 2 * k1)
        k3 = rate(H / 2, state + H / 2 * k2)
        x, v = state + H / 6 * (k1 + 2 * k2 + 2 * k3 + rate(H, state + H * k3))
    t = H * np.arange(steps + 1)
    start = np.abs(xs[0])
    error = np.maximum(np.sqrt(np.mean(xs[t >= SECONDS / 4 - H / 2] ** 2, axis=0)), 1e-4 * start)
    variation = np.abs(np.diff(us, axis=0)).sum(axis=0) / (BOUND * SECONDS)
    return np.array(
        [error, np.trapezoid(t[:, None] * np.abs(xs), t, axis=0) / start + WEIGHT * variation]
    )


def leads(subject: families.Subject, axis: str, level: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the median leads in error and cost, by this package and by the second coding, (2,)
    each.
    """
    plant = subject.plant.name
    ours = {}
    theirs = {}
    for name, law in LAWS.items():
        made = subject.scenarios(axis, level, name)
        ours[name] = families.scores(made)
        starts = np.array([np.ravel(one.resolved.x0)[0] for one in made])
        gains = []
        for its in gain_sets.tuned(plant, name, "tuned").sets[:RUNS]:
            gains.append([its[gain] for gain in its])
        if axis.startswith("load"):
            load, omega = subject.load(axis, level)
        else:
            load = 0.0
            omega = 0.0
        if load:
            noise = 0.0
        else:
            noise = level * max(map(abs, made[0].plant.x0))
        theirs[name] = simulate(plant, law(np.array(gains).T), starts, omega, load, noise)
    by_ours, by_theirs = (
        np.median(its["adrc"] / its["super_twisting"], axis=1) for its in (ours, theirs)
    )
    return by_ours, by_theirs


if __name__ == "__main__":
    print("plant, condition: lead in error, in cost | by the second coding")
    for plant in PLANTS:
        subject = families.subject(plant, Path("foreign"))
        for axis, level in CELLS:
            ours, theirs = (
                ", ".join(f"{value:.3f}" for value in its) for its in leads(subject, axis, level)
            )
            print(f"{plant}, {axis} {level:g}: {ours} | {theirs}", flush=True)
